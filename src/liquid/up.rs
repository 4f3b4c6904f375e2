//! The axis that points up in particles of which this is not known.

use std::collections::HashMap;

use glam::DVec3;

use super::particles::{Particles, Up};

/// Share of the columns above which an end of the liquid is level.
const LEVEL: f64 = 0.9;

/// Share of the columns below which an end of the liquid is uneven.
const UNEVEN: f64 = 0.5;

/// Particles sampled.
const SAMPLES: usize = 65536;

/// The axis along which the liquid lies on a level floor below an uneven surface, or has a level surface
/// over an uneven floor: `None` if neither y nor z is such an axis, or if both are.
///
/// Walls are level on both sides, and liquid in the air on neither; so a full box and a single drop tell
/// nothing. `radius` is that of the particles, m.
pub fn likely_up(particles: &Particles, radius: f32) -> Option<Up> {
    let bounds = particles.bulk()?.bounds;
    let step = particles.len().div_ceil(SAMPLES);
    let places = (0..particles.len()).step_by(step).map(|i| particles.place(i));
    let within = |x: &DVec3| x.cmpge(bounds.0).all() && x.cmple(bounds.1).all();
    let places: Vec<_> = places.filter(within).collect();
    // Twice the spacing of the sampled particles.
    let side = 4.0 * f64::from(radius) * (step as f64).cbrt();
    let one_sided = |axis| {
        let (low, high) = level_ends(&places, bounds, side, axis)?;
        Some(low.max(high) > LEVEL && low.min(high) < UNEVEN)
    };
    match (one_sided(1)?, one_sided(2)?) {
        (true, false) => Some(Up::Y),
        (false, true) => Some(Up::Z),
        _ => None,
    }
}

/// Shares of the columns along `axis`, of this `side`, that reach the lower and the upper end of the bulk;
/// `None` without columns.
fn level_ends(
    places: &[DVec3],
    (min, max): (DVec3, DVec3),
    side: f64,
    axis: usize,
) -> Option<(f64, f64)> {
    let across = [(axis + 1) % 3, (axis + 2) % 3];
    let mut columns: HashMap<[i64; 2], (f64, f64)> = HashMap::new();
    for place in places {
        let cell = across.map(|axis| ((place[axis] - min[axis]) / side) as i64);
        let ends = columns.entry(cell).or_insert((f64::INFINITY, f64::NEG_INFINITY));
        *ends = (ends.0.min(place[axis]), ends.1.max(place[axis]));
    }
    // Of a spacing and a half.
    let reach = 0.75 * side;
    let share = |reaches: &dyn Fn(&(f64, f64)) -> bool| {
        columns.values().filter(|ends| reaches(ends)).count() as f64 / columns.len() as f64
    };
    let low = share(&|ends| ends.0 - min[axis] < reach);
    let high = share(&|ends| max[axis] - ends.1 < reach);
    (!columns.is_empty()).then_some((low, high))
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
        assert_eq!(likely_up(&of(Up::Y, |_| true), 0.5), None, "a box");
        let drop = |x: DVec3| x.distance(DVec3::new(10.0, 5.0, 7.0)) < 5.0;
        assert_eq!(likely_up(&of(Up::Z, drop), 0.5), None, "a drop");
        let corner = |x: DVec3| x.y + x.z + 2.0 * (0.8 * x.x).sin() < 7.0;
        assert_eq!(likely_up(&of(Up::Y, corner), 0.5), None, "in a corner of floor and wall");
        assert_eq!(likely_up(&Particles::default(), 0.5), None);
    }
}
