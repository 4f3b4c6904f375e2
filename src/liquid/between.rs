//! Interpolation of particles between two frames, and concatenation of several fluids.

use std::collections::{HashMap, HashSet};

use glam::{DVec3, Vec3};

use super::bulk::bounds;
use super::particles::{Particles, origin_for_box};

impl Particles {
    /// Upper bound on the bytes that [`Particles::between`] and [`Particles::mixed`] allocate per input
    /// particle: pairs twice, a table of ids, and all attributes.
    #[doc(hidden)]
    pub const MATCHED: usize = 2 * size_of::<Pair>() + 48 + 88;

    /// Interpolates between frames `a` and `b` at `fraction` (0 to 1).
    ///
    /// Particles are matched by id. Without ids, or if many particles share one (a material, a phase),
    /// they are matched by index, provided that both frames have equally many and that most
    /// displacements are plausible (by the velocities, or small against the liquid's extent); otherwise
    /// the result is the nearer frame.
    ///
    /// A matched particle follows the cubic Hermite curve of its positions and velocities, or a straight
    /// line without velocities: ballistic flight is exact. The time between the frames is the
    /// least-squares fit of displacements to mean velocities. A particle that only one frame has exists
    /// for the half of the interval next to that frame and moves linearly. So does a particle that
    /// jumps, through a periodic border or because its id was reused. At 0 and 1 the result equals that
    /// frame.
    pub fn between(a: &Self, b: &Self, fraction: f64) -> Self {
        if fraction <= 0.0 {
            return a.clone();
        }
        if fraction >= 1.0 {
            return b.clone();
        }
        let nearer = |fraction: f64| if fraction < 0.5 { a.clone() } else { b.clone() };
        let (mut pairs, matched_by_id) = match (&a.ids, &b.ids) {
            (Some(from), Some(to)) if are_distinct(from) && are_distinct(to) => {
                (by_id(from, to), true)
            }
            _ if a.len() == b.len() => ((0..a.len()).map(|i| (Some(i), Some(i))).collect(), false),
            _ => return nearer(fraction),
        };
        let apart = b.origin - a.origin;
        let move_to = |i: usize, j: usize| apart + (b.positions[j] - a.positions[i]).as_dvec3();
        let motion = Displacements::new(a, b, &pairs, move_to);
        if !matched_by_id && !motion.is_plausible() {
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
            values: floats(|particles| &particles.values),
            colors: mixed(&pairs, a.colors.as_deref(), b.colors.as_deref(), |x, y| x.lerp(y, f)),
            is_hull: a.is_hull,
        }
    }

    /// Concatenates the parts of one liquid. Keeps the attributes that all parts have.
    pub fn joined(parts: &[Self]) -> Self {
        Self { ids: joined(parts, |part| &part.ids), ..Self::concatenated(parts) }
    }

    /// Concatenates several fluids and assigns each particle the index of its fluid. Keeps the attributes
    /// that all fluids have, except ids, which may collide between fluids.
    pub fn mixed(fluids: &[Self]) -> Self {
        let numbers = (0..).zip(fluids).flat_map(|(k, fluid)| vec![k; fluid.positions.len()]);
        Self { fluids: Some(numbers.collect()), ..Self::concatenated(fluids) }
    }

    /// Concatenates everything but ids and fluids.
    fn concatenated(fluids: &[Self]) -> Self {
        let boxes = fluids.iter().filter_map(Self::bulk).map(|bulk| bulk.bounds);
        let all = bounds(boxes.flat_map(|(min, max)| [min, max]));
        let origin = all.map_or(DVec3::ZERO, origin_for_box);
        let filled = || fluids.iter().filter(|fluid| !fluid.is_empty());
        let same = filled().all(|fluid| fluid.origin == origin);
        let position = |fluid: &Self, x: Vec3| {
            if same { x } else { (fluid.origin - origin + x.as_dvec3()).as_vec3() }
        };
        Self {
            origin,
            positions: fluids
                .iter()
                .flat_map(|fluid| fluid.positions.iter().map(|&x| position(fluid, x)))
                .collect(),
            velocities: joined(fluids, |fluid| &fluid.velocities),
            densities: joined(fluids, |fluid| &fluid.densities),
            radii: joined(fluids, |fluid| &fluid.radii),
            ids: None,
            ellipsoids: joined(fluids, |fluid| &fluid.ellipsoids),
            values: joined(fluids, |fluid| &fluid.values),
            colors: joined(fluids, |fluid| &fluid.colors),
            fluids: None,
            is_hull: fluids.iter().any(|fluid| fluid.is_hull),
        }
    }
}

type Pair = (Option<usize>, Option<usize>);

/// Whether at least nine in ten ids are distinct.
fn are_distinct(ids: &[i64]) -> bool {
    let distinct = ids.iter().collect::<HashSet<_>>().len();
    10 * distinct >= 9 * ids.len()
}

/// Matches the particles of two frames: those of the first in its order, then those that only the
/// second has. The last of several particles with one id is matched.
fn by_id(from: &[i64], to: &[i64]) -> Vec<Pair> {
    let mut places: HashMap<i64, usize> = to.iter().copied().zip(0..).collect();
    let mut pairs: Vec<Pair> =
        from.iter().zip(0..).map(|(id, i)| (Some(i), places.remove(id))).collect();
    let mut rest: Vec<usize> = places.into_values().collect();
    rest.sort_unstable();
    pairs.extend(rest.into_iter().map(|j| (None, Some(j))));
    pairs
}

/// Robust statistics of the displacements of matched particles, by which jumps are detected.
struct Displacements<'a> {
    velocities: Option<[&'a [Vec3]; 2]>,
    /// Time between the frames, s; 0 if it cannot be derived from velocities.
    duration: f64,
    /// Displacement common to all particles, m; 0 if `duration` is known.
    shared: DVec3,
    /// Median distance of a particle from its predicted position, m.
    median_deviation: f64,
    /// Approximate particle spacing, m.
    spacing: f64,
    /// Diagonal of the box that contains most particles, m.
    extent: f64,
    /// Whether there are too few particles for statistics.
    too_few: bool,
}

/// Smallest number of particles for statistics.
const MIN_SAMPLES: usize = 16;

/// Number of pairs sampled for medians, evenly over all.
const SAMPLES: usize = 10_000;

/// Deviation that is tolerated, as a multiple of the median deviation.
const MEDIANS: f64 = 8.0;
/// Deviation that is always tolerated, in particle spacings.
const SPACINGS: f64 = 2.0;
/// Displacement that is tolerated without velocities, as a share of the extent.
const SHARE: f64 = 0.1;

impl<'a> Displacements<'a> {
    fn new(
        a: &'a Particles,
        b: &'a Particles,
        pairs: &[Pair],
        displacement: impl Fn(usize, usize) -> DVec3,
    ) -> Self {
        let step = pairs.len().div_ceil(SAMPLES).max(1);
        let both = pairs.iter().filter_map(|&(i, j)| Some((i?, j?)));
        let sample: Vec<_> = both
            .step_by(step)
            .map(|(i, j)| (i, j, displacement(i, j)))
            .filter(|(.., d)| d.is_finite())
            .collect();
        let velocities = a.velocities.as_deref().zip(b.velocities.as_deref());
        let mut motion = Self {
            velocities: velocities.map(|(from, to)| [from, to]),
            duration: 0.0,
            shared: DVec3::ZERO,
            median_deviation: 0.0,
            spacing: 0.0,
            extent: 0.0,
            too_few: sample.len() < MIN_SAMPLES,
        };
        motion.duration = motion.robust_duration(&sample);
        if motion.duration == 0.0 {
            let axis = |k: usize| median(sample.iter().map(|(.., d)| d[k]).collect());
            motion.shared = DVec3::new(axis(0), axis(1), axis(2));
        }
        let deviations = sample.iter().map(|&(i, j, d)| motion.deviation(i, j, d)).collect();
        motion.median_deviation = median(deviations);
        let sides = [0, 1, 2].map(|k| {
            let mut x: Vec<_> =
                sample.iter().map(|&(i, ..)| f64::from(a.positions[i][k])).collect();
            x.sort_by(f64::total_cmp);
            let outer = x.len() / 20;
            x.get(outer).map_or(0.0, |low| x[x.len() - 1 - outer] - low)
        });
        motion.extent = DVec3::from(sides).length();
        // Ignores the thin directions of sheets and lines.
        let long = sides.into_iter().filter(|&side| side > 1e-3 * motion.extent);
        let (volume, dimensions) = long.fold((1.0, 0.0), |(v, n), side| (v * side, n + 1.0));
        if dimensions > 0.0 {
            motion.spacing = f64::powf(volume / pairs.len() as f64, 1.0 / dimensions);
        }
        motion
    }

    /// Estimates the [`duration`] as the weighted median over particles, which jumps do not affect.
    fn robust_duration(&self, sample: &[(usize, usize, DVec3)]) -> f64 {
        let mut estimates: Vec<_> = sample
            .iter()
            .filter_map(|&(i, j, d)| {
                let v = self.mean_velocity(i, j)?;
                let weight = v.length_squared();
                (weight > 0.0 && weight.is_finite()).then(|| (d.dot(v) / weight, weight))
            })
            .collect();
        estimates.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut left = 0.5 * estimates.iter().map(|(_, weight)| weight).sum::<f64>();
        let median = estimates.iter().find(|(_, weight)| {
            left -= weight;
            left <= 0.0
        });
        median.map_or(0.0, |&(duration, _)| duration.max(0.0))
    }

    fn mean_velocity(&self, i: usize, j: usize) -> Option<DVec3> {
        self.velocities.map(|[from, to]| 0.5 * (from[i] + to[j]).as_dvec3())
    }

    /// Distance of a particle from its predicted position, m.
    fn deviation(&self, i: usize, j: usize, displacement: DVec3) -> f64 {
        let own = self.mean_velocity(i, j).map_or(DVec3::ZERO, |v| self.duration * v);
        (displacement - self.shared - own).length()
    }

    /// Whether matching by index is plausible: most particles are near their predicted positions.
    fn is_plausible(&self) -> bool {
        let tolerance = f64::max(SPACINGS * self.spacing, SHARE * self.extent);
        self.too_few || self.median_deviation <= tolerance
    }

    /// Whether a particle deviates too far from its predicted position to have moved there.
    fn is_jump(&self, i: usize, j: usize, displacement: DVec3) -> bool {
        let own = match self.velocities {
            Some([from, to]) if self.duration > 0.0 => {
                // The particle may reverse its direction on the way.
                self.duration * f64::from(from[i].length() + to[j].length())
            }
            _ => SHARE * self.extent,
        };
        let tolerance = MEDIANS * self.median_deviation + SPACINGS * self.spacing + own;
        !self.too_few && self.deviation(i, j, displacement) > tolerance
    }
}

/// Median; 0 for an empty list.
fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Least-squares time between two frames, s: Σ d·v / Σ v·v over the matched particles, with displacement
/// d and mean velocity v; 0 if nothing moves, or not along the velocities.
fn duration(
    pairs: &[Pair],
    displacement: impl Fn(usize, usize) -> DVec3,
    from: &[Vec3],
    to: &[Vec3],
) -> f64 {
    let (mut along, mut squared) = (0.0, 0.0);
    for &(i, j) in pairs {
        let (Some(i), Some(j)) = (i, j) else { continue };
        let v = 0.5 * (from[i] + to[j]).as_dvec3();
        along += displacement(i, j).dot(v);
        squared += v.length_squared();
    }
    let duration = along / squared;
    if duration > 0.0 && duration.is_finite() { duration } else { 0.0 }
}

/// Cubic Hermite curve from 0 to `end` over t from 0 to 1, with end velocities `v0` and `v1` per unit
/// of t.
fn hermite(end: DVec3, v0: DVec3, v1: DVec3, t: f64) -> DVec3 {
    let (t2, t3) = (t * t, t * t * t);
    (3.0 * t2 - 2.0 * t3) * end + (t3 - 2.0 * t2 + t) * v0 + (t3 - t2) * v1
}

/// Interpolates an attribute over the pairs, if both frames have it.
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

/// Concatenates an attribute, if all non-empty fluids have it.
fn joined<T: Copy>(fluids: &[Particles], of: fn(&Particles) -> &Option<Vec<T>>) -> Option<Vec<T>> {
    let filled = fluids.iter().filter(|fluid| !fluid.is_empty());
    let parts: Option<Vec<&Vec<T>>> = filled.map(|fluid| of(fluid).as_ref()).collect();
    parts
        .filter(|parts| !parts.is_empty())
        .map(|parts| parts.into_iter().flatten().copied().collect())
}
