//! Frames of particles, read, interpolated, classified and ready to draw.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use limpid::diffuse::Diffuse;
use limpid::glam::Vec3;
use limpid::liquid::bulk::Bulk;
use limpid::liquid::classify::colors::Colors;
use limpid::liquid::classify::{self, Splats};
use limpid::liquid::{Particles, Up};
use limpid::look::Body;
use limpid::memory;
use limpid::scene::{Scene, Solid};

#[cfg(doc)]
use super::Input;
use super::diffuse_files;
use super::fluid::{Fluid, FluidSource, Origin};
use super::loaded::{Loaded, RadiusFrom, UpFrom};
use crate::color_by::{Attribute, AttributeRange, ColorBy, ColorScale, Values};
#[cfg(doc)]
use crate::error::Error;
use crate::error::Result;
use crate::particles::Contents;
use crate::particles::shown::is_named;
use crate::project::{LiquidSource, Moved, ParticleSource, Project, SolidMotion};
use crate::sequence::{FrameTime, Missing, Sequence};
use crate::shared_classifier::{Processor, SharedClassifier};
use crate::spread::Spread;

/// Frames, at most, whose values decide the range of colours, and particles of each.
const RANGED: usize = 64;
const RANGED_PARTICLES: usize = 1 << 16;

/// The values of an attribute in a sequence.
#[derive(Debug, Clone)]
struct Seen {
    /// Their usual range.
    range: [f32; 2],
    /// The attribute's name, spelled as in the files.
    name: String,
    unit: String,
}

/// Reads the frames of an [`Input`], classifies their particles, and moves the solids of its scene.
#[derive(Debug, Clone)]
pub struct Loader {
    /// The frames; with several fluids, those of any fluid.
    pub sequence: Sequence,
    /// The frame selected by the scene.
    pub frame: Option<i64>,
    /// Treatment of missing frames.
    pub missing: Missing,
    /// Keep the particles' velocities in [`Loaded::velocities`].
    pub with_velocities: bool,
    /// The processor that classifies the particles; initially the project's.
    processor: Processor,
    /// The attribute that colours the particles.
    color_by: Option<ColorBy>,
    /// Colours of the opaque fluids: [`Project::opaque_fluids`].
    opaque_fluids: Vec<Option<Vec3>>,
    /// Its values in all frames, once they are known.
    seen: Arc<OnceLock<Seen>>,
    classifier: SharedClassifier,
    pub(super) fps: Option<f64>,
    // At least one.
    pub(super) fluids: Vec<Fluid>,
    /// The recipe or the simulation that makes the particles.
    made: Option<LiquidSource>,
    /// Foam, spray, bubbles and dust.
    pub(super) diffuse: Vec<diffuse_files::Source>,
    /// How the solids of the scene move; known after [`Input::resolve`].
    pub(super) motion: SolidMotion,
    pub(super) body: Option<Body>,
}

impl Loader {
    /// Reads the frames of at least one fluid.
    pub(super) fn new(fluids: Vec<Fluid>, frame: Option<i64>) -> Self {
        let first = fluids[0].sequence.clone();
        let diffuse = diffuse_files::beside(&fluids);
        let joined = |all: Sequence, fluid: &Fluid| all.joined(&fluid.sequence);
        Self {
            sequence: fluids[1..].iter().fold(first, joined),
            frame,
            missing: Missing::Error,
            with_velocities: false,
            processor: Processor::default(),
            color_by: None,
            opaque_fluids: Vec::new(),
            seen: Arc::default(),
            classifier: SharedClassifier::default(),
            fps: None,
            fluids,
            made: None,
            diffuse,
            motion: SolidMotion::default(),
            body: None,
        }
    }

    /// As a project's, whose source may make the particles.
    pub(super) fn of_project(self, project: &Project) -> Self {
        let source = Some(&project.source);
        let made = source.filter(|of| of.recipe().is_some() || of.simulation().is_some());
        let (processor, opaque_fluids) = (project.processor, project.opaque_fluids.clone());
        let loader = Self { processor, opaque_fluids, made: made.cloned(), ..self };
        loader.colored_by(project.color_by.clone())
    }

    /// Sets the attribute that colours the particles, which readers keep.
    #[must_use]
    pub fn colored_by(mut self, color_by: Option<ColorBy>) -> Self {
        for fluid in &mut self.fluids {
            fluid.options.shown = color_by.as_ref().and_then(|by| by.attribute.of_files());
        }
        Self { color_by, seen: Arc::default(), ..self }
    }

    /// The attribute that colours the particles.
    pub fn color_by(&self) -> Option<&ColorBy> {
        self.color_by.as_ref()
    }

    /// Frames per second of the simulation, if the scene or a list of the files has them.
    pub fn fps(&self) -> Option<f64> {
        self.fps.or_else(|| self.fluids.iter().find_map(|fluid| fluid.sequence.fps))
    }

    /// Reads or generates the particles at a frame time, y up. Between frames those of each fluid are
    /// interpolated, see [`Particles::between`].
    ///
    /// # Errors
    /// As [`Contents::read`] and [`limpid_sim::recipe::Recipe::particles`]; [`Error::MissingFrame`] for a missing frame, if
    /// [`Loader::missing`] makes it an error.
    pub fn particles(&self, at: impl Into<FrameTime>) -> Result<Particles> {
        self.contents(at).map(|contents| contents.particles)
    }

    /// As [`Loader::particles`], with the arrays and cells of the files; between frames, those of the
    /// previous one.
    ///
    /// # Errors
    /// As [`Loader::particles`].
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

    /// The attributes that can colour the particles, with their values in the first frame that has particles.
    ///
    /// # Errors
    /// As [`Loader::particles`].
    pub fn attributes(&self) -> Result<Vec<AttributeRange>> {
        let mut loader = self.clone().colored_by(None);
        loader.fluids.iter_mut().for_each(|fluid| fluid.options.values = true);
        for frame in &loader.sequence.frames {
            let Contents { particles, arrays, .. } = loader.contents(frame)?;
            if !particles.is_empty() {
                return Ok(AttributeRange::of(&particles, &arrays));
            }
        }
        Ok(Vec::new())
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
    /// As [`Loader::particles`] and [`Loader::prepare`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn load(&self, at: impl Into<FrameTime>, scene: &Scene) -> Result<Loaded> {
        pollster::block_on(self.finish_load(at, scene))
    }

    /// As [`Loader::load`], for code that browsers and other programs share: waiting for a device that classifies
    /// yields in a browser and blocks elsewhere.
    ///
    /// # Errors
    /// As [`Loader::load`].
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
        // Attributes that nothing reads would take as much memory as the tables of classification.
        let shows = |of| self.color_by.as_ref().is_some_and(|by| by.attribute == of);
        particles.ids.take_if(|_| !shows(Attribute::Id));
        particles.densities.take_if(|_| !shows(Attribute::Density));
        let moves = self.with_velocities || shows(Attribute::Velocity);
        particles.velocities.take_if(|_| !moves);
        let prepared = self.finish_prepare(at, &particles, bulk, scene).await?;
        remarks.extend_from_slice(&prepared.remarks);
        Ok(Loaded { arrays, cells, remarks, ..prepared })
    }

    /// Classifies a frame's particles with the settings of `scene`, whose solids are moved to where they are then.
    ///
    /// # Errors
    /// [`Error::UnknownRadius`] if the radius cannot be determined; as [`SharedClassifier::classify`] and
    /// [`Loader::moved`].
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
        if let Some(by) = self.color_by.as_ref().filter(|_| scene.is_opaque()) {
            let range = match by.range {
                None if by.attribute.is_mapped() => self.seen(by)?.range,
                range => range.unwrap_or_default(),
            };
            splats.colors = Some(by.colors(particles, radius, &splats, range)?);
        }
        splats.opaque = self.opaque_splats(particles, radius, scene, &solids).await?;
        let (diffuse, on_diffuse) = match self.diffuse.as_slice() {
            [] => (None, Vec::new()),
            _ => self.diffuse(at, classify::median_radius(particles, radius)?)?,
        };
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
            diffuse_counts: diffuse.as_ref().map(Diffuse::counts).unwrap_or_default(),
            diffuse: diffuse.map(Arc::new),
            remarks: [moved.remarks(), &on_diffuse].concat(),
            bulk,
            moved,
            velocities: match particles.velocities.as_ref().filter(|_| self.with_velocities) {
                Some(velocities) => memory::collect(velocities.iter().copied(), "velocities")?,
                None => Vec::new(),
            },
        })
    }

    /// The splats of the opaque fluids among several, with their colours.
    async fn opaque_splats(
        &self,
        particles: &Particles,
        radius: f32,
        scene: &Scene,
        solids: &[Solid],
    ) -> Result<Option<Box<Splats>>> {
        let Some(fluids) = particles.fluids.as_ref().filter(|_| !self.opaque_fluids.is_empty())
        else {
            return Ok(None);
        };
        let color = |fluid: u8| self.opaque_fluids.get(usize::from(fluid)).copied().flatten();
        let colors: Vec<Vec3> = fluids.iter().filter_map(|&fluid| color(fluid)).collect();
        let mut opaque = particles.clone();
        opaque.retain(|i| color(fluids[i]).is_some());
        let settings = &scene.settings.classify;
        let mut splats = self.classifier.finish(&opaque, radius, settings, self.processor).await?;
        classify::add_closed_wall_contacts(&mut splats, solids, settings.wetting);
        splats.colors = Some(Colors::given(&opaque, radius, &splats, &colors)?);
        Ok((!splats.is_empty()).then(|| Box::new(splats)))
    }

    /// The colours of values, for a legend; `None` if none are shown by a map. The usual range of an attribute is the 2nd to
    /// 98th percentile of at most 65536 particles of each of at most 64 frames, both evenly spread, so that it is the same
    /// for all frames.
    ///
    /// # Errors
    /// As [`Loader::particles`]; [`Error::Usage`] if the files lack the attribute. Frames that cannot be read are left
    /// out if others can.
    pub fn color_scale(&self) -> Result<Option<ColorScale>> {
        let Some(by) = self.color_by.as_ref().filter(|by| by.attribute.is_mapped()) else {
            return Ok(None);
        };
        let Seen { range: usual, name, unit } = self.seen(by)?;
        let range = by.range.unwrap_or(usual);
        Ok(Some(ColorScale { name, unit, map: by.map, range, automatic: by.range.is_none() }))
    }

    /// The values that colour the particles, as the files show them.
    fn seen(&self, by: &ColorBy) -> Result<Seen> {
        if let Some(known) = self.seen.get() {
            return Ok(known.clone());
        }
        let frames = &self.sequence.frames;
        // With a given range, one frame tells the unit.
        let most = if by.range.is_some() { 1 } else { RANGED };
        let count = frames.len().min(most);
        let last = frames.len().saturating_sub(1);
        let (mut all, mut problem) = (Vec::new(), None);
        let (mut name, mut unit) = (by.attribute.to_string(), by.attribute.unit().to_owned());
        for k in 0..count {
            // The first, the last, and some between.
            let frame = &frames[(k * last).checked_div(count - 1).unwrap_or(0)];
            let Contents { particles, arrays, .. } = match self.contents(frame) {
                Err(error) if error.is_of_reading() => {
                    problem.get_or_insert(error);
                    continue;
                }
                contents => contents?,
            };
            let wanted = by.attribute.name();
            if let Some(array) = arrays.iter().find(|array| is_named(&array.name, wanted)) {
                let (spelled, of_file) = array.name_and_unit();
                spelled.clone_into(&mut name);
                // Some are known whatever the file says.
                if by.attribute.unit().is_empty() {
                    of_file.clone_into(&mut unit);
                }
            }
            if let Some(Values::Scalars(values)) = by.attribute.values(&particles) {
                let step = values.len().div_ceil(RANGED_PARTICLES).max(1);
                all.extend(values.into_iter().step_by(step));
            }
        }
        let usual = Spread::of(all).map(|spread| spread.usual);
        if let (None, Some(problem)) = (usual, problem) {
            return Err(problem);
        }
        let range = usual.unwrap_or([0.0, 1.0]);
        Ok(self.seen.get_or_init(|| Seen { range, name, unit }).clone())
    }

    /// Where the solids of `scene` are at a frame time, if its file moves any: this project's, with whatever
    /// settings.
    ///
    /// # Errors
    /// [`Error::MissingFrame`] if a solid lacks the frame and [`Loader::missing`] makes that an error; as
    /// [`crate::meshes::load`] and [`crate::meshes::rigid_bodies::read_poses`].
    pub fn moved(&self, at: impl Into<FrameTime>, scene: &Scene) -> Result<Moved> {
        let moved = |motion: &SolidMotion| motion.at(at.into(), &scene.solids, self.missing);
        self.motion().map_or_else(|| Ok(Moved::default()), moved)
    }

    /// Replaces the motion of the scene's solids.
    pub(crate) fn with_motion(mut self, motion: &SolidMotion) -> Self {
        self.motion.clone_from(motion);
        self
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

    /// How the scene's solids move, if they do.
    pub fn motion(&self) -> Option<&SolidMotion> {
        Some(&self.motion).filter(|motion| !motion.is_empty())
    }

    /// Origin of the radius of a frame's particles; with several fluids, the least reliable. After
    /// [`Input::resolve`] a guess applies to the whole sequence.
    pub fn radius_from(&self, particles: &Particles) -> RadiusFrom {
        match self.fluids.as_slice() {
            [_] if particles.radii.is_some() => RadiusFrom::File,
            fluids => fluids.iter().map(|fluid| fluid.radius_from).max().unwrap_or_default(),
        }
    }

    /// The axis that points up in the files, and how that is known; with several fluids, of the first that has z up, or of
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
        match &self.made {
            Some(source) => source.clone(),
            None => {
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
        let simulated = self.made.as_ref().is_some_and(|made| made.simulation().is_some());
        !simulated && self.fluids.iter().any(|fluid| matches!(fluid.source, FluidSource::Files))
    }

    /// The body of liquid that [`Input::resolve`] has measured, if it had to.
    pub fn body(&self) -> Option<&Body> {
        self.body.as_ref()
    }
}
