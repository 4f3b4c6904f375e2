//! A uniform grid that sorts particles by cell and finds their neighbours.

use glam::{DVec3, Vec3, Vec4, Vec4Swizzles as _};
use rayon::prelude::*;

use super::colliders::{Colliders, Contact};
use limpid::liquid::counting_sort;

/// Particles per parallel task. It does not affect results.
pub(super) const CHUNK: usize = 256;

/// A grid whose cells are at least as wide as the kernel, over the bulk of the particles. Particles
/// outside it are assigned to the border cells, so that stray ones do not enlarge the grid.
#[derive(Debug, Default)]
pub(crate) struct Grid {
    min: Vec3,
    per_cell: f32,
    counts: [usize; 3],
    /// Index of each cell's first particle in the sorted order, and the total at the end.
    starts: Vec<u32>,
    cells: Vec<u32>,
}

impl Grid {
    /// Sorts the points by cell, x fastest, and stably. Writes to `order`, for each index in the new
    /// order, the index in the old one.
    pub(crate) fn sort(&mut self, points: &[Vec3], width: f32, order: &mut Vec<u32>) {
        self.fit(points, width);
        let Self { min, per_cell, counts, .. } = *self;
        points
            .par_iter()
            .map(|&x| cell(x, min, per_cell, counts))
            .map(|[x, y, z]| ((z * counts[1] + y) * counts[0] + x) as u32)
            .collect_into_vec(&mut self.cells);
        counting_sort::by_cell(&self.cells, counts.iter().product(), &mut self.starts, order);
    }

    /// Sets the grid's extent to four standard deviations about the mean, and the cell width to `width`,
    /// or more where there would be too many cells.
    fn fit(&mut self, points: &[Vec3], width: f32) {
        let count = points.len().max(1) as f64;
        let first = points.first().copied().unwrap_or_default();
        let (mut min, mut max) = (first, first);
        let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
        for &x in points {
            (min, max) = (min.min(x), max.max(x));
            let x = x.as_dvec3();
            sum += x;
            squares += x * x;
        }
        let mean = sum / count;
        let deviation = (squares / count - mean * mean).max(DVec3::ZERO).map(f64::sqrt);
        min = min.max((mean - 4.0 * deviation).as_vec3());
        max = max.min((mean + 4.0 * deviation).as_vec3());
        let max_cells = 2.0 * count as f32 + 4096.0;
        let mut width = width;
        // At least one cell along each axis.
        let cells = |width: f32| ((max - min) / width).max(Vec3::ZERO).floor() + 1.0;
        while cells(width).element_product() > max_cells {
            width *= 1.25;
        }
        self.min = min;
        self.per_cell = 1.0 / width;
        self.counts = cells(width).to_array().map(|count| count as usize);
    }

    /// Finds the neighbours of the sorted particles within `h`, and the obstacles within `reach`.
    pub(super) fn neighbours(
        &self,
        points: &[Vec4],
        h: f32,
        colliders: &Colliders,
        reach: f32,
        found: &mut Vec<Neighbours>,
    ) {
        found.resize_with(points.len().div_ceil(CHUNK), Neighbours::default);
        let chunks = found.par_iter_mut().zip(points.par_chunks(CHUNK)).enumerate();
        chunks.for_each(|(chunk, (near, own))| {
            near.clear();
            for (i, x) in (chunk * CHUNK..).zip(own) {
                let x = x.xyz();
                self.append(points, i, x, h * h, &mut near.particles);
                near.ends.push(near.particles.len() as u32);
                colliders.contacts(x, reach, &mut near.contacts);
                near.contact_ends.push(near.contacts.len() as u32);
            }
        });
    }

    /// Appends the neighbours of particle `i` at `x` that are nearer than the root of `square`.
    pub(crate) fn append(
        &self,
        points: &[Vec4],
        i: usize,
        x: Vec3,
        square: f32,
        found: &mut Vec<u32>,
    ) {
        let counts = self.counts;
        let [cx, cy, cz] = cell(x, self.min, self.per_cell, counts);
        let around = |c: usize, count: usize| c.saturating_sub(1)..(c + 2).min(count);
        let along = around(cx, counts[0]);
        for z in around(cz, counts[2]) {
            for y in around(cy, counts[1]) {
                let row = (z * counts[1] + y) * counts[0];
                let begin = self.starts[row + along.start] as usize;
                let end = self.starts[row + along.end] as usize;
                // Branchless compaction: a branch would be mispredicted too often.
                let mut length = found.len();
                found.resize(length + end - begin, 0);
                for (j, other) in (begin..end).zip(&points[begin..end]) {
                    found[length] = j as u32;
                    let near = other.xyz().distance_squared(x) < square && j != i;
                    length += usize::from(near);
                }
                found.truncate(length);
            }
        }
    }
}

fn cell(x: Vec3, min: Vec3, per_cell: f32, counts: [usize; 3]) -> [usize; 3] {
    let at = ((x - min) * per_cell).to_array();
    // The cast saturates negative values to 0.
    std::array::from_fn(|axis| (at[axis] as usize).min(counts[axis] - 1))
}

/// The neighbours and contacts of up to [`CHUNK`] particles.
#[derive(Debug, Default)]
pub(super) struct Neighbours {
    particles: Vec<u32>,
    ends: Vec<u32>,
    contacts: Vec<Contact>,
    contact_ends: Vec<u32>,
}

impl Neighbours {
    fn clear(&mut self) {
        self.particles.clear();
        self.ends.clear();
        self.contacts.clear();
        self.contact_ends.clear();
    }

    /// The neighbours of the chunk's k-th particle, excluding itself.
    #[inline]
    pub(super) fn of(&self, k: usize) -> &[u32] {
        slice(&self.particles, &self.ends, k)
    }

    /// The obstacles near the chunk's k-th particle.
    #[inline]
    pub(super) fn contacts(&self, k: usize) -> &[Contact] {
        slice(&self.contacts, &self.contact_ends, k)
    }
}

fn slice<'a, T>(items: &'a [T], ends: &[u32], k: usize) -> &'a [T] {
    let begin = if k == 0 { 0 } else { ends[k - 1] as usize };
    &items[begin..ends[k] as usize]
}
