//! Measures of a whole sequence, which its thresholds follow.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::estimate::gravity;
use super::{Flow, Potentials};

/// Neighbours of a particle within liquid whose particles fill cubes of two radii.
const FULL: f32 = 33.5;

/// Least and largest number of neighbours that count as full: thin sheets have fewer, compressed liquid has more.
const FULL_RANGE: [f32; 2] = [15.0, 120.0];

/// The quantile of a frame's potentials that stands for its highest; a single stray particle decides nothing.
const HIGH: f64 = 0.995;

/// The least of a threshold in parts of the highest, as the automatic mode of `SPlisHSPlasH`'s `FoamGenerator` has it.
const LOW: f32 = 0.1;

/// Thresholds below which no liquid makes whitewater: the head of its speed, radii; the speed at which neighbours meet, in
/// speeds of a head of one radius; and the curvature of crests.
const LEAST_HEAD: f32 = 4.0;
const LEAST_AIR: f32 = 0.5;
const LEAST_CREST: f32 = 0.03;

/// Particles that liquid of full potentials emits in the time √(r/g), per particle.
const RATE: f32 = 20.0;

/// Largest expected number of diffuse particles, per particle of liquid.
const SHARE: f64 = 4.0;

/// The mean life in units of [`Survey::life`]: see [`Survey::lifetime`].
const MEAN_LIFE: f64 = 6.0;

/// The measures of a sequence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Survey {
    /// Radius of the liquid's particles, m.
    pub radius: f32,
    /// Acceleration of gravity, m/s²: that of the earth, or what falls in the files if that is far from it, as in files of
    /// another unit.
    pub gravity: f32,
    /// Number of neighbours within the liquid.
    pub full: f32,
    /// Thresholds of the head of speeds, radii.
    pub head: [f32; 2],
    /// Thresholds of trapped air, in speeds of a head of one radius.
    pub air: [f32; 2],
    /// Thresholds of crests.
    pub crest: [f32; 2],
    /// Time in which the fastest liquid rises until it falls, s.
    pub life: f32,
    /// Particles that liquid of full potentials emits per particle and second.
    pub rate: f32,
    /// Expected number of particles at a time.
    pub population: f64,
    /// The extent of the liquid in all frames, m.
    pub bounds: [DVec3; 2],
}

/// Equation 1 of Ihmsen et al. 2012: 0 below the thresholds, 1 above.
pub(crate) fn clamped(value: f32, [low, high]: [f32; 2]) -> f32 {
    (value.min(high) - value.min(low)) / (high - low).max(f32::MIN_POSITIVE)
}

impl Survey {
    /// The speed of a head of one radius, m/s.
    fn unit(&self) -> f32 {
        (2.0 * self.gravity * self.radius).sqrt()
    }

    /// The clamped potential of kinetic energy.
    pub(crate) fn energy(&self, of: &Potentials) -> f32 {
        clamped(of.square / self.unit().powi(2), self.head)
    }

    /// The clamped potentials together, from 0 to 2: equation 8 of Ihmsen et al. 2012 with equal factors.
    pub fn potential(&self, of: &Potentials) -> f32 {
        let air = clamped(of.air / self.unit(), self.air);
        self.energy(of) * (air + clamped(of.crest, self.crest))
    }

    /// Seconds that a new particle has, by its potential of energy and a random number from 0 to 1: 4 to 10 units, as 2 to
    /// 5 s are in `FoamGenerator`'s scenes.
    pub(crate) fn lifetime(&self, energy: f32, random: f32) -> f32 {
        self.life * (4.0 + 6.0 * energy * random)
    }

    /// Expected number of particles at a time.
    pub(crate) fn expected(&self, amount: f32) -> f64 {
        self.population * f64::from(amount)
    }
}

/// Measures a sequence, frame by frame.
#[derive(Debug, Clone)]
pub struct Surveyor {
    radius: f32,
    frames: Vec<Frame>,
    /// Accelerations downwards, m/s².
    falls: Vec<f32>,
    bounds: Option<[DVec3; 2]>,
}

/// The potentials of some particles of a frame.
#[derive(Debug, Clone)]
struct Frame {
    some: Vec<Potentials>,
    /// Particles for each of these.
    each: f64,
}

impl Frame {
    /// Particles of a frame that are kept, at most.
    const MOST: usize = 1 << 15;

    /// A quantile of some value.
    fn quantile(&self, share: f64, of: impl Fn(&Potentials) -> f32) -> f32 {
        let mut all: Vec<f32> = self.some.iter().map(of).collect();
        let at = (share * (all.len() - 1) as f64) as usize;
        *all.select_nth_unstable_by(at, f32::total_cmp).1
    }
}

impl Surveyor {
    /// Begins with particles of this radius, m.
    pub fn new(radius: f32) -> Self {
        Self { radius, frames: Vec::new(), falls: Vec::new(), bounds: None }
    }

    /// Adds a frame with its bounds in world space, and its accelerations downwards: [`super::falls`].
    pub fn add(
        &mut self,
        flow: &Flow,
        bounds: (DVec3, DVec3),
        potentials: &[Potentials],
        falls: &[f32],
    ) {
        if flow.is_empty() {
            return;
        }
        let step = potentials.len().div_ceil(Frame::MOST);
        let some = potentials.iter().step_by(step).copied().collect();
        self.frames.push(Frame { some, each: step as f64 });
        self.falls.extend_from_slice(falls);
        let [min, max] = self.bounds.unwrap_or([bounds.0, bounds.1]);
        self.bounds = Some([min.min(bounds.0), max.max(bounds.1)]);
    }

    /// Potentials of a frame as a survey takes them: of liquid whose number of neighbours is unknown yet.
    pub fn potentials(flow: &Flow) -> Vec<Potentials> {
        Potentials::of(flow, FULL)
    }

    /// The measures of all frames; those of calm liquid without any.
    pub fn finish(mut self) -> Survey {
        let (radius, gravity) = (self.radius, gravity(std::mem::take(&mut self.falls)));
        let frames = &self.frames;
        let mean = |of: &dyn Fn(&Frame) -> f32| {
            frames.iter().map(of).sum::<f32>() / frames.len().max(1) as f32
        };
        let full = mean(&|frame| frame.quantile(0.9, |own| own.neighbours as f32));
        let full = if frames.is_empty() { FULL } else { full.clamp(FULL_RANGE[0], FULL_RANGE[1]) };
        let square = 2.0 * gravity * radius;
        let high = |of: fn(&Potentials) -> f32| mean(&|frame| frame.quantile(HIGH, of));
        let thresholds = |high: f32, least: f32| {
            let low = least.max(LOW * high);
            [low, high.max(4.0 * low)]
        };
        let head = thresholds(high(|own| own.square) / square, LEAST_HEAD);
        // Those of the surveyor count neighbours as if the liquid were full of `FULL`.
        let scale = FULL / full;
        let air = thresholds(scale * high(|own| own.air) / square.sqrt(), LEAST_AIR);
        let crest = thresholds(scale * high(|own| own.crest), LEAST_CREST);
        let life = (2.0 * radius * head[1] / gravity).sqrt();
        let corner = DVec3::splat(radius.into());
        let bounds =
            self.bounds.map_or([DVec3::ZERO; 2], |[min, max]| [min - corner, max + corner]);
        let rate = RATE * (gravity / radius).sqrt();
        let survey =
            Survey { radius, gravity, full, head, air, crest, life, rate, population: 0.0, bounds };
        let scaled = |own: &Potentials| Potentials {
            air: scale * own.air,
            crest: scale * own.crest,
            ..*own
        };
        let potential = |own: &Potentials| f64::from(survey.potential(&scaled(own)));
        let of_frame = |frame: &Frame| frame.each * frame.some.iter().map(potential).sum::<f64>();
        let count = frames.len().max(1) as f64;
        let sum = frames.iter().map(of_frame).sum::<f64>() / count;
        let particles = frames.iter().map(|frame| frame.each * frame.some.len() as f64);
        let most = SHARE * particles.sum::<f64>() / count;
        let wanted = f64::from(rate) * sum * MEAN_LIFE * f64::from(life);
        let population = wanted.min(most);
        let rate = if wanted > most { rate * (most / wanted) as f32 } else { rate };
        Survey { rate, population, ..survey }
    }
}
