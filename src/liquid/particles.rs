//! One frame of particles.

use glam::{DVec3, Vec3};

use super::bulk::{Bulk, bounds, bulk, holds};
use super::ellipsoid::Ellipsoid;
use crate::up_axis::Up;

/// One frame of particles as a structure of arrays: every attribute that is present has one entry
/// per particle, and every number but those of [`Particles::values`] is finite.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Particles {
    /// Origin of the positions in world space, in metres: 0 where 32-bit floats are precise enough;
    /// otherwise see [`Particles::from_places`].
    pub origin: DVec3,
    /// Centres relative to the origin, in metres.
    pub positions: Vec<Vec3>,
    /// Velocities, in metres per second.
    pub velocities: Option<Vec<Vec3>>,
    /// Mass densities, in kg/m³.
    pub densities: Option<Vec<f32>>,
    /// Particle radii, in metres (`pscale`, `radius`), none negative.
    pub radii: Option<Vec<f32>>,
    /// Ids that persist between frames.
    pub ids: Option<Vec<i64>>,
    /// Index of each particle's fluid in the scene; `None` for a single fluid.
    pub fluids: Option<Vec<u8>>,
    /// Shapes from the file, in units of each particle's radius.
    pub ellipsoids: Option<Vec<Ellipsoid>>,
    /// Values of a further attribute, for pictures that show it in colours: a scalar, or the length of a vector. NaN for
    /// particles without one.
    pub values: Option<Vec<f32>>,
    /// Colours, linear RGB.
    pub colors: Option<Vec<Vec3>>,
    /// Whether the particles fill only a hull of the liquid, as those of the recipe `pool`: the space that they
    /// enclose is liquid too.
    pub is_hull: bool,
}

impl Particles {
    /// Creates particles without other attributes, with the origin at 0.
    pub fn from_positions(positions: Vec<Vec3>) -> Self {
        Self { positions, ..Self::default() }
    }

    /// Creates particles without other attributes from world positions. The origin is 0, or the centre
    /// of the [bulk] if that is farther from 0 than 16 times its longest side, where 32-bit
    /// floats would lose precision. Positions that are not finite do not count for it.
    pub fn from_places(places: &[DVec3]) -> Self {
        let finite: Vec<DVec3>;
        let placed = match places.iter().all(|place| place.is_finite()) {
            true => places,
            false => {
                finite = places.iter().copied().filter(|place| place.is_finite()).collect();
                &finite
            }
        };
        let origin = origin_for(placed.len(), |i| placed[i]);
        let positions = places.iter().map(|&place| (place - origin).as_vec3()).collect();
        Self { origin, positions, ..Self::default() }
    }

    /// The number of particles.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are no particles, as in the first frames of many emitters.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Minimum and maximum corner of the bounding box of all centres; `None` without particles.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let places = self.positions.iter().map(|&position| self.origin + position.as_dvec3());
        bounds(places)
    }

    /// Bounding box of the bulk of the particles: [`bulk()`](super::bulk::bulk).
    pub fn bulk(&self) -> Option<Bulk> {
        self.bulk_beside(None)
    }

    /// As [`Particles::bulk`], where particles in a box, m, are known to be at rest, as other frames show.
    pub fn bulk_beside(&self, parked: Option<(DVec3, DVec3)>) -> Option<Bulk> {
        let velocities = self.velocities.as_deref();
        let is_at_rest = |i: usize| {
            velocities.is_some_and(|all| all[i] == Vec3::ZERO)
                || parked.is_some_and(|parked| holds(parked, self.place(i)))
        };
        bulk(self.len(), |i| self.place(i), is_at_rest)
    }

    /// Rotates positions, velocities and ellipsoids of a file with this `up` axis to y up: a quarter
    /// turn about x, which preserves handedness.
    pub fn to_y_up(&mut self, up: Up) {
        if up == Up::Z {
            self.origin = up.to_y_up(self.origin);
            for v in self.positions.iter_mut().chain(self.velocities.iter_mut().flatten()) {
                *v = Vec3::new(v.x, v.z, -v.y);
            }
            for ellipsoid in self.ellipsoids.iter_mut().flatten() {
                *ellipsoid = ellipsoid.turned_y_up();
            }
        }
    }

    /// Multiplies all lengths by `factor`: positions, velocities and radii, and densities by its inverse
    /// cube. For files in units other than metres.
    pub fn scale(&mut self, factor: f64) {
        if factor == 1.0 {
            return;
        }
        self.origin *= factor;
        let narrow = factor as f32;
        for v in self.positions.iter_mut().chain(self.velocities.iter_mut().flatten()) {
            *v *= narrow;
        }
        for radius in self.radii.iter_mut().flatten() {
            *radius *= narrow;
        }
    }

    /// Keeps the particles whose numbers satisfy `keep`, in their order, and the origin.
    pub fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        fn filter<T>(values: &mut Vec<T>, keep: &impl Fn(usize) -> bool) {
            let mut i = 0..;
            values.retain(|_| i.next().is_some_and(keep));
        }
        let Self {
            origin: _,
            positions,
            velocities,
            densities,
            radii,
            ids,
            fluids,
            ellipsoids,
            values,
            colors,
            is_hull: _,
        } = self;
        filter(positions, &keep);
        velocities.iter_mut().for_each(|values| filter(values, &keep));
        densities.iter_mut().for_each(|values| filter(values, &keep));
        radii.iter_mut().for_each(|values| filter(values, &keep));
        ids.iter_mut().for_each(|values| filter(values, &keep));
        fluids.iter_mut().for_each(|values| filter(values, &keep));
        ellipsoids.iter_mut().for_each(|values| filter(values, &keep));
        values.iter_mut().for_each(|values| filter(values, &keep));
        colors.iter_mut().for_each(|values| filter(values, &keep));
    }

    /// World position of particle `i`, m, rounded to 32-bit floats. Unlike the sum it preserves −0.
    pub fn single_place(&self, i: usize) -> Vec3 {
        if self.narrow() { self.positions[i] } else { self.place(i).as_vec3() }
    }

    /// World position of particle `i`, m.
    pub fn place(&self, i: usize) -> DVec3 {
        self.origin + self.positions[i].as_dvec3()
    }

    /// Whether 32-bit floats represent the world positions exactly.
    pub fn narrow(&self) -> bool {
        self.origin == DVec3::ZERO
    }
}

/// Whether a radius is positive and its cube is a normal 32-bit float.
#[doc(hidden)]
pub fn drawable(radius: f32) -> bool {
    radius > 0.0 && radius.powi(3).is_normal()
}

/// Chooses an origin from which 32-bit floats represent all positions of the bulk precisely enough: 0 if possible,
/// so that the positions of ordinary files stay unchanged.
#[doc(hidden)]
pub fn origin_for(count: usize, place: impl Fn(usize) -> DVec3 + Sync) -> DVec3 {
    bulk(count, place, |_| false).map_or(DVec3::ZERO, |bulk| origin_for_box(bulk.bounds))
}

/// As [`origin_for`], of all positions, whose bounding box this is.
pub(super) fn origin_for_box((min, max): (DVec3, DVec3)) -> DVec3 {
    /// Distance from 0 in bounding-box sizes at which 32-bit floats still resolve 1e-6 of the size.
    const FAR: f64 = 16.0;
    let middle = 0.5 * (min + max);
    let far = middle.abs().max_element() > FAR * (max - min).max_element();
    if far { middle } else { DVec3::ZERO }
}
