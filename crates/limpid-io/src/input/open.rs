//! Opening an input, from files, from memory or from a scene.

use std::path::Path;
use std::sync::Arc;

use limpid::liquid::{Particles, Up};
use limpid::look::Framing;

use super::files::is_scene_file;
use super::fluid::{Fluid, FluidSource};
use super::loader::Loader;
use super::{Input, RadiusFrom, UpFrom};
use crate::bake;
use crate::error::{Error, Result};
use crate::particles::{AttributeMap, ReadOptions};
use crate::project::{LiquidSource, ParticleSource, Project};
use crate::sequence::{Frame, Sequence};

impl Input {
    /// Opens a scene or a recipe (`.toml`), a particle file, a pattern or a folder.
    ///
    /// # Errors
    /// As [`Project::load`] and [`Sequence::open`]; a scene without particles is an
    /// [`Error::Scene`].
    pub fn open(input: impl AsRef<Path>) -> Result<Self> {
        let path = input.as_ref();
        if is_scene_file(path) {
            return Self::from_project(Project::load(path)?, path);
        }
        let sequence = Sequence::open(path)?;
        let fluid = Fluid::of_files(sequence, None, None, AttributeMap::default());
        Ok(Self::of(None, Fluid { guess_up: true, ..fluid }, None))
    }

    /// As [`Input::open`], for descriptions instead of drawing: of an environment map only the header is
    /// read.
    ///
    /// # Errors
    /// As [`Input::open`].
    pub fn outline(input: impl AsRef<Path>) -> Result<Self> {
        let path = input.as_ref();
        if is_scene_file(path) {
            return Self::from_project(Project::outline(path)?, path);
        }
        Self::open(path)
    }

    /// The built-in demo: a frame of a double dam break, simulated with SPlisHSPlasH.
    ///
    /// # Errors
    /// None: a test loads the demo.
    pub fn demo() -> Result<Self> {
        let text = limpid::sims::DEMO;
        let project = Project::parse(text, "demo", Path::new(""))?;
        let particles = project.source.files().first().cloned();
        let particles = particles.expect("the demo names its particles");
        let demo = limpid::sims::DEMO_PARTICLES;
        let fluid = Fluid {
            radius: particles.radius,
            radius_from: RadiusFrom::Scene,
            up: particles.up.unwrap_or_default(),
            up_from: UpFrom::Scene,
            ..Fluid::in_memory(particles.source.as_ref(), "demo", demo.into())
        };
        Ok(Self::of(Some(project), fluid, Some(0)))
    }

    /// One frame of particles, a file in memory. `path` selects the format and appears in messages; `name`
    /// stands for the sequence.
    pub fn from_memory(path: &Path, name: &str, bytes: Vec<u8>) -> Self {
        let fluid = Fluid::in_memory(path, name, bytes.into());
        Self::of(None, Fluid { guess_up: true, ..fluid }, None)
    }

    /// One frame, the number 0, of particles that the caller has. They are not copied unless they have to be
    /// turned or scaled. `name` stands for them in messages.
    pub fn from_particles(particles: Arc<Particles>, name: &str) -> Self {
        let fluid = Fluid { guess_up: true, ..Fluid::given(particles, name) };
        Self::of(None, fluid, None)
    }

    /// As [`Input::open`], for a project that is already loaded, from the file `origin`.
    ///
    /// # Errors
    /// As [`Input::open`].
    pub fn from_project(project: Project, origin: impl AsRef<Path>) -> Result<Self> {
        let file = origin.as_ref();
        let origin = file.display().to_string();
        if let LiquidSource::Recipe(recipe) = project.source {
            let frame = Frame::new(0, file.to_owned());
            let fluid = Fluid {
                sequence: Sequence {
                    frames: vec![frame],
                    pattern: origin,
                    fps: None,
                    absent: Vec::new(),
                },
                radius: Some(recipe.particle_radius() as f32),
                radius_from: RadiusFrom::Scene,
                up: Up::Y,
                up_from: UpFrom::Scene,
                guess_up: false,
                scale: 1.0,
                parked: None,
                options: ReadOptions::default(),
                source: FluidSource::Recipe(recipe),
            };
            return Ok(Self::of(Some(project), fluid, Some(0)));
        }
        if let Some(simulation) = project.source.simulation() {
            let sequence = Sequence::open(bake::folder(file))
                .map_err(|_| Error::NotBaked { scene: origin })?;
            let (radius, fps) = (simulation.particle_radius() as f32, simulation.fps);
            let fluid =
                Fluid::of_files(sequence, Some(radius), Some(Up::Y), AttributeMap::default());
            return Ok(Self::of(Some(project), fluid, None).at(Some(fps)));
        }
        let sources = project.source.files();
        if sources.iter().any(|particles| particles.source.as_os_str().is_empty()) {
            let problem =
                "[particles] has no source; name the particles there, or draw them in this scene";
            return Err(Error::Scene { origin, problem: problem.into() });
        }
        let fluids: Vec<Fluid> = sources
            .iter()
            .map(|particles| {
                let sequence = Sequence::open(&particles.source)?;
                let ParticleSource { radius, up, scale, map, select, .. } = particles;
                let mut fluid = Fluid::of_files(sequence, *radius, *up, map.clone());
                fluid.options.select.clone_from(select);
                Ok(Fluid { scale: scale.unwrap_or(1.0), ..fluid })
            })
            .collect::<Result<_>>()?;
        if fluids.is_empty() {
            let problem = "has no [particles], [[fluid]], [recipe] or [simulation]; draw a particle file in this scene";
            return Err(Error::Scene { origin, problem: problem.into() });
        }
        // A single file is the frame, whatever number its name contains.
        let single = sources.iter().all(|particles| crate::files::is_file(&particles.source));
        let frame = sources.iter().find_map(|particles| particles.frame).filter(|_| !single);
        let fps = sources.iter().find_map(|particles| particles.fps);
        Ok(Self::of_fluids(Some(project), fluids, frame).at(fps))
    }

    /// An input with one fluid.
    fn of(project: Option<Project>, fluid: Fluid, frame: Option<i64>) -> Self {
        Self::of_fluids(project, vec![fluid], frame)
    }

    /// An input with at least one fluid; its frames are those of any.
    fn of_fluids(project: Option<Project>, fluids: Vec<Fluid>, frame: Option<i64>) -> Self {
        let loader = Loader::new(fluids, frame);
        let loader = match &project {
            Some(project) => loader.of_project(project),
            None => loader,
        };
        Self { project, loader, framing: Framing::default(), measured: false, together: None }
    }

    /// As this, of frames at a rate per second.
    fn at(mut self, fps: Option<f64>) -> Self {
        self.loader.fps = fps;
        self
    }
}

impl Loader {
    /// The outline of a loader that is elsewhere, as a page has it of its worker's: the numbers
    /// of its frames, not their particles, and whether it [has files](Self::has_files).
    #[must_use]
    pub fn outline_of(
        project: &Project,
        sequence: Sequence,
        has_files: bool,
        fps: Option<f64>,
    ) -> Self {
        let files = Fluid::of_files(sequence.clone(), None, None, AttributeMap::default());
        let fluid = match has_files {
            true => files,
            false => Fluid { sequence, ..Fluid::given(Arc::default(), "") },
        };
        let mut loader = Self::new(vec![fluid], None).of_project(project);
        loader.fps = fps;
        loader
    }
}
