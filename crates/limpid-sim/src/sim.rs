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
mod swell;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::waves::WaveSpectrum;
use limpid::error::{Error, Result};
use limpid::liquid::Particles;
use limpid::scene::Solid;

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
    pub kind: Method,
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
pub enum Method {
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
    /// [`Error::Invalid`] naming the first key that is out of its range.
    pub fn check(&self) -> Result<()> {
        match self.problem() {
            Some(problem) => Err(Error::invalid("simulation", problem)),
            None => Ok(()),
        }
    }

    /// Memory that it takes to go on after a frame, or to begin, bytes.
    pub fn memory(&self, last: Option<&State>) -> usize {
        let blocks = self.blocks.iter().map(|block| block.count(2.0 * self.radius));
        let count = last.map_or_else(|| blocks.sum(), |state| state.len() as u64);
        (count as usize).saturating_mul(EACH)
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
            Method::Pbf if self.waves.is_some() => {
                return Some("waves are for kind = \"swell\"".into());
            }
            Method::Pbf if self.blocks.is_empty() && self.emitters.is_empty() => {
                return Some("needs a [[simulation.block]] or a [[simulation.emitter]]".into());
            }
            Method::Swell => {
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
            Method::Pbf => {}
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
fn is_within_bounds(x: DVec3) -> bool {
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
            (is_within_bounds(min) && is_within_bounds(max), "coordinates must be within 10000 m"),
            (min.cmplt(max).all(), "min must be below max, a radius above 0"),
            (self.velocity.length() <= 1e3, "velocity must be at most 1000 m/s"),
        ];
        checks.into_iter().find_map(|(good, problem)| (!good).then_some(problem))
    }
}

impl Emitter {
    fn problem(&self) -> Option<&'static str> {
        let checks = [
            (is_within_bounds(self.center), "center must be within 10000 m"),
            (self.direction.try_normalize().is_some(), "direction must be finite and not zero"),
            ((0.0..=1e3).contains(&self.radius), "radius must be 0 to 1000"),
            ((0.01..=100.0).contains(&self.speed), "speed must be 0.01 to 100"),
            (self.from >= 0.0 && self.from.is_finite(), "from must not be negative"),
            (self.until >= self.from, "until must not be before from"),
        ];
        checks.into_iter().find_map(|(good, problem)| (!good).then_some(problem))
    }
}

/// Makes a simulation's frames, one after the other.
pub struct Solver<'a>(Running<'a>);

enum Running<'a> {
    Pbf(Box<pbf::Fluid<'a>>, Option<State>),
    Swell(swell::Swell, f64),
}

impl<'a> Solver<'a> {
    /// Goes on after a frame of the simulation, or begins with the first.
    pub fn new(simulation: &'a Simulation, solids: &[Solid], last: Option<State>) -> Self {
        Self(match simulation.kind {
            Method::Pbf => Running::Pbf(Box::new(pbf::Fluid::new(simulation, solids)), last),
            Method::Swell => Running::Swell(swell::Swell::new(simulation), simulation.fps),
        })
    }

    /// The particles of the next frame, which has this number; the first has 1.
    pub fn make(&mut self, number: u32) -> Particles {
        match &mut self.0 {
            Running::Pbf(fluid, last) => {
                let state = match last.take() {
                    Some(mut state) => {
                        fluid.advance(number - 1, &mut state);
                        state
                    }
                    None => fluid.start(),
                };
                last.insert(state).to_particles()
            }
            Running::Swell(swell, fps) => swell.at(f64::from(number - 1) / *fps).to_particles(),
        }
    }
}

/// All that a frame is, in the order of identities; one entry per particle in each list.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
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

    /// That of a frame's particles; `None` for particles that no simulation has made.
    pub fn from_particles(particles: Particles) -> Option<Self> {
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
