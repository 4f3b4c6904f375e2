//! Particle frames of an input: files, recipes, simulations and the demo, read, interpolated and
//! classified.

mod files;
mod fluid;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec3};

use crate::adjustments::Adjustments;
use crate::bake;
use crate::error::{Error, Result};
use crate::frames::check_fps;
use crate::particles::{Array, AttributeMap, Contents, ReadOptions, Remark};
use crate::project::{
    Automatic, LiquidSource, Moved, ParticleSource, Project, SolidMotion, is_scale,
};
use crate::sequence::{Frame, Sequence, is_absent};
use crate::shared_classifier::{Processor, SharedClassifier};
use limpid::liquid::bulk::Bulk;
use limpid::liquid::classify::{self, Splat, Splats};
use limpid::liquid::particles::drawable;
use limpid::liquid::{Particles, Up};
use limpid::look::{Body, Framing, Look};
use limpid::memory;
use limpid::scene::{Scene, Solid};

use self::files::is_scene_file;
use self::fluid::{Fluid, FluidSource};

pub use self::files::files_of;
pub use self::fluid::Origin;
pub use crate::sequence::{FrameTime, Missing};

/// A project with its particle frames.
#[derive(Debug, Clone)]
pub struct Input {
    /// The project; `None` for bare particle files, which get one from [`Input::resolve`].
    pub project: Option<Project>,
    /// The frames; with several fluids, those of any fluid.
    pub sequence: Sequence,
    /// The frame selected by the scene.
    pub frame: Option<i64>,
    /// Treatment of missing frames.
    pub missing: Missing,
    /// Keep the particles' velocities in [`Loaded::velocities`].
    pub with_velocities: bool,
    /// The pictures that an automatic camera is for.
    pub framing: Framing,
    /// The processor that classifies the particles; initially the project's.
    processor: Processor,
    classifier: SharedClassifier,
    fps: Option<f64>,
    // At least one.
    fluids: Vec<Fluid>,
    body: Option<Body>,
    /// Whether the body is measured even if the scene is complete.
    measured: bool,
    /// In place of the body for the automatic parts of the scene.
    together: Option<Body>,
}

/// The origin of a particle radius, the most reliable first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum RadiusFrom {
    /// Their file has radii.
    #[default]
    File,
    /// The user: [`Input::with_radius`].
    Option,
    /// The scene, its recipe or its simulation.
    Scene,
    /// Their spacing: [`classify::estimate_radius`].
    Guess,
}

/// What says which axis of the files points up, the most reliable first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum UpFrom {
    /// The user: [`Adjustments::up`].
    Option,
    /// The scene, its recipe or its simulation.
    Scene,
    /// The format, or the names of the arrays, of this program.
    Format(&'static str),
    /// The particles, which lie in a plane: the other of y and z.
    Flat,
    /// The surface of the liquid: [`limpid::liquid::likely_up`]. Of bare particles alone.
    Guess,
    /// Nothing: y is taken to point up.
    #[default]
    Default,
}

impl UpFrom {
    /// A word for it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Option => "option",
            Self::Scene => "scene",
            Self::Format(program) => program,
            Self::Flat => "flat",
            Self::Guess => "guessed",
            Self::Default => "default",
        }
    }
}

/// A frame of particles, ready to draw.
#[derive(Debug, Clone, Default)]
pub struct Loaded {
    /// Number of the frame; between two frames, of the previous one.
    pub number: i64,
    /// Number of particles in the file.
    pub particles: usize,
    /// The classified particles.
    pub splats: Splats,
    /// Number of splashes among them.
    pub splashes: usize,
    /// Origin of the radius; with several fluids, the least reliable.
    pub radius_from: RadiusFrom,
    /// The axis that points up in the files, and what says so; see [`Input::up`].
    pub up: (Up, UpFrom),
    /// Bounds of all centres; both 0 without particles.
    pub bounds: (DVec3, DVec3),
    /// Arrays of the files other than the positions, used or ignored; see [`Contents::arrays`].
    pub arrays: Vec<Array>,
    /// Cells of meshes in the files; see [`Contents::cells`].
    pub cells: usize,
    /// Remarks on the files; see [`Contents::remarks`].
    pub remarks: Vec<Remark>,
    /// Bounds of the bulk of the particles, for cameras, and the number outside; all 0 without
    /// particles.
    pub bulk: Bulk,
    /// Where the scene's solids are, if they move.
    pub moved: Moved,
    /// Velocity of each particle, m/s, if [`Input::with_velocities`] is set and the files have them.
    pub velocities: Vec<Vec3>,
}

impl Loaded {
    /// Memory of the frame, bytes.
    pub fn bytes(&self) -> u64 {
        let splats = self.splats.aggregates.capacity() + self.splats.splashes.capacity();
        let velocities = self.velocities.capacity() * size_of::<Vec3>();
        (size_of::<Self>() + splats * size_of::<Splat>() + velocities) as u64 + self.moved.bytes()
    }

    /// The scene to draw the frame in: its solids are where they are then. `scene` is the one that the frame was
    /// loaded for, with whatever settings.
    pub fn scene<'a>(&self, scene: &'a Scene) -> Cow<'a, Scene> {
        self.moved.scene(scene)
    }
}

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
        let text = include_str!("../../../sims/demo.toml");
        let project = Project::parse(text, "demo", Path::new(""))?;
        let particles = project.source.files().first().cloned();
        let particles = particles.expect("the demo names its particles");
        let demo = include_bytes!("../../../sims/demo.bgeo").as_slice();
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

    /// An input with one fluid.
    fn of(project: Option<Project>, fluid: Fluid, frame: Option<i64>) -> Self {
        let sequence = fluid.sequence.clone();
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
            fluids: vec![fluid],
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
        let Some(first) = fluids.first() else {
            let problem = "has no [particles], [[fluid]], [recipe] or [simulation]; draw a particle file in this scene";
            return Err(Error::Scene { origin, problem: problem.into() });
        };
        let sequence = fluids[1..]
            .iter()
            .fold(first.sequence.clone(), |all, fluid| all.joined(&fluid.sequence));
        // A single file is the frame, whatever number its name contains.
        let single = sources.iter().all(|particles| crate::files::is_file(&particles.source));
        let frame = sources.iter().find_map(|particles| particles.frame).filter(|_| !single);
        let fps = sources.iter().find_map(|particles| particles.fps);
        Ok(Self {
            processor: project.processor,
            project: Some(project),
            sequence,
            frame,
            missing: Missing::Error,
            with_velocities: false,
            framing: Framing::default(),
            classifier: SharedClassifier::default(),
            fps,
            fluids,
            body: None,
            measured: false,
            together: None,
        })
    }

    /// Frames per second of the simulation, if the scene or a list of the files has them.
    pub fn fps(&self) -> Option<f64> {
        self.fps.or_else(|| self.fluids.iter().find_map(|fluid| fluid.sequence.fps))
    }

    /// Fails if a fluid or a solid lacks one of these frames and missing frames are errors.
    ///
    /// # Errors
    /// [`Error::MissingFrame`] naming the files and their first missing frame.
    pub fn check_frames(&self, numbers: &[i64]) -> Result<()> {
        let of_fluids = self.fluids.iter().map(|fluid| &fluid.sequence);
        for sequence in of_fluids.chain(self.motion().into_iter().flat_map(SolidMotion::sequences))
        {
            for &number in numbers {
                sequence.shown_or_missing(number, self.missing)?;
            }
        }
        Ok(())
    }

    /// Fails if a file of these frame times does not exist, as a piece that another lists or what a link leads to, and
    /// missing frames are errors.
    ///
    /// # Errors
    /// [`Error::MissingFrames`] naming the list and the first of the files.
    pub fn check_files(&self, times: &[FrameTime]) -> Result<()> {
        if self.missing != Missing::Error {
            return Ok(());
        }
        let files = self.fluids.iter().filter(|fluid| matches!(fluid.source, FluidSource::Files));
        let of_fluids = files.map(|fluid| &fluid.sequence);
        for sequence in of_fluids.chain(self.motion().into_iter().flat_map(SolidMotion::sequences))
        {
            let numbers = times.iter().flat_map(|at| [at.frame, at.next]);
            let frames: BTreeMap<i64, &Frame> =
                numbers.filter_map(|number| Some((number, sequence.frame(number)?))).collect();
            let mut absent = Vec::new();
            for (number, frame) in frames {
                let files = std::iter::once(&frame.path).chain(&frame.parts);
                let files = files.flat_map(|path| files::with_pieces(path));
                absent.extend(files.filter(|path| is_absent(path)).map(|path| (number, path)));
            }
            if let Some((number, path)) = absent.first() {
                let more = match absent.len() - 1 {
                    0 => String::new(),
                    more => format!(", and {more} more files"),
                };
                let problem =
                    format!("the file {} of frame {number}{more} is missing", path.display());
                return Err(Error::MissingFrames { pattern: sequence.pattern.clone(), problem });
            }
        }
        Ok(())
    }

    /// Frame times at steps of `step` frames from the first of the ascending `numbers` to the last. A
    /// frame has the length of the sequence's [stride](Sequence::stride).
    pub fn frame_times(&self, numbers: &[i64], step: f64) -> Vec<FrameTime> {
        let (Some(&first), Some(&last)) = (numbers.first(), numbers.last()) else {
            return Vec::new();
        };
        if step == 1.0 || step <= 0.0 || step.is_nan() {
            return numbers.iter().map(|&number| FrameTime::at(number)).collect();
        }
        let step = step * self.sequence.stride() as f64;
        let count = (last.abs_diff(first) as f64 / step * (1.0 + 1e-12)).floor() as usize;
        (0..=count).map(|k| FrameTime::after(numbers, k as f64 * step)).collect()
    }

    /// The frame time at `time`, in frames, among the ascending `numbers`: 12.25 is a quarter of the way
    /// from frame 12 to 13.
    ///
    /// # Errors
    /// [`Error::Sequence`] for a time before the first frame or after the last.
    pub fn frame_time(&self, numbers: &[i64], time: f64) -> Result<FrameTime> {
        let fail = |problem| Error::Sequence { pattern: self.sequence.pattern.clone(), problem };
        match numbers {
            [first, .., last] | [first @ last]
                if (*first as f64..=*last as f64).contains(&time) =>
            {
                Ok(FrameTime::after(numbers, time - *first as f64))
            }
            [first, .., last] => {
                Err(fail(format!("time {time} is not in its frames, from {first} to {last}")))
            }
            [frame] => Err(fail(format!("time {time} is not in its only frame, {frame}"))),
            [] => Err(fail("has no frames".into())),
        }
    }

    /// Reads or generates the particles at a frame time, y up. Between frames those of each fluid are
    /// interpolated, see [`Particles::between`].
    ///
    /// # Errors
    /// As [`Contents::read`] and [`limpid_sim::recipe::Recipe::particles`]; [`Error::MissingFrame`] for a missing frame, if
    /// [`Input::missing`] makes it an error.
    pub fn particles(&self, at: impl Into<FrameTime>) -> Result<Particles> {
        self.contents(at).map(|contents| contents.particles)
    }

    /// As [`Input::particles`], with the arrays and cells of the files; between frames, those of the
    /// previous one.
    ///
    /// # Errors
    /// As [`Input::particles`].
    pub fn contents(&self, at: impl Into<FrameTime>) -> Result<Contents> {
        let at = at.into();
        if let [fluid] = self.fluids.as_slice() {
            return fluid.contents_at(at, self.missing);
        }
        let (mut fluids, mut all) = (Vec::new(), Contents::default());
        for fluid in &self.fluids {
            let contents = fluid.contents_at(at, self.missing)?;
            let mut particles = contents.particles;
            // Each fluid keeps its own radius.
            if particles.radii.is_none() {
                let radius = fluid.radius_of(at.frame, &particles)?;
                let radii = std::iter::repeat_n(radius, particles.len());
                particles.radii = Some(memory::collect(radii, &fluid.sequence.pattern)?);
            }
            fluids.push(particles);
            all.arrays.extend(contents.arrays);
            all.remarks.extend(contents.remarks);
            all.cells = all.cells.saturating_add(contents.cells);
        }
        let count: usize = fluids.iter().map(Particles::len).sum();
        memory::probe(count.saturating_mul(Particles::MATCHED), &self.sequence.pattern)?;
        all.particles = Particles::mixed(&fluids);
        Ok(all)
    }

    /// Origins of the particles at a frame time: for each fluid the frame and, between frames, the next.
    pub fn origins(&self, at: FrameTime) -> Vec<Origin<'_>> {
        let numbers = if at.fraction == 0.0 { vec![at.frame] } else { vec![at.frame, at.next] };
        let fluids = self.fluids.iter();
        fluids
            .flat_map(|fluid| numbers.iter().map(|&number| fluid.origin(number, self.missing)))
            .collect()
    }

    /// Reads and classifies the particles at a frame time, with the settings of `scene`, and moves its solids.
    ///
    /// # Errors
    /// As [`Input::particles`] and [`Input::prepare`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn load(&self, at: impl Into<FrameTime>, scene: &Scene) -> Result<Loaded> {
        pollster::block_on(self.finish_load(at, scene))
    }

    /// As [`Input::load`], for code that browsers and other programs share: waiting for a device that classifies
    /// yields in a browser and blocks elsewhere.
    ///
    /// # Errors
    /// As `Input::load`.
    pub async fn finish_load(&self, at: impl Into<FrameTime>, scene: &Scene) -> Result<Loaded> {
        let at = at.into();
        if let [fluid] = self.fluids.as_slice()
            && let Some(particles) = fluid.unchanged()
        {
            let bulk = self.bulk(&particles);
            return self.finish_prepare(at, &particles, bulk, scene).await;
        }
        let Contents { mut particles, arrays, cells, mut remarks, .. } = self.contents(at)?;
        let bulk = self.bulk(&particles);
        // Attributes that classification does not read would take as much memory as its tables.
        (particles.ids, particles.densities) = (None, None);
        particles.velocities.take_if(|_| !self.with_velocities);
        let prepared = self.finish_prepare(at, &particles, bulk, scene).await?;
        remarks.extend_from_slice(&prepared.remarks);
        Ok(Loaded { arrays, cells, remarks, ..prepared })
    }

    /// Classifies a frame's particles with the settings of `scene`, whose solids are moved to where they are then.
    ///
    /// # Errors
    /// [`Error::UnknownRadius`] if the radius cannot be determined; as [`SharedClassifier::classify`] and
    /// [`Input::moved`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn prepare(
        &self,
        at: impl Into<FrameTime>,
        particles: &Particles,
        scene: &Scene,
    ) -> Result<Loaded> {
        let bulk = self.bulk(particles);
        pollster::block_on(self.finish_prepare(at, particles, bulk, scene))
    }

    async fn finish_prepare(
        &self,
        at: impl Into<FrameTime>,
        particles: &Particles,
        bulk: Bulk,
        scene: &Scene,
    ) -> Result<Loaded> {
        let at = at.into();
        let number = at.frame;
        let moved = self.moved(at, scene)?;
        let settings = &scene.settings.classify;
        let radius = self.fluids[0].radius_of(number, particles)?;
        let classified = self.classifier.finish(particles, radius, settings, self.processor);
        let mut splats = classified.await?;
        splats.bulk = bulk.lost.map(|_| bulk.bounds);
        classify::add_wall_contacts(&mut splats, &moved.solids(&scene.solids), settings.wetting);
        Ok(Loaded {
            number,
            particles: particles.len(),
            splashes: splats.splashes.len(),
            splats,
            radius_from: self.radius_from(particles),
            up: self.up(),
            bounds: particles.bounds().unwrap_or_default(),
            arrays: Vec::new(),
            cells: 0,
            remarks: moved.remarks().to_vec(),
            bulk,
            moved,
            velocities: match particles.velocities.as_ref().filter(|_| self.with_velocities) {
                Some(velocities) => memory::collect(velocities.iter().copied(), "velocities")?,
                None => Vec::new(),
            },
        })
    }

    /// Where the solids of `scene` are at a frame time, if its file moves any: this project's, with whatever
    /// settings.
    ///
    /// # Errors
    /// [`Error::MissingFrame`] if a solid lacks the frame and [`Input::missing`] makes that an error; as
    /// [`crate::meshes::load`] and [`crate::meshes::rigid_bodies::read_poses`].
    pub fn moved(&self, at: impl Into<FrameTime>, scene: &Scene) -> Result<Moved> {
        let moved = |motion: &SolidMotion| motion.at(at.into(), &scene.solids, self.missing);
        self.motion().map_or_else(|| Ok(Moved::default()), moved)
    }

    /// Replaces the motion of the scene's solids.
    pub(crate) fn with_motion(mut self, motion: &SolidMotion) -> Self {
        if let Some(project) = &mut self.project {
            project.motion.clone_from(motion);
        }
        self
    }

    /// How the scene's solids move, if they do.
    pub fn motion(&self) -> Option<&SolidMotion> {
        let motion = self.project.as_ref().map(|project| &project.motion);
        motion.filter(|motion| !motion.is_empty())
    }

    /// Origin of the radius of a frame's particles; with several fluids, the least reliable. After
    /// [`Input::resolve`] a guess applies to the whole sequence.
    pub fn radius_from(&self, particles: &Particles) -> RadiusFrom {
        match self.fluids.as_slice() {
            [_] if particles.radii.is_some() => RadiusFrom::File,
            fluids => fluids.iter().map(|fluid| fluid.radius_from).max().unwrap_or_default(),
        }
    }

    /// The axis that points up in the files, and what says so; with several fluids, of the first that has z up, or of
    /// the first. Known after [`Input::resolve`].
    pub fn up(&self) -> (Up, UpFrom) {
        let turned = self.fluids.iter().find(|fluid| fluid.up == Up::Z);
        let fluid = turned.unwrap_or(&self.fluids[0]);
        (fluid.up, fluid.up_from)
    }

    /// Whether z points up in the files and neither an option nor a scene says so.
    pub fn is_turned(&self) -> bool {
        let (up, from) = self.up();
        up == Up::Z && !matches!(from, UpFrom::Option | UpFrom::Scene)
    }

    /// The bulk of a frame's particles, all 0 without any. Particles that wait from the first frame to the last, as
    /// [`Input::resolve`] has seen, are known to be at rest.
    pub fn bulk(&self, particles: &Particles) -> Bulk {
        let parked = self.fluids.iter().find_map(|fluid| fluid.parked);
        particles.bulk_beside(parked).unwrap_or_default()
    }

    /// Median radius of a frame's particles, m: the file's, the given one, or an estimate from the
    /// spacing.
    ///
    /// # Errors
    /// [`Error::UnknownRadius`] if it cannot be determined; [`limpid::Error::Memory`].
    pub fn radius(&self, at: impl Into<FrameTime>, particles: &Particles) -> Result<f32> {
        let default = self.fluids[0].radius_of(at.into().frame, particles)?;
        Ok(classify::median_radius(particles, default)?)
    }

    /// The source of its particles, for a scene file in the working directory.
    pub fn source(&self) -> LiquidSource {
        let own = self.project.as_ref().map(|project| &project.source);
        match own {
            Some(source) if source.files().is_empty() && *source != LiquidSource::Unspecified => {
                source.clone()
            }
            _ => {
                let files = self.fluids.iter().map(|fluid| ParticleSource {
                    source: match fluid.source {
                        // A scene names no file then, and `--scene` gives it particles.
                        FluidSource::Memory(_) | FluidSource::Given(_) => PathBuf::new(),
                        _ => fluid.sequence.pattern.clone().into(),
                    },
                    frame: self.frame.filter(|_| fluid.sequence.frames.len() > 1),
                    radius: fluid.radius,
                    up: Some(fluid.up),
                    fps: self.fps,
                    scale: Some(fluid.scale).filter(|&scale| scale != 1.0),
                    map: fluid.map(),
                    select: fluid.options.select.clone(),
                });
                match files.collect::<Vec<_>>() {
                    mut files if files.len() == 1 => LiquidSource::File(files.remove(0)),
                    files => LiquidSource::Fluids(files),
                }
            }
        }
    }

    /// The files of the particles at a frame time.
    pub fn files_at(&self, at: FrameTime) -> impl Iterator<Item = &Path> {
        let next = (at.fraction > 0.0).then_some(at.next);
        let numbers = [Some(at.frame), next].into_iter().flatten();
        let of_files = |fluid: &&Fluid| matches!(fluid.source, FluidSource::Files);
        numbers
            .flat_map(move |number| {
                let fluids = self.fluids.iter().filter(of_files);
                let frames =
                    fluids.filter_map(move |fluid| fluid.sequence.shown(number, self.missing));
                frames.flat_map(|frame| std::iter::once(&frame.path).chain(&frame.parts))
            })
            .map(PathBuf::as_path)
    }

    /// Whether particles are read from files that the user has given.
    pub fn has_files(&self) -> bool {
        let simulated = self.project.as_ref().is_some_and(|p| p.source.simulation().is_some());
        !simulated && self.fluids.iter().any(|fluid| matches!(fluid.source, FluidSource::Files))
    }

    /// The body of liquid that [`Input::resolve`] has measured, if it had to.
    pub fn body(&self) -> Option<&Body> {
        self.body.as_ref()
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

    /// Whether a look is to provide the light.
    pub(crate) fn takes_light_from_look(&self) -> bool {
        let automatic =
            |project: &Project| project.automatic.is_some_and(|automatic| automatic.light);
        self.project.as_ref().is_none_or(automatic)
    }

    /// Resolves values that neither files nor scene have: the radius of each fluid from its first frame
    /// with particles; the axis that points up, by format, by the particles' plane or, for files without a scene, by the
    /// surface of the liquid; the parts of the scene that a look provides; and the camera, which sees the
    /// [bulk](limpid::liquid::Bulk) of the particles in the first frame, the last one and the one between.
    /// So a sequence has one radius and one view, however it is shared among machines.
    ///
    /// A single file that belongs to a sequence gets the sequence's radius: the guess from its first
    /// frame with particles. If the two guesses differ by more than 10 %, the files are taken to be of
    /// different simulations despite their names, and the file keeps its own guess.
    ///
    /// # Errors
    /// As [`crate::particles::read`].
    pub fn resolve(mut self) -> Result<(Self, Project)> {
        let bare =
            || Project { automatic: Some(Automatic::all(Look::default())), ..Project::default() };
        let mut project = self.project.clone().unwrap_or_else(bare);
        let complete = project.camera.is_some() && project.automatic.is_none() && !self.measured;
        if complete && self.fluids.iter().all(|fluid| fluid.radius.is_some()) {
            self.fluids.iter_mut().for_each(Fluid::resolve_up);
            project.turn_cameras(self.up().0);
            return Ok((self, project));
        }
        let mut body: Option<Body> = None;
        for fluid in &mut self.fluids {
            let found = fluid.resolve(!complete)?;
            body = match (body, found) {
                (Some(a), Some(b)) => Some(a.with(b)),
                (a, b) => a.or(b),
            };
        }
        let body = body.unwrap_or_else(|| Body::filling(-DVec3::ONE, DVec3::ONE, 0.0));
        let shown = self.solids_shown(&project.scene);
        let body = shown.iter().fold(body, |body, solids| body.among(solids));
        let body = self.together.take().unwrap_or(body);
        project.complete(&body);
        project.turn_cameras(self.up().0);
        project.camera.get_or_insert_with(|| body.camera(self.framing));
        self.body = Some(body);
        Ok((self.with_motion(&project.motion), project))
    }

    /// The solids of `scene` in the first frame, the last one and the one between.
    fn solids_shown(&self, scene: &Scene) -> Vec<Vec<Solid>> {
        let frames = &self.sequence.frames;
        let last = frames.len().saturating_sub(1);
        let mut shown = vec![0, last / 2, last];
        shown.dedup();
        let still = self.motion().is_none();
        shown.truncate(if still { 1 } else { shown.len() });
        let at = |i: usize| {
            // Damaged files are an error once the frame is drawn.
            let moved = frames.get(i).and_then(|frame| self.moved(frame, scene).ok());
            moved.unwrap_or_default().solids(&scene.solids).into_owned()
        };
        shown.into_iter().map(at).collect()
    }
}
