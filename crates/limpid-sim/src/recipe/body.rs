//! Bodies as signed distance functions, and the operators that combine them.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// A body of liquid: the points where [`Body::distance`] is negative.
pub struct Body {
    /// Smallest coordinates of a bounding box, m.
    pub min: DVec3,
    /// Largest coordinates of a bounding box, m.
    pub max: DVec3,
    distance: Box<dyn Fn(DVec3) -> f64 + Send + Sync>,
}

impl Body {
    pub(super) fn new(
        min: DVec3,
        max: DVec3,
        distance: impl Fn(DVec3) -> f64 + Send + Sync + 'static,
    ) -> Self {
        Self { min, max, distance: Box::new(distance) }
    }

    /// Signed distance from `x` to the surface, m, negative inside. It is exact for a ball and a slab.
    /// For other bodies it is exact at the surface, and correct to first order near it after division
    /// by the length of [`Body::gradient`].
    pub fn distance(&self, x: DVec3) -> f64 {
        (self.distance)(x)
    }

    /// Gradient of the distance. On the surface it points along the outward normal.
    pub fn gradient(&self, x: DVec3) -> DVec3 {
        // Central differences: rounding and truncation are both below 1e-9 here.
        let step = 1e-5 * (self.max - self.min).max_element();
        let along = |axis: DVec3| self.distance(x + step * axis) - self.distance(x - step * axis);
        DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)) / (2.0 * step)
    }

    /// Volume, m³, by quadrature: within 1 % unless a part is much thinner than a hundredth of the body.
    pub fn volume(&self) -> f64 {
        /// Cells along the longest side of the box.
        const CELLS: f64 = 96.0;

        let size = self.max - self.min;
        let cells = (size / size.max_element() * CELLS).ceil().max(DVec3::splat(16.0));
        let cell = size / cells;
        let side = cell.element_product().cbrt();
        let [nx, ny, nz] = cells.as_u64vec3().to_array();
        // Slices are summed in order: the result must not depend on the number of threads.
        let slice = |i: u64| -> f64 {
            let at = |j, k| self.min + (DVec3::new(i as f64, j as f64, k as f64) + 0.5) * cell;
            let rows = (0..ny).flat_map(|j| (0..nz).map(move |k| at(j, k)));
            rows.map(|x| (0.5 - self.distance(x) / side).clamp(0.0, 1.0)).sum()
        };
        let slices: Vec<f64> = (0..nx).into_par_iter().map(slice).collect();
        slices.iter().sum::<f64>() * cell.element_product()
    }
}

pub(super) fn ball(center: DVec3, radius: f64) -> Body {
    Body::new(center - radius, center + radius, move |x| x.distance(center) - radius)
}

pub(super) fn slab(min: DVec3, max: DVec3) -> Body {
    Body::new(min, max, move |x| cuboid(x, min, max))
}

/// Distance to an axis-aligned box.
pub(super) fn cuboid(x: DVec3, min: DVec3, max: DVec3) -> f64 {
    let face = (x - 0.5 * (min + max)).abs() - 0.5 * (max - min);
    face.max(DVec3::ZERO).length() + face.max_element().min(0.0)
}

/// Distance to a ball swept from `a` to `b` while its radius changes from `radii[0]` to `radii[1]`.
pub(super) fn limb(x: DVec3, a: DVec3, b: DVec3, radii: [f64; 2]) -> f64 {
    let (along, offset) = (b - a, x - a);
    let t = (offset.dot(along) / along.length_squared()).clamp(0.0, 1.0);
    (offset - t * along).length() - (radii[0] + t * (radii[1] - radii[0]))
}

/// First-order distance to an ellipse about the origin.
pub(super) fn ellipse(x: DVec2, semi_axes: DVec2) -> f64 {
    let k = (x / semi_axes).length();
    let slope = (x / (semi_axes * semi_axes)).length();
    // At the centre the nearest point is along the shorter axis.
    if slope < 1e-9 { -semi_axes.min_element() } else { k * (k - 1.0) / slope }
}

/// Smooth union of two distances, with a fillet where they differ by less than `blend`.
pub(super) fn join(a: f64, b: f64, blend: f64) -> f64 {
    let overlap = (blend - (a - b).abs()).max(0.0);
    a.min(b) - overlap * overlap / (4.0 * blend)
}

/// Smooth difference, the first body without the second, with edges rounded within `blend`.
pub(super) fn cut(a: f64, b: f64, blend: f64) -> f64 {
    -join(-a, b, blend)
}

/// Smoothstep from 0 at `low` to 1 at `high`.
pub(super) fn ramp(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
