//! Light at an interface and in a liquid, in f64.
//!
//! Formulas as in M. Born and E. Wolf, Principles of Optics, 7th edition (1999), section 1.5: the
//! laws of reflection and refraction, Fresnel's amplitudes by polarisation (eqs. 20 and 21), and
//! the reflectance of unpolarised light as the mean of the two.
//!
//! `d` is the direction of travel, `n` the unit normal towards the side from which light arrives
//! (d·n ≤ 0), `eta` the index of the far side over that of the near one, above or below 1.

use glam::DVec3;

/// What an interface makes of light that arrives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interface {
    /// The share that is reflected, 0 to 1.
    pub reflectance: f64,
    /// The direction of that share.
    pub reflected: DVec3,
    /// The direction of the rest; none where all is reflected.
    pub refracted: Option<DVec3>,
}

impl Interface {
    /// Light of direction `d` at a surface of normal `n`.
    pub fn new(d: DVec3, n: DVec3, eta: f64) -> Self {
        Self {
            reflectance: fresnel(-d.dot(n), eta),
            reflected: reflect(d, n),
            refracted: refract(d, n, eta),
        }
    }
}

/// The mirrored direction.
pub fn reflect(d: DVec3, n: DVec3) -> DVec3 {
    (d - 2.0 * d.dot(n) * n).normalize()
}

/// The direction beyond the surface by Snell's law; none for total reflection.
pub fn refract(d: DVec3, n: DVec3, eta: f64) -> Option<DVec3> {
    // The part of d along the surface shrinks by eta; the part across follows from unit length.
    let along = (d - d.dot(n) * n) / eta;
    let across2 = 1.0 - along.length_squared();
    (across2 >= 0.0).then(|| (along - across2.sqrt() * n).normalize())
}

/// The reflected share of unpolarised light that arrives with cosine `cos_i` (0 to 1); 1 for total
/// reflection.
pub fn fresnel(cos_i: f64, eta: f64) -> f64 {
    // No interface; at grazing incidence the ratios below were 0/0.
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

/// The share of light that is left after `length` metres at `absorption` per metre (Beer and
/// Lambert).
pub fn transmittance(absorption: DVec3, length: f64) -> DVec3 {
    (-length * absorption).exp()
}
