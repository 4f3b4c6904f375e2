//! Motion of diffuse particles from one frame to the next (Ihmsen et al. 2012, section 3.3).

use glam::Vec3;
use limpid::diffuse::DiffuseKind;

use super::flow::Sample;
use super::survey::Survey;
use super::{Particle, Passage, Walls};

/// Share of full neighbours below which a particle is spray: 6 of 33.
const SPRAY: f32 = 0.18;

/// Share of full neighbours that a bubble has more than a radius above it. Counting those above tells depth at the bottom
/// and at walls too, where liquid ends on the other side.
const BURIED: f32 = 0.15;

/// How far a share may pass a threshold before the kind changes, relative to it, so that none flickers.
const MARGIN: f32 = 0.15;

/// The buoyancy of a bubble in units of gravity: `k_b` of Ihmsen et al. 2012.
const BUOYANCY: f32 = 2.0;

/// The speed of dust as it sinks, in units of √(g d), d its diameter: that of fine sand.
const SINKING: f32 = 0.1;

/// How fast life passes: of foam and dust; in the air and below; and on a solid, where spray has landed.
const SLOW: f32 = 1.0 / 3.0;
const LANDED: f32 = 4.0;

/// Terminal speed of a bubble in still water, m/s: 0.71 √(g d), d its diameter (Davies and Taylor 1950, for a spherical
/// cap).
pub(crate) fn terminal(radius: f32, gravity: f32) -> f32 {
    0.71 * (gravity * 2.0 * radius).sqrt()
}

/// The kind of a particle that was `before`, by the liquid around it.
pub(crate) fn kind(sample: &Sample, full: f32, before: Option<DiffuseKind>) -> DiffuseKind {
    let limit = |share: f32, stays: bool| {
        let margin = match before {
            None => 1.0,
            Some(_) if stays => 1.0 + MARGIN,
            Some(_) => 1.0 - MARGIN,
        };
        share * full * margin
    };
    if (sample.count as f32) < limit(SPRAY, before == Some(DiffuseKind::Spray)) {
        DiffuseKind::Spray
    } else if sample.above as f32 > limit(BURIED, before != Some(DiffuseKind::Bubble)) {
        DiffuseKind::Bubble
    } else {
        DiffuseKind::Foam
    }
}

/// The particle at the end of a passage; `None` if its life is over or it has left the sequence.
pub(crate) fn moved(
    own: Particle,
    passage: &Passage<'_>,
    survey: &Survey,
    walls: &Walls,
) -> Option<Particle> {
    let &Passage { before, after, seconds, .. } = passage;
    let near = &mut Vec::new();
    let from = own.position;
    let shift = (after.origin() - before.origin()).as_vec3();
    let start = before.sample(from + shift, near);
    // Heun's method: the mean of the velocities at the begin and where they lead.
    let end = after.sample(from + seconds * start.velocity, near);
    let flow = match end.count {
        0 => start.velocity,
        _ => 0.5 * (start.velocity + end.velocity),
    };
    let dust = own.kind == DiffuseKind::Dust;
    let alone = start.count == 0;
    let gravity = survey.gravity;
    let (to, velocity) = match own.kind {
        DiffuseKind::Dust if alone => return None,
        DiffuseKind::Dust => {
            let sinking = SINKING * (gravity * 2.0 * own.radius).sqrt();
            let velocity = flow - sinking * Vec3::Y;
            (from + seconds * velocity, velocity)
        }
        DiffuseKind::Foam if !alone => (from + seconds * flow, flow),
        DiffuseKind::Bubble if !alone => rise(&own, flow, gravity, seconds),
        _ => {
            let fall = -gravity * Vec3::Y;
            let to = from + seconds * own.velocity + 0.5 * seconds * seconds * fall;
            (to, own.velocity + seconds * fall)
        }
    };
    let reached = walls.follow(from, to);
    let velocity = velocity - velocity.dot(reached.normal).min(0.0) * reached.normal;
    let sample = after.sample(reached.position, near);
    let kind = if dust { DiffuseKind::Dust } else { kind(&sample, survey.full, Some(own.kind)) };
    let pace = match kind {
        DiffuseKind::Foam | DiffuseKind::Dust => 1.0,
        DiffuseKind::Spray if reached.normal != Vec3::ZERO => LANDED,
        DiffuseKind::Spray | DiffuseKind::Bubble => SLOW,
    };
    let left = own.left - pace * seconds;
    let gone = left <= 0.0 || reached.below && sample.count == 0;
    let (position, age) = (reached.position, own.age + seconds);
    (!gone).then_some(Particle { position, velocity, kind, age, left, ..own })
}

/// The place and the velocity of a bubble in liquid of this velocity. Its speed against the liquid relaxes to the terminal
/// one, exactly as dv/dt = `k_b` g + (u − v)/τ does.
fn rise(own: &Particle, flow: Vec3, gravity: f32, seconds: f32) -> (Vec3, Vec3) {
    let limit = flow + terminal(own.radius, gravity) * Vec3::Y;
    let relaxation = terminal(own.radius, gravity) / (BUOYANCY * gravity);
    let fading = (-seconds / relaxation).exp();
    let excess = own.velocity - limit;
    let to = own.position + seconds * limit + relaxation * (1.0 - fading) * excess;
    (to, limit + fading * excess)
}
