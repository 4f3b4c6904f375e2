//! Opening of inputs: from a path or pattern to frames that can be drawn, shared by all programs.

use std::path::PathBuf;

use crate::adjustments::Adjustments;
use crate::camera_axes::{CameraAxes, GivenCamera};
use crate::error::Result;
use crate::input::{Input, Loader, Missing};
use crate::particles::ReadOptions;
use crate::project::{LiquidSource, Project, overrides};
use limpid::liquid::Up;
use limpid::look::{Body, Framing};
use limpid::settings::Settings;

/// An input to open, with overrides.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Request {
    /// A scene or a recipe (`.toml`), a particle file, a pattern or a folder; `None` is the demo.
    pub input: Option<PathBuf>,
    /// A scene file to draw the input's particles in.
    pub scene: Option<PathBuf>,
    /// Particle radius if the files have none, m.
    pub radius: Option<f32>,
    /// Overrides of values: [`Project::set`].
    pub overrides: Vec<String>,
    /// The camera, instead of the scene's.
    pub camera: Option<GivenCamera>,
    /// The axis that points up where this camera, or else those of the scene, count; `None` leaves it to their
    /// [axes](GivenCamera::axes).
    pub camera_up: Option<Up>,
    /// Treatment of missing frames.
    pub missing: Missing,
    /// Options for reading particle files.
    pub options: ReadOptions,
    /// Changes to the scene and to the reading of its files.
    pub adjustments: Adjustments,
    /// The pictures that an automatic camera is for.
    pub framing: Framing,
    /// Whether the body of liquid is measured even if the scene is complete.
    pub measured: bool,
    /// The body that the automatic parts of the scene are for, instead of its own: that of several inputs together.
    pub together: Option<Body>,
}

/// A project ready to be drawn.
#[derive(Debug, Clone)]
pub struct Opened {
    /// Reads its frames; every fluid with particles has a radius.
    pub loader: Loader,
    /// The project without the overrides and the request's camera; it has a camera.
    pub plain: Project,
    /// The project with the overrides and the request's camera.
    pub project: Project,
    /// The axis that points up where its camera was given; y, if it was fitted.
    pub camera_up: Up,
}

impl Request {
    /// Opens the input. This may read the frames up to the first one with particles.
    ///
    /// # Errors
    /// As [`Input::open`], [`Project::load`], [`Input::resolve`] and [`Project::set`].
    pub fn open(&self) -> Result<Opened> {
        // Settings are checked before anything is read, which may take long.
        let settings: Vec<String> = (self.overrides.iter())
            .filter(|text| {
                !["liquid.", "fluid.", "classify.on"].iter().any(|of| text.starts_with(of))
            })
            .cloned()
            .collect();
        overrides::replaced(&Settings::default(), &settings)?;
        match (&self.input, &self.scene) {
            (Some(input), _) => self.open_from(Input::open(input)?),
            (None, Some(scene)) => {
                let project = Project::load(scene)?;
                let shown = match project.source {
                    LiquidSource::Unspecified => Input::demo()?.with_project(project),
                    _ => Input::from_project(project, scene)?,
                };
                self.open_shown(shown)
            }
            (None, None) => self.open_from(Input::demo()?),
        }
    }

    /// As [`Request::open`], for an input that is already open.
    ///
    /// # Errors
    /// As [`Request::open`].
    pub fn open_from(&self, mut input: Input) -> Result<Opened> {
        if let Some(scene) = &self.scene {
            input = input.with_project(Project::load(scene)?);
        }
        self.open_shown(input)
    }

    /// As [`Request::open_from`], for an input that is in its scene.
    fn open_shown(&self, mut input: Input) -> Result<Opened> {
        if let Some(radius) = self.radius {
            input = input.with_radius(radius)?;
        }
        (input.loader.missing, input.framing) = (self.missing, self.framing);
        let mut axes = input.project.as_ref().map_or(CameraAxes::default(), |p| p.camera_axes);
        if let (Some(project), Some(up)) = (&mut input.project, self.camera_up) {
            let views = project.views.iter_mut().map(|view| &mut view.axes);
            views.chain([&mut project.camera_axes]).for_each(|axes| axes.up = Some(up));
        }
        let input = input.with_options(&self.options).with_adjustments(&self.adjustments)?;
        let input = input.measured_with(self.measured, self.together.clone());
        let lit_by_look = input.takes_light_from_look();
        let (loader, mut plain) = input.resolve()?;
        self.adjustments.apply(&mut plain, loader.body())?;
        // A look's light on nothing that shows it is no slip of the user's.
        if lit_by_look && !plain.scene.is_lit() {
            plain.scene.lights.clear();
        }
        // The loader moves the solids that are left.
        let loader = loader.with_motion(&plain.motion);
        let mut project = plain.clone();
        project.set(&self.overrides)?;
        let files = loader.up().0;
        if let Some(given) = self.camera {
            axes = CameraAxes { up: self.camera_up.or(given.axes.up), ..given.axes };
            project.camera = Some(axes.to_world(given.camera, files));
        }
        let camera_up = self.camera_up.or(axes.up).unwrap_or(files);
        project.check()?;
        let loader = loader.processed_by(project.processor).colored_by(project.color_by.clone());
        Ok(Opened { loader, plain, project, camera_up })
    }
}
