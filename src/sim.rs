//! Simulated liquid: what stands in a scene's `[simulation]`, and the frames that it bakes to.
//!
//! The scene's solids are what the liquid runs into. Frames depend on the scene alone: they are the
//! same to the bit on any number of threads, and whether they were made in one go or not, since
//! what a frame's file holds is all that the next frame is made from.

mod colliders;
mod emitter;
mod grid;
mod kernel;
mod pbf;
mod record;
mod swell;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{channel, sync_channel};

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::memory;
use crate::output;
use crate::particles::Particles;
use crate::scene::Solid;
use crate::waves::WaveSpectrum;

/// Mass density of the liquid at rest, kg/m³.
const DENSITY: f32 = 1000.0;

/// The most that a swell's tables may hold: a wave for each particle along the tank's three edges.
const MOST_TABLED: f64 = 1e8;

/// Bytes that a particle takes while it is simulated: itself in three frames, sorted, and its
/// neighbours.
const EACH: usize = 640;

/// The most particles that a simulation may have.
const MOST_PARTICLES: f64 = 1e7;

/// A simulation, as a scene's `[simulation]` describes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Simulation {
    /// How particles move.
    #[serde(default)]
    pub kind: Kind,
    /// Number of frames, the first being the start: 1 to 100,000.
    pub frames: u32,
    /// Frames per second: 1 to 1000.
    #[serde(default = "thirty")]
    pub fps: f64,
    /// Particle radius, m: 0.0001 to 10. Each has the volume of a cube of twice that.
    pub radius: f64,
    /// Acceleration of gravity, m/s².
    #[serde(default = "earth")]
    pub gravity: Vec3,
    /// How fast a particle takes on the velocity of those around it, 1/s: 0 to 1000.
    #[serde(default = "watery")]
    pub viscosity: f64,
    /// How strongly neighbours draw each other, m/s² at a distance of one diameter: 0 to 1000. A
    /// thin sheet or jet holds together longer.
    #[serde(default)]
    pub cohesion: f64,
    /// Least number of iterations of the density constraints in each step: 1 to 50. Deep or
    /// crowded liquid takes up to 16.
    #[serde(default = "few")]
    pub iterations: u32,
    /// Walls that are not drawn. A coordinate may be infinite.
    #[serde(default)]
    pub bounds: Option<Extent>,
    /// Particles outside are removed after each frame. A coordinate may be infinite.
    #[serde(default)]
    pub drain: Option<Extent>,
    /// The waves of a swell.
    #[serde(default)]
    pub waves: Option<WaveSpectrum>,
    /// Liquid at the start.
    #[serde(default, rename = "block")]
    pub blocks: Vec<Block>,
    /// What pours liquid.
    #[serde(default, rename = "emitter")]
    pub emitters: Vec<Emitter>,
}

/// How particles move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Position-based fluids (Macklin and Müller 2013).
    #[default]
    Pbf,
    /// Standing waves in a tank that one block fills, from closed forms.
    Swell,
}

/// A box.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extent {
    /// The corner with the smallest coordinates, m.
    pub min: DVec3,
    /// The corner with the largest.
    pub max: DVec3,
}

impl Extent {
    fn contains(&self, x: Vec3) -> bool {
        let x = x.as_dvec3();
        x.cmpge(self.min).all() && x.cmple(self.max).all()
    }
}

/// Liquid at the start: a box (`min`, `max`) or a ball (`center`, `radius`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// The box's corner with the smallest coordinates, m.
    #[serde(default)]
    pub min: Option<DVec3>,
    /// The box's corner with the largest.
    #[serde(default)]
    pub max: Option<DVec3>,
    /// The ball's centre, m.
    #[serde(default)]
    pub center: Option<DVec3>,
    /// The ball's radius, m.
    #[serde(default)]
    pub radius: Option<f64>,
    /// Its velocity, m/s.
    #[serde(default)]
    pub velocity: DVec3,
}

impl Block {
    fn ball(&self) -> Option<(DVec3, f64)> {
        self.center.zip(self.radius)
    }

    fn extent(&self) -> (DVec3, DVec3) {
        match self.ball() {
            Some((center, radius)) => (center - radius, center + radius),
            None => (self.min.unwrap_or_default(), self.max.unwrap_or_default()),
        }
    }

    fn count(&self, spacing: f64) -> u64 {
        match self.ball() {
            Some(_) => emitter::places(self, spacing).len() as u64,
            None => {
                let (min, max) = self.extent();
                emitter::lattice(min, max, spacing).element_product() as u64
            }
        }
    }
}

/// A disc that pours liquid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Emitter {
    /// The disc's centre, m. Particles appear here, so it must be off all solids.
    pub center: DVec3,
    /// Where it points; any length.
    pub direction: DVec3,
    /// The disc's radius, m.
    pub radius: f64,
    /// Speed of what comes out, m/s: 0.01 to 100.
    pub speed: f64,
    /// When it begins, s.
    #[serde(default)]
    pub from: f64,
    /// When it ends, s; default never.
    #[serde(default = "never")]
    pub until: f64,
}

/// How far a bake has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Frames that are on disk.
    pub done: u32,
    /// Frames that there will be.
    pub frames: u32,
}

fn thirty() -> f64 {
    30.0
}

fn earth() -> Vec3 {
    Vec3::new(0.0, -9.81, 0.0)
}

fn watery() -> f64 {
    8.0
}

fn few() -> u32 {
    3
}

fn never() -> f64 {
    f64::INFINITY
}

impl Simulation {
    /// Particle radius, m.
    pub fn particle_radius(&self) -> f64 {
        self.radius
    }

    /// Checks all values against their ranges.
    ///
    /// # Errors
    /// [`Error::Scene`] naming the first key that is out of its range.
    pub fn check(&self) -> Result<()> {
        match self.problem() {
            Some(problem) => Err(Error::Scene { origin: "simulation".into(), problem }),
            None => Ok(()),
        }
    }

    fn problem(&self) -> Option<String> {
        let ranges = [
            ("frames", f64::from(self.frames), 1.0..=1e5),
            ("fps", self.fps, 1.0..=1e3),
            ("radius", self.radius, 1e-4..=10.0),
            ("viscosity", self.viscosity, 0.0..=1e3),
            ("cohesion", self.cohesion, 0.0..=1e3),
            ("iterations", f64::from(self.iterations), 1.0..=50.0),
        ];
        if let Some(problem) = out_of_range(&ranges) {
            return Some(problem);
        }
        if !(self.gravity.is_finite() && self.gravity.length() <= 1e3) {
            return Some("gravity must be at most 1000 m/s²".into());
        }
        for (key, extent) in [("bounds", self.bounds), ("drain", self.drain)] {
            if extent.is_some_and(|extent| !extent.min.cmplt(extent.max).all()) {
                return Some(format!("{key}: min must be below max"));
            }
        }
        for (number, block) in (1..).zip(&self.blocks) {
            if let Some(problem) = block.problem() {
                return Some(format!("block {number}: {problem}"));
            }
        }
        for (number, emitter) in (1..).zip(&self.emitters) {
            if let Some(problem) = emitter.problem() {
                return Some(format!("emitter {number}: {problem}"));
            }
        }
        match self.kind {
            Kind::Pbf if self.waves.is_some() => {
                return Some("waves are for kind = \"swell\"".into());
            }
            Kind::Pbf if self.blocks.is_empty() && self.emitters.is_empty() => {
                return Some("needs a [[simulation.block]] or a [[simulation.emitter]]".into());
            }
            Kind::Swell => {
                let one_box = self.blocks.len() == 1 && self.blocks[0].ball().is_none();
                let rest = self.emitters.is_empty() && self.bounds.or(self.drain).is_none();
                let Some(waves) = self.waves.filter(|_| one_box && rest) else {
                    let problem = "a swell has waves, one block (min and max), and no emitter, \
                                   bounds or drain";
                    return Some(problem.into());
                };
                let [shortest, longest] = waves.wavelengths;
                let ranges = [
                    ("waves.count", f64::from(waves.count), 0.0..=1e4),
                    ("waves.wavelengths", shortest, 1e-3..=1e3),
                    ("waves.wavelengths", longest, shortest..=1e3),
                    ("waves.rms_slope", waves.rms_slope, 0.0..=1.0),
                ];
                if let Some(problem) = out_of_range(&ranges) {
                    return Some(problem);
                }
                let (min, max) = self.blocks[0].extent();
                let along = emitter::lattice(min, max, 2.0 * self.radius).element_sum();
                if along * f64::from(waves.count) > MOST_TABLED {
                    let count = waves.count;
                    return Some(format!(
                        "waves.count is {count}, too many for a block of {along} particles along its \
                         edges: their product may be {MOST_TABLED}"
                    ));
                }
            }
            Kind::Pbf => {}
        }
        let most = self.most_particles();
        (most > MOST_PARTICLES).then(|| {
            format!("{most:.0} particles by the last frame, at most {MOST_PARTICLES} can be simulated; make radius larger")
        })
    }

    /// How many particles there may be, those counted that the drain will remove.
    fn most_particles(&self) -> f64 {
        let spacing = 2.0 * self.radius;
        let end = f64::from(self.frames - 1) / self.fps;
        let block = |block: &Block| {
            let (min, max) = block.extent();
            ((max - min) / spacing).element_product()
        };
        let emitter = |emitter: &Emitter| {
            let disc = std::f64::consts::PI * (emitter.radius / spacing + 1.0).powi(2);
            let time = (end.min(emitter.until) - emitter.from).max(0.0);
            disc * (time * emitter.speed / spacing + 1.0)
        };
        self.blocks.iter().map(block).sum::<f64>() + self.emitters.iter().map(emitter).sum::<f64>()
    }
}

/// Beyond this 32-bit particles are further apart than their radius.
fn is_place(x: DVec3) -> bool {
    x.is_finite() && x.abs().max_element() <= 1e4
}

fn out_of_range(ranges: &[(&str, f64, std::ops::RangeInclusive<f64>)]) -> Option<String> {
    ranges.iter().find(|(_, value, range)| !range.contains(value)).map(|(key, value, range)| {
        format!("{key} is {value}, expected {} to {}", range.start(), range.end())
    })
}

impl Block {
    fn problem(&self) -> Option<&'static str> {
        let (min, max) = self.extent();
        match (self.min, self.max, self.center, self.radius) {
            (Some(_), Some(_), None, None) | (None, None, Some(_), Some(_)) => {}
            _ => return Some("takes min and max, or center and radius"),
        }
        let checks = [
            (is_place(min) && is_place(max), "coordinates must be within 10000 m"),
            (min.cmplt(max).all(), "min must be below max, a radius above 0"),
            (self.velocity.length() <= 1e3, "velocity must be at most 1000 m/s"),
        ];
        checks.into_iter().find_map(|(good, problem)| (!good).then_some(problem))
    }
}

impl Emitter {
    fn problem(&self) -> Option<&'static str> {
        let checks = [
            (is_place(self.center), "center must be within 10000 m"),
            (self.direction.try_normalize().is_some(), "direction must be finite and not zero"),
            ((0.0..=1e3).contains(&self.radius), "radius must be 0 to 1000"),
            ((0.01..=100.0).contains(&self.speed), "speed must be 0.01 to 100"),
            (self.from >= 0.0 && self.from.is_finite(), "from must not be negative"),
            (self.until >= self.from, "until must not be before from"),
        ];
        checks.into_iter().find_map(|(good, problem)| (!good).then_some(problem))
    }
}

/// Where the frames of a scene file are baked to if nothing else is said: `sims/baked/dam_break`
/// for `sims/dam_break.toml`.
pub fn folder(scene_file: &Path) -> PathBuf {
    let name = scene_file.file_stem().unwrap_or_default();
    scene_file.parent().unwrap_or(Path::new("")).join("baked").join(name)
}

/// The file of a frame.
pub fn frame_path(folder: &Path, name: &str, number: u32) -> PathBuf {
    folder.join(format!("{name}_{number:04}.bgeo"))
}

/// The pattern of all frames' files.
pub fn frame_pattern(folder: &Path, name: &str) -> String {
    folder.join(format!("{name}_{{}}.bgeo")).to_string_lossy().into_owned()
}

/// Makes the frames of a simulation among `solids` that are not in `folder` yet.
///
/// `progress` is told of each frame that is on disk, also of those found there, in order, and ends
/// the bake by [`ControlFlow::Break`]; what is there then is whole, and the next bake goes on
/// from it.
///
/// # Errors
/// As [`Simulation::check`]; [`Error::Io`] if
/// the folder cannot be written, [`Error::Usage`] if it holds frames of this name that other
/// parameters made.
pub fn bake(
    simulation: &Simulation,
    solids: &[Solid],
    name: &str,
    folder: &Path,
    mut progress: impl FnMut(Progress) -> ControlFlow<()>,
) -> Result<()> {
    simulation.check()?;
    let frames = simulation.frames;
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
    record::keep(simulation, solids, name, folder)?;
    let (found, last) = found(simulation, name, folder)?;
    for done in 1..=found {
        if progress(Progress { done, frames }).is_break() {
            return Ok(());
        }
    }
    if found >= frames {
        return Ok(());
    }

    let blocks = simulation.blocks.iter().map(|block| block.count(2.0 * simulation.radius));
    let count = last.as_ref().map_or_else(|| blocks.sum(), |state| state.len() as u64);
    memory::probe((count as usize).saturating_mul(EACH), name)?;

    std::thread::scope(|scope| {
        // A frame is written while the next one is made.
        let (made, to_write) = sync_channel::<(u32, Particles)>(1);
        let (wrote, written) = channel();
        let write = move || {
            for (number, particles) in to_write {
                let outcome = particles.write(&frame_path(folder, name, number)).map(|()| number);
                let failed = outcome.is_err();
                if wrote.send(outcome).is_err() || failed {
                    return;
                }
            }
        };
        std::thread::Builder::new().spawn_scoped(scope, write).map_err(Error::Threads)?;
        let mut frame = Source::new(simulation, solids, last);
        let mut tell =
            |outcome: Result<u32>| outcome.map(|done| progress(Progress { done, frames }));
        for number in found + 1..=frames {
            // The writer is gone once it has failed; why is among what it said.
            let gone = made.send((number, frame.make(number))).is_err();
            for outcome in written.try_iter() {
                if tell(outcome)?.is_break() {
                    return Ok(());
                }
            }
            if gone {
                break;
            }
        }
        drop(made);
        for outcome in written {
            if tell(outcome)?.is_break() {
                break;
            }
        }
        Ok(())
    })
}

/// Removes a bake's frames and its record, so that the next one begins anew.
///
/// # Errors
/// [`Error::Io`] naming the file that could not be removed; [`Error::Usage`] for frames without a
/// record, which may be another program's.
pub fn clear(name: &str, folder: &Path) -> Result<()> {
    let remove = |path: &Path| std::fs::remove_file(path).map_err(|e| Error::io(path, "remove", e));
    let (frames, record) = (frames_in(folder, name)?, record::path(folder, name));
    if !frames.is_empty() && !record.exists() {
        return Err(record::unknown(name, folder));
    }
    if record.exists() {
        output::Kind::BakeRecord.check(&record)?;
    }
    // The record last: without it the frames that are left would be nobody's.
    for path in frames {
        remove(&path)?;
    }
    if record.exists() { remove(&record) } else { Ok(()) }
}

/// The frames of this name that are there, whatever their numbers.
fn frames_in(folder: &Path, name: &str) -> Result<Vec<PathBuf>> {
    let fail = |e| Error::io(folder, "list", e);
    let entries = match std::fs::read_dir(folder) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(fail)?,
    };
    let paths = entries.map(|entry| entry.map(|entry| entry.path()).map_err(fail));
    let is_frame = |path: &PathBuf| {
        let stem = path.file_name().and_then(|n| n.to_str()).and_then(|n| n.strip_suffix(".bgeo"));
        let number = stem.and_then(|stem| stem.strip_prefix(name)?.strip_prefix('_'));
        let number = number.and_then(|number| number.parse().ok());
        number.is_some_and(|number| *path == frame_path(folder, name, number))
    };
    let frames: Result<Vec<PathBuf>> = paths.collect();
    Ok(frames?.into_iter().filter(is_frame).collect())
}

/// The number of whole frames that are there without a gap, and the particles of the last.
///
/// # Errors
/// [`Error::Io`], [`Error::Memory`]: the frame may be whole.
fn found(simulation: &Simulation, name: &str, folder: &Path) -> Result<(u32, Option<State>)> {
    let there = |number: &u32| frame_path(folder, name, *number).exists();
    let mut found = (1..=simulation.frames).take_while(there).count() as u32;
    while found > 0 {
        let path = frame_path(folder, name, found);
        let last = match Particles::read(&path) {
            Ok(last) => State::from_particles(last),
            Err(Error::Malformed { .. } | Error::Format { .. }) => None,
            Err(error) => return Err(error),
        };
        if last.is_some() {
            return Ok((found, last));
        }
        // By the record it is this bake's, but it is no particle file, which would be replaced. That it
        // cannot be removed is an error once it is written.
        let _ = std::fs::remove_file(path);
        found -= 1;
    }
    Ok((0, None))
}

/// What makes the frames, one after the other.
enum Source<'a> {
    Pbf(Box<pbf::Fluid<'a>>, Option<State>),
    Swell(swell::Swell, f64),
}

impl<'a> Source<'a> {
    fn new(simulation: &'a Simulation, solids: &[Solid], last: Option<State>) -> Self {
        match simulation.kind {
            Kind::Pbf => Self::Pbf(Box::new(pbf::Fluid::new(simulation, solids)), last),
            Kind::Swell => Self::Swell(swell::Swell::new(simulation), simulation.fps),
        }
    }

    fn make(&mut self, number: u32) -> Particles {
        match self {
            Self::Pbf(fluid, last) => {
                let state = match last.take() {
                    Some(mut state) => {
                        fluid.advance(number - 1, &mut state);
                        state
                    }
                    None => fluid.start(),
                };
                last.insert(state).to_particles()
            }
            Self::Swell(swell, fps) => swell.at(f64::from(number - 1) / *fps).to_particles(),
        }
    }
}

/// All that a frame is, in the order of identities; one entry per particle in each list.
#[derive(Debug, Clone, Default, PartialEq)]
struct State {
    positions: Vec<Vec3>,
    velocities: Vec<Vec3>,
    /// In shares of the density at rest.
    densities: Vec<f32>,
    ids: Vec<u64>,
}

impl State {
    fn len(&self) -> usize {
        self.positions.len()
    }

    fn push(&mut self, id: u64, x: Vec3, velocity: DVec3) {
        self.positions.push(x);
        self.velocities.push(velocity.as_vec3());
        self.densities.push(1.0);
        self.ids.push(id);
    }

    fn retain(&mut self, keep: impl Fn(Vec3) -> bool) {
        let kept: Vec<bool> = self.positions.iter().map(|&x| keep(x)).collect();
        fn filter<T>(items: &mut Vec<T>, kept: &[bool]) {
            let mut kept = kept.iter();
            items.retain(|_| kept.next() == Some(&true));
        }
        filter(&mut self.positions, &kept);
        filter(&mut self.velocities, &kept);
        filter(&mut self.densities, &kept);
        filter(&mut self.ids, &kept);
    }

    fn to_particles(&self) -> Particles {
        Particles {
            positions: self.positions.clone(),
            velocities: Some(self.velocities.clone()),
            densities: Some(self.densities.iter().map(|share| share * DENSITY).collect()),
            ids: Some(self.ids.iter().map(|&id| id as i64).collect()),
            ..Particles::default()
        }
    }

    /// `None` for particles that no bake has written.
    fn from_particles(particles: Particles) -> Option<Self> {
        let count = particles.len();
        let ids = particles.ids?.into_iter().map(u64::try_from).collect::<Result<_, _>>().ok()?;
        Some(Self {
            positions: particles.positions,
            velocities: particles.velocities?,
            // Not what the next frame is made from.
            densities: vec![1.0; count],
            ids,
        })
    }
}
