//! Ground truth on the CPU: light traced exactly, in f64, by code that shares nothing with the
//! shaders.
//!
//! A [`Liquid`] is a closed body with a ray intersection: [`mesh::Mesh`] from particles, or the
//! exact forms of [`analytic`]. [`trace::trace`] follows both branches at every interface and
//! renders the picture; [`trace::first_last`] gives the first and the last surface along each
//! camera ray, its perfect layers. [`caustics`] traces light from the lights through the liquid to
//! the solids.
//!
//! Everything is in world space, metres, f64, linear RGB radiance; directions are unit vectors.

use glam::{DVec2, DVec3, Vec3Swizzles as _};

pub mod analytic;
pub mod caustics;
pub mod conic;
mod image_plane;
pub mod layers;
pub mod mesh;
pub mod optics;
pub mod solids;
pub mod surroundings;
pub mod trace;
pub mod turbid;
mod wetting;

/// A ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// The origin, m.
    pub origin: DVec3,
    /// The direction, a unit vector.
    pub direction: DVec3,
}

impl Ray {
    /// The point at distance `t`, m.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }
}

/// An intersection of a ray with the surface of a liquid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Distance along the ray, m, at least 0.
    pub t: f64,
    /// The geometric unit normal, out of the liquid.
    pub normal: DVec3,
    /// The shading normal, a unit vector: interpolated on a mesh, otherwise equal to `normal`.
    pub shading: DVec3,
}

/// A body of liquid.
///
/// The side on which a ray starts is passed in, because most rays start on the surface, where
/// rounded coordinates cannot determine it.
pub trait Liquid: Sync {
    /// Finds the first crossing ahead at which the ray leaves the liquid (`inside`) or enters it.
    fn crossing(&self, ray: &Ray, inside: bool) -> Option<Crossing>;

    /// Whether a point is inside the liquid.
    fn contains(&self, point: DVec3) -> bool;
}

/// Converts a vector of a scene to f64.
fn wide(v: impl Into<DVec3>) -> DVec3 {
    v.into()
}

/// Projects onto the coordinate plane nearest to a plane: x and z if it is horizontal.
fn in_plane(normal: DVec3, x: DVec3) -> DVec2 {
    let a = normal.abs();
    if a.y >= a.x.max(a.z) {
        x.xz()
    } else if a.x >= a.z {
        x.zy()
    } else {
        x.xy()
    }
}
