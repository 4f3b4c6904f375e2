//! Where particles come from: blocks at the start, and discs that pour.

use std::collections::HashMap;

use glam::{DVec3, IVec3, Vec3};

use super::colliders::Colliders;
use super::{Block, Emitter, Simulation, State};
use crate::rng::splitmix64;

/// Largest displacement of a particle from its lattice, in spacings: a perfect lattice would fall
/// as columns.
const JITTER: f64 = 0.05;

/// The particles of all blocks, without those that would be in solids. Each has the identity of
/// its place.
pub(super) fn blocks(simulation: &Simulation, colliders: &Colliders) -> State {
    let mut state = State::default();
    let mut id = 0;
    for block in &simulation.blocks {
        for x in places(block, 2.0 * simulation.radius) {
            if let Some(x) = colliders.place(jittered(x, id, simulation)) {
                state.push(id, x, block.velocity);
            }
            id += 1;
        }
    }
    state
}

/// The places of a block's particles: a cubic lattice in its middle, a radius inside its faces.
pub(super) fn places(block: &Block, spacing: f64) -> Vec<DVec3> {
    let (min, max) = block.extent();
    let counts = lattice(min, max, spacing);
    let first = 0.5 * (min + max) - 0.5 * spacing * (counts - 1.0);
    let ball = block.ball();
    let mut places = Vec::new();
    // A needle's other axes may be long.
    if counts.min_element() < 1.0 {
        return places;
    }
    for y in 0..counts.y as u32 {
        for z in 0..counts.z as u32 {
            for x in 0..counts.x as u32 {
                let place = first + spacing * DVec3::new(x.into(), y.into(), z.into());
                if ball.is_none_or(|(center, radius)| place.distance(center) <= radius) {
                    places.push(place);
                }
            }
        }
    }
    places
}

/// How many particles fit along each axis.
pub(super) fn lattice(min: DVec3, max: DVec3, spacing: f64) -> DVec3 {
    // What is a whole number in decimals shall be one here.
    ((max - min) / spacing + 1e-6).floor()
}

fn jittered(x: DVec3, id: u64, simulation: &Simulation) -> Vec3 {
    let mut state = id;
    let mut unit = || 2.0 * splitmix64(&mut state) - 1.0;
    let offset = DVec3::new(unit(), unit(), unit());
    (x + 2.0 * simulation.radius * JITTER * offset).as_vec3()
}

/// Speed of the fastest emitter, m/s.
pub(super) fn fastest(simulation: &Simulation) -> f32 {
    simulation.emitters.iter().map(|emitter| emitter.speed as f32).fold(0.0, f32::max)
}

/// Whether anything is emitted after `since`, up to `now`.
pub(super) fn emits(simulation: &Simulation, since: f64, now: f64) -> bool {
    let spacing = 2.0 * simulation.radius;
    simulation.emitters.iter().any(|e| e.layers(since, spacing) < e.layers(now, spacing))
}

/// Adds what is emitted after `since`, or from the very beginning, up to `now`; s.
///
/// A layer is a lattice's, one spacing behind the one before it. Identities follow from the time
/// alone: those of particles that find their place taken are left out.
pub(super) fn emit(
    simulation: &Simulation,
    colliders: &Colliders,
    since: Option<f64>,
    now: f64,
    state: &mut State,
) {
    let spacing = 2.0 * simulation.radius;
    let before = |emitter: &Emitter| since.map_or(0, |since| emitter.layers(since, spacing));
    let mut id = simulation.blocks.iter().map(|block| block.count(spacing)).sum::<u64>()
        + simulation
            .emitters
            .iter()
            .map(|emitter| before(emitter) * emitter.slots(spacing).len() as u64)
            .sum::<u64>();
    for emitter in &simulation.emitters {
        let layers = before(emitter)..emitter.layers(now, spacing);
        if layers.is_empty() {
            continue;
        }
        let slots = emitter.slots(spacing);
        let direction = emitter.direction.normalize();
        let reach = emitter.radius + emitter.speed / simulation.fps + 2.0 * spacing;
        let center = emitter.center.as_vec3();
        let is_near = |x: &&Vec3| x.distance(center) < reach as f32;
        let closest = 0.6 * spacing as f32;
        let mut near = Near::new(closest);
        state.positions.iter().filter(is_near).for_each(|&x| near.add(x));
        for layer in layers {
            let age = now - emitter.from - layer as f64 * spacing / emitter.speed;
            for slot in &slots {
                let x = emitter.center + *slot + age * emitter.speed * direction;
                let x = colliders.place(jittered(x, id, simulation));
                if let Some(x) = x.filter(|&x| near.is_free(x)) {
                    state.push(id, x, emitter.speed * direction);
                    near.add(x);
                }
                id += 1;
            }
        }
    }
}

/// Particles that may be too close to a new one, by cubes as wide as that is.
struct Near {
    closest: f32,
    cubes: HashMap<IVec3, Vec<Vec3>>,
}

impl Near {
    fn new(closest: f32) -> Self {
        Self { closest, cubes: HashMap::new() }
    }

    fn cube(&self, x: Vec3) -> IVec3 {
        // A little wider, so that no rounding puts a neighbour beyond the next cube.
        (x.as_dvec3() / (1.001 * f64::from(self.closest))).floor().as_ivec3()
    }

    fn add(&mut self, x: Vec3) {
        self.cubes.entry(self.cube(x)).or_default().push(x);
    }

    fn is_free(&self, x: Vec3) -> bool {
        let cube = self.cube(x);
        let beside = [-1, 0, 1];
        let around = beside.into_iter().flat_map(|i| {
            beside.into_iter().flat_map(move |j| beside.map(move |k| IVec3::new(i, j, k)))
        });
        let others = around.filter_map(|offset| self.cubes.get(&(cube.saturating_add(offset))));
        others.flatten().all(|other| other.distance(x) >= self.closest)
    }
}

impl Emitter {
    /// How many layers it has emitted by `time`, the first one at its beginning.
    pub(super) fn layers(&self, time: f64, spacing: f64) -> u64 {
        let period = spacing / self.speed;
        if time < self.from {
            return 0;
        }
        let most = ((self.until - self.from) / period).ceil().max(0.0) as u64;
        (((time - self.from) / period) as u64 + 1).min(most)
    }

    /// The places of a layer's particles about its centre.
    pub(super) fn slots(&self, spacing: f64) -> Vec<DVec3> {
        let (right, up) = self.direction.normalize().any_orthonormal_pair();
        let reach = (self.radius / spacing) as i32 + 1;
        let mut slots = Vec::new();
        for i in -reach..=reach {
            for j in -reach..=reach {
                let slot = spacing * (f64::from(i) * right + f64::from(j) * up);
                if slot.length() <= self.radius {
                    slots.push(slot);
                }
            }
        }
        slots
    }
}
