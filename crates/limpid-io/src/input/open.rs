//! Opening an input, from files, from memory or from a scene, and the options that decide how it is read.

use std::path::Path;
use std::sync::Arc;

use limpid::liquid::particles::drawable;
use limpid::liquid::{Particles, Up};
use limpid::look::{Body, Framing};

use super::files::is_scene_file;
use super::fluid::{Fluid, FluidSource};
use super::{Input, RadiusFrom, UpFrom};
use crate::adjustments::Adjustments;
use crate::bake;
use crate::error::{Error, Result};
use crate::frames::check_fps;
use crate::particles::{AttributeMap, ReadOptions};
use crate::project::{Automatic, LiquidSource, ParticleSource, Project, is_scale};
use crate::sequence::{Frame, Missing, Sequence};
use crate::shared_classifier::{Processor, SharedClassifier};

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

    /// The outline of an input that is open elsewhere, as a page has it of what its worker has open: the numbers
    /// of its frames, not their particles, and whether it [has files](Self::has_files).
    #[must_use]
    pub fn outline_of(
        project: Project,
        sequence: Sequence,
        has_files: bool,
        fps: Option<f64>,
    ) -> Self {
        let files = Fluid::of_files(sequence.clone(), None, None, AttributeMap::default());
        let fluid = match has_files {
            true => files,
            false => Fluid { sequence, ..Fluid::given(Arc::default(), "") },
        };
        Self { fps, ..Self::of(Some(project), fluid, None) }
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
            return Ok(Self { fps: Some(fps), ..Self::of(Some(project), fluid, None) });
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
        Ok(Self { fps, ..Self::of_fluids(Some(project), fluids, frame) })
    }

    /// An input with one fluid.
    fn of(project: Option<Project>, fluid: Fluid, frame: Option<i64>) -> Self {
        Self::of_fluids(project, vec![fluid], frame)
    }

    /// An input with at least one fluid; its frames are those of any.
    fn of_fluids(project: Option<Project>, fluids: Vec<Fluid>, frame: Option<i64>) -> Self {
        let first = fluids[0].sequence.clone();
        let joined = |all: Sequence, fluid: &Fluid| all.joined(&fluid.sequence);
        let sequence = fluids[1..].iter().fold(first, joined);
        Self {
            processor: project.as_ref().map_or(Processor::default(), |project| project.processor),
            project,
            sequence,
            frame,
            missing: Missing::Error,
            with_velocities: false,
            framing: Framing::default(),
            classifier: SharedClassifier::default(),
            fps: None,
            fluids,
            body: None,
            measured: false,
            together: None,
        }
    }

    /// Replaces the scene. If its file has particles too, their radius, up axis and attribute map apply
    /// to these frames.
    #[must_use]
    pub fn with_project(mut self, project: Project) -> Self {
        self.fluids.iter_mut().for_each(|fluid| fluid.guess_up = false);
        if let Some(simulation) = project.source.simulation() {
            self.fps = Some(simulation.fps);
            for fluid in &mut self.fluids {
                fluid.radius = Some(simulation.particle_radius() as f32);
                fluid.radius_from = RadiusFrom::Scene;
            }
        }
        if let Some(particles) = project.source.files().first() {
            self.fps = particles.fps.or(self.fps);
            for fluid in &mut self.fluids {
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
        Self { processor: project.processor, project: Some(project), ..self }
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
        for fluid in &mut self.fluids {
            fluid.radius = Some(radius);
            fluid.radius_from = RadiusFrom::Option;
        }
        Ok(self)
    }

    /// Sets the classifier; without one, particles are classified on the CPU.
    #[must_use]
    pub fn classified(self, classifier: SharedClassifier) -> Self {
        Self { classifier, ..self }
    }

    /// Sets the processor that classifies the particles.
    #[must_use]
    pub fn processed_by(self, processor: Processor) -> Self {
        Self { processor, ..self }
    }

    /// Sets the options for reading the files. An attribute map and a selection replace the scene's, unless
    /// they are the default.
    #[must_use]
    pub fn with_options(mut self, options: &ReadOptions) -> Self {
        for fluid in &mut self.fluids {
            let own = std::mem::replace(&mut fluid.options, options.clone());
            if options.map.is_empty() {
                fluid.options.map = own.map;
            }
            if options.select.is_automatic() {
                fluid.options.select = own.select;
            }
        }
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
            self.fluids.iter_mut().for_each(|fluid| fluid.scale = scale);
        }
        if let Some(up) = adjustments.up {
            for fluid in &mut self.fluids {
                (fluid.up, fluid.up_from) = (up, UpFrom::Option);
            }
        }
        if let Some(fps) = adjustments.fps {
            check_fps(fps)?;
            self.fps = Some(fps);
        }
        self.measured = adjustments.need_body();
        if let Some(look) = adjustments.look {
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
}
