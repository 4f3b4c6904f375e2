//! Ground truth on the CPU: light followed exactly, in f64, by code that shares nothing with the
//! shaders.
//!
//! A [`Liquid`] is a closed body that tells where a ray crosses its surface: [`mesh::Mesh`] from
//! particles, or the exact forms of [`analytic`]. [`trace::trace`] follows both branches at every
//! interface and gives the picture; [`trace::first_last`] gives the two surfaces that a camera
//! could see at best, its perfect layers. [`caustics`] follows light the other way, from the lights
//! through the liquid to the solids.
//!
//! All in world space, metres, f64, linear RGB radiance; directions are unit vectors.

use glam::DVec3;

pub mod analytic;
pub mod caustics;
pub mod conic;
pub mod layers;
pub mod mesh;
pub mod optics;
pub mod surroundings;
pub mod trace;
mod wetting;

/// A half line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it starts, m.
    pub origin: DVec3,
    /// Where it goes, a unit vector.
    pub direction: DVec3,
}

impl Ray {
    /// The point at distance `t`, m.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }
}

/// A ray's passage through the surface of a liquid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Distance along the ray, m, not negative.
    pub t: f64,
    /// The surface's unit normal, out of the liquid.
    pub normal: DVec3,
    /// The unit normal that refracts: a mesh interpolates it, elsewhere it is `normal`.
    pub shading: DVec3,
}

/// A body of liquid.
///
/// Crossings are asked for with the side on which the ray starts, because a ray that starts on
/// the surface, as all but the first do, cannot be told its side by rounded coordinates.
pub trait Liquid: Sync {
    /// The first crossing ahead at which the ray leaves the liquid (`inside`) or enters it.
    fn crossing(&self, ray: &Ray, inside: bool) -> Option<Crossing>;

    /// Whether a point is in the liquid.
    fn contains(&self, point: DVec3) -> bool;
}

/// As f64, whatever a scene keeps it in.
fn wide(v: impl Into<DVec3>) -> DVec3 {
    v.into()
}
