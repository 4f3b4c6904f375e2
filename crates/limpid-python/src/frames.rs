//! Particles in the scene that they are drawn in, and the frames of files.

use std::path::PathBuf;
use std::sync::Arc;

use limpid::liquid::{Particles, Up};
use limpid::look::Framing;
use limpid_io::adjustments::Adjustments;
use limpid_io::camera_axes::CameraAxes;
use limpid_io::input::Input;
use limpid_io::open::{Opened, Request};
use limpid_io::project::{LiquidSource, Project};
use pyo3::prelude::*;

use crate::camera::{Camera, Kind};
use crate::colors::of_values;
use crate::series::unmeasured;
use crate::{scene, work};

/// Properties that decide how particles are drawn, apart from the picture.
#[derive(Clone, Default)]
pub(crate) struct Setting {
    pub(crate) project: Option<Project>,
    /// In the world of the particles.
    pub(crate) camera: Option<Camera>,
    /// The axis that points up in the particles' world.
    pub(crate) up: Option<Up>,
    /// Particle radius, m.
    pub(crate) radius: Option<f32>,
    /// Rays per pixel.
    pub(crate) samples: Option<u32>,
    /// The pictures that a fitted camera is for.
    pub(crate) framing: Framing,
    pub(crate) alpha: bool,
    pub(crate) motion: bool,
    /// Whether the particles are in metres, whatever the unit of the scene's files.
    pub(crate) in_metres: bool,
    /// Whether values colour the particles, which needs an opaque liquid.
    pub(crate) shows_values: bool,
}

/// Particles in their scene.
pub(crate) struct Staged {
    pub(crate) opened: Opened,
    /// The camera in the world of the scene.
    pub(crate) camera: Camera,
    /// The camera in the world of the particles, which is another one if z points up there.
    pub(crate) own_camera: Camera,
}

impl Setting {
    /// Puts particles into the scene, which is completed where it lacks something.
    ///
    /// # Errors
    /// As [`Request::open_from`].
    pub(crate) fn stage(&self, mut input: Input) -> limpid_io::Result<Staged> {
        // Values have another look than other particles without a scene.
        let says_nothing = |own: &&Project| self.shows_values && **own == unmeasured(None);
        let given = self.project.as_ref().filter(|own| !says_nothing(own));
        let is_alike = |project: Option<&Project>| project.is_none_or(|own| !own.has_directions());
        let is_bare = is_alike(given) && is_alike(input.project.as_ref());
        let aimed = self.camera.and_then(|camera| camera.camera());
        if let Some(mut project) = given.cloned() {
            // Those of an earlier picture.
            project.color_by = project.color_by.filter(|by| by.attribute != of_values());
            // A complete scene is not measured, which takes time; the camera is replaced below.
            let placeholder = || {
                self.camera
                    .map(|_| limpid::camera::Camera::fit(-glam::DVec3::ONE, glam::DVec3::ONE))
            };
            if self.in_metres {
                project.source.files_mut().iter_mut().for_each(|files| files.scale = None);
            }
            if let Some(camera) = aimed.or_else(placeholder) {
                (project.camera, project.camera_axes) = (Some(camera), CameraAxes::default());
            }
            input = input.with_project(project);
        }
        let up = self.up.or_else(|| self.camera.filter(|_| is_bare)?.likely_up());
        let mut overrides = Vec::from_iter(self.samples.map(|n| format!("refract.samples={n}")));
        overrides.extend(self.alpha.then(|| "refract.transparent=true".to_owned()));
        let request = Request {
            radius: self.radius,
            overrides,
            adjustments: Adjustments {
                up,
                color_by: self.shows_values.then(of_values),
                ..Adjustments::default()
            },
            framing: self.framing,
            ..Request::default()
        };
        let mut opened = request.open_from(input)?;
        if self.shows_values {
            let own = self.project.as_ref().and_then(|project| project.color_by.clone());
            opened.plain.color_by.clone_from(&own);
            opened.project.color_by = own;
        }
        let up = opened.loader.up().0;
        let camera = match self.camera {
            Some(camera) => camera.to_y_up(up),
            None => Camera(Kind::Aimed(opened.project.camera_for(Default::default()))),
        };
        let own_camera = self.camera.unwrap_or_else(|| camera.y_up_to(up));
        (opened.plain.camera, opened.project.camera) = (camera.camera(), camera.camera());
        opened.plain.source = match opened.loader.source() {
            // With the radius that was found.
            source @ LiquidSource::File(_) => source,
            _ => opened.plain.source,
        };
        opened.loader.with_velocities = self.motion;
        Ok(Staged { opened, camera, own_camera })
    }
}

/// Parses the name of an axis.
pub(crate) fn up(name: Option<&str>) -> PyResult<Option<Up>> {
    match name {
        None => Ok(None),
        Some("y") => Ok(Some(Up::Y)),
        Some("z") => Ok(Some(Up::Z)),
        Some(other) => {
            let problem = format!("up is {other:?}; expected \"y\" or \"z\"");
            Err(pyo3::exceptions::PyValueError::new_err(problem))
        }
    }
}

/// The frames of particle files, in a scene that is the same for all.
#[pyclass(frozen, module = "limpid._limpid")]
pub(crate) struct Frames {
    pub(crate) staged: Arc<Staged>,
    pub(crate) numbers: Vec<i64>,
}

#[pymethods]
impl Frames {
    /// Opens a file, a pattern, a folder or a scene file.
    #[staticmethod]
    #[pyo3(signature = (source, project, camera, up, radius, samples, size))]
    #[expect(clippy::too_many_arguments, reason = "the Python half passes what it was given")]
    fn open(
        py: Python<'_>,
        source: PathBuf,
        project: Option<PyRef<'_, scene::Project>>,
        camera: Option<PyRef<'_, Camera>>,
        up: Option<&str>,
        radius: Option<f32>,
        samples: Option<u32>,
        size: (u32, u32),
    ) -> PyResult<Self> {
        let setting = Setting {
            project: project.map(|project| project.project()),
            camera: camera.map(|camera| *camera),
            up: self::up(up)?,
            radius,
            samples,
            framing: Framing::of(size.into()),
            ..Setting::default()
        };
        let staged = work::run(py, move |_| setting.stage(Input::open(&source)?))?;
        let input = &staged.opened.loader;
        let all = || input.sequence.frames.iter().map(|frame| frame.number).collect();
        let numbers = input.frame.map_or_else(all, |frame| vec![frame]);
        Ok(Self { staged: Arc::new(staged), numbers })
    }

    fn __len__(&self) -> usize {
        self.numbers.len()
    }

    /// Frames per second, if the scene or the files have them.
    #[getter]
    fn fps(&self) -> Option<f64> {
        self.staged.opened.loader.fps()
    }
}

/// Source of a picture: particles, or a frame of files.
pub(crate) enum Source {
    Particles(Arc<Particles>, Box<Setting>),
    Frame(Arc<Staged>),
}
