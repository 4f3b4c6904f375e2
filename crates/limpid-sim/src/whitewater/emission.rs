//! Emission of diffuse particles (Ihmsen et al. 2012, section 3.2).

use std::f32::consts::TAU;

use glam::Vec3;
use limpid::diffuse::DiffuseKind;
use rayon::prelude::*;

use super::survey::clamped;
use super::{Particle, Passage, Potentials, Walls, Whitewater, motion};
use crate::rng::splitmix64;

/// Share of full neighbours of a particle that emits: single drops make nothing.
const JOINED: f32 = 0.2;

/// Smallest and largest radius of a new particle, in radii of the liquid's.
const RADII: [f32; 2] = [0.1, 0.28];

/// Speed across the flow of a new particle at the edge, in speeds at which neighbours meet.
const SPREAD: f32 = 0.5;

/// Downward slope of the normal at the ground, its head that raises dust, radii, and the rate relative to that of air.
const GROUND: f32 = -0.6;
const RAISING: f32 = 2.0;
const DUST: f32 = 0.2;

/// A particle of liquid that emits.
struct Source {
    /// Its number in the file, and in the sorted order.
    number: u32,
    sorted: usize,
    potentials: Potentials,
    /// Expected numbers of new particles: of air, and of dust.
    expected: [f32; 2],
}

/// Random numbers of a particle in a frame, from 0 to 1.
struct Random(u64);

impl Random {
    fn new(seed: u64, frame: i64, particle: u32, stream: u64) -> Self {
        let mut state = seed;
        for part in [frame as u64, u64::from(particle), stream] {
            // Each part passes through the generator, so that sums of parts do not coincide.
            splitmix64(&mut state);
            state = state.rotate_left(23) ^ part.wrapping_mul(0xd6e8_feb8_6659_fd93);
        }
        splitmix64(&mut state);
        Self(state)
    }

    fn next(&mut self) -> f32 {
        splitmix64(&mut self.0) as f32
    }

    /// A whole number whose mean is `expected`.
    fn count(&mut self, expected: f32) -> u32 {
        expected as u32 + u32::from(self.next() < expected.fract())
    }
}

/// Appends the particles that the liquid emits at the end of a passage, `room` at most.
pub(crate) fn emit(
    of: &Whitewater,
    passage: &Passage<'_>,
    walls: &Walls,
    room: usize,
    all: &mut Vec<Particle>,
) {
    let (survey, choices) = (&of.survey, &of.choices);
    let flow = passage.after;
    let rate = survey.rate * choices.amount * passage.seconds;
    let source = |(sorted, potentials): (usize, Potentials)| {
        if (potentials.neighbours as f32) < JOINED * survey.full {
            return None;
        }
        let air = rate * survey.potential(&potentials);
        let (_, velocity) = flow.at(sorted);
        let along = velocity - velocity.dot(potentials.normal) * potentials.normal;
        let raised = choices.dust && potentials.normal.y < GROUND;
        let head = along.length_squared() / (2.0 * survey.gravity * survey.radius);
        let high = survey.head[1].max(2.0 * RAISING);
        let dust = if raised { DUST * rate * clamped(head, [RAISING, high]) } else { 0.0 };
        let number = flow.number(sorted);
        let emits = air + dust > 0.0;
        emits.then_some(Source { number, sorted, potentials, expected: [air, dust] })
    };
    let potentials = Potentials::sorted(flow, survey.full);
    let mut sources: Vec<Source> = potentials.into_iter().enumerate().filter_map(source).collect();
    // The order of the file, which no grid decides.
    sources.sort_unstable_by_key(|source| source.number);
    let total: f64 = sources.iter().flat_map(|source| source.expected).map(f64::from).sum();
    let thinning = (room as f64 / total.max(1.0)).min(1.0) as f32;
    let emitted = sources.par_iter().flat_map_iter(|source| {
        let kinds = [None, Some(DiffuseKind::Dust)];
        kinds.into_iter().zip(source.expected).zip(0..).flat_map(
            move |((kind, expected), stream)| {
                let mut random = Random::new(choices.seed, passage.number, source.number, stream);
                let count = random.count(thinning * expected);
                let each = (0..count)
                    .filter_map(move |_| particle(of, passage, walls, source, kind, &mut random));
                each.collect::<Vec<_>>()
            },
        )
    });
    let emitted: Vec<Particle> = emitted.collect();
    all.extend(emitted.into_iter().take(room));
}

/// A new particle: in a cylinder around the path of the liquid's, as wide as that is; `None` inside of a solid.
fn particle(
    of: &Whitewater,
    passage: &Passage<'_>,
    walls: &Walls,
    source: &Source,
    kind: Option<DiffuseKind>,
    random: &mut Random,
) -> Option<Particle> {
    let (survey, flow) = (&of.survey, passage.after);
    let (x, v) = flow.at(source.sorted);
    let [wide, turn, along, size, life] = [(); 5].map(|()| random.next());
    let (a, b) = v.try_normalize().unwrap_or(Vec3::Y).any_orthonormal_pair();
    let (sin, cos) = (TAU * turn).sin_cos();
    let across = wide.sqrt() * (cos * a + sin * b);
    let path = (along - 0.5) * passage.seconds * v;
    let position = x + flow.radius() * across + path;
    if !walls.is_free(position) {
        return None;
    }
    let [small, large] = RADII;
    let near = &mut Vec::new();
    let found = || motion::kind(&flow.sample(position, near), survey.full, None);
    Some(Particle {
        position,
        velocity: v + SPREAD * source.potentials.air * across,
        radius: flow.radius() * small * (large / small).powf(size),
        kind: kind.unwrap_or_else(found),
        age: 0.0,
        left: survey.lifetime(survey.energy(&source.potentials), life),
    })
}
