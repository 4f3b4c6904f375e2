//! Numerical reference for uniform sky light below level liquid.

use glam::DVec3;
use limpid_lab::reference::optics::{fresnel, transmittance};

/// Share of uniform sky light that reaches a level patch `depth` metres below the surface of liquid of
/// index `ior`: the transmitted and not absorbed light, averaged over the squared sine of the sky angle.
pub(crate) fn even_light(ior: f64, absorption: DVec3, depth: f64) -> DVec3 {
    const STEPS: u32 = 4000;
    let step = |i: u32| {
        // Integrates over the cosine c in air: the measure is 2 c dc.
        let c = (f64::from(i) + 0.5) / f64::from(STEPS);
        let cos = (1.0 - (1.0 - c * c) / (ior * ior)).sqrt();
        let in_liquid = transmittance(absorption, depth / cos);
        2.0 * c / f64::from(STEPS) * (1.0 - fresnel(c, ior)) * in_liquid
    };
    (0..STEPS).map(step).sum()
}
