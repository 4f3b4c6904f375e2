//! What files do not tell: velocities, the time between frames, and gravity.

use std::collections::HashMap;

use glam::Vec3;
use limpid::liquid::Particles;

/// The earth's gravity, m/s².
pub(crate) const GRAVITY: f32 = 9.81;

/// For each particle of `b` its number in `a`: by ids, or by order where both frames have equally many.
fn matched(a: &Particles, b: &Particles) -> Option<Vec<Option<usize>>> {
    if let (Some(from), Some(to)) = (&a.ids, &b.ids) {
        let known: HashMap<i64, usize> = from.iter().enumerate().map(|(i, &id)| (id, i)).collect();
        // Ids of a material or a phase are shared.
        if known.len() == from.len() {
            return Some(to.iter().map(|id| known.get(id).copied()).collect());
        }
    }
    (a.len() == b.len()).then(|| (0..a.len()).map(Some).collect())
}

/// Displacements of the particles of `b` since `a`, m; `None` of those that are new.
fn displacements(a: &Particles, b: &Particles) -> Option<Vec<Option<Vec3>>> {
    let apart = (b.origin - a.origin).as_vec3();
    let matched = matched(a, b)?.into_iter().enumerate();
    let moved = |(j, i): (usize, Option<usize>)| Some(b.positions[j] - a.positions[i?] + apart);
    Some(matched.map(moved).collect())
}

/// The middle of some numbers, the upper of two.
fn median(mut all: Vec<f32>) -> Option<f32> {
    let middle = all.len() / 2;
    (!all.is_empty()).then(|| *all.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// Velocities of the particles of `b`, m/s, by their displacements since frame `a`, `seconds` before. Particles that are new
/// or jump, as through a periodic border, stand still. `None` where particles cannot be matched.
pub fn velocities(a: &Particles, b: &Particles, seconds: f32) -> Option<Vec<Vec3>> {
    /// Displacement of a jump, in medians of those that move.
    const JUMP: f32 = 30.0;
    let moved = displacements(a, b)?;
    let lengths = moved.iter().flatten().map(|moved| moved.length()).filter(|&length| length > 0.0);
    let usual = median(lengths.collect()).unwrap_or(0.0);
    let velocity = |moved: &Option<Vec3>| match moved {
        Some(moved) if moved.length() <= JUMP * usual => *moved / seconds,
        _ => Vec3::ZERO,
    };
    Some(moved.iter().map(velocity).collect())
}

/// The time between two frames, s, by displacements and velocities of the fast particles; `None` where they do not tell.
pub fn duration(a: &Particles, b: &Particles) -> Option<f32> {
    /// Particles that have to agree.
    const ENOUGH: usize = 10;
    let (from, to) = (a.velocities.as_ref()?, b.velocities.as_ref()?);
    let matched = matched(a, b)?;
    let moved = displacements(a, b)?;
    let mean = |j: usize| matched[j].map(|i| 0.5 * (from[i] + to[j]));
    let fastest = (0..b.len()).filter_map(mean).map(Vec3::length).fold(0.0, f32::max);
    let time = |j: usize| {
        let (velocity, moved) = (mean(j)?, moved[j]?);
        let is_fast = fastest > 0.0 && velocity.length() > 0.25 * fastest;
        is_fast.then(|| moved.dot(velocity) / velocity.length_squared())
    };
    let times: Vec<f32> = (0..b.len()).filter_map(time).collect();
    let enough = times.len() >= ENOUGH.min(b.len());
    median(times).filter(|&time| enough && time > 0.0 && time.is_finite())
}

/// Accelerations downwards, m/s², of the particles of `b` whose velocity has changed downwards alone since frame `a`, `seconds`
/// before: of spray, jets and falling drops they are those of free fall, and of others they scatter.
pub fn falls(
    (a, slow): (&Particles, &[Vec3]),
    (b, fast): (&Particles, &[Vec3]),
    seconds: f32,
) -> Vec<f32> {
    /// Change of velocity across in parts of that downwards, and of that in parts of the velocity.
    const ACROSS: f32 = 0.02;
    const LEAST: f32 = 0.01;
    let Some(matched) = matched(a, b) else { return Vec::new() };
    let fall = |(j, i): (usize, Option<usize>)| {
        let change = fast[j] - slow[i?];
        let down = -change.y;
        let falls = down > LEAST * fast[j].length() && change.with_y(0.0).length() < ACROSS * down;
        falls.then(|| down / seconds)
    };
    matched.into_iter().enumerate().filter_map(fall).collect()
}

/// The acceleration of gravity that accelerations downwards show, m/s²: that of the earth, unless many agree on one that is far
/// from it, as in files of another unit.
pub(crate) fn gravity(mut falls: Vec<f32>) -> f32 {
    /// Particles that have to agree, their share of all, how well they do, and how far from the earth's gravity.
    const ENOUGH: usize = 50;
    const SHARE: f32 = 0.25;
    const SPREAD: f32 = 1.05;
    const FAR: f32 = 10.0;
    falls.sort_unstable_by(f32::total_cmp);
    // The window with the most of them.
    let (mut end, mut most) = (0, 0..0);
    for begin in 0..falls.len() {
        while end < falls.len() && falls[end] <= SPREAD * falls[begin] {
            end += 1;
        }
        if end - begin > most.len() {
            most = begin..end;
        }
    }
    let agree = most.len() >= ENOUGH && most.len() as f32 > SHARE * falls.len() as f32;
    let fall = falls.get(most.start + most.len() / 2).copied().unwrap_or(GRAVITY);
    let is_far = fall > FAR * GRAVITY || FAR * fall < GRAVITY;
    if agree && is_far { fall } else { GRAVITY }
}
