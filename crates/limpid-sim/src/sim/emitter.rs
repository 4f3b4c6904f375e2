//! Particle sources: the initial blocks, and emitting discs.

use std::collections::HashMap;

use glam::{DVec3, IVec3, Vec3};

use super::colliders::Colliders;
use super::{Block, Emitter, Simulation, State};
use crate::rng::splitmix64;

/// Largest displacement of a particle from its lattice position, in spacings: a perfect lattice would
/// fall as columns.
const JITTER: f64 = 0.05;

/// Creates the particles of all blocks, except those inside solids. A particle's id is the index of
/// its lattice position.
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

/// Positions of a block's particles: a cubic lattice, centred, one radius inside the faces.
pub(super) fn places(block: &Block, spacing: f64) -> Vec<DVec3> {
    let (min, max) = block.extent();
    let counts = lattice(min, max, spacing);
    let first = 0.5 * (min + max) - 0.5 * spacing * (counts - 1.0);
    let ball = block.ball();
    let mut places = Vec::new();
    // Without this, a needle without particles would be looped over along its long axis.
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

/// Number of particles that fit along each axis.
pub(super) fn lattice(min: DVec3, max: DVec3, spacing: f64) -> DVec3 {
    // The tolerance restores integers that rounding has reduced.
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

/// Whether a layer is emitted after `since`, up to `now`, s.
pub(super) fn emits(simulation: &Simulation, since: f64, now: f64) -> bool {
    let spacing = 2.0 * simulation.radius;
    simulation.emitters.iter().any(|e| e.layers(since, spacing) < e.layers(now, spacing))
}

/// Adds the particles emitted after `since`, or since the beginning if it is `None`, up to `now`, s.
///
/// Layers are those of a cubic lattice, one spacing apart. Ids follow from the time alone: the id of a
/// particle whose position is occupied is skipped.
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
        let is_nearby = |x: &&Vec3| x.distance(center) < reach as f32;
        let min_distance = 0.6 * spacing as f32;
        let mut occupied = OccupancyGrid::new(min_distance);
        state.positions.iter().filter(is_nearby).for_each(|&x| occupied.add(x));
        for layer in layers {
            let age = now - emitter.from - layer as f64 * spacing / emitter.speed;
            for slot in &slots {
                let x = emitter.center + *slot + age * emitter.speed * direction;
                let x = colliders.place(jittered(x, id, simulation));
                if let Some(x) = x.filter(|&x| occupied.is_free(x)) {
                    state.push(id, x, emitter.speed * direction);
                    occupied.add(x);
                }
                id += 1;
            }
        }
    }
}

/// Particles near an emitter, hashed by cubes of the minimum distance, to test new ones for overlap.
struct OccupancyGrid {
    min_distance: f32,
    cubes: HashMap<IVec3, Vec<Vec3>>,
}

impl OccupancyGrid {
    fn new(min_distance: f32) -> Self {
        Self { min_distance, cubes: HashMap::new() }
    }

    fn cube(&self, x: Vec3) -> IVec3 {
        // Slightly wider, so that rounding cannot put a neighbour beyond the adjacent cube.
        (x.as_dvec3() / (1.001 * f64::from(self.min_distance))).floor().as_ivec3()
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
        others.flatten().all(|other| other.distance(x) >= self.min_distance)
    }
}

impl Emitter {
    /// Number of layers emitted by `time`, the first one at the start time.
    pub(super) fn layers(&self, time: f64, spacing: f64) -> u64 {
        let period = spacing / self.speed;
        if time < self.from {
            return 0;
        }
        let most = ((self.until - self.from) / period).ceil().max(0.0) as u64;
        (((time - self.from) / period) as u64 + 1).min(most)
    }

    /// Positions of a layer's particles relative to its centre.
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
