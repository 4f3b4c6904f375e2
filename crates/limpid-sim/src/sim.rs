//! Simulated liquid: a scene's `[simulation]` table, and the solvers for its frames.
//!
//! The scene's solids are the obstacles. Frames depend on the scene alone: they are bit-identical on
//! any number of threads, and after an interruption, since each frame is computed from the contents of
//! the previous frame's file.

pub(crate) mod colliders;
mod emitter;
pub(crate) mod grid;
mod kernel;
mod pbf;
mod swell;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::waves::WaveSpectrum;
use limpid::error::{Error, Result};
use limpid::liquid::Particles;
use limpid::scene::Solid;

/// Rest density, kg/m³.
const DENSITY: f32 = 1000.0;

/// Largest size of a swell's tables: waves times the particles along the tank's three edges.
const MAX_TABLE_ENTRIES: f64 = 1e8;

/// Memory per simulated particle, bytes: its state in three frames, its sorted copy, and its
/// neighbours.
const BYTES_PER_PARTICLE: usize = 640;

/// Largest number of particles of a simulation.
const MAX_PARTICLES: f64 = 1e7;

/// A simulation: a scene's `[simulation]` table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Simulation {
    /// The simulation method.
    #[serde(default)]
    pub kind: Method,
    /// Number of frames, including the initial state: 1 to 100,000.
    pub frames: u32,
    /// Frames per second: 1 to 1000.
    #[serde(default = "default_fps")]
    pub fps: f64,
    /// Particle radius, m: 0.0001 to 10. A particle has the volume of a cube with twice that side.
    pub radius: f64,
    /// Acceleration of gravity, m/s².
    #[serde(default = "default_gravity")]
    pub gravity: Vec3,
    /// Rate at which a particle adopts the mean velocity of its neighbours, 1/s: 0 to 1000.
    #[serde(default = "default_viscosity")]
    pub viscosity: f64,
    /// Attraction between neighbours, m/s² at a distance of one diameter: 0 to 1000. It keeps thin
    /// sheets and jets together for longer.
    #[serde(default)]
    pub cohesion: f64,
    /// Minimum number of iterations of the density constraints per step: 1 to 50. Deep or compressed
    /// liquid takes up to 16.
    #[serde(default = "default_iterations")]
    pub iterations: u32,
    /// Invisible walls. A coordinate may be infinite.
    #[serde(default)]
    pub bounds: Option<Extent>,
    /// Particles outside this box are removed after each frame. A coordinate may be infinite.
    #[serde(default)]
    pub drain: Option<Extent>,
    /// The waves of a swell.
    #[serde(default)]
    pub waves: Option<WaveSpectrum>,
    /// Liquid in the initial state.
    #[serde(default, rename = "block")]
    pub blocks: Vec<Block>,
    /// Sources of liquid.
    #[serde(default, rename = "emitter")]
    pub emitters: Vec<Emitter>,
}

/// A simulation method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Position-based fluids (Macklin and Müller 2013).
    #[default]
    Pbf,
    /// Closed-form standing waves in a tank that one block fills.
    Swell,
}

/// An axis-aligned box.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extent {
    /// The corner with the smallest coordinates, m.
    pub min: DVec3,
    /// The corner with the largest coordinates, m.
    pub max: DVec3,
}

impl Extent {
    fn contains(&self, x: Vec3) -> bool {
        let x = x.as_dvec3();
        x.cmpge(self.min).all() && x.cmple(self.max).all()
    }
}

/// Liquid in the initial state: a box (`min`, `max`) or a ball (`center`, `radius`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// The box's corner with the smallest coordinates, m.
    #[serde(default)]
    pub min: Option<DVec3>,
    /// The box's corner with the largest coordinates, m.
    #[serde(default)]
    pub max: Option<DVec3>,
    /// The ball's centre, m.
    #[serde(default)]
    pub center: Option<DVec3>,
    /// The ball's radius, m.
    #[serde(default)]
    pub radius: Option<f64>,
    /// The initial velocity, m/s.
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

/// A disc that emits liquid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Emitter {
    /// The disc's centre, m. It must be clear of all solids.
    pub center: DVec3,
    /// Direction of the flow, of any length.
    pub direction: DVec3,
    /// The disc's radius, m.
    pub radius: f64,
    /// Speed of the emitted particles, m/s: 0.01 to 100.
    pub speed: f64,
    /// Start time, s.
    #[serde(default)]
    pub from: f64,
    /// End time, s; never by default.
    #[serde(default = "never")]
    pub until: f64,
}

fn default_fps() -> f64 {
    30.0
}

fn default_gravity() -> Vec3 {
    Vec3::new(0.0, -9.81, 0.0)
}

fn default_viscosity() -> f64 {
    8.0
}

fn default_iterations() -> u32 {
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

    /// Memory needed to continue from frame `last`, or to start, bytes.
    pub fn memory(&self, last: Option<&State>) -> usize {
        let blocks = self.blocks.iter().map(|block| block.count(2.0 * self.radius));
        let count = last.map_or_else(|| blocks.sum(), |state| state.len() as u64);
        (count as usize).saturating_mul(BYTES_PER_PARTICLE)
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
                if along * f64::from(waves.count) > MAX_TABLE_ENTRIES {
                    let count = waves.count;
                    return Some(format!(
                        "waves.count is {count}, too many for a block of {along} particles along its \
                         edges: their product may be {MAX_TABLE_ENTRIES}"
                    ));
                }
            }
            Method::Pbf => {}
        }
        let count = self.max_particles();
        (count > MAX_PARTICLES).then(|| {
            format!("{count:.0} particles by the last frame, at most {MAX_PARTICLES} can be simulated; make radius larger")
        })
    }

    /// Upper bound of the number of particles, including those that the drain removes.
    fn max_particles(&self) -> f64 {
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

/// Whether `x` is finite and within 10 km; beyond that, 32-bit positions are too coarse.
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

/// Computes a simulation's frames in order.
pub struct Solver<'a>(Backend<'a>);

enum Backend<'a> {
    Pbf(Box<pbf::Fluid<'a>>, Option<State>),
    Swell(swell::Swell, f64),
}

impl<'a> Solver<'a> {
    /// Continues from frame `last`, or starts with the first frame.
    pub fn new(simulation: &'a Simulation, solids: &[Solid], last: Option<State>) -> Self {
        Self(match simulation.kind {
            Method::Pbf => Backend::Pbf(Box::new(pbf::Fluid::new(simulation, solids)), last),
            Method::Swell => Backend::Swell(swell::Swell::new(simulation), simulation.fps),
        })
    }

    /// Computes the particles of the next frame, whose number is `number`; the first frame is 1.
    pub fn make(&mut self, number: u32) -> Particles {
        match &mut self.0 {
            Backend::Pbf(fluid, last) => {
                let state = match last.take() {
                    Some(mut state) => {
                        fluid.advance(number - 1, &mut state);
                        state
                    }
                    None => fluid.start(),
                };
                last.insert(state).to_particles()
            }
            Backend::Swell(swell, fps) => swell.at(f64::from(number - 1) / *fps).to_particles(),
        }
    }
}

/// The state of a frame: one entry per particle in each list, in the order of the ids.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    positions: Vec<Vec3>,
    velocities: Vec<Vec3>,
    /// Relative to the rest density.
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

    /// Restores the state from a frame's particles; `None` if they lack ids or velocities, as particles
    /// from another source may.
    pub fn from_particles(particles: Particles) -> Option<Self> {
        let count = particles.len();
        let ids = particles.ids?.into_iter().map(u64::try_from).collect::<Result<_, _>>().ok()?;
        Some(Self {
            positions: particles.positions,
            velocities: particles.velocities?,
            // The next frame does not depend on them.
            densities: vec![1.0; count],
            ids,
        })
    }
}
