//! Particle frames of an input: files, recipes, simulations and the demo, read, interpolated and
//! classified.

mod files;
mod fluid;
mod loaded;
mod open;
mod resolve;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use limpid::liquid::bulk::Bulk;
use limpid::liquid::classify;
use limpid::liquid::{Particles, Up};
use limpid::look::{Body, Framing};
use limpid::memory;
use limpid::scene::Scene;

use crate::error::{Error, Result};
use crate::particles::Contents;
use crate::project::{LiquidSource, Moved, ParticleSource, Project, SolidMotion};
use crate::sequence::{Frame, Sequence, is_absent};
use crate::shared_classifier::{Processor, SharedClassifier};

use self::fluid::{Fluid, FluidSource};

pub use self::files::files_of;
pub use self::fluid::Origin;
pub use self::loaded::{Loaded, RadiusFrom, UpFrom};
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

impl Input {
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
        let solids = moved.solids(&scene.solids);
        match scene.is_opaque() {
            true => classify::add_closed_wall_contacts(&mut splats, &solids, settings.wetting),
            false => classify::add_wall_contacts(&mut splats, &solids, settings.wetting),
        }
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

    /// Whether a look is to provide the light.
    pub(crate) fn takes_light_from_look(&self) -> bool {
        let automatic =
            |project: &Project| project.automatic.is_some_and(|automatic| automatic.light);
        self.project.as_ref().is_none_or(automatic)
    }
}
