//! A seated figure: a thick body with many concavities and holes.

use glam::{DVec3, Vec3Swizzles as _};
use serde::{Deserialize, Serialize};

use super::body::{Body, join, limb};

/// A seated figure with four arms and a ring behind its head, facing +z.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Idol {
    /// Centre of the flat base, m.
    pub base: DVec3,
    /// Height above the base, m: 0.001 to 1000.
    pub height: f64,
    /// Number of particles.
    pub count: f64,
    /// Seed of their arrangement.
    #[serde(default)]
    pub seed: u32,
}

/// Ends and radii of the parts in the plane of symmetry, in units in which the figure is [`TOP`] high.
const MIDDLE: [([f64; 3], [f64; 3], [f64; 2]); 6] = [
    ([-0.07, 0.13, 0.00], [0.07, 0.13, 0.00], [0.13, 0.13]), // hips
    ([0.00, 0.22, 0.03], [0.00, 0.25, 0.03], [0.135, 0.125]), // belly
    ([0.00, 0.37, 0.00], [0.00, 0.45, 0.00], [0.115, 0.125]), // chest
    ([-0.14, 0.52, -0.01], [0.14, 0.52, -0.01], [0.07, 0.07]), // shoulders
    ([0.00, 0.52, 0.00], [0.00, 0.62, 0.01], [0.06, 0.055]), // neck
    ([0.00, 0.69, 0.02], [0.00, 0.76, 0.01], [0.08, 0.095]), // head
];

/// Ends and radii of the parts of the right side, which the left mirrors.
const SIDE: [([f64; 3], [f64; 3], [f64; 2]); 11] = [
    ([0.12, 0.11, 0.02], [0.36, 0.07, 0.15], [0.10, 0.075]), // thigh
    ([0.36, 0.07, 0.15], [0.05, 0.05, 0.29], [0.072, 0.05]), // shin
    ([0.05, 0.05, 0.29], [-0.05, 0.05, 0.30], [0.05, 0.04]), // foot
    ([0.19, 0.50, 0.00], [0.31, 0.33, 0.05], [0.06, 0.052]), // lower upper arm
    ([0.31, 0.33, 0.05], [0.13, 0.23, 0.21], [0.05, 0.042]), // lower forearm
    ([0.13, 0.23, 0.21], [0.02, 0.23, 0.23], [0.045, 0.04]), // lower hand
    ([0.18, 0.54, -0.03], [0.37, 0.60, -0.03], [0.055, 0.048]), // raised upper arm
    ([0.37, 0.60, -0.03], [0.31, 0.80, 0.00], [0.047, 0.038]), // raised forearm
    ([0.31, 0.80, 0.00], [0.30, 0.86, 0.00], [0.052, 0.03]), // raised hand
    ([0.095, 0.72, 0.01], [0.105, 0.64, 0.02], [0.025, 0.03]), // ear
    ([0.04, 0.685, 0.10], [0.02, 0.68, 0.11], [0.022, 0.022]), // cheek
];

/// Centre, radius and tube radius of the ring behind the head.
const RING: (DVec3, f64, f64) = (DVec3::new(0.0, 0.72, -0.06), 0.2, 0.032);

/// Top of the topknot, by which all lengths are divided.
const TOP: f64 = 0.955;

impl Idol {
    pub(super) fn body(&self) -> Body {
        let Self { base, height, .. } = *self;
        let scale = height / TOP;
        let (low, high) = (DVec3::new(-0.46, 0.0, -0.15), DVec3::new(0.46, 0.98, 0.36));
        Body::new(base + scale * low, base + scale * high, move |x| {
            scale * figure((x - base) / scale)
        })
    }
}

/// Distance to the figure, in units in which it is [`TOP`] high.
fn figure(x: DVec3) -> f64 {
    let part = |x: DVec3, (a, b, radii): ([f64; 3], [f64; 3], [f64; 2])| {
        limb(x, DVec3::from_array(a), DVec3::from_array(b), radii)
    };
    let mirrored = DVec3::new(-x.x, x.y, x.z);
    let (center, radius, thickness) = RING;
    let offset = x - center;
    let ring = (offset.xy().length() - radius).hypot(offset.z) - thickness;
    let topknot = limb(x, DVec3::new(0.0, 0.85, 0.0), DVec3::new(0.0, 0.92, 0.0), [0.05, 0.035]);
    let body = MIDDLE.iter().fold(topknot, |body, &p| join(body, part(x, p), 0.04));
    let body = SIDE
        .iter()
        .fold(body, |body, &p| join(join(body, part(x, p), 0.035), part(mirrored, p), 0.035));
    let body = join(body, ring, 0.02);
    // The flat base.
    body.max(-x.y)
}
