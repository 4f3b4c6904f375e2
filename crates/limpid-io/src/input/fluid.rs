//! The particles of one fluid: their frames, their files and their radius.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

use crate::error::{Error, Result};
use crate::particles::{
    Attribute, AttributeMap, Contents, ReadOptions, Remark, Section, Selection,
};
use crate::sequence::{Frame, FrameTime, Missing, Sequence};
use limpid::liquid::bulk::{bounds, bulk};
use limpid::liquid::classify;
use limpid::liquid::{Particles, Up, likely_up};
use limpid::look::Body;
use limpid::memory;
use limpid_sim::recipe::Recipe;

use super::{RadiusFrom, UpFrom};

/// The frames of one fluid.
#[derive(Debug, Clone)]
pub(super) struct Fluid {
    pub(super) sequence: Sequence,
    pub(super) radius: Option<f32>,
    /// Origin of the radius; a guess without one.
    pub(super) radius_from: RadiusFrom,
    pub(super) up: Up,
    pub(super) up_from: UpFrom,
    /// Whether the axis, if nothing else tells it, is guessed from the first frames.
    pub(super) guess_up: bool,
    /// Length of the file's unit, m.
    pub(super) scale: f64,
    /// The box, m, y up, of particles outside the bulk that wait from the first frame to the last.
    pub(super) parked: Option<(DVec3, DVec3)>,
    pub(super) options: ReadOptions,
    pub(super) source: FluidSource,
}

/// The axis that points up in a file, and how that is known, if it is.
type KnownUp = Option<(Up, UpFrom)>;

/// The source of a fluid's particles.
#[derive(Debug, Clone)]
pub(super) enum FluidSource {
    /// The files of the frames.
    Files,
    /// A file in memory: the demo's, or one that was read from a pipe.
    Memory(Arc<[u8]>),
    /// Particles that the caller has.
    Given(Arc<Particles>),
    /// A recipe, which generates them.
    Recipe(Recipe),
}

/// The origin of one fluid's particles in one frame.
#[derive(Debug)]
pub struct Origin<'a> {
    /// The file; `None` for an empty or generated frame, and for one in memory or of the caller.
    pub file: Option<&'a Path>,
    /// Further files of the frame.
    pub parts: &'a [PathBuf],
    /// Its part of the file, if that has several frames.
    pub section: Option<Section>,
    /// The file, if it is in memory.
    pub memory: Option<&'a [u8]>,
    /// The recipe of generated particles.
    pub made: Option<&'a Recipe>,
    /// Particle radius if the file has none, m.
    pub radius: Option<f32>,
    /// The axis that points up.
    pub up: Up,
    /// Length of the file's unit, m.
    pub scale: f64,
    /// The arrays from which attributes are read.
    pub map: &'a AttributeMap,
    /// Which of its particles are read.
    pub select: &'a Selection,
}

impl Fluid {
    pub(super) fn of_files(
        sequence: Sequence,
        radius: Option<f32>,
        up: Option<Up>,
        map: AttributeMap,
    ) -> Self {
        let options = ReadOptions { map, ..ReadOptions::default() };
        let radius_from = radius.map_or(RadiusFrom::Guess, |_| RadiusFrom::Scene);
        Self {
            sequence,
            radius,
            radius_from,
            up: up.unwrap_or_default(),
            up_from: up.map_or(UpFrom::Default, |_| UpFrom::Scene),
            guess_up: false,
            scale: 1.0,
            parked: None,
            options,
            source: FluidSource::Files,
        }
    }

    /// One frame, a file in memory, which messages call `pattern`.
    pub(super) fn in_memory(path: &Path, pattern: &str, bytes: Arc<[u8]>) -> Self {
        let frames = vec![Frame::new(0, path.to_owned())];
        let sequence = Sequence { frames, pattern: pattern.into(), fps: None, absent: Vec::new() };
        let fluid = Self::of_files(sequence, None, None, AttributeMap::default());
        Self { source: FluidSource::Memory(bytes), ..fluid }
    }

    /// One frame of particles that the caller has, which messages call `pattern`.
    pub(super) fn given(particles: Arc<Particles>, pattern: &str) -> Self {
        let fluid = Self::in_memory(Path::new(pattern), pattern, Arc::default());
        Self { source: FluidSource::Given(particles), ..fluid }
    }

    /// The particles of the caller, if no copy has to be changed.
    pub(super) fn unchanged(&self) -> Option<Arc<Particles>> {
        let FluidSource::Given(particles) = &self.source else { return None };
        (self.up == Up::Y && self.scale == 1.0).then(|| particles.clone())
    }

    /// The particles of a frame that is there, y up, and the axis that points up in its file if that tells.
    fn particles(&self, number: i64) -> Result<(Arc<Particles>, KnownUp)> {
        if let Some(particles) = self.unchanged() {
            return Ok((particles, None));
        }
        let (_, Contents { particles, up, .. }) = self.contents(number, Missing::Error)?;
        Ok((Arc::new(particles), up.map(|(up, program)| (up, UpFrom::Format(program)))))
    }

    /// The contents at a frame time, y up.
    pub(super) fn contents_at(&self, at: FrameTime, missing: Missing) -> Result<Contents> {
        let (shown, mut contents) = self.contents(at.frame, missing)?;
        if at.fraction == 0.0 {
            return Ok(contents);
        }
        let (next_shown, next) = self.contents(at.next, missing)?;
        contents.remarks.extend(next.remarks);
        // A frame that is held stands still.
        if next_shown == shown {
            return Ok(contents);
        }
        let next = next.particles;
        let count = contents.particles.len() + next.len();
        memory::probe(count.saturating_mul(Particles::MATCHED), &self.sequence.pattern)?;
        contents.particles = Particles::between(&contents.particles, &next, at.fraction);
        Ok(contents)
    }

    /// The contents of a frame, y up, and the number of the frame that is shown, if one is.
    pub(super) fn contents(
        &self,
        number: i64,
        missing: Missing,
    ) -> Result<(Option<i64>, Contents)> {
        // They are those of whatever frame solids are shown at.
        let number = if let FluidSource::Given(_) = self.source { 0 } else { number };
        let (options, overruled) = self.reading();
        let read = |frame: &Frame| match &self.source {
            FluidSource::Files => frame.read(&options),
            FluidSource::Memory(bytes) => Contents::parse(&frame.path, bytes, &options),
            FluidSource::Given(particles) => {
                classify::probe_memory(particles.len(), &self.sequence.pattern)?;
                Ok(Particles::clone(particles).into())
            }
            FluidSource::Recipe(recipe) => Ok(recipe.particles()?.into()),
        };
        let mut remarks = Vec::new();
        let shown = self.sequence.read_shown(number, missing, &mut remarks, read)?;
        let (shown, mut contents) = match shown {
            Some((shown, contents)) => (Some(shown), contents),
            None => (None, Contents::default()),
        };
        contents.remarks.extend(remarks);
        if !matches!(self.source, FluidSource::Recipe(_)) {
            contents.particles.to_y_up(self.up);
            contents.particles.scale(self.scale);
            if let Some(array) = overruled {
                contents.remarks.push(Remark::RadiusGiven { array });
            } else if self.radius_from == RadiusFrom::Option && contents.particles.radii.is_some() {
                contents.remarks.push(Remark::OwnRadii);
            }
        }
        Ok((shown, contents))
    }

    /// The options for reading its files, and the arrays of radii in its attribute map, if the user has given
    /// a radius, which wins over these.
    fn reading(&self) -> (Cow<'_, ReadOptions>, Option<String>) {
        let mut options = Cow::Borrowed(&self.options);
        let mut overruled = None;
        if self.radius_from == RadiusFrom::Option && options.map.has(Attribute::Radius) {
            overruled = options.to_mut().map.leave_out(Attribute::Radius);
        }
        (options, overruled)
    }

    /// The arrays that attributes are read from, for a scene with its radius.
    pub(super) fn map(&self) -> AttributeMap {
        self.reading().0.map.clone()
    }

    /// The origin of a frame's particles.
    pub(super) fn origin(&self, number: i64, missing: Missing) -> Origin<'_> {
        let frame = self.sequence.shown(number, missing);
        let (file, memory, made) = match &self.source {
            FluidSource::Files => (frame.map(|frame| frame.path.as_path()), None, None),
            FluidSource::Memory(bytes) => (None, frame.map(|_| &**bytes), None),
            FluidSource::Given(_) => (None, None, None),
            FluidSource::Recipe(recipe) => (None, None, frame.map(|_| recipe)),
        };
        let parts = frame.filter(|_| file.is_some()).map_or(&[][..], |frame| &frame.parts);
        Origin {
            file,
            parts,
            section: frame.and_then(|frame| frame.section),
            memory,
            made,
            radius: self.radius,
            up: self.up,
            scale: self.scale,
            map: &self.options.map,
            select: &self.options.select,
        }
    }

    /// Sets the axis that points up, if it is not known and the file of the first frame with particles tells it by its
    /// format or is flat. Frames that cannot be read are errors once they are drawn.
    pub(super) fn resolve_up(&mut self) {
        if self.up_from != UpFrom::Default || !matches!(self.source, FluidSource::Files) {
            return;
        }
        let numbers: Vec<i64> = self.sequence.frames.iter().map(|frame| frame.number).collect();
        let mut read = numbers.into_iter().map_while(|number| self.particles(number).ok());
        let first = read.find(|(particles, _)| !particles.is_empty());
        drop(read);
        let found = first.and_then(|(particles, told)| told.or_else(|| flat_up(&particles)));
        (self.up, self.up_from) = found.unwrap_or((self.up, self.up_from));
    }

    /// Sets the radius from the first frame with particles and the axis that points up, if they are not
    /// known, and returns the body of liquid in that frame; with `all`, in it, the middle frame and the last
    /// one, so that an automatic view shows the whole event. The first of these that shows the axis tells it.
    pub(super) fn resolve(&mut self, all: bool) -> Result<Option<Body>> {
        let mut up = (self.up_from != UpFrom::Default).then_some((self.up, self.up_from));
        let guess_up = self.guess_up;
        let guess = |particles: &Particles, radius: f32| {
            let guessed = guess_up.then(|| likely_up(particles, radius)).flatten();
            guessed.map(|up| (up, UpFrom::Guess))
        };
        let numbers: Vec<i64> = self.sequence.frames.iter().map(|frame| frame.number).collect();
        let mut shown: Option<(Arc<Particles>, f32)> = None;
        let mut first = numbers.len();
        // Damaged frames are errors, or replaced, once they are drawn.
        let mut damage = None;
        for (i, &number) in numbers.iter().enumerate() {
            let (particles, told) = match self.particles(number) {
                Err(error) if error.is_of_reading() => {
                    damage.get_or_insert(error);
                    continue;
                }
                particles => particles?,
            };
            if particles.is_empty() {
                continue;
            }
            // A single particle has no spacing, but a later frame may have more.
            let resolved = match self.resolved_radius(number, &particles) {
                Err(Error::UnknownRadius { .. }) if i + 1 < numbers.len() => continue,
                resolved => resolved?,
            };
            if resolved > 0.0 && self.radius.is_none() {
                let own = particles.radii.is_some();
                self.radius_from = if own { RadiusFrom::File } else { RadiusFrom::Guess };
                self.radius = Some(resolved);
            }
            let radius = classify::median_radius(&particles, resolved)?;
            up = up.or(told).or_else(|| flat_up(&particles)).or_else(|| guess(&particles, radius));
            shown = Some((particles, radius));
            first = i;
            break;
        }
        if let Some(error) = damage.filter(|_| first == numbers.len()) {
            return Err(error);
        }
        let Some((shown, radius)) = shown else { return Ok(None) };
        let last = numbers.len().saturating_sub(1);
        let others = [last, first + (last.saturating_sub(first)) / 2];
        let mut body: Option<Body> = None;
        for (k, &i) in others.iter().enumerate() {
            if !all || i <= first || others[..k].contains(&i) {
                continue;
            }
            let Ok((particles, _)) = self.particles(numbers[i]) else { continue };
            if i == last {
                self.parked = parked(&shown, &particles);
            }
            up = up.or_else(|| guess(&particles, radius));
            body = joined(body, self.body(&particles, radius));
        }
        let mut body = joined(self.body(&shown, radius), body);
        if let (UpFrom::Default, Some((up, from))) = (self.up_from, up) {
            // These particles were read as y-up; from here on files are turned as they are read.
            (self.up, self.up_from) = (up, from);
            body = body.map(|body| body.to_y_up(up));
            self.parked = self
                .parked
                .and_then(|(min, max)| bounds([up.to_y_up(min), up.to_y_up(max)].into_iter()));
        }
        Ok(body)
    }

    /// The body of a frame's particles; `None` without any.
    fn body(&self, particles: &Particles, radius: f32) -> Option<Body> {
        let bulk = particles.bulk_beside(self.parked)?;
        Some(Body::of_bulk(particles, &bulk, radius))
    }

    /// The radius for all frames: as [`Fluid::radius_of`], or, for a single file, that of its sequence.
    pub(super) fn resolved_radius(&self, number: i64, particles: &Particles) -> Result<f32> {
        /// Largest relative difference of guesses for frames of one simulation.
        const TOLERANCE: f32 = 0.1;
        let own = self.radius_of(number, particles)?;
        let guessed = self.radius.is_none() && particles.radii.is_none();
        let (FluidSource::Files, [frame], true) = (&self.source, &*self.sequence.frames, guessed)
        else {
            return Ok(own);
        };
        let siblings = Sequence::around(&frame.path).map_or(Vec::new(), |all| all.frames);
        // They need not have the attribute that colours this file.
        let options = ReadOptions { shown: None, ..self.reading().0.into_owned() };
        for sibling in siblings.iter().take_while(|sibling| sibling.number < frame.number) {
            let first = match Contents::read(&sibling.path, &options) {
                Ok(contents) => {
                    let mut particles = contents.particles;
                    particles.scale(self.scale);
                    particles
                }
                // Not a frame of the same simulation.
                Err(
                    Error::Malformed { .. }
                    | Error::Unplaced { .. }
                    | Error::TooLarge { .. }
                    | Error::Format { .. },
                ) => {
                    break;
                }
                Err(error) => return Err(error),
            };
            if first.is_empty() {
                continue;
            }
            if first.radii.is_none() {
                let theirs = match self.radius_of(sibling.number, &first) {
                    // A single particle has no spacing.
                    Err(Error::UnknownRadius { .. }) => continue,
                    theirs => theirs?,
                };
                return Ok(if (theirs - own).abs() <= TOLERANCE * own { theirs } else { own });
            }
            break;
        }
        Ok(own)
    }

    /// The radius for particles without radii: the given one, or an estimate from their spacing.
    pub(super) fn radius_of(&self, number: i64, particles: &Particles) -> Result<f32> {
        let radius = match self.radius {
            Some(radius) => radius,
            None => {
                classify::probe_memory(particles.len(), &self.sequence.pattern)?;
                classify::estimate_radius(particles)
            }
        };
        if radius > 0.0 || particles.is_empty() || particles.radii.is_some() {
            return Ok(radius);
        }
        let origin = match self.sequence.frame(number) {
            Some(frame) => frame.path.display().to_string(),
            None => self.sequence.pattern.clone(),
        };
        Err(Error::UnknownRadius { origin })
    }
}

/// The axis that points up in particles of a plane: the one of y and z that has an extent. In 2-D, y = 0 or z = 0
/// throughout.
fn flat_up(particles: &Particles) -> Option<(Up, UpFrom)> {
    /// Fewer particles are flat by chance.
    const FEWEST: usize = 32;
    /// Extent of a plane over that of the liquid: digits that programs have rounded.
    const FLAT: f64 = 1e-5;
    let bulk = particles.bulk().filter(|_| particles.len() >= FEWEST)?;
    let extent = bulk.bounds.1 - bulk.bounds.0;
    let is_flat = |x: f64| x <= FLAT * extent.max_element();
    let up = match (is_flat(extent.y), is_flat(extent.z)) {
        (true, false) => Up::Z,
        (false, true) => Up::Y,
        _ => return None,
    };
    Some((up, UpFrom::Flat))
}

/// The body of two frames.
fn joined(a: Option<Body>, b: Option<Body>) -> Option<Body> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.with(b)),
        (a, b) => a.or(b),
    }
}

/// The box of the particles outside the bulk that are at the same places in two frames. `None` if they have velocities,
/// which tell by themselves.
fn parked(first: &Particles, last: &Particles) -> Option<(DVec3, DVec3)> {
    if first.len() != last.len() || first.velocities.is_some() {
        return None;
    }
    let is_still = |i: usize| first.place(i) == last.place(i);
    let bulk = bulk(first.len(), |i| first.place(i), is_still)?;
    let lost = (0..first.len()).filter(|&i| is_still(i) && !bulk.holds(first.place(i)));
    bounds(lost.map(|i| first.place(i)))
}
