//! A uniform grid: particles sorted by cell, and the neighbours of each.

use glam::{DVec3, Vec3, Vec4, Vec4Swizzles as _};
use rayon::prelude::*;

use super::colliders::{Colliders, Contact};
use limpid::liquid::counting_sort;

/// Particles that one task works on. It has no influence on results.
pub(super) const CHUNK: usize = 256;

/// Cells at least as wide as the kernel, over where most particles are. What lies outside is in the
/// cells at the border, so that a stray particle costs nothing.
#[derive(Debug, Default)]
pub(super) struct Grid {
    min: Vec3,
    per_cell: f32,
    counts: [usize; 3],
    /// Where each cell's particles begin in the sorted order; one more than there are cells.
    starts: Vec<u32>,
    cells: Vec<u32>,
}

impl Grid {
    /// Sorts by cell, x fastest; the order within a cell is kept. Returns for each place in the new
    /// order the one in the old.
    pub(super) fn sort(&mut self, points: &[Vec3], width: f32, order: &mut Vec<u32>) {
        self.lay(points, width);
        let Self { min, per_cell, counts, .. } = *self;
        points
            .par_iter()
            .map(|&x| cell(x, min, per_cell, counts))
            .map(|[x, y, z]| ((z * counts[1] + y) * counts[0] + x) as u32)
            .collect_into_vec(&mut self.cells);
        counting_sort::by_cell(&self.cells, counts.iter().product(), &mut self.starts, order);
    }

    fn lay(&mut self, points: &[Vec3], width: f32) {
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
        let most = 2.0 * count as f32 + 4096.0;
        let mut width = width;
        // At least one cell along each axis.
        let cells = |width: f32| ((max - min) / width).max(Vec3::ZERO).floor() + 1.0;
        while cells(width).element_product() > most {
            width *= 1.25;
        }
        self.min = min;
        self.per_cell = 1.0 / width;
        self.counts = cells(width).to_array().map(|count| count as usize);
    }

    /// Finds the neighbours of sorted particles within `h`, and the obstacles they may touch within
    /// `reach`.
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

    fn append(&self, points: &[Vec4], i: usize, x: Vec3, square: f32, found: &mut Vec<u32>) {
        let counts = self.counts;
        let [cx, cy, cz] = cell(x, self.min, self.per_cell, counts);
        let around = |c: usize, count: usize| c.saturating_sub(1)..(c + 2).min(count);
        let along = around(cx, counts[0]);
        for z in around(cz, counts[2]) {
            for y in around(cy, counts[1]) {
                let row = (z * counts[1] + y) * counts[0];
                let begin = self.starts[row + along.start] as usize;
                let end = self.starts[row + along.end] as usize;
                // Written always and kept if near: a branch would be guessed wrong too often.
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
    // The cast takes what is below to 0.
    std::array::from_fn(|axis| (at[axis] as usize).min(counts[axis] - 1))
}

/// The neighbours of up to [`CHUNK`] particles, and what these touch.
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

    /// The neighbours of the chunk's k-th particle, without itself.
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
