//! Particles between two frames, and of several fluids together.

use std::collections::{HashMap, HashSet};

use glam::{DVec3, Vec3};

use super::particles::{Particles, origin_for};

impl Particles {
    /// Bytes that [`Particles::between`] and [`Particles::mixed`] take for each particle that they are
    /// given, at most: pairs twice, a table of ids, and all attributes.
    #[doc(hidden)]
    pub const MATCHED: usize = 2 * size_of::<Pair>() + 48 + 72;

    /// Particles at `fraction` (0 to 1) of the way from frame `a` to frame `b`.
    ///
    /// Particles are matched by their ids; without ids, or if these are the same for many (a material, a
    /// phase), by their order where both frames have as many and most move as far as particles do (by
    /// their velocities, or little against the liquid's extent); else the nearer frame is shown. A
    /// matched particle follows the cubic that has its two
    /// places and velocities (Hermite), or without velocities a straight line: so ballistic flight is
    /// exact. How much time lies between the frames is found from what has moved: the least squares of
    /// displacement against mean velocity. A particle that only one frame has is there for the half
    /// that is nearer to it, and flies straight on. So is one that jumps: through a periodic border,
    /// or because its id was given to another. At 0 and at 1 the result holds the particles of that
    /// frame, as they are.
    pub fn between(a: &Self, b: &Self, fraction: f64) -> Self {
        if fraction <= 0.0 {
            return a.clone();
        }
        if fraction >= 1.0 {
            return b.clone();
        }
        let nearer = |fraction: f64| if fraction < 0.5 { a.clone() } else { b.clone() };
        let (mut pairs, told) = match (&a.ids, &b.ids) {
            (Some(from), Some(to)) if are_distinct(from) && are_distinct(to) => {
                (by_id(from, to), true)
            }
            _ if a.len() == b.len() => ((0..a.len()).map(|i| (Some(i), Some(i))).collect(), false),
            // Nothing says which is which.
            _ => return nearer(fraction),
        };
        let apart = b.origin - a.origin;
        let move_to = |i: usize, j: usize| apart + (b.positions[j] - a.positions[i]).as_dvec3();
        let motion = Motion::new(a, b, &pairs, move_to);
        if !told && !motion.is_plausible() {
            return nearer(fraction);
        }
        for pair in &mut pairs {
            if let (Some(i), Some(j)) = *pair
                && motion.is_jump(i, j, move_to(i, j))
            {
                *pair = if fraction < 0.5 { (Some(i), None) } else { (None, Some(j)) };
            }
        }
        let pairs: Vec<_> = pairs
            .into_iter()
            .filter(|pair| match pair {
                (Some(_), Some(_)) => true,
                (Some(_), None) => fraction < 0.5,
                (None, _) => fraction >= 0.5,
            })
            .collect();
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

/// Whether numbers tell particles apart, but for a few.
fn are_distinct(ids: &[i64]) -> bool {
    let distinct = ids.iter().collect::<HashSet<_>>().len();
    10 * distinct >= 9 * ids.len()
}

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

/// How far matched particles move, as most of them do: what tells those that jump.
struct Motion<'a> {
    velocities: Option<[&'a [Vec3]; 2]>,
    /// Time between the frames, s; 0 if velocities do not tell.
    duration: f64,
    /// The motion that all share, m; 0 where velocities tell.
    shared: DVec3,
    /// Median distance of a particle from where it is expected, m.
    usual: f64,
    /// About the distance between two particles, m.
    spacing: f64,
    /// The diagonal of the box that most particles are in, m.
    extent: f64,
    /// Too few particles to tell what is usual.
    few: bool,
}

/// Particles from which on most of them tell what is usual.
const FEW: usize = 16;

/// Pairs that are looked at for medians, evenly over all.
const SAMPLES: usize = 10_000;

/// Median distances from where particles are expected, beyond which one jumps.
const USUAL: f64 = 8.0;
/// Spacings that a particle may always be off.
const SPACINGS: f64 = 2.0;
/// Share of the extent that particles may move without velocities.
const SHARE: f64 = 0.1;

impl<'a> Motion<'a> {
    fn new(
        a: &'a Particles,
        b: &'a Particles,
        pairs: &[Pair],
        moved: impl Fn(usize, usize) -> DVec3,
    ) -> Self {
        let step = pairs.len().div_ceil(SAMPLES).max(1);
        let both = pairs.iter().filter_map(|&(i, j)| Some((i?, j?)));
        let sample: Vec<_> = both
            .step_by(step)
            .map(|(i, j)| (i, j, moved(i, j)))
            .filter(|(.., d)| d.is_finite())
            .collect();
        let velocities = a.velocities.as_deref().zip(b.velocities.as_deref());
        let mut motion = Self {
            velocities: velocities.map(|(from, to)| [from, to]),
            duration: 0.0,
            shared: DVec3::ZERO,
            usual: 0.0,
            spacing: 0.0,
            extent: 0.0,
            few: sample.len() < FEW,
        };
        motion.duration = motion.robust_duration(&sample);
        if motion.duration == 0.0 {
            let axis = |k: usize| median(sample.iter().map(|(.., d)| d[k]).collect());
            motion.shared = DVec3::new(axis(0), axis(1), axis(2));
        }
        motion.usual = median(sample.iter().map(|&(i, j, d)| motion.off(i, j, d)).collect());
        let sides = [0, 1, 2].map(|k| {
            let mut x: Vec<_> =
                sample.iter().map(|&(i, ..)| f64::from(a.positions[i][k])).collect();
            x.sort_by(f64::total_cmp);
            let outer = x.len() / 20;
            x.get(outer).map_or(0.0, |low| x[x.len() - 1 - outer] - low)
        });
        motion.extent = DVec3::from(sides).length();
        // Of a sheet or a line, in the directions that it has.
        let long = sides.into_iter().filter(|&side| side > 1e-3 * motion.extent);
        let (volume, dimensions) = long.fold((1.0, 0.0), |(v, n), side| (v * side, n + 1.0));
        if dimensions > 0.0 {
            motion.spacing = f64::powf(volume / pairs.len() as f64, 1.0 / dimensions);
        }
        motion
    }

    /// As [`duration`], by the weighted median of what each particle says: however far some jump.
    fn robust_duration(&self, sample: &[(usize, usize, DVec3)]) -> f64 {
        let mut said: Vec<_> = sample
            .iter()
            .filter_map(|&(i, j, d)| {
                let v = self.mean_velocity(i, j)?;
                let weight = v.length_squared();
                (weight > 0.0 && weight.is_finite()).then(|| (d.dot(v) / weight, weight))
            })
            .collect();
        said.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut left = 0.5 * said.iter().map(|(_, weight)| weight).sum::<f64>();
        let median = said.iter().find(|(_, weight)| {
            left -= weight;
            left <= 0.0
        });
        median.map_or(0.0, |&(duration, _)| duration.max(0.0))
    }

    fn mean_velocity(&self, i: usize, j: usize) -> Option<DVec3> {
        self.velocities.map(|[from, to]| 0.5 * (from[i] + to[j]).as_dvec3())
    }

    /// How far a particle is from where it is expected, m.
    fn off(&self, i: usize, j: usize, moved: DVec3) -> f64 {
        let own = self.mean_velocity(i, j).map_or(DVec3::ZERO, |v| self.duration * v);
        (moved - self.shared - own).length()
    }

    /// Whether particles of one place in the files may be the same: most are where they are expected.
    fn is_plausible(&self) -> bool {
        self.few || self.usual <= f64::max(SPACINGS * self.spacing, SHARE * self.extent)
    }

    /// Whether a particle is farther from where it is expected than anything that flows.
    fn is_jump(&self, i: usize, j: usize, moved: DVec3) -> bool {
        let own = match self.velocities {
            Some([from, to]) if self.duration > 0.0 => {
                // It may turn round on its way.
                self.duration * f64::from(from[i].length() + to[j].length())
            }
            _ => SHARE * self.extent,
        };
        let most = USUAL * self.usual + SPACINGS * self.spacing + own;
        !self.few && self.off(i, j, moved) > most
    }
}

/// The middle value; 0 of none.
fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
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
