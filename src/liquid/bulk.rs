//! Robust bounding box of a particle set, on which cameras, floors and light views are based.
//!
//! Simulations lose particles: one leaks through a wall and falls for ever, a time step that is too
//! long ejects a few. In the bounding box of all particles the liquid is then a point, and a picture or
//! map of that box shows nothing. Particles that are near the others or connected to them are not
//! outliers, however few they are: a drop above a splash, the tip of a jet.

use std::collections::{HashMap, VecDeque};

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Bounding box of the bulk of a particle set, in world space, m.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Bulk {
    /// Minimum and maximum corner of the bounding box of the centres.
    pub bounds: (DVec3, DVec3),
    /// Number of centres outside the box.
    pub outside: usize,
    /// Minimum and maximum corner of the core, which spans the middle 98 % of the centres along each
    /// axis.
    pub core: (DVec3, DVec3),
}

/// Share of the particles below and above the core along each axis. A body of more particles than this
/// is never an outlier.
const TAIL: f64 = 0.01;

/// Smaller sets have no outliers: a single particle is too large a share of them.
const MIN_COUNT: usize = 32;

/// Positions sampled to find the core.
const SAMPLES: usize = 16384;

/// Distance from the core within which particles belong to the bulk even if unconnected, as a multiple
/// of the core's longest side. The core thus fills at least a third of a picture of the bulk.
const REACH: f64 = 1.0;

/// Cells along the core's longest side. Particles in the same or in adjacent cells are connected.
const CELLS: f64 = 16.0;

/// Finds the bulk of `count` particles; `None` without particles.
///
/// The core spans the middle 98 % of the particles along each axis. The bulk is the bounding box of all
/// particles that
///
/// - are within a distance of the core's longest side from the core, or
/// - are connected to the core by particles no further apart than about a sixteenth of that side.
///
/// If these are all particles, the box is exactly their bounding box. Percentiles thus cut off neither
/// the outermost particles of a compact cloud nor a thin jet. Two bodies far from each other are both
/// in the bulk if each has more than 1 % of the particles.
pub fn bulk(count: usize, place: impl Fn(usize) -> DVec3) -> Option<Bulk> {
    let bounds = bounds((0..count).map(&place))?;
    let all = Bulk { bounds, outside: 0, core: bounds };
    if count < MIN_COUNT {
        return Some(all);
    }
    let core = core(count, &place);
    let side = (core.1 - core.0).max_element();
    let near = (core.0 - REACH * side, core.1 + REACH * side);
    if side <= 0.0 || holds(near, bounds.0) && holds(near, bounds.1) {
        return Some(Bulk { core, ..all });
    }
    let connected = connected(count, &place, core, side / CELLS);
    let kept = (0..count).map(&place).filter(|&x| holds(near, x) || connected(x));
    let bounds = self::bounds(kept)?;
    let outside = (0..count).filter(|&i| !holds(bounds, place(i))).count();
    Some(Bulk { bounds, outside, core })
}

/// Minimum and maximum corner of the bounding box of positions; `None` without any.
#[doc(hidden)]
pub fn bounds(mut places: impl Iterator<Item = DVec3>) -> Option<(DVec3, DVec3)> {
    let first = places.next()?;
    Some(places.fold((first, first), |(min, max), p| (min.min(p), max.max(p))))
}

impl Bulk {
    /// Whether the box contains a position.
    pub fn holds(&self, place: DVec3) -> bool {
        holds(self.bounds, place)
    }
}

fn holds((min, max): (DVec3, DVec3), place: DVec3) -> bool {
    min.cmple(place).all() && place.cmple(max).all()
}

/// Bounding box without the lowest and highest hundredth along each axis.
fn core(count: usize, place: &impl Fn(usize) -> DVec3) -> (DVec3, DVec3) {
    let step = count.div_ceil(SAMPLES);
    let sample: Vec<_> = (0..count).step_by(step).map(place).collect();
    let tail = (TAIL * sample.len() as f64).ceil() as usize;
    let along = |axis: usize| {
        let mut sorted: Vec<_> = sample.iter().map(|x| x[axis]).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        (sorted[tail], sorted[sorted.len() - 1 - tail])
    };
    let [x, y, z] = [0, 1, 2].map(along);
    (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1))
}

/// Flood fill from the core through occupied cells of this `side`. The result tells whether a position
/// outside the core lies in a reached cell.
fn connected(
    count: usize,
    place: &impl Fn(usize) -> DVec3,
    core: (DVec3, DVec3),
    side: f64,
) -> impl Fn(DVec3) -> bool {
    // Aligned with the core's minimum corner, so that particles that touch the core are in cells next
    // to it.
    let cell = move |x: DVec3| ((x - core.0) / side).floor().to_array().map(|n| n as i64);
    let last = cell(core.1);
    let mut reached: HashMap<[i64; 3], bool> = HashMap::new();
    let mut queue = VecDeque::new();
    for x in (0..count).map(place).filter(|&x| !holds(core, x)) {
        let at = cell(x);
        reached.entry(at).or_insert_with(|| {
            let beside = (0..3).all(|axis| (-1..=last[axis].saturating_add(1)).contains(&at[axis]));
            if beside {
                queue.push_back(at);
            }
            beside
        });
    }
    while let Some(at) = queue.pop_front() {
        for i in 0..27 {
            let step = [i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1];
            let next = [0, 1, 2].map(|axis| at[axis].saturating_add(step[axis]));
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
