//! Liquid in a vase: a body of revolution with circular ripples on its surface.

use std::f64::consts::TAU;
use std::ops::RangeInclusive;

use glam::{DVec3, Vec3Swizzles as _};
use serde::{Deserialize, Serialize};

use super::body::Body;

/// The liquid in a round vase, whose thin wall is omitted. It focuses light that enters through the
/// surface and the sides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Vase {
    /// Centre of the flat base, m.
    pub base: DVec3,
    /// Height of the liquid's level at rest above the base, m: 0.001 to 1000.
    pub height: f64,
    /// Radii of the foot, of the belly, and of the neck at the level, m: 0.001 to 1000. The belly is the
    /// widest.
    pub radii: [f64; 3],
    /// Amplitude of the ripples at the centre of the surface, m: 0 to a tenth of `height`.
    pub ripple: f64,
    /// Wavelength of the ripples, m: at least 10 times `ripple`.
    pub wavelength: f64,
    /// Number of particles.
    pub count: f64,
    /// Seed of their arrangement.
    #[serde(default)]
    pub seed: u32,
}

/// Height of the belly, as a fraction of the height.
const BELLY: f64 = 0.4;

impl Vase {
    pub(super) fn ranges(
        &self,
        size: RangeInclusive<f64>,
    ) -> Vec<(&'static str, f64, RangeInclusive<f64>)> {
        let [foot, belly, neck] = self.radii;
        let least = *size.start();
        vec![
            ("height", self.height, size.clone()),
            ("radii", belly, size.clone()),
            ("radii", foot, least..=belly),
            ("radii", neck, least..=belly),
            ("ripple", self.ripple, 0.0..=0.1 * self.height),
            ("wavelength", self.wavelength, least.max(10.0 * self.ripple)..=*size.end()),
        ]
    }

    /// Radius at height `y` above the base, and its derivative: a smoothstep from the foot to the belly
    /// and another to the neck, vertical at all three.
    fn profile(&self, y: f64) -> (f64, f64) {
        let [foot, belly, neck] = self.radii;
        let t = y / self.height;
        let (from, to, radii) =
            if t < BELLY { (0.0, BELLY, [foot, belly]) } else { (BELLY, 1.0, [belly, neck]) };
        let u = ((t - from) / (to - from)).clamp(0.0, 1.0);
        let spread = radii[1] - radii[0];
        let radius = radii[0] + spread * u * u * (3.0 - 2.0 * u);
        (radius, 6.0 * spread * u * (1.0 - u) / ((to - from) * self.height))
    }

    /// Height of the surface above the level, and its slope: circular ripples, approximately a Bessel
    /// function J₀.
    fn rings(&self, radius: f64) -> (f64, f64) {
        let k = TAU / self.wavelength;
        let x = k * radius;
        let fading = (1.0 + x * x).powf(-0.25);
        let height = self.ripple * fading * x.cos();
        let slope = -self.ripple * fading * k * (x.sin() + 0.5 * x * x.cos() / (1.0 + x * x));
        (height, slope)
    }

    pub(super) fn body(&self) -> Body {
        let vase = *self;
        let Self { base, height, radii: [_, belly, _], ripple, .. } = vase;
        let min = base - DVec3::new(belly, 0.0, belly);
        let max = base + DVec3::new(belly, height + ripple, belly);
        Body::new(min, max, move |x| {
            let x = x - base;
            let from_axis = x.xz().length();
            let (radius, flare) = vase.profile(x.y);
            let (rings, slope) = vase.rings(from_axis);
            let beside = (from_axis - radius) / 1f64.hypot(flare);
            let above = (x.y - height - rings) / 1f64.hypot(slope);
            beside.max(above).max(-x.y)
        })
    }
}
