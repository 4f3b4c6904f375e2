//! A grid of cells in the world, in which rays other than the eye's see foam, spray and bubbles: `diffuse/cells.wgsl`.

use glam::{DVec3, UVec3};

use crate::diffuse::Diffuse;

/// Most cells, and most along an axis.
const MOST: u32 = 1 << 16;
const LONGEST: u32 = 64;

/// Where the cells lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cells {
    /// The least corner in world space, m.
    pub(super) first: DVec3,
    /// Side of a cell, m.
    pub(super) side: f64,
    /// Cells along each axis.
    pub(super) across: UVec3,
}

impl Cells {
    /// The cells of spheres in a box: as wide as two mean diameters or, if that makes too many, wider.
    pub(super) fn new(diffuse: &Diffuse, [low, high]: [DVec3; 2]) -> Self {
        let mean = diffuse.radii.iter().map(|&r| f64::from(r)).sum::<f64>() / diffuse.len() as f64;
        let mut side = 4.0 * mean;
        loop {
            let across = ((high - low) / side).ceil().as_uvec3().max(UVec3::ONE);
            let count = across.as_u64vec3().element_product();
            if across.max_element() <= LONGEST && count <= MOST.into() {
                // The box is in the middle.
                let first = 0.5 * (low + high) - 0.5 * side * across.as_dvec3();
                return Self { first, side, across };
            }
            side *= 1.25;
        }
    }

    /// Number of cells.
    pub(super) fn count(&self) -> u32 {
        self.across.element_product()
    }

    /// Bytes of the cells, and of the bricks behind them.
    pub(super) fn bytes(&self) -> u64 {
        let bricks = self.across.map(|n| n.div_ceil(4)).element_product();
        16 * u64::from(self.count() + bricks.div_ceil(4))
    }
}
