//! Where the bulk of the particles is: the box that cameras, floors and light maps are made for.
//!
//! Simulations lose particles: one leaks through a wall and falls for ever, a time step that is too
//! long throws a few out. In the box around all of them the liquid is a point, and a picture or a
//! map of that box shows nothing. What is near the others, or joined to them, is not lost, however
//! few it is: a drop above a splash, the tip of a jet.

use std::collections::{HashMap, VecDeque};

use glam::DVec3;

/// The box around the bulk of some particles, in world space, m.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Bulk {
    /// Its least and its greatest corner: the box around the centres.
    pub bounds: (DVec3, DVec3),
    /// How many centres lie outside.
    pub outside: usize,
    /// Corners of the core: along each axis it spans the middle 98 % of the centres.
    pub core: (DVec3, DVec3),
}

/// Share of the particles on either side of the core, along each axis. A body of more particles
/// than this is never left out.
const TAIL: f64 = 0.01;

/// Fewer particles are all bulk: one of them is too large a share to be called lost.
const FEW: usize = 32;

/// Places along an axis that tell where the core is.
const SAMPLES: usize = 16384;

/// How far from the core particles belong to the bulk whether or not others lead to them, in
/// longest sides of the core. A picture of the bulk is at most so much wider than the core that
/// the liquid still fills a third of it.
const REACH: f64 = 1.0;

/// Particles are joined if they are in the same cell or in cells that touch, so many along the
/// core's longest side.
const CELLS: f64 = 16.0;

/// The bulk of `count` particles; none without any.
///
/// The core spans along each axis the middle 98 % of the particles. The bulk is the box around
/// all particles that
///
/// - are within one longest side of the core from it, or
/// - are joined to it by particles no further apart than about a sixteenth of that side.
///
/// Where these are all, the box is exactly that around all particles. So percentiles cut nothing
/// off by themselves: neither the outermost particles of a compact cloud nor a thin jet. Two bodies
/// that are far from each other are both in the bulk if each has more than 1 % of the particles.
pub fn bulk(count: usize, place: impl Fn(usize) -> DVec3) -> Option<Bulk> {
    let bounds = bounds((0..count).map(&place))?;
    let all = Bulk { bounds, outside: 0, core: bounds };
    if count < FEW {
        return Some(all);
    }
    let core = core(count, &place);
    let side = (core.1 - core.0).max_element();
    let near = (core.0 - REACH * side, core.1 + REACH * side);
    if side <= 0.0 || holds(near, bounds.0) && holds(near, bounds.1) {
        return Some(Bulk { core, ..all });
    }
    let joined = joined(count, &place, core, side / CELLS);
    let kept = (0..count).map(&place).filter(|&x| holds(near, x) || joined(x));
    let bounds = self::bounds(kept)?;
    let outside = (0..count).filter(|&i| !holds(bounds, place(i))).count();
    Some(Bulk { bounds, outside, core })
}

/// The corners of the box around all places, if there are any.
#[doc(hidden)]
pub fn bounds(mut places: impl Iterator<Item = DVec3>) -> Option<(DVec3, DVec3)> {
    let first = places.next()?;
    Some(places.fold((first, first), |(min, max), p| (min.min(p), max.max(p))))
}

impl Bulk {
    /// Whether a place is in the box.
    pub fn holds(&self, place: DVec3) -> bool {
        holds(self.bounds, place)
    }
}

fn holds((min, max): (DVec3, DVec3), place: DVec3) -> bool {
    min.cmple(place).all() && place.cmple(max).all()
}

/// The box without the lowest and highest hundredth along each axis.
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

/// Whether a chain of particles leads from the core to a particle, through cubes of this `side`.
fn joined(
    count: usize,
    place: &impl Fn(usize) -> DVec3,
    core: (DVec3, DVec3),
    side: f64,
) -> impl Fn(DVec3) -> bool {
    // From the core's edge, so that what touches it is in the cells beside it.
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
