//! Robust bounding box of a particle set, on which cameras, floors and light views are based.
//!
//! Simulations lose particles: one leaks through a wall and falls for ever, a time step that is too
//! long ejects a few, and those that an emitter has not yet used are parked somewhere far away. In the bounding
//! box of all particles the liquid is then a point, and a picture or map of that box shows nothing. Particles
//! that are near the others or connected to them are not outliers, however few they are: a drop above a splash,
//! the tip of a jet.

use std::collections::{HashMap, VecDeque};

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Bounding box of the bulk of a particle set, in world space, m.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Bulk {
    /// Minimum and maximum corner of the bounding box of the centres.
    pub bounds: (DVec3, DVec3),
    /// Number of centres outside the box.
    pub outside: usize,
    /// Minimum and maximum corner of the bounding box of these centres; `None` if there are none.
    pub lost: Option<(DVec3, DVec3)>,
    /// Minimum and maximum corner of the core, the box of the dense bodies of liquid.
    pub core: (DVec3, DVec3),
}

/// Share of the liquid below which a clump counts only where it is near the core.
const TAIL: f64 = 0.01;

/// Smaller sets have no outliers: a single particle is too large a share of them.
const MIN_COUNT: usize = 32;

/// Positions sampled to find the core.
const SAMPLES: usize = 4096;

/// Least number of sampled positions in the cell of the median one: cells of that size are connected in liquid.
const FILLED: usize = 8;

/// Most positions of a cell that count, which limits the weight of crowds.
const CROWD: usize = 2 * FILLED;

/// Distance from the core within which particles belong to the bulk even if unconnected, as a multiple
/// of the core's longest side. The core thus fills at least a third of a picture of the bulk.
const REACH: f64 = 1.0;

/// The same for clumps of more than a [`TAIL`]: their share of the liquid times this,
const REACH_OF_ALL: f64 = 720.0;

/// but at most this: beyond it, a picture of both shows neither.
const LONGEST_REACH: f64 = 64.0;

/// The same for clumps that are at rest while the heaviest moves.
const REACH_AT_REST: f64 = 8.0;

/// Cells along the core's longest side. Particles in the same or in adjacent cells are connected.
const CELLS: f64 = 16.0;

/// Finds the bulk of `count` particles; `None` without particles. `is_at_rest` tells which of them have a
/// velocity of exactly 0, as parked ones have; without velocities none has.
///
/// Particles that fill space as densely as most of them do and touch are a clump. The core is the box of the
/// heaviest clump – the heaviest that moves, if some are at rest – and of those that matter beside it: the more of the
/// liquid they have, the farther they may be. Particles in one place count once. The bulk is the bounding
/// box of all particles that
///
/// - are within a distance of the core's longest side from the core, or
/// - are connected to one of these by particles no further apart than about a sixteenth of that side.
///
/// If these are all particles, the box is exactly their bounding box. A compact cloud thus keeps
/// its outermost particles, and a thin jet its tip.
pub fn bulk(
    count: usize,
    place: impl Fn(usize) -> DVec3 + Sync,
    is_at_rest: impl Fn(usize) -> bool,
) -> Option<Bulk> {
    let bounds = bounds_where(count, &place, |_| true)?;
    let all = Bulk { bounds, outside: 0, lost: None, core: bounds };
    if count < MIN_COUNT {
        return Some(all);
    }
    let Some(core) = core(sample(count, SAMPLES).map(|i| (place(i), is_at_rest(i))), bounds) else {
        return Some(all);
    };
    let side = (core.1 - core.0).max_element();
    let near = (core.0 - REACH * side, core.1 + REACH * side);
    if holds(near, bounds.0) && holds(near, bounds.1) {
        return Some(Bulk { core, ..all });
    }
    let connected = connected(count, &place, near, side / CELLS);
    let bounds = bounds_where(count, &place, |x| holds(near, x) || connected(x))?;
    let lost = bounds_where(count, &place, |x| !holds(bounds, x));
    let outside = (0..count).into_par_iter().filter(|&i| !holds(bounds, place(i))).count();
    Some(Bulk { bounds, outside, lost, core })
}

/// At most `most` of the numbers below `count`, evenly but without a period, which lattices would answer to.
pub(super) fn sample(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let step = count.div_ceil(most).max(1);
    // SplitMix64 (Steele, Lea and Flood 2014).
    let mix = |k: usize| {
        let mut x = (k as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    };
    (0..count.div_ceil(step)).map(move |k| {
        let within = (count - k * step).min(step) as u64;
        k * step + (mix(k) % within) as usize
    })
}

/// Minimum and maximum corner of the bounding box of positions; `None` without any.
#[doc(hidden)]
pub fn bounds(mut places: impl Iterator<Item = DVec3>) -> Option<(DVec3, DVec3)> {
    let first = places.next()?;
    Some(places.fold((first, first), |(min, max), p| (min.min(p), max.max(p))))
}

/// As [`bounds`], of the particles for whose place `counts` holds.
fn bounds_where(
    count: usize,
    place: &(impl Fn(usize) -> DVec3 + Sync),
    counts: impl Fn(DVec3) -> bool + Sync,
) -> Option<(DVec3, DVec3)> {
    let none = || (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (min, max) = (0..count)
        .into_par_iter()
        .with_min_len(4096)
        .map(place)
        .filter(|&x| counts(x))
        .fold(none, |(min, max), x| (min.min(x), max.max(x)))
        .reduce(none, united);
    min.is_finite().then_some((min, max))
}

impl Bulk {
    /// Whether the box contains a position.
    pub fn holds(&self, place: DVec3) -> bool {
        holds(self.bounds, place)
    }
}

pub(super) fn holds((min, max): (DVec3, DVec3), place: DVec3) -> bool {
    min.cmple(place).all() && place.cmple(max).all()
}

/// The box around two boxes.
fn united(a: (DVec3, DVec3), b: (DVec3, DVec3)) -> (DVec3, DVec3) {
    (a.0.min(b.0), a.1.max(b.1))
}

/// Longest side of a box.
fn side((min, max): (DVec3, DVec3)) -> f64 {
    (max - min).max_element()
}

/// Space between two boxes along the axis where it is widest; 0 where they overlap.
fn gap(a: (DVec3, DVec3), b: (DVec3, DVec3)) -> f64 {
    (a.0 - b.1).max(b.0 - a.1).max_element().max(0.0)
}

/// Particles that touch.
struct Clump {
    bounds: (DVec3, DVec3),
    /// Side of a cube of the volume of its cells, m.
    size: f64,
    /// Share of the liquid.
    share: f64,
    is_at_rest: bool,
}

/// The box of the dense bodies of liquid, of places with whether they are at rest, all within `bounds`; `None` if
/// there are too few places for bodies.
fn core(
    places: impl Iterator<Item = (DVec3, bool)>,
    bounds: (DVec3, DVec3),
) -> Option<(DVec3, DVec3)> {
    let mut clumps = clumps(&distinct(places), bounds)?;
    // The sort is stable, so that equals stay in the order of the file.
    clumps.sort_by(|a, b| b.share.total_cmp(&a.share));
    let moving = |clump: &Clump| !clump.is_at_rest && clump.share >= TAIL;
    let moves = clumps.iter().any(moving);
    let heaviest = clumps.iter().position(moving).unwrap_or(0);
    let mut core = clumps.remove(heaviest).bounds;
    loop {
        let reaches = |clump: &Clump| {
            let size = side(core).max(clump.size);
            let longest = if moves && clump.is_at_rest { REACH_AT_REST } else { LONGEST_REACH };
            let reach = (REACH_OF_ALL * clump.share).clamp(REACH, longest);
            gap(core, clump.bounds) <= reach * size
        };
        let (reached, others): (Vec<_>, Vec<_>) = clumps.into_iter().partition(reaches);
        // Fewer are spray, which does not widen the core and so the reach of other spray.
        if reached.iter().map(|clump| clump.share).sum::<f64>() < TAIL {
            return Some(core);
        }
        core = reached.iter().fold(core, |core, clump| united(core, clump.bounds));
        clumps = others;
    }
}

/// Each place once, at rest if all particles there are.
fn distinct(places: impl Iterator<Item = (DVec3, bool)>) -> Vec<(DVec3, bool)> {
    let mut places: Vec<_> = places.collect();
    let key = |x: DVec3| x.to_array();
    places.sort_by(|a, b| {
        let (a, b) = (key(a.0), key(b.0));
        a.partial_cmp(&b).unwrap_or(std::cmp::Ordering::Equal)
    });
    places.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 &= next.1;
        }
        same
    });
    places
}

/// A cell of a grid.
#[derive(Default)]
struct Cell {
    places: Vec<usize>,
    is_reached: bool,
}

/// The clumps of distinct places within a box. They are connected through adjacent cells of half the side, a
/// quarter and so on, the smallest such that the median place shares its cell with [`FILLED`].
fn clumps(places: &[(DVec3, bool)], bounds: (DVec3, DVec3)) -> Option<Vec<Clump>> {
    /// Halvings at which places are no longer told apart.
    const MOST: i32 = 48;
    let cell_of =
        |x: DVec3, side: f64| ((x - bounds.0) / side).floor().to_array().map(|n| n as i64);
    let is_filled = |&side: &f64| {
        let mut all: Vec<_> = places.iter().map(|&(x, _)| cell_of(x, side)).collect();
        all.sort_unstable();
        let mut counts: Vec<_> = all.chunk_by(|a, b| a == b).map(<[_]>::len).collect();
        counts.sort_unstable();
        let mut below = 0;
        let median = counts.into_iter().find(|count| {
            below += count;
            2 * below >= places.len()
        });
        median >= Some(FILLED)
    };
    let sides = (1..MOST).map(|k| side(bounds) * 0.5_f64.powi(k));
    let smallest = sides.take_while(is_filled).last()?;
    let mut cells: HashMap<[i64; 3], Cell> = HashMap::new();
    for (i, &(x, _)) in places.iter().enumerate() {
        cells.entry(cell_of(x, smallest)).or_default().places.push(i);
    }

    let total: usize = cells.values().map(|cell| cell.places.len().min(CROWD)).sum();
    // In the order of the places, since that of a hash map differs from run to run.
    let mut starts: Vec<_> = cells.iter().map(|(&at, cell)| (cell.places[0], at)).collect();
    starts.sort_unstable();
    let mut clumps = Vec::new();
    for (first, start) in starts {
        let mut queue = VecDeque::new();
        let reach = |queue: &mut VecDeque<[i64; 3]>, cells: &mut HashMap<_, Cell>, at| {
            let cell = cells.get_mut(&at).filter(|cell| !cell.is_reached)?;
            cell.is_reached = true;
            queue.push_back(at);
            Some(())
        };
        reach(&mut queue, &mut cells, start);
        let mut clump = Clump {
            bounds: (places[first].0, places[first].0),
            size: 0.0,
            share: 0.0,
            is_at_rest: true,
        };
        let mut count = 0.0_f64;
        while let Some(at) = queue.pop_front() {
            let cell = &cells[&at];
            count += 1.0;
            clump.share += cell.places.len().min(CROWD) as f64 / total as f64;
            for &(x, is_at_rest) in cell.places.iter().map(|&i| &places[i]) {
                clump.bounds = united(clump.bounds, (x, x));
                clump.is_at_rest &= is_at_rest;
            }
            for next in around(at) {
                reach(&mut queue, &mut cells, next);
            }
        }
        if count > 0.0 {
            clump.size = smallest * count.cbrt();
            clumps.push(clump);
        }
    }
    Some(clumps)
}

/// The cell and its neighbours.
fn around(at: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (0..27).map(move |i| {
        let step = [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1];
        [0, 1, 2].map(|axis| at[axis].saturating_add(step[axis]))
    })
}

/// Flood fill through occupied cells of this `side`, from those of particles within the box `near`. The result tells
/// whether a position outside lies in a reached cell.
fn connected(
    count: usize,
    place: &(impl Fn(usize) -> DVec3 + Sync),
    near: (DVec3, DVec3),
    side: f64,
) -> impl Fn(DVec3) -> bool + Sync {
    let cell = move |x: DVec3| ((x - near.0) / side).floor().to_array().map(|n| n as i64);
    // Cells further in have no neighbour outside.
    let inner = (near.0 + 2.0 * side, near.1 - 2.0 * side);
    let all = (0..count).into_par_iter().with_min_len(4096).map(place);
    let outer: Vec<DVec3> = all.filter(|&x| !holds(inner, x)).collect();
    let mut reached: HashMap<[i64; 3], bool> = HashMap::new();
    for x in outer {
        *reached.entry(cell(x)).or_default() |= holds(near, x);
    }
    let first = reached.iter().filter(|(_, is_reached)| **is_reached);
    let mut queue: VecDeque<[i64; 3]> = first.map(|(&at, _)| at).collect();
    while let Some(at) = queue.pop_front() {
        for next in around(at) {
            if let Some(seen) = reached.get_mut(&next)
                && !*seen
            {
                *seen = true;
                queue.push_back(next);
            }
        }
    }
    move |x| reached.get(&cell(x)).copied().unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body of water of 20 × 15 × 10 particles, spacing 0.02 m, with a wavy surface, jittered.
    fn pool() -> Vec<DVec3> {
        let cells = (0..20 * 15 * 10)
            .map(|i| DVec3::new(f64::from(i % 20), f64::from(i / 20 % 15), f64::from(i / 300)));
        let wet = cells.filter(|x| x.y < 11.0 + 3.0 * (0.4 * x.x).sin());
        let jitter = |x: DVec3| {
            DVec3::new((37.0 * x.y + x.z).sin(), (51.0 * x.z + x.x).sin(), (29.0 * x.x + x.y).sin())
        };
        wet.map(|x| 0.02 * (x + 0.2 * jitter(x))).collect()
    }

    fn lattice(size: [i32; 3], spacing: f64, corner: DVec3) -> Vec<DVec3> {
        let [nx, ny, nz] = size;
        let cells = (0..nx * ny * nz).map(|i| [i % nx, i / nx % ny, i / (nx * ny)]);
        cells.map(|cell| corner + spacing * DVec3::from(cell.map(f64::from))).collect()
    }

    fn moving(places: &[DVec3]) -> Bulk {
        bulk(places.len(), |i| places[i], |_| false).unwrap()
    }

    /// Particles that wait far away, however many and however they lie, are not of the bulk.
    #[test]
    fn parked_particles_are_lost() {
        let pool = pool();
        let third = 3 * pool.len() as i32 / 7;
        let far = DVec3::splat(1000.0);
        let at = |x: DVec3, count: i32| vec![x; count as usize];
        let parked: [(&str, Vec<DVec3>); 10] = [
            ("one in a hundred at a point", at(far, pool.len() as i32 / 99)),
            ("a third at a point", at(far, third)),
            ("nine tenths at a point", at(-far, 9 * pool.len() as i32)),
            (
                "at two points",
                [at(far, third), at(DVec3::new(0.0, -500.0, 3.0), third / 2)].concat(),
            ),
            ("in a dense line", lattice([third, 1, 1], 0.02, far)),
            ("in a sparse line", lattice([third, 1, 1], 1.0, DVec3::new(5.0, 0.0, 0.0))),
            ("in a lattice", lattice([12, 12, third / 144], 0.02, far)),
            ("in a sparse lattice", lattice([12, 12, third / 144], 1.0, far)),
            ("in a plane", lattice([40, third / 40, 1], 0.5, DVec3::new(30.0, -2.0, 0.0))),
            ("at 1e6", at(DVec3::new(0.0, 1e6, 0.0), 1)),
        ];
        let whole = moving(&pool);
        assert_eq!((whole.outside, whole.lost), (0, None));
        for (name, parked) in parked {
            // Before the liquid, since the order in the file must not matter.
            let all = [parked.clone(), pool.clone()].concat();
            let found = moving(&all);
            assert_eq!((found.outside, found.bounds), (parked.len(), whole.bounds), "{name}");
            assert_eq!(found.lost, bounds(parked.into_iter()), "{name}");
        }
        // The liquid is far from the origin, where they wait.
        let away: Vec<_> = pool.iter().map(|&x| x + far).collect();
        let all = [away.clone(), at(DVec3::ZERO, third)].concat();
        assert_eq!(moving(&all).bounds, moving(&away).bounds);
    }

    /// Moving particles are the bulk, though more wait in a lattice as dense as liquid.
    #[test]
    fn what_moves_counts_before_what_is_heavier() {
        let pool = pool();
        let waiting = lattice([20, 20, 20], 0.02, DVec3::new(15.0, 0.0, 0.0));
        let all = [waiting.clone(), pool.clone()].concat();
        let found = bulk(all.len(), |i| all[i], |i| i < waiting.len()).unwrap();
        assert_eq!((found.outside, found.bounds), (waiting.len(), moving(&pool).bounds));
        assert_eq!(moving(&all).outside, 0, "two bodies, as far as is known");
        // A drop falls into a pool at rest, which is at rest before it is hit.
        let drop = lattice([6, 6, 6], 0.02, DVec3::new(0.1, 1.5, 0.1));
        let all = [pool.clone(), drop].concat();
        assert_eq!(bulk(all.len(), |i| all[i], |i| i < pool.len()).unwrap().outside, 0);
    }

    /// All of these are one bulk: two pools, a drop above a pool, a jet, and a spray that gets thinner.
    #[test]
    fn bodies_drops_jets_and_spray_stay() {
        let pool = pool();
        let size = side(moving(&pool).bounds);
        let shifted = |by: DVec3, share: f64| {
            let count = (share * pool.len() as f64) as usize;
            pool[..count].iter().map(|&x| x + by).collect::<Vec<_>>()
        };
        // Golden-angle directions at growing distances.
        let spray = (0..2000).map(|i| {
            let (t, angle) = (f64::from(i) / 2000.0, 2.4 * f64::from(i));
            let ring = DVec3::new(angle.cos(), 0.2 + t, angle.sin());
            0.1 + (0.2 + 1.5 * t * t) * ring
        });
        let others: [(&str, Vec<DVec3>); 5] = [
            ("60 to 40", shifted(DVec3::X * 6.0 * size, 2.0 / 3.0)),
            ("far below", shifted(DVec3::Y * -30.0 * size, 0.5)),
            ("a drop", lattice([3, 3, 3], 0.02, DVec3::new(0.1, 0.28 + 0.9 * size, 0.1))),
            ("a jet", lattice([1, 60, 1], 0.02, DVec3::new(0.1, 0.2, 0.1))),
            ("spray", spray.collect()),
        ];
        for (name, other) in others {
            let all = [pool.clone(), other].concat();
            let found = moving(&all);
            assert_eq!((found.outside, Some(found.bounds)), (0, bounds(all.into_iter())), "{name}");
        }
    }

    /// A sample takes every part of the particles and none twice.
    #[test]
    fn samples_are_even() {
        for (count, most) in [(1, 8), (7, 8), (8, 8), (9, 8), (1000, 64)] {
            let sampled: Vec<_> = sample(count, most).collect();
            assert!(sampled.len() <= most && sampled.is_sorted_by(|a, b| a < b), "{count}");
            assert!(sampled.last() < Some(&count));
            let step = count.div_ceil(most);
            assert!(sampled.iter().enumerate().all(|(k, i)| i / step == k), "{count}");
        }
    }
}
