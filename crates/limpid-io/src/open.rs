//! From what a user names to frames that can be drawn: the one way that all programs go.

use std::path::PathBuf;

use crate::error::Result;
use crate::input::{Input, Missing};
use crate::particles::ReadOptions;
use crate::project::{Project, overrides};
use limpid::camera::Camera;
use limpid::settings::Settings;

/// What to open, and what to replace in it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Request {
    /// A scene or a recipe (`.toml`), a particle file, a pattern or a folder; `None` is the demo.
    pub input: Option<String>,
    /// A scene file to draw the input's particles in.
    pub scene: Option<PathBuf>,
    /// Particle radius where the files have none, m.
    pub radius: Option<f32>,
    /// Values to replace: [`Project::set`].
    pub overrides: Vec<String>,
    /// The camera, instead of the scene's.
    pub camera: Option<Camera>,
    /// What stands for a frame that is not there.
    pub missing: Missing,
    /// How particle files are read.
    pub options: ReadOptions,
}

/// A project that is ready to be drawn.
#[derive(Debug, Clone)]
pub struct Opened {
    /// Its frames; every fluid has a radius, where there are particles.
    pub input: Input,
    /// The project without the overrides and the other camera; it has a camera.
    pub plain: Project,
    /// The project with them.
    pub project: Project,
}

impl Request {
    /// Opens it. This may read the first frame that has particles.
    ///
    /// # Errors
    /// As [`Input::open`], [`Project::load`], [`Input::resolve`] and [`Project::set`].
    pub fn open(&self) -> Result<Opened> {
        // Before anything is read that may take long.
        let settings: Vec<String> = (self.overrides.iter())
            .filter(|text| {
                !["liquid.", "fluid.", "classify.on"].iter().any(|of| text.starts_with(of))
            })
            .cloned()
            .collect();
        overrides::replaced(&Settings::default(), &settings)?;
        let input = match &self.input {
            Some(input) => Input::open(input)?,
            None => Input::demo()?,
        };
        self.open_from(input)
    }

    /// As [`Request::open`], of an input that is open already.
    ///
    /// # Errors
    /// As [`Request::open`].
    pub fn open_from(&self, mut input: Input) -> Result<Opened> {
        if let Some(scene) = &self.scene {
            input = input.with_project(Project::load(scene)?);
        }
        if let Some(radius) = self.radius {
            input = input.with_radius(radius)?;
        }
        input.missing = self.missing;
        let (input, plain) = input.with_options(&self.options).resolve()?;
        let mut project = plain.clone();
        project.set(&self.overrides)?;
        project.camera = self.camera.or(project.camera);
        project.check()?;
        let input = input.processed_by(project.processor);
        Ok(Opened { input, plain, project })
    }
}
