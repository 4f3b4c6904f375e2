//! One frame of particles.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::bulk::{Bulk, bounds, bulk};
use super::ellipsoid::Ellipsoid;

/// One frame of particles, structure of arrays: every attribute that is present has one entry
/// per particle, and every number is finite.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Particles {
    /// The point that positions are counted from, in metres: 0 where 32-bit floats hold enough digits;
    /// otherwise see [`Particles::from_places`].
    pub origin: DVec3,
    /// Centres, in metres, from the origin.
    pub positions: Vec<Vec3>,
    /// Velocities, in metres per second.
    pub velocities: Option<Vec<Vec3>>,
    /// Mass densities, in kg/m³.
    pub densities: Option<Vec<f32>>,
    /// Particle radii, in metres (`pscale`, `radius`), none negative.
    pub radii: Option<Vec<f32>>,
    /// Identities that persist between frames.
    pub ids: Option<Vec<i64>>,
    /// Which of a scene's fluids each belongs to, from 0; of one fluid, none.
    pub fluids: Option<Vec<u8>>,
    /// Shapes that the file gives, in units of each particle's radius.
    pub ellipsoids: Option<Vec<Ellipsoid>>,
}

/// The axis that points up in a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    /// As in limpid, Houdini and most simulators.
    #[default]
    Y,
    /// As in Blender and CAD.
    Z,
}

impl Particles {
    /// Particles without other attributes, counted from 0.
    pub fn from_positions(positions: Vec<Vec3>) -> Self {
        Self { positions, ..Self::default() }
    }

    /// Particles without other attributes. They are counted from 0, or where 32-bit floats would
    /// lose digits by that from the middle of the box around them: where it is farther from 0 than
    /// 16 times its longest side.
    pub fn from_places(places: &[DVec3]) -> Self {
        let origin = origin_for(places.iter().copied());
        let positions = places.iter().map(|&place| (place - origin).as_vec3()).collect();
        Self { origin, positions, ..Self::default() }
    }

    /// The number of particles.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are none, as in the first frames of many emitters.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// The least and the greatest corner of the box around all centres, if there are any.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let places = self.positions.iter().map(|&position| self.origin + position.as_dvec3());
        bounds(places)
    }

    /// Where the bulk of the particles is: [`bulk()`](super::bulk::bulk).
    pub fn bulk(&self) -> Option<Bulk> {
        bulk(self.len(), |i| self.place(i))
    }

    /// Turns positions, velocities and ellipsoids of a file with this `up` axis to limpid's, which
    /// is y: a quarter turn about x, so handedness is kept.
    pub fn to_y_up(&mut self, up: Up) {
        if up == Up::Z {
            self.origin = DVec3::new(self.origin.x, self.origin.z, -self.origin.y);
            for v in self.positions.iter_mut().chain(self.velocities.iter_mut().flatten()) {
                *v = Vec3::new(v.x, v.z, -v.y);
            }
            for ellipsoid in self.ellipsoids.iter_mut().flatten() {
                *ellipsoid = ellipsoid.turned_y_up();
            }
        }
    }

    /// Where particle `i` is, m, as far as 32-bit floats can tell. Unlike the sum it keeps −0.
    pub fn single_place(&self, i: usize) -> Vec3 {
        if self.narrow() { self.positions[i] } else { self.place(i).as_vec3() }
    }

    /// Where particle `i` is, m.
    pub fn place(&self, i: usize) -> DVec3 {
        self.origin + self.positions[i].as_dvec3()
    }

    /// Whether 32-bit floats hold the places, bit by bit.
    pub fn narrow(&self) -> bool {
        self.origin == DVec3::ZERO
    }
}

/// Whether a particle of this radius has a volume that a 32-bit float can hold.
#[doc(hidden)]
pub fn drawable(radius: f32) -> bool {
    radius > 0.0 && radius.powi(3).is_normal()
}

/// The point from which 32-bit floats keep enough digits of all places: 0 if it does, so that
/// ordinary files stay as they are.
#[doc(hidden)]
pub fn origin_for(places: impl Iterator<Item = DVec3>) -> DVec3 {
    /// So many sizes from 0, floats resolve 1e-6 of the size.
    const FAR: f64 = 16.0;
    let Some((min, max)) = bounds(places) else { return DVec3::ZERO };
    let middle = 0.5 * (min + max);
    let far = middle.abs().max_element() > FAR * (max - min).max_element();
    if far { middle } else { DVec3::ZERO }
}
