//! Filling of bodies with particles, distributed as in SPH.

use std::collections::HashMap;

use glam::DVec3;
use rayon::prelude::*;

use super::Droplet;
use super::body::Body;
use crate::rng::splitmix64;

/// Number of relaxation sweeps, enough to equalise the distances of nearest neighbours.
const SWEEPS: u32 = 10;

/// Range of the repulsion between points, in spacings: slightly above the nearest-neighbour distance of
/// the densest packing, 2^(1/6), up to which the repulsion distributes them evenly.
const REACH: f64 = 1.2;

/// Fraction of the overlap by which each point of a pair moves per sweep; above about 0.3 a point with a
/// dozen neighbours overshoots.
const STIFFNESS: f64 = 0.22;

/// Upper bound of the slope of a body's distance function, which is 1 where the distance is exact.
const MAX_SLOPE: f64 = 1.5;

/// Memory that filling takes per point, bytes, at most: points and distances, their successors, and
/// cells.
pub(super) const BYTES: usize = 4 * 32 + 24 + 8 * CELLS_PER_POINT;

/// Largest number of grid cells per point.
const CELLS_PER_POINT: usize = 64;

/// Side of a body-centred lattice cell, which has two points, and the number of cells along each axis.
fn lattice(body: &Body, spacing: f64) -> (f64, DVec3) {
    let cell = 2f64.cbrt() * spacing;
    (cell, ((body.max - body.min) / cell).ceil() + 1.0)
}

/// Number of candidate positions of [`fill`].
pub(super) fn places(body: &Body, spacing: f64) -> f64 {
    2.0 * lattice(body, spacing).1.element_product()
}

/// Fills `body` with points of mean spacing `spacing`, at least about half of that below the surface
/// where the body is thick enough: a jittered and relaxed body-centred lattice.
pub(super) fn fill(body: &Body, spacing: f64, seed: u64) -> Vec<DVec3> {
    let (cell, cells) = lattice(body, spacing);
    let cells = cells.as_u64vec3();
    let slice = |i: u64| {
        let corners = (0..cells.y).flat_map(move |j| (0..cells.z).map(move |k| (j, k)));
        corners.flat_map(move |(j, k)| {
            let mut state = seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ (i << 42 | j << 21 | k);
            [0.0, 0.5].map(|offset| {
                let corner = DVec3::new(i as f64, j as f64, k as f64) + (offset - 0.25);
                body.min + cell * (corner + 0.3 * random_offset(&mut state))
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
            // Only points that may be less than `depth` inside are evaluated again.
            let farthest = distance + MAX_SLOPE * x.distance(moved);
            if farthest < -depth { (moved, farthest) } else { confined(body, moved, depth) }
        };
        (points, distances) = points.par_iter().zip(&distances).map(relaxed).unzip();
    }
    points
}

/// Moves `x` to a depth of at least `depth`, or in a part too thin for that to about its middle. Returns
/// the point and its distance.
fn confined(body: &Body, x: DVec3, depth: f64) -> (DVec3, f64) {
    let (mut x, mut distance) = (x, body.distance(x));
    for _ in 0..3 {
        let missing = distance + depth;
        if missing <= 1e-3 * depth {
            break;
        }
        // One-sided differences are accurate enough for a direction.
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

/// Adds up to about `count` particles in droplets that are clear of the body and of each other.
pub(super) fn scatter(
    points: &mut Vec<DVec3>,
    body: &Body,
    spacing: f64,
    count: usize,
    droplets: impl Iterator<Item = Option<Droplet>>,
) {
    /// Draws per requested particle before the search for free positions ends.
    const DRAWS_PER_PARTICLE: usize = 12;

    /// Distance, in spacings, at which classification separates two surfaces.
    const CLEARANCE: f64 = 2.1;

    let total = points.len() + count;
    // Droplets hashed by cube. Droplets that touch are in adjacent cubes at most.
    let cube = (2.0 * Droplet::LARGEST + CLEARANCE) * spacing;
    let mut taken: HashMap<[i64; 3], Vec<(DVec3, f64)>> = HashMap::new();
    let mut state = 1;
    for droplet in droplets.take(DRAWS_PER_PARTICLE * count).flatten() {
        if points.len() >= total {
            break;
        }
        let size = droplet.size * spacing;
        let [x, y, z] = (droplet.center / cube).floor().to_array().map(|n| n as i64);
        let around =
            (0..27).flat_map(|i| taken.get(&[x + i / 9 - 1, y + i / 3 % 3 - 1, z + i % 3 - 1]));
        let touching = around.flatten().any(|&(center, other)| {
            center.distance(droplet.center) < size + other + CLEARANCE * spacing
        });
        if touching || body.distance(droplet.center) < size + 1.3 * spacing {
            continue;
        }
        taken.entry([x, y, z]).or_default().push((droplet.center, size));
        // A piece of a cubic lattice in a random orientation.
        let turn = glam::DQuat::from_scaled_axis(6.0 * random_offset(&mut state));
        let reach = (droplet.size.ceil() as i32).max(0);
        let near = || (-reach..=reach).map(f64::from);
        let lattice = near().flat_map(|x| near().flat_map(move |y| near().map(move |z| (x, y, z))));
        let clump = lattice.map(DVec3::from).filter(|p| p.length() <= droplet.size);
        points.extend(
            clump.map(|p| droplet.center + spacing * (turn * p + 0.15 * random_offset(&mut state))),
        );
    }
}

/// A uniform random vector in the cube from −1 to 1.
fn random_offset(state: &mut u64) -> DVec3 {
    let mut unit = || 2.0 * splitmix64(state) - 1.0;
    DVec3::new(unit(), unit(), unit())
}

/// A uniform grid of points, for neighbour queries.
struct Grid {
    min: DVec3,
    per_cell: f64,
    cells: [usize; 3],
    /// Index of each cell's first point in `sorted`.
    starts: Vec<u32>,
    sorted: Vec<DVec3>,
}

impl Grid {
    /// Sorts points into cells of side `cell`, surrounded by an empty layer of cells. The side is larger
    /// where sparse points would need more than [`CELLS_PER_POINT`].
    fn new(points: &[DVec3], cell: f64) -> Self {
        let (min, max) =
            points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), &x| {
                (min.min(x), max.max(x))
            });
        // Half a cell of margin, so that rounding cannot put a point into the empty layer.
        let max_cells = (CELLS_PER_POINT * points.len() + (1 << 20)) as f64;
        let count = |cell: f64| ((max - min) / cell + 3.5).element_product();
        let mut cell = cell;
        while count(cell) > max_cells {
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

    /// Visits the points in the cell of `x`, which must be one of the points, and in adjacent cells.
    fn near(&self, x: DVec3, mut visit: impl FnMut(DVec3)) {
        let [_, ny, nz] = self.cells;
        let middle = self.cell(x);
        for row in [0, 1, 2].into_iter().flat_map(|i| [0, 1, 2].map(|j| i * ny * nz + j * nz)) {
            // Three cells along z are contiguous in memory.
            let first = middle + row - (ny * nz + nz + 1);
            let found = self.starts[first] as usize..self.starts[first + 3] as usize;
            self.sorted[found].iter().copied().for_each(&mut visit);
        }
    }
}
