//! Particles between two frames, and of several fluids together.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::{Particles, origin_for};

impl Particles {
    /// Particles at `fraction` (0 to 1) of the way from frame `a` to frame `b`.
    ///
    /// Particles are matched by their ids; without ids, by their order where both frames have as many.
    /// A matched particle follows the cubic that has its two places and velocities (Hermite), or
    /// without velocities a straight line: so ballistic flight is exact. How much time lies between
    /// the frames is found from what has moved: the least squares of displacement against mean
    /// velocity. A particle that only one frame has is there for the half that is nearer to it, and
    /// flies straight on. At 0 and at 1 the result holds the particles of that frame, as they are.
    pub fn between(a: &Self, b: &Self, fraction: f64) -> Self {
        if fraction <= 0.0 {
            return a.clone();
        }
        if fraction >= 1.0 {
            return b.clone();
        }
        let pairs = match (&a.ids, &b.ids) {
            (Some(from), Some(to)) => by_id(from, to),
            _ if a.len() == b.len() => (0..a.len()).map(|i| (Some(i), Some(i))).collect(),
            // Nothing says which is which: the nearer frame.
            _ => return if fraction < 0.5 { a.clone() } else { b.clone() },
        };
        let pairs: Vec<_> = pairs
            .into_iter()
            .filter(|pair| match pair {
                (Some(_), Some(_)) => true,
                (Some(_), None) => fraction < 0.5,
                (None, _) => fraction >= 0.5,
            })
            .collect();
        let apart = b.origin - a.origin;
        let move_to = |i: usize, j: usize| apart + (b.positions[j] - a.positions[i]).as_dvec3();
        let duration = match (&a.velocities, &b.velocities) {
            (Some(from), Some(to)) => duration(&pairs, move_to, from, to),
            _ => 0.0,
        };
        let velocity = |of: &Self, i: usize| match &of.velocities {
            Some(velocities) => duration * velocities[i].as_dvec3(),
            None => DVec3::ZERO,
        };
        let straight = duration == 0.0;
        let position = |&pair: &(Option<usize>, Option<usize>)| match pair {
            (Some(i), Some(j)) => {
                let (v0, v1) = (velocity(a, i), velocity(b, j));
                let offset = if straight {
                    fraction * move_to(i, j)
                } else {
                    hermite(move_to(i, j), v0, v1, fraction)
                };
                a.positions[i] + offset.as_vec3()
            }
            (Some(i), None) => a.positions[i] + (fraction * velocity(a, i)).as_vec3(),
            (None, Some(j)) => {
                let back = (fraction - 1.0) * velocity(b, j) + apart;
                b.positions[j] + back.as_vec3()
            }
            (None, None) => Vec3::ZERO,
        };
        let f = fraction as f32;
        let floats = |of: fn(&Self) -> &Option<Vec<f32>>| {
            mixed(&pairs, of(a).as_deref(), of(b).as_deref(), |x, y| x + f * (y - x))
        };
        Self {
            origin: a.origin,
            positions: pairs.iter().map(position).collect(),
            velocities: mixed(&pairs, a.velocities.as_deref(), b.velocities.as_deref(), |x, y| {
                x.lerp(y, f)
            }),
            densities: floats(|particles| &particles.densities),
            radii: floats(|particles| &particles.radii),
            ids: mixed(&pairs, a.ids.as_deref(), b.ids.as_deref(), |id, _| id),
            fluids: mixed(&pairs, a.fluids.as_deref(), b.fluids.as_deref(), |fluid, _| fluid),
            ellipsoids: mixed(&pairs, a.ellipsoids.as_deref(), b.ellipsoids.as_deref(), |a, b| {
                if fraction < 0.5 { a } else { b }
            }),
        }
    }

    /// The particles of several fluids, one after another, each with the number of its fluid. Of the
    /// attributes those that all have; ids are left out, for two fluids may use the same.
    pub fn mixed(fluids: &[Self]) -> Self {
        let places = fluids.iter().filter_map(Self::bounds).flat_map(|(min, max)| [min, max]);
        let origin = origin_for(places);
        let filled = || fluids.iter().filter(|fluid| !fluid.is_empty());
        let same = filled().all(|fluid| fluid.origin == origin);
        let position = |fluid: &Self, x: Vec3| {
            if same { x } else { (fluid.origin - origin + x.as_dvec3()).as_vec3() }
        };
        let all = fluids.iter();
        Self {
            origin,
            positions: all
                .clone()
                .flat_map(|fluid| fluid.positions.iter().map(|&x| position(fluid, x)))
                .collect(),
            velocities: joined(fluids, |fluid| &fluid.velocities),
            densities: joined(fluids, |fluid| &fluid.densities),
            radii: joined(fluids, |fluid| &fluid.radii),
            ids: None,
            ellipsoids: joined(fluids, |fluid| &fluid.ellipsoids),
            fluids: Some(
                (0..).zip(all).flat_map(|(k, fluid)| vec![k; fluid.positions.len()]).collect(),
            ),
        }
    }
}

type Pair = (Option<usize>, Option<usize>);

/// The particles of both frames, those of the first in its order, then those that only the second
/// has. Of several with one id the last counts.
fn by_id(from: &[i64], to: &[i64]) -> Vec<Pair> {
    let mut places: HashMap<i64, usize> = to.iter().copied().zip(0..).collect();
    let mut pairs: Vec<Pair> =
        from.iter().zip(0..).map(|(id, i)| (Some(i), places.remove(id))).collect();
    let mut rest: Vec<usize> = places.into_values().collect();
    rest.sort_unstable();
    pairs.extend(rest.into_iter().map(|j| (None, Some(j))));
    pairs
}

/// The time between two frames, s: Σ d·v / Σ v·v over the matched particles, d how far one has moved
/// and v the mean of its velocities; 0 if nothing moves, or not the way it says.
fn duration(
    pairs: &[Pair],
    moved: impl Fn(usize, usize) -> DVec3,
    from: &[Vec3],
    to: &[Vec3],
) -> f64 {
    let (mut along, mut squared) = (0.0, 0.0);
    for &(i, j) in pairs {
        let (Some(i), Some(j)) = (i, j) else { continue };
        let v = 0.5 * (from[i] + to[j]).as_dvec3();
        along += moved(i, j).dot(v);
        squared += v.length_squared();
    }
    let duration = along / squared;
    if duration > 0.0 && duration.is_finite() { duration } else { 0.0 }
}

/// The cubic from 0 to `end` over t from 0 to 1, with the velocities `v0` and `v1` per unit of t.
fn hermite(end: DVec3, v0: DVec3, v1: DVec3, t: f64) -> DVec3 {
    let (t2, t3) = (t * t, t * t * t);
    (3.0 * t2 - 2.0 * t3) * end + (t3 - 2.0 * t2 + t) * v0 + (t3 - t2) * v1
}

/// An attribute of the matched particles, if both frames have it.
fn mixed<T: Copy>(
    pairs: &[Pair],
    a: Option<&[T]>,
    b: Option<&[T]>,
    mix: impl Fn(T, T) -> T,
) -> Option<Vec<T>> {
    let (a, b) = (a?, b?);
    let values = pairs.iter().filter_map(|&pair| match pair {
        (Some(i), Some(j)) => Some(mix(a[i], b[j])),
        (Some(i), None) => Some(a[i]),
        (None, j) => j.map(|j| b[j]),
    });
    Some(values.collect())
}

/// An attribute of all particles, if all fluids that have particles have it.
fn joined<T: Copy>(fluids: &[Particles], of: fn(&Particles) -> &Option<Vec<T>>) -> Option<Vec<T>> {
    let filled = fluids.iter().filter(|fluid| !fluid.is_empty());
    let parts: Option<Vec<&Vec<T>>> = filled.map(|fluid| of(fluid).as_ref()).collect();
    parts
        .filter(|parts| !parts.is_empty())
        .map(|parts| parts.into_iter().flatten().copied().collect())
}
