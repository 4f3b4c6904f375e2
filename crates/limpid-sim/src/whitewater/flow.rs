//! One frame of liquid, whose velocity and neighbours are known anywhere.

use glam::{DVec3, Vec3, Vec4, Vec4Swizzles as _};
use limpid::liquid::Particles;

use super::SUPPORT;
use crate::sim::grid::Grid;

/// One frame of liquid.
#[derive(Debug)]
pub struct Flow {
    origin: DVec3,
    radius: f32,
    grid: Grid,
    /// Positions, sorted by cell.
    points: Vec<Vec4>,
    /// Velocities, sorted alike.
    velocities: Vec<Vec3>,
    /// The number of each in the file.
    numbers: Vec<u32>,
}

/// The liquid around a place.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sample {
    /// Number of particles within the support.
    pub(crate) count: u32,
    /// Number of those that are more than a radius higher.
    pub(crate) above: u32,
    /// Mean velocity, weighted by nearness, m/s.
    pub(crate) velocity: Vec3,
}

/// The radially symmetric weight of Ihmsen et al. 2012, equation 3, by the distance in supports.
#[inline]
pub(crate) fn weight(t: f32) -> f32 {
    (1.0 - t).max(0.0)
}

/// Mean of [`weight`] in a ball.
pub(crate) const MEAN_WEIGHT: f32 = 0.25;

impl Flow {
    /// Sorts the particles of a frame with one velocity each, m/s. `radius` is that of the particles, m.
    ///
    /// # Panics
    /// If the numbers of particles and of velocities differ.
    pub fn new(particles: &Particles, velocities: &[Vec3], radius: f32) -> Self {
        assert_eq!(particles.len(), velocities.len(), "each particle has a velocity");
        let mut grid = Grid::default();
        let mut numbers = Vec::new();
        grid.sort(&particles.positions, SUPPORT * radius, &mut numbers);
        let point = |&i: &u32| particles.positions[i as usize].extend(0.0);
        Self {
            origin: particles.origin,
            radius,
            points: numbers.iter().map(point).collect(),
            velocities: numbers.iter().map(|&i| velocities[i as usize]).collect(),
            numbers,
            grid,
        }
    }

    /// Origin of all positions in world space, m.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Radius of the particles, m.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// The number of particles.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are no particles.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Reach of sums, m.
    pub(crate) fn support(&self) -> f32 {
        SUPPORT * self.radius
    }

    /// Place and velocity of the `i`-th particle in the sorted order.
    pub(crate) fn at(&self, i: usize) -> (Vec3, Vec3) {
        (self.points[i].xyz(), self.velocities[i])
    }

    /// The number in the file of the `i`-th particle in the sorted order.
    pub(crate) fn number(&self, i: usize) -> u32 {
        self.numbers[i]
    }

    /// Finds the sorted numbers of the particles within the support of `x`, other than `i`.
    pub(crate) fn near(&self, x: Vec3, i: usize, found: &mut Vec<u32>) {
        found.clear();
        if !self.is_empty() {
            self.grid.append(&self.points, i, x, self.support().powi(2), found);
        }
    }

    /// The liquid around a place.
    pub(crate) fn sample(&self, x: Vec3, near: &mut Vec<u32>) -> Sample {
        self.near(x, usize::MAX, near);
        let mut sample = Sample { count: near.len() as u32, ..Sample::default() };
        let mut sum = 0.0;
        for &j in near.iter() {
            let (at, velocity) = self.at(j as usize);
            let own = weight(at.distance(x) / self.support());
            sum += own;
            sample.velocity += own * velocity;
            sample.above += u32::from(at.y > x.y + self.radius);
        }
        sample.velocity /= sum.max(f32::MIN_POSITIVE);
        sample
    }
}
