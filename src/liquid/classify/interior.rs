//! The interior of large bodies: nobody sees the particles there, so one splat stands for all of a grid cell.
//!
//! A cell is interior if all 2×2×2 cells with it are full. Its sphere passes through the cell's corners: it leaves no hole
//! in the body, whether an eye is inside or gaps are searched for, and reaches into the cells beside it by less than they
//! are filled. The number of splats then grows with the surface of a body, and with an eighth of its volume.

use glam::UVec3;
use rayon::prelude::*;

use super::grid::Grid;
use super::{Cloud, Member, Splat};
use crate::settings::Classify;

/// Least number of particles. In fewer, little is interior, and that little costs little.
const LEAST: usize = 1 << 18;

/// Particles in 2×2×2 full cells, at least, over those at rest.
const FULL: f64 = 0.9;

/// Particles that may be missing from them: a bubble of no more is hardly longer than a particle's radius, for four that lie
/// side by side leave no gap at all between swollen splats.
const MISSING: f64 = 6.0;

/// Particles in each of these cells, at least, over those at rest. Spheres bulge into the cells beside them by a third of
/// their width: with 0.5, some stood out of the slopes of waves.
const EACH: f64 = 0.6;

impl Cloud {
    /// Whether cells are searched for the interior: many particles, alike in radius and fluid, none with a shape from
    /// the file.
    pub(super) fn has_interior(&self, settings: &Classify) -> bool {
        let alike = |m: &Member| m.radius == self.radius && m.fluid == self.members[0].fluid;
        merges(self.members.len(), settings)
            && self.ellipsoids.is_none()
            && self.members.par_iter().all(alike)
    }

    /// A sphere around each of these cells.
    pub(super) fn spheres(&self, grid: &Grid<'_>, cells: &[bool]) -> Vec<Splat> {
        let layout = grid.layout();
        let width = 1.0 / layout.per_cell;
        let half_diagonal = 0.5 * 3.0f32.sqrt() * width;
        let sphere = |(index, &marked): (usize, &bool)| {
            let first = grid.of_cell(index).next().filter(|_| marked)?;
            let member = &self.members[grid.order()[first as usize] as usize];
            let corner = layout.min + width * layout.cell_at(index).as_vec3();
            let centre = (corner + 0.5 * width).as_dvec3() - self.shift;
            Some(Splat {
                centre: centre.as_vec3().to_array(),
                radius: member.radius,
                diagonal: [half_diagonal; 3],
                particle: member.particle,
                off_diagonal: [0.0; 3],
                tags: member.fluid | Splat::BURIED | Splat::INTERIOR,
            })
        };
        cells.par_iter().enumerate().filter_map(sphere).collect()
    }
}

/// Whether cells of so many particles that are alike may have one splat.
pub(super) fn merges(count: usize, settings: &Classify) -> bool {
    count >= LEAST && f64::from(settings.splash_density) <= EACH
}

/// Particles in 2×2×2 full cells, and in each of them, at least.
pub(super) fn full_cells(support: f32) -> [f64; 2] {
    let at_rest = (f64::from(support) / 2.0).powi(3);
    [(8.0 * at_rest * FULL).max(8.0 * at_rest - MISSING), EACH * at_rest]
}

impl Grid<'_> {
    /// Which cells are interior.
    pub(super) fn interior(&self) -> Vec<bool> {
        let layout = self.layout();
        let [least, least_each] = full_cells(self.support());
        // A cell and the seven after it, along all axes.
        let eight = |cell: UVec3| {
            let of = move |i: u32| cell + UVec3::new(i & 1, i >> 1 & 1, i >> 2);
            (0..8).map(move |i| layout.index(of(i)) as usize)
        };
        let count = |cell: usize| self.of_cell(cell).len() as f64;
        let is_full = |index: usize| {
            let cell = layout.cell_at(index);
            if (cell + 1).cmpge(layout.counts).any() {
                return false;
            }
            let sum: f64 = eight(cell).map(count).sum();
            sum >= least && eight(cell).all(|cell| count(cell) >= least_each)
        };
        let full: Vec<bool> = (0..self.cells()).into_par_iter().map(is_full).collect();
        let is_interior = |index: usize| {
            let cell = layout.cell_at(index);
            cell.cmpgt(UVec3::ZERO).all() && eight(cell - 1).all(|block| full[block])
        };
        (0..self.cells()).into_par_iter().map(is_interior).collect()
    }
}
