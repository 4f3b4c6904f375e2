//! Foam, spray, bubbles and dust, which move with a liquid and are drawn beside it.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::up_axis::Up;

/// Parts of a life in which a particle appears and disappears.
const FADES: [f32; 2] = [0.1, 0.3];

/// The same in seconds, for particles whose whole life is unknown.
const FADE_SECONDS: [f32; 2] = [0.1, 0.5];

/// Foam, spray, bubbles and dust of one frame: the *diffuse* particles of Ihmsen et al. 2012, "Unified spray, foam and
/// air bubbles for particle-based fluids". A structure of arrays: every attribute that is present has one entry per
/// particle, and every number is finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Diffuse {
    /// Origin of the positions in world space, m; as [`Particles::origin`](crate::liquid::Particles::origin).
    pub origin: DVec3,
    /// Centres relative to the origin, m.
    pub positions: Vec<Vec3>,
    /// Velocities, m/s.
    pub velocities: Option<Vec<Vec3>>,
    /// Radii, m, positive.
    pub radii: Vec<f32>,
    /// Kinds.
    pub kinds: Vec<DiffuseKind>,
    /// Seconds since each appeared, not negative.
    pub ages: Option<Vec<f32>>,
    /// Seconds left until each disappears, not negative: the `lifetime` of `SPlisHSPlasH`'s `FoamGenerator`. The whole life of
    /// a particle is its age and its lifetime together.
    pub lifetimes: Option<Vec<f32>>,
    /// Albedo of each kind, linear RGB, by its number.
    pub colors: [Vec3; DiffuseKind::ALL.len()],
}

/// A kind of diffuse particle. The numbers are those that files of limpid hold.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "lowercase")]
#[repr(u8)]
pub enum DiffuseKind {
    /// Floats on the surface.
    #[default]
    Foam = 0,
    /// Flies through the air.
    Spray = 1,
    /// Rises within the liquid.
    #[serde(rename = "bubbles", alias = "bubble")]
    Bubble = 2,
    /// Floats within turbid liquid, near the ground.
    Dust = 3,
}

impl DiffuseKind {
    /// All kinds, by their numbers.
    pub const ALL: [Self; 4] = [Self::Foam, Self::Spray, Self::Bubble, Self::Dust];

    /// Its name in scenes, options and messages.
    pub fn name(self) -> &'static str {
        ["foam", "spray", "bubbles", "dust"][self as usize]
    }
}

impl Default for Diffuse {
    /// No particles, and the colours of clean water: white, and brown dust.
    fn default() -> Self {
        const WHITE: Vec3 = Vec3::splat(0.92);
        const BROWN: Vec3 = Vec3::new(0.36, 0.25, 0.14);
        Self {
            origin: DVec3::ZERO,
            positions: Vec::new(),
            velocities: None,
            radii: Vec::new(),
            kinds: Vec::new(),
            ages: None,
            lifetimes: None,
            colors: [WHITE, WHITE, WHITE, BROWN],
        }
    }
}

impl Diffuse {
    /// Creates foam of one radius, m, without other attributes, with the origin at 0.
    pub fn from_positions(positions: Vec<Vec3>, radius: f32) -> Self {
        let (radii, kinds) =
            (vec![radius; positions.len()], vec![DiffuseKind::Foam; positions.len()]);
        Self { positions, radii, kinds, ..Self::default() }
    }

    /// The number of particles.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are no particles.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The number of particles of each kind.
    pub fn counts(&self) -> [usize; DiffuseKind::ALL.len()] {
        DiffuseKind::ALL.map(|kind| self.kinds.iter().filter(|&&own| own == kind).count())
    }

    /// Keeps the particles whose numbers satisfy `keep`, in their order.
    pub fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        fn filter<T>(values: &mut Vec<T>, keep: &impl Fn(usize) -> bool) {
            let mut i = 0..;
            values.retain(|_| i.next().is_some_and(keep));
        }
        filter(&mut self.positions, &keep);
        filter(&mut self.radii, &keep);
        filter(&mut self.kinds, &keep);
        self.velocities.iter_mut().for_each(|all| filter(all, &keep));
        self.ages.iter_mut().for_each(|all| filter(all, &keep));
        self.lifetimes.iter_mut().for_each(|all| filter(all, &keep));
    }

    /// Appends particles, whose colours are not taken over. Where one side lacks an attribute that the other has, its
    /// particles stand still, and are in the middle of a long life.
    pub fn append(&mut self, other: &Self) {
        const LONG: f32 = 1e6;
        fn joined<T: Copy>(
            own: &mut Option<Vec<T>>,
            count: usize,
            other: Option<&[T]>,
            others: usize,
            missing: T,
        ) {
            if own.is_none() && other.is_none() {
                return;
            }
            let own = own.get_or_insert_with(|| vec![missing; count]);
            match other {
                Some(other) => own.extend_from_slice(other),
                None => own.resize(count + others, missing),
            }
        }
        let (count, others) = (self.len(), other.len());
        let apart = (other.origin - self.origin).as_vec3();
        self.positions.extend(other.positions.iter().map(|&position| apart + position));
        self.radii.extend_from_slice(&other.radii);
        self.kinds.extend_from_slice(&other.kinds);
        joined(&mut self.velocities, count, other.velocities.as_deref(), others, Vec3::ZERO);
        joined(&mut self.ages, count, other.ages.as_deref(), others, LONG);
        joined(&mut self.lifetimes, count, other.lifetimes.as_deref(), others, LONG);
    }

    /// The particles `seconds` later: each moves on in its direction, and those that disappear meanwhile are left out.
    #[must_use]
    pub fn after(mut self, seconds: f32) -> Self {
        if let Some(velocities) = &self.velocities {
            let moved = self.positions.iter_mut().zip(velocities);
            moved.for_each(|(position, velocity)| *position += seconds * *velocity);
        }
        self.ages.iter_mut().flatten().for_each(|age| *age += seconds);
        if let Some(lifetimes) = &mut self.lifetimes {
            lifetimes.iter_mut().for_each(|left| *left -= seconds);
            let left = lifetimes.clone();
            self.retain(|i| left[i] > 0.0);
        }
        self
    }

    /// Opacity of a particle, from 0 to 1: it appears in the first tenth of its life and disappears in the last 0.3, so
    /// that none pops. Without ages it disappears in its last half second, without lifetimes it appears in its first tenth
    /// of a second, and without both it is 1.
    pub fn opacity(&self, particle: usize) -> f32 {
        let value = |of: &Option<Vec<f32>>| of.as_ref().map(|all| all[particle]);
        let (age, left) = (value(&self.ages), value(&self.lifetimes));
        let [appears, disappears] = match age.zip(left) {
            Some((age, left)) => FADES.map(|part| part * (age + left)),
            None => FADE_SECONDS,
        };
        let ramp = |time: Option<f32>, length: f32| match time {
            // A particle without a life is not there.
            Some(time) => (time / length.max(f32::MIN_POSITIVE)).clamp(0.0, 1.0),
            None => 1.0,
        };
        let smooth = |x: f32| x * x * (3.0 - 2.0 * x);
        smooth(ramp(age, appears)) * smooth(ramp(left, disappears))
    }

    /// Rotates positions and velocities of a file with this `up` axis to y up: as
    /// [`Particles::to_y_up`](crate::liquid::Particles::to_y_up).
    pub fn to_y_up(&mut self, up: Up) {
        if up == Up::Z {
            self.origin = up.to_y_up(self.origin);
            for v in self.positions.iter_mut().chain(self.velocities.iter_mut().flatten()) {
                *v = Vec3::new(v.x, v.z, -v.y);
            }
        }
    }

    /// Multiplies all lengths by `factor`: positions, velocities and radii.
    pub fn scale(&mut self, factor: f64) {
        if factor == 1.0 {
            return;
        }
        self.origin *= factor;
        let narrow = factor as f32;
        for v in self.positions.iter_mut().chain(self.velocities.iter_mut().flatten()) {
            *v *= narrow;
        }
        self.radii.iter_mut().for_each(|radius| *radius *= narrow);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opacities(ages: Option<Vec<f32>>, lifetimes: Option<Vec<f32>>) -> Vec<f32> {
        let foam = Diffuse::from_positions(vec![Vec3::ZERO; 3], 0.01);
        let foam = Diffuse { ages, lifetimes, ..foam };
        (0..3).map(|i| foam.opacity(i)).collect()
    }

    /// A life of 10 s: at its ends nothing is seen, and halfway up a fade half.
    #[test]
    fn particles_fade_in_and_out() {
        let (born, dying) = (vec![0.0, 0.5, 5.0], vec![10.0, 9.5, 5.0]);
        assert_eq!(opacities(Some(born), Some(dying)), [0.0, 0.5, 1.0]);
        assert_eq!(
            opacities(Some(vec![10.0, 8.5, 7.0]), Some(vec![0.0, 1.5, 3.0])),
            [0.0, 0.5, 1.0]
        );
        assert_eq!(opacities(Some(vec![0.0, 0.05, 9.0]), None), [0.0, 0.5, 1.0]);
        assert_eq!(opacities(None, Some(vec![0.0, 0.25, 9.0])), [0.0, 0.5, 1.0]);
        assert_eq!(opacities(None, None), [1.0; 3]);
        assert_eq!(opacities(Some(vec![0.0; 3]), Some(vec![0.0; 3])), [0.0; 3]);
    }

    /// The numbers are those of the files.
    #[test]
    fn kinds_are_numbered() {
        assert_eq!(DiffuseKind::ALL.map(|kind| kind as u8), [0, 1, 2, 3]);
        let kinds = vec![DiffuseKind::Spray, DiffuseKind::Dust, DiffuseKind::Spray];
        let mixed = Diffuse { kinds, ..Diffuse::default() };
        assert_eq!(mixed.counts(), [0, 2, 0, 1]);
    }
}
