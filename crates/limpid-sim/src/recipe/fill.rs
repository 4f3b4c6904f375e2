//! Particles spread in a body as SPH spreads them.

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use super::Droplet;
use super::body::Body;
use crate::rng::splitmix64;

/// Relaxation sweeps: after these the nearest neighbours are evenly far.
const SWEEPS: u32 = 10;

/// Points push each other apart up to this distance, in spacings. A little above the least
/// distance of the densest packing, 2^(1/6): up to there the push spreads them evenly.
const REACH: f64 = 1.2;

/// Share of the overlap by which each point of a pair gives way in a sweep; beyond about 0.3 a
/// point with a dozen neighbours overshoots.
const STIFFNESS: f64 = 0.22;

/// How much a body's distance changes, at most, over a unit of length. 1 where it is exact.
const STEEPEST: f64 = 1.5;

/// Bytes that filling takes for each point, at most: points and distances, their successors, and cells.
pub(super) const BYTES: usize = 4 * 32 + 24 + 8 * CELLS_PER_POINT;

/// Cells in which points are sorted, at most, for each.
const CELLS_PER_POINT: usize = 64;

/// The side of a lattice cell, of two points, and how many there are along each axis.
fn lattice(body: &Body, spacing: f64) -> (f64, DVec3) {
    let cell = 2f64.cbrt() * spacing;
    (cell, ((body.max - body.min) / cell).ceil() + 1.0)
}

/// How many places [`fill`] looks at.
pub(super) fn places(body: &Body, spacing: f64) -> f64 {
    2.0 * lattice(body, spacing).1.element_product()
}

/// Points of mean spacing `spacing` in `body`, none nearer to its surface than about half that
/// where the body is thick enough: a shaken body-centred lattice, relaxed.
pub(super) fn fill(body: &Body, spacing: f64, seed: u64) -> Vec<DVec3> {
    let (cell, cells) = lattice(body, spacing);
    let cells = cells.as_u64vec3();
    let slice = |i: u64| {
        let corners = (0..cells.y).flat_map(move |j| (0..cells.z).map(move |k| (j, k)));
        corners.flat_map(move |(j, k)| {
            let mut state = seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ (i << 42 | j << 21 | k);
            [0.0, 0.5].map(|offset| {
                let corner = DVec3::new(i as f64, j as f64, k as f64) + (offset - 0.25);
                body.min + cell * (corner + 0.3 * shake(&mut state))
            })
        })
    };
    let inside = |x: DVec3| {
        let distance = body.distance(x);
        (distance < 0.0).then_some((x, distance))
    };
    let (mut points, mut distances): (Vec<DVec3>, Vec<f64>) =
        (0..cells.x).into_par_iter().flat_map_iter(|i| slice(i).filter_map(inside)).unzip();
    let depth = 0.5 * spacing;
    for _ in 0..SWEEPS {
        let grid = Grid::new(&points, REACH * spacing);
        let relaxed = |(&x, &distance): (&DVec3, &f64)| {
            let mut push = DVec3::ZERO;
            grid.near(x, |other| {
                let offset = x - other;
                let distance = offset.length();
                if distance > 0.0 && distance < REACH * spacing {
                    push += (REACH * spacing / distance - 1.0) * offset;
                }
            });
            let moved = x + STIFFNESS * push;
            // Only those that can have come out are looked at again.
            let farthest = distance + STEEPEST * x.distance(moved);
            if farthest < -depth { (moved, farthest) } else { confined(body, moved, depth) }
        };
        (points, distances) = points.par_iter().zip(&distances).map(relaxed).unzip();
    }
    points
}

/// `x`, or if that is not `depth` inside the body the nearest point that is, or in a part too thin
/// for that about its middle; and the distance there.
fn confined(body: &Body, x: DVec3, depth: f64) -> (DVec3, f64) {
    let (mut x, mut distance) = (x, body.distance(x));
    for _ in 0..3 {
        let missing = distance + depth;
        if missing <= 1e-3 * depth {
            break;
        }
        // One-sided differences: the direction is enough.
        let ahead =
            |axis: DVec3| (body.distance(x + 1e-3 * depth * axis) - distance) / (1e-3 * depth);
        let gradient = DVec3::new(ahead(DVec3::X), ahead(DVec3::Y), ahead(DVec3::Z));
        let step = missing * gradient / gradient.length_squared().max(0.25);
        let nearer = [1.0, 0.5, 0.25].iter().find_map(|scale| {
            let to = x - *scale * step;
            let there = body.distance(to);
            (there < distance).then_some((to, there))
        });
        let Some(found) = nearer else { break };
        (x, distance) = found;
    }
    (x, distance)
}

/// Adds about `count` particles as droplets, clear of the body and of each other.
pub(super) fn scatter(
    points: &mut Vec<DVec3>,
    body: &Body,
    spacing: f64,
    count: usize,
    droplets: impl Iterator<Item = Option<Droplet>>,
) {
    /// Draws for each droplet that is wanted, before the search for room is given up.
    const TRIES: usize = 12;

    /// Distance of two surfaces at which classification sees two bodies, in spacings.
    const APART: f64 = 2.1;

    let total = points.len() + count;
    // Droplets by the cube they are in; no two that touch are further apart than a cube.
    let cube = (2.0 * Droplet::LARGEST + APART) * spacing;
    let mut taken: HashMap<[i64; 3], Vec<(DVec3, f64)>> = HashMap::new();
    let mut state = 1;
    for droplet in droplets.take(TRIES * count).flatten() {
        if points.len() >= total {
            break;
        }
        let size = droplet.size * spacing;
        let [x, y, z] = (droplet.center / cube).floor().to_array().map(|n| n as i64);
        let around =
            (0..27).flat_map(|i| taken.get(&[x + i / 9 - 1, y + i / 3 % 3 - 1, z + i % 3 - 1]));
        let touching = around.flatten().any(|&(center, other)| {
            center.distance(droplet.center) < size + other + APART * spacing
        });
        if touching || body.distance(droplet.center) < size + 1.3 * spacing {
            continue;
        }
        taken.entry([x, y, z]).or_default().push((droplet.center, size));
        // A clump of the lattice, turned at random.
        let turn = glam::DQuat::from_scaled_axis(6.0 * shake(&mut state));
        let reach = (droplet.size.ceil() as i32).max(0);
        let near = || (-reach..=reach).map(f64::from);
        let lattice = near().flat_map(|x| near().flat_map(move |y| near().map(move |z| (x, y, z))));
        let clump = lattice.map(DVec3::from).filter(|p| p.length() <= droplet.size);
        points.extend(
            clump.map(|p| droplet.center + spacing * (turn * p + 0.15 * shake(&mut state))),
        );
    }
}

/// A vector in the cube from −1 to 1.
fn shake(state: &mut u64) -> DVec3 {
    let mut unit = || 2.0 * splitmix64(state) - 1.0;
    DVec3::new(unit(), unit(), unit())
}

/// Points sorted into cubes, to find those near a place.
struct Grid {
    min: DVec3,
    per_cell: f64,
    cells: [usize; 3],
    /// Where each cell's points begin in `sorted`.
    starts: Vec<u32>,
    sorted: Vec<DVec3>,
}

impl Grid {
    /// Cells of side `cell`, and around them an empty layer. They are wider where so few points are in
    /// so wide a space that cells would take more memory than these.
    fn new(points: &[DVec3], cell: f64) -> Self {
        let (min, max) =
            points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), &x| {
                (min.min(x), max.max(x))
            });
        // Half a cell more, so that rounding cannot put a point into that layer.
        let most = (CELLS_PER_POINT * points.len() + (1 << 20)) as f64;
        let count = |cell: f64| ((max - min) / cell + 3.5).element_product();
        let mut cell = cell;
        while count(cell) > most {
            cell *= 1.25;
        }
        let (min, per_cell) = (min - 1.5 * cell, 1.0 / cell);
        let cells = ((max - min) * per_cell).to_array().map(|n| n as usize + 2);
        let mut grid = Self { min, per_cell, cells, starts: Vec::new(), sorted: Vec::new() };
        let cell_of: Vec<usize> = points.par_iter().map(|&x| grid.cell(x)).collect();
        grid.starts = vec![0; cells.iter().product::<usize>() + 1];
        for &cell in &cell_of {
            grid.starts[cell + 1] += 1;
        }
        for i in 1..grid.starts.len() {
            grid.starts[i] += grid.starts[i - 1];
        }
        let mut next = grid.starts.clone();
        grid.sorted = vec![DVec3::ZERO; points.len()];
        for (&cell, &x) in cell_of.iter().zip(points) {
            grid.sorted[next[cell] as usize] = x;
            next[cell] += 1;
        }
        grid
    }

    fn cell(&self, x: DVec3) -> usize {
        let [i, j, k] = ((x - self.min) * self.per_cell).to_array().map(|n| n as usize);
        (i * self.cells[1] + j) * self.cells[2] + k
    }

    /// Visits the points in the cell of `x`, which must be one of the points, and those around it.
    fn near(&self, x: DVec3, mut visit: impl FnMut(DVec3)) {
        let [_, ny, nz] = self.cells;
        let middle = self.cell(x);
        for row in [0, 1, 2].into_iter().flat_map(|i| [0, 1, 2].map(|j| i * ny * nz + j * nz)) {
            // Three cells along z are neighbours in memory.
            let first = middle + row - (ny * nz + nz + 1);
            let found = self.starts[first] as usize..self.starts[first + 3] as usize;
            self.sorted[found].iter().copied().for_each(&mut visit);
        }
    }
}
