//! Optics of interfaces and absorption, in f64.
//!
//! Formulas after M. Born and E. Wolf, Principles of Optics, 7th edition (1999), section 1.5: the
//! laws of reflection and refraction, Fresnel's amplitudes by polarisation (eqs. 20 and 21), and
//! the reflectance of unpolarised light as the mean of the two.
//!
//! `d` is the direction of propagation, `n` the unit normal towards the side of incidence (d·n ≤
//! 0), `eta` the index of the far side over that of the near one, above or below 1.

use glam::DVec3;

use super::{Crossing, Ray};

/// Reflection and refraction of light at an interface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interface {
    /// The reflectance, 0 to 1.
    pub reflectance: f64,
    /// The reflected direction.
    pub reflected: DVec3,
    /// The refracted direction; `None` for total reflection.
    pub refracted: Option<DVec3>,
}

impl Interface {
    /// Computes the interaction of light of direction `d` with a surface of normal `n`.
    pub fn new(d: DVec3, n: DVec3, eta: f64) -> Self {
        Self {
            reflectance: fresnel(-d.dot(n), eta),
            reflected: reflect(d, n),
            refracted: refract(d, n, eta),
        }
    }
}

/// Reflects a direction.
pub fn reflect(d: DVec3, n: DVec3) -> DVec3 {
    (d - 2.0 * d.dot(n) * n).normalize()
}

/// Refracts a direction by Snell's law; `None` for total reflection.
pub fn refract(d: DVec3, n: DVec3, eta: f64) -> Option<DVec3> {
    // The tangential part of d scales by 1/eta; the normal part follows from unit length.
    let along = (d - d.dot(n) * n) / eta;
    let across2 = 1.0 - along.length_squared();
    (across2 >= 0.0).then(|| (along - across2.sqrt() * n).normalize())
}

/// Fresnel reflectance of unpolarised light at cosine of incidence `cos_i` (0 to 1); 1 for total
/// reflection.
pub fn fresnel(cos_i: f64, eta: f64) -> f64 {
    // No interface; at grazing incidence the ratios below would be 0/0.
    if eta == 1.0 {
        return 0.0;
    }
    let cos_i = cos_i.clamp(0.0, 1.0);
    let sin_t2 = (1.0 - cos_i * cos_i) / (eta * eta);
    if sin_t2 >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin_t2).sqrt();
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    0.5 * (perpendicular * perpendicular + parallel * parallel)
}

/// Transmittance of `length` metres at `absorption` per metre (Beer and Lambert).
pub fn transmittance(absorption: DVec3, length: f64) -> DVec3 {
    (-length * absorption).exp()
}

/// Distance, m and relative, up to which a solid behind a surface counts as wet: coordinates of
/// scenes and meshes that should be equal may be rounded to 32 bits.
pub(super) const TOUCH: f64 = 1e-6;

/// Computes reflection and refraction with the shading normal, or with the geometric normal if the
/// former would send light through the wrong side of the triangle.
pub(super) fn interface(ray: &Ray, crossing: &Crossing, inside: bool, eta: f64) -> Interface {
    let facing = |n: DVec3| if inside { -n } else { n };
    let normal = facing(crossing.normal);
    let shading = facing(crossing.shading);
    let smooth = Interface::new(ray.direction, shading, eta);
    let consistent = ray.direction.dot(shading) < 0.0
        && smooth.reflected.dot(normal) > 0.0
        && smooth.refracted.is_none_or(|direction| direction.dot(normal) < 0.0);
    if consistent { smooth } else { Interface::new(ray.direction, normal, eta) }
}
