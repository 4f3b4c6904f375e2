//! The axis that points up in particles of which this is not known.

use std::collections::HashMap;

use glam::DVec3;

use super::bulk::sample;
use super::particles::Particles;
use crate::up_axis::Up;

/// Share of the columns above which an end of the liquid is level.
const LEVEL: f64 = 0.85;

/// Share of the columns below which an end of the liquid is uneven.
const UNEVEN: f64 = 0.5;

/// Particles sampled.
const SAMPLES: usize = 65536;

/// Columns that count, at least: fewer are no surface.
const FEWEST: usize = 9;

/// The axis along which the liquid lies on a level floor below an uneven surface, or has a level surface
/// over an uneven floor; else the axis along which an end of it is level at all, as of a calm pool without straight
/// walls: `None` if neither y nor z is such an axis, or if both are.
///
/// Walls are level on both sides, and liquid in the air on neither; so a full box and a single drop tell
/// nothing. An end is level where most of its columns end at the height of the median one, and a column ends at the
/// first particle that has another beside it: one particle in a hundred, wherever it is, changes little of
/// this. `radius` is that of the particles, m.
pub fn likely_up(particles: &Particles, radius: f32) -> Option<Up> {
    let bulk = particles.bulk()?;
    let count = particles.len();
    let places = sample(count, SAMPLES).map(|i| particles.place(i));
    let places: Vec<_> = places.filter(|&x| bulk.holds(x)).collect();
    // Twice the spacing of the sampled particles.
    let share = count as f64 / count.min(SAMPLES) as f64;
    let side = 4.0 * f64::from(radius) * share.cbrt();
    let ends = [level_ends(&places, side, 1)?, level_ends(&places, side, 2)?];
    let alone = |is_up: fn((f64, f64)) -> bool| match ends.map(is_up) {
        [true, false] => Some(Up::Y),
        [false, true] => Some(Up::Z),
        _ => None,
    };
    let is_level = |(low, high): (f64, f64)| low.max(high) > LEVEL;
    let is_uneven = |(low, high): (f64, f64)| low.max(high) < UNEVEN;
    let one_sided = alone(|(low, high)| low.max(high) > LEVEL && low.min(high) < UNEVEN);
    let layered = || alone(is_level).filter(|_| ends.into_iter().any(is_uneven));
    one_sided.or_else(layered)
}

/// Shares of the columns along `axis`, of this `side`, that end at the median height below and above; `None`
/// without a surface of columns.
fn level_ends(places: &[DVec3], side: f64, axis: usize) -> Option<(f64, f64)> {
    let across = [(axis + 1) % 3, (axis + 2) % 3];
    let mut columns: HashMap<[i64; 2], Vec<f64>> = HashMap::new();
    for place in places {
        let cell = across.map(|axis| (place[axis] / side).floor() as i64);
        columns.entry(cell).or_default().push(place[axis]);
    }
    let ends = columns.into_values().filter_map(|mut column| {
        column.sort_unstable_by(f64::total_cmp);
        let is_pair = |pair: &&[f64]| pair[1] - pair[0] < side;
        let low = column.windows(2).find(is_pair)?[0];
        let high = column.windows(2).rfind(is_pair)?[1];
        Some((low, high))
    });
    let (low, high): (Vec<f64>, Vec<f64>) = ends.unzip();
    // Of a spacing.
    let reach = 0.5 * side;
    let share = |mut ends: Vec<f64>| {
        ends.sort_unstable_by(f64::total_cmp);
        let median = ends[ends.len() / 2];
        ends.iter().filter(|&end| (end - median).abs() < reach).count() as f64 / ends.len() as f64
    };
    (low.len() >= FEWEST).then(|| (share(low), share(high)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places of a box of 20 × 10 × 14 particles of spacing 1 where `inside` holds, with `up` up.
    fn of(up: Up, inside: impl Fn(DVec3) -> bool) -> Particles {
        let places = (0..20 * 10 * 14)
            .map(|i| DVec3::new(f64::from(i % 20), f64::from(i / 20 % 10), f64::from(i / 200)));
        let turned = |x: DVec3| if up == Up::Z { DVec3::new(x.x, -x.z, x.y) } else { x };
        let places: Vec<_> = places.filter(|&x| inside(x)).map(turned).collect();
        Particles::from_places(&places)
    }

    /// Liquid on a floor, and a lake in its bed, tell the axis that is up; a box, a drop and liquid that
    /// leans on a wall as well do not.
    #[test]
    fn gravity_is_seen_where_one_end_is_level() {
        let wave = |x: DVec3| x.y < 5.0 + 3.0 * (0.5 * x.x).sin() + 1.5 * (0.7 * x.z).cos();
        let lake = |x: DVec3| x.y > 0.1 * ((x.x - 9.5).powi(2) + (x.z - 6.5).powi(2));
        for up in [Up::Y, Up::Z] {
            assert_eq!(likely_up(&of(up, wave), 0.5), Some(up), "a wave");
            assert_eq!(likely_up(&of(up, lake), 0.5), Some(up), "a lake");
        }
        let pond = |x: DVec3| x.y < 4.0 && (x.x - 9.5).hypot(1.5 * (x.z - 6.5)) < 9.0;
        for up in [Up::Y, Up::Z] {
            assert_eq!(likely_up(&of(up, pond), 0.5), Some(up), "a pond");
        }
        assert_eq!(likely_up(&of(Up::Y, |_| true), 0.5), None, "a box");
        let drop = |x: DVec3| x.distance(DVec3::new(10.0, 5.0, 7.0)) < 5.0;
        assert_eq!(likely_up(&of(Up::Z, drop), 0.5), None, "a drop");
        let corner = |x: DVec3| x.y + x.z + 2.0 * (0.8 * x.x).sin() < 7.0;
        assert_eq!(likely_up(&of(Up::Y, corner), 0.5), None, "in a corner of floor and wall");
        assert_eq!(likely_up(&Particles::default(), 0.5), None);
    }

    /// One particle in a hundred out of place, by any distance along any axis, singly or together, turns neither a full
    /// box nor a jittered one, and hides no wave but by a row of them.
    #[test]
    fn strays_do_not_turn_the_world() {
        let wave = |x: DVec3| x.y < 5.0 + 3.0 * (0.5 * x.x).sin() + 1.5 * (0.7 * x.z).cos();
        for (up, jitter) in [(Up::Y, 0.0), (Up::Y, 0.06), (Up::Z, 0.2)] {
            let displaced = |whole: Particles, every: usize, by: DVec3, places: usize| {
                let count = whole.len();
                let mut all: Vec<_> = (0..count)
                    .map(|i| {
                        let wobble = DVec3::new(i as f64, 1.7 * i as f64, 2.9 * i as f64);
                        whole.place(i) + jitter * (12.3 * wobble).map(f64::sin)
                    })
                    .collect();
                // From the middle of a face, or spread through the file.
                let strays = (0..count).skip(count / 2).step_by(every).take(places);
                strays.for_each(|i| all[i] += by);
                Particles::from_places(&all)
            };
            for by in [2.0, 4.0, 40.0].into_iter().flat_map(|d| {
                let axes = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
                axes.into_iter().flat_map(move |axis| [d * axis, -d * axis])
            }) {
                let hundredth = |whole: &Particles| whole.len() / 100;
                for (every, share) in [(1, 0), (1, 1), (37, 1)] {
                    let places = |whole: &Particles| (share * hundredth(whole)).max(1);
                    let full = of(up, |_| true);
                    let n = places(&full);
                    let found = likely_up(&displaced(full, every, by, n), 0.5);
                    assert_eq!(found, None, "a box, {n} by {by}, one in {every}");
                    let sea = of(up, wave);
                    let n = places(&sea);
                    let found = likely_up(&displaced(sea, every, by, n), 0.5);
                    // A row of strays on the floor is a tenth of the columns of so small a sea.
                    let is_row = every == 1 && n > 1;
                    assert!(
                        found == Some(up) || is_row && found.is_none(),
                        "a wave, {n} by {by}, one in {every}"
                    );
                }
            }
        }
    }
}
