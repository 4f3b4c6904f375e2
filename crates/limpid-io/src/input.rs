//! Particle frames of an input: files, recipes, simulations and the demo.
//!
//! An [`Input`] is a user's request. [`Input::resolve`] finds values that neither files nor scene give, and returns the
//! [`Loader`] of its frames and the [`Project`] to draw them in.

mod diffuse;
mod diffuse_files;
mod files;
mod fluid;
mod loaded;
mod loader;
mod open;
mod resolve;
mod times;

use limpid::liquid::particles::drawable;
use limpid::look::{Body, Framing, Look};

use crate::adjustments::Adjustments;
use crate::error::{Error, Result};
use crate::frames::check_fps;
use crate::particles::ReadOptions;
use crate::project::{Automatic, Project, is_scale};

pub use self::files::files_of;
pub use self::fluid::Origin;
pub use self::loaded::{Loaded, RadiusFrom, UpFrom};
pub use self::loader::Loader;
pub use crate::sequence::{FrameTime, Missing};

/// The input that a user asks for: frames of particles, and the project to draw them in.
#[derive(Debug, Clone)]
pub struct Input {
    /// The project; `None` for bare particle files, which get one from [`Input::resolve`].
    pub project: Option<Project>,
    /// Reads the frames.
    pub loader: Loader,
    /// The pictures that an automatic camera is for.
    pub framing: Framing,
    /// Whether the body is measured even if the scene is complete.
    measured: bool,
    /// In place of the body for the automatic parts of the scene.
    together: Option<Body>,
}

impl Input {
    /// Replaces the scene. If its file has particles too, their radius, up axis and attribute map apply
    /// to these frames. The axis that points up is still guessed in a scene that is alike from all sides.
    #[must_use]
    pub fn with_project(mut self, project: Project) -> Self {
        if project.has_directions() {
            self.loader.fluids.iter_mut().for_each(|fluid| fluid.guess_up = false);
        }
        if let Some(simulation) = project.source.simulation() {
            self.loader.fps = Some(simulation.fps);
            for fluid in &mut self.loader.fluids {
                fluid.radius = Some(simulation.particle_radius() as f32);
                fluid.radius_from = RadiusFrom::Scene;
            }
        }
        if let Some(particles) = project.source.files().first() {
            self.loader.fps = particles.fps.or(self.loader.fps);
            for fluid in &mut self.loader.fluids {
                if let Some(radius) = particles.radius {
                    fluid.radius = Some(radius);
                    fluid.radius_from = RadiusFrom::Scene;
                }
                if let Some(up) = particles.up {
                    (fluid.up, fluid.up_from) = (up, UpFrom::Scene);
                }
                fluid.scale = particles.scale.unwrap_or(1.0);
                fluid.options.map.clone_from(&particles.map);
                fluid.options.select.clone_from(&particles.select);
            }
        }
        let loader = self.loader.of_project(&project);
        Self { project: Some(project), loader, ..self }
    }

    /// Sets the particle radius for files without one, m. It wins over radii in the attribute map.
    ///
    /// # Errors
    /// [`Error::Usage`] unless the cube of the radius fits a 32-bit float.
    pub fn with_radius(mut self, radius: f32) -> Result<Self> {
        if !drawable(radius) {
            let problem = format!("a particle radius of {radius}: expected 1e-12 to 1e12 m");
            return Err(Error::Usage(problem));
        }
        for fluid in &mut self.loader.fluids {
            fluid.radius = Some(radius);
            fluid.radius_from = RadiusFrom::Option;
        }
        Ok(self)
    }

    /// Sets the options for reading the files. An attribute map and a selection replace the scene's, unless
    /// they are the default.
    #[must_use]
    pub fn with_options(mut self, options: &ReadOptions) -> Self {
        for fluid in &mut self.loader.fluids {
            let own = std::mem::replace(&mut fluid.options, options.clone());
            if options.map.is_empty() {
                fluid.options.map = own.map;
            }
            if options.select.is_automatic() {
                fluid.options.select = own.select;
            }
            fluid.options.shown = options.shown.clone().or(own.shown);
        }
        self.loader.limit_diffuse(options);
        self
    }

    /// Applies the changes that decide how files are read, and the look.
    ///
    /// # Errors
    /// [`Error::Usage`] for a scale or a rate out of range.
    pub(crate) fn with_adjustments(mut self, adjustments: &Adjustments) -> Result<Self> {
        if let Some(scale) = adjustments.scale {
            if !is_scale(scale) {
                let problem = format!("a scale of {scale}: expected 1e-12 to 1e12");
                return Err(Error::Usage(problem));
            }
            self.loader.fluids.iter_mut().for_each(|fluid| fluid.scale = scale);
        }
        if let Some(up) = adjustments.up {
            for fluid in &mut self.loader.fluids {
                (fluid.up, fluid.up_from) = (up, UpFrom::Option);
            }
        }
        if let Some(fps) = adjustments.fps {
            check_fps(fps)?;
            self.loader.fps = Some(fps);
        }
        self.measured = adjustments.need_body();
        let paint = adjustments.color_by.is_some() && self.project.is_none();
        if let Some(look) = adjustments.look.or_else(|| paint.then_some(Look::Paint)) {
            let bare = self.project.is_none();
            let project = self.project.get_or_insert_default();
            let own = project.automatic.unwrap_or_else(|| Automatic {
                absorption: bare,
                ground: project.scene.solids.is_empty(),
                ..Automatic::all(look)
            });
            let whole = Automatic { environment: true, light: true, tonemap: true, ..own };
            project.automatic = Some(Automatic { look, ..whole });
        }
        Ok(self)
    }

    /// Measures the body in any case, if it is not known to, and completes the scene for another one.
    pub(crate) fn measured_with(self, measured: bool, together: Option<Body>) -> Self {
        Self { measured: self.measured || measured, together, ..self }
    }

    /// Whether a look is to provide the light.
    pub(crate) fn takes_light_from_look(&self) -> bool {
        let automatic =
            |project: &Project| project.automatic.is_some_and(|automatic| automatic.light);
        self.project.as_ref().is_none_or(automatic)
    }
}
