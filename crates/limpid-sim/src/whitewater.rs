//! Whitewater: foam, spray, bubbles and dust that a liquid makes, after Ihmsen, Akinci, Akinci and Teschner 2012,
//! "Unified spray, foam and air bubbles for particle-based fluids".
//!
//! Liquid that traps air or breaks at a crest, and is fast, emits particles. They are told apart by their neighbours in the
//! liquid: few are spray, which flies; some are foam, which floats with the surface; many are bubbles, which rise.
//!
//! All lengths are measured by the radius r of the liquid's particles, all accelerations by gravity g, and so speeds by
//! their head v² / 2 g r, in radii. A sequence therefore makes the same whitewater in any unit of length, if its times go
//! with it (Froude 1872). The thresholds of the potentials follow the sequence's own [`Survey`], but never fall below heads
//! of a few radii: calm liquid makes none.
//!
//! Results depend on the frames and the seed alone: they have the same bits on any number of threads.

mod emission;
mod estimate;
mod flow;
mod motion;
mod potentials;
mod survey;

use glam::{DVec3, Vec3};
use limpid::diffuse::{Diffuse, DiffuseKind};
use limpid::scene::Solid;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::sim::colliders::Colliders;

pub use self::estimate::{duration, falls, velocities};
pub use self::flow::Flow;
pub use self::potentials::Potentials;
pub use self::survey::{Survey, Surveyor};

/// Support of all sums over neighbours, in radii: 33.5 of them where the liquid's particles fill cubes of two radii.
pub(crate) const SUPPORT: f32 = 4.0;

/// The choices of a user.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choices {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Factor of the number of particles: 0 to 1000.
    pub amount: f32,
    /// Whether fast liquid raises dust from the ground.
    pub dust: bool,
}

impl Default for Choices {
    fn default() -> Self {
        Self { seed: 1, amount: 1.0, dust: false }
    }
}

/// A generator of whitewater, and what it knows of the sequence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Whitewater {
    /// The user's choices.
    pub choices: Choices,
    /// The measures of the sequence.
    pub survey: Survey,
}

/// The passage from one frame of liquid to the next.
#[derive(Debug, Clone, Copy)]
pub struct Passage<'a> {
    /// The liquid at its begin.
    pub before: &'a Flow,
    /// The liquid at its end.
    pub after: &'a Flow,
    /// Its length, s.
    pub seconds: f32,
    /// The solids at its end.
    pub solids: &'a [Solid],
    /// The number of the frame at its end, for random numbers.
    pub number: i64,
}

/// A diffuse particle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Particle {
    /// Its place, m, from the origin of the flow after.
    pub(crate) position: Vec3,
    pub(crate) velocity: Vec3,
    pub(crate) radius: f32,
    pub(crate) kind: DiffuseKind,
    pub(crate) age: f32,
    /// Seconds left.
    pub(crate) left: f32,
}

impl Whitewater {
    /// Upper bound on the memory of a step for each diffuse particle that may be there, bytes.
    pub const BYTES_PER_PARTICLE: usize = 2 * size_of::<Particle>() + 64;

    /// Moves the particles of `state` over a passage, and emits those of its end. The colours stay.
    pub fn step(&self, passage: &Passage<'_>, state: &Diffuse) -> Diffuse {
        let Passage { after, solids, .. } = *passage;
        let walls = Walls {
            colliders: (!solids.is_empty())
                .then(|| Colliders::new(solids, None, 0.1 * after.radius())),
            origin: after.origin(),
            bounds: self.survey.bounds.map(|corner| (corner - after.origin()).as_vec3()),
        };
        let shift = (state.origin - after.origin()).as_vec3();
        let of = |all: &Option<Vec<f32>>, i: usize, missing: f32| {
            all.as_ref().map_or(missing, |all| all[i])
        };
        let particle = |i: usize| Particle {
            position: state.positions[i] + shift,
            velocity: state.velocities.as_ref().map_or(Vec3::ZERO, |all| all[i]),
            radius: state.radii[i],
            kind: state.kinds[i],
            age: of(&state.ages, i, 0.0),
            left: of(&state.lifetimes, i, self.survey.life),
        };
        let moved = (0..state.len()).into_par_iter().map(particle);
        let moved = moved.filter_map(|own| motion::moved(own, passage, &self.survey, &walls));
        let mut all: Vec<Particle> = moved.collect();
        let room = self.most().saturating_sub(all.len());
        emission::emit(self, passage, &walls, room, &mut all);
        let mut next =
            Diffuse { origin: after.origin(), colors: state.colors, ..Diffuse::default() };
        next.positions = all.iter().map(|own| own.position).collect();
        next.velocities = Some(all.iter().map(|own| own.velocity).collect());
        next.radii = all.iter().map(|own| own.radius).collect();
        next.kinds = all.iter().map(|own| own.kind).collect();
        next.ages = Some(all.iter().map(|own| own.age).collect());
        next.lifetimes = Some(all.iter().map(|own| own.left).collect());
        next
    }

    /// Largest number of particles at a time, which bounds memory.
    pub fn most(&self) -> usize {
        const MOST: f64 = 5e7;
        /// Above the expected number, which is on average.
        const PEAK: f64 = 3.0;
        let expected = self.survey.expected(self.choices.amount);
        (PEAK * expected).clamp(1000.0, MOST) as usize
    }
}

/// Obstacles of particles: solids, and the extent of the liquid in the whole sequence.
pub(crate) struct Walls {
    colliders: Option<Colliders>,
    origin: DVec3,
    bounds: [Vec3; 2],
}

/// The end of a path.
pub(crate) struct Reached {
    pub(crate) position: Vec3,
    /// Unit normal of an obstacle that it met, or 0.
    pub(crate) normal: Vec3,
    /// Whether it lies below the sequence.
    pub(crate) below: bool,
}

impl Walls {
    /// Follows a path from one place to another, which stays outside of solids and between the sides of the sequence.
    pub(crate) fn follow(&self, from: Vec3, to: Vec3) -> Reached {
        let origin = self.origin.as_vec3();
        let free = match &self.colliders {
            Some(colliders) => colliders.sweep(from + origin, to + origin) - origin,
            None => to,
        };
        let [min, max] = self.bounds;
        let inside = Vec3::new(free.x.clamp(min.x, max.x), free.y, free.z.clamp(min.z, max.z));
        // Closer than rounding is no contact.
        let normal = (inside - to).normalize_or_zero();
        let touched = inside.distance(to) > 1e-4 * (to - from).length();
        let normal = if touched { normal } else { Vec3::ZERO };
        Reached { position: inside, normal, below: inside.y < min.y }
    }

    /// Whether a place is outside of solids.
    pub(crate) fn is_free(&self, place: Vec3) -> bool {
        let world = place + self.origin.as_vec3();
        self.colliders.as_ref().is_none_or(|colliders| colliders.place(world).is_some())
    }
}
