//! Position-based fluids (M. Macklin and M. Müller, "Position Based Fluids", ACM Transactions on
//! Graphics 32(4), 2013), in small steps of few iterations (Macklin et al., Small steps in physics
//! simulation, 2019).
//!
//! There are four differences from the paper:
//!
//! - Constraints only reduce densities above the rest density, so the surface needs no special
//!   treatment.
//! - The gradient is that of the density kernel. With a second kernel the forces have no potential, and
//!   a settled tank boils.
//! - Walls add the density that liquid beyond them would contribute.
//! - Multipliers accumulate over a step's iterations, with Nesterov's momentum (as Mazhar, Heyn, Negrut
//!   and Tasora do for contacts, Using Nesterov's method to accelerate multibody dynamics, 2015): an
//!   iteration propagates only between neighbours, so the weight of the liquid above would not reach
//!   deep particles.
//!
//! The numbers of steps and iterations follow from the state alone.

use glam::{Vec3, Vec4, Vec4Swizzles as _};
use rayon::prelude::*;

use super::colliders::{Colliders, Contact, above};
use super::grid::{CHUNK, Grid, Neighbours};
use super::kernel::Kernel;
use super::{Simulation, State, emitter};
use limpid::scene::Solid;

/// Largest movement of a particle per step, in spacings.
const COURANT: f32 = 1.2;
/// Largest fall from rest per step, in spacings.
const FALL: f32 = 0.032;
/// Largest number of steps per frame; beyond it, steps exceed [`COURANT`] and [`FALL`].
const MAX_STEPS: u32 = 16;
/// Relaxation of the constraints (the paper's ε), relative to their stiffness at rest.
const COMPLIANCE: f32 = 0.02;
/// Under-relaxation of multiplier updates, which overshoot as they are simultaneous (Jacobi). With a
/// larger factor a settled tank boils.
const UNDER_RELAXATION: f32 = 0.5;
/// Mean relative compression at which the iterations stop.
const TOLERANCE: f64 = 1e-2;
/// Largest number of iterations to reach [`TOLERANCE`].
const MAX_ITERATIONS: u32 = 16;
/// Largest correction of a particle per iteration, in spacings.
const MAX_CORRECTION: f32 = 0.25;
/// Artificial pressure between particles closer than half a spacing (the paper's k, for constraints
/// in squared spacings).
const REPULSION: f32 = 5e-4;

/// A simulated liquid and its working memory.
pub(super) struct Fluid<'a> {
    simulation: &'a Simulation,
    colliders: Colliders,
    kernel: Kernel,
    grid: Grid,
    near: Vec<Neighbours>,
    pressures: Vec<Pressure>,
    compressions: Vec<Compression>,
    particles: Sorted,
    scratch: Sorted,
    predicted: Vec<Vec3>,
    order: Vec<u32>,
}

/// Particles sorted by cell.
#[derive(Default)]
struct Sorted {
    /// Positions at the beginning of the step.
    from: Vec<Vec3>,
    /// Predicted positions; w has room for the change of the constraint's multiplier.
    to: Vec<Vec4>,
    velocities: Vec<Vec4>,
    densities: Vec<f32>,
    /// Indices in the frame.
    places: Vec<u32>,
}

/// A density constraint's accumulated multiplier, in squared spacings, never negative.
#[derive(Clone, Copy, Default)]
struct Pressure {
    /// As computed by the last iteration.
    found: f32,
    /// As applied to the particles: ahead of `found` by the momentum.
    applied: f32,
}

/// Compression of a chunk's particles.
#[derive(Clone, Copy, Default)]
struct Compression {
    /// Sum of the excess densities, relative to the rest density.
    excess: f64,
    /// Number of compressed particles.
    count: u32,
}

impl<'a> Fluid<'a> {
    pub(super) fn new(simulation: &'a Simulation, solids: &[Solid]) -> Self {
        let radius = simulation.radius as f32;
        Self {
            simulation,
            colliders: Colliders::new(solids, simulation.bounds, radius),
            kernel: Kernel::new(radius),
            grid: Grid::default(),
            near: Vec::new(),
            pressures: Vec::new(),
            compressions: Vec::new(),
            particles: Sorted::default(),
            scratch: Sorted::default(),
            predicted: Vec::new(),
            order: Vec::new(),
        }
    }

    /// Creates the first frame: the blocks, and the emitters' first layers.
    pub(super) fn start(&mut self) -> State {
        let mut state = emitter::blocks(self.simulation, &self.colliders);
        emitter::emit(self.simulation, &self.colliders, None, 0.0, &mut state);
        self.load(&state);
        self.predicted.clone_from(&self.particles.from);
        self.sort_and_find_neighbours();
        self.smooth_velocities(0.0);
        self.store(&mut state);
        state
    }

    /// Advances the state from frame `number` to the next.
    pub(super) fn advance(&mut self, number: u32, state: &mut State) {
        let Simulation { fps, drain, .. } = *self.simulation;
        let [begin, end] = [number - 1, number].map(|frame| f64::from(frame) / fps);
        let steps = self.step_count(state);
        let dt = ((end - begin) / f64::from(steps)) as f32;
        self.load(state);
        let mut time = begin;
        for step in 1..=steps {
            self.step(dt);
            let now = match steps - step {
                0 => end,
                _ => begin + (end - begin) * f64::from(step) / f64::from(steps),
            };
            if emitter::emits(self.simulation, time, now) {
                self.store(state);
                emitter::emit(self.simulation, &self.colliders, Some(time), now, state);
                self.load(state);
            }
            time = now;
        }
        self.store(state);
        if let Some(extent) = drain {
            state.retain(|x| extent.contains(x));
        }
    }

    /// Number of steps of the next frame, a function of the state at its beginning.
    fn step_count(&self, state: &State) -> u32 {
        let frame = 1.0 / self.simulation.fps as f32;
        let gravity = self.simulation.gravity.length();
        let fastest = state.velocities.par_iter().map(|v| v.length_squared());
        let fastest = fastest.reduce(|| 0.0, f32::max).sqrt() + gravity * frame;
        let fastest = fastest.max(emitter::fastest(self.simulation));
        let spacing = self.kernel.spacing;
        let steps = (fastest * frame / (COURANT * spacing))
            .max(frame * (gravity / (FALL * spacing)).sqrt());
        (steps.ceil() as u32).clamp(1, MAX_STEPS)
    }

    fn load(&mut self, state: &State) {
        let Sorted { from, velocities, densities, places, .. } = &mut self.particles;
        from.clone_from(&state.positions);
        velocities.clear();
        velocities.extend(state.velocities.iter().map(|v| v.extend(0.0)));
        densities.clone_from(&state.densities);
        places.clear();
        places.extend(0..state.len() as u32);
    }

    fn store(&self, state: &mut State) {
        let Sorted { from, velocities, densities, places, .. } = &self.particles;
        for (i, &place) in places.iter().enumerate() {
            let place = place as usize;
            state.positions[place] = from[i];
            state.velocities[place] = velocities[i].xyz();
            state.densities[place] = densities[i];
        }
    }

    fn step(&mut self, dt: f32) {
        let kick = self.simulation.gravity * dt;
        let Self { particles, colliders, predicted, .. } = self;
        let falling = particles.from.par_iter().zip(&particles.velocities);
        falling
            .map(|(&x, v)| colliders.sweep(x, x + dt * (v.xyz() + kick)))
            .collect_into_vec(predicted);
        self.sort_and_find_neighbours();
        self.solve_density();
        self.update_velocities(dt);
        self.smooth_velocities(dt);
    }

    /// Sorts all particles by the cells of their predicted positions, and finds their neighbours.
    fn sort_and_find_neighbours(&mut self) {
        let Self { particles, scratch, predicted, order, grid, kernel, .. } = self;
        grid.sort(predicted, kernel.h, order);
        let at = |i: &u32| *i as usize;
        let order = order.as_slice();
        order.par_iter().map(|i| particles.from[at(i)]).collect_into_vec(&mut scratch.from);
        let velocities = order.par_iter().map(|i| particles.velocities[at(i)]);
        velocities.collect_into_vec(&mut scratch.velocities);
        order.par_iter().map(|i| particles.places[at(i)]).collect_into_vec(&mut scratch.places);
        order.par_iter().map(|i| predicted[at(i)].extend(0.0)).collect_into_vec(&mut scratch.to);
        scratch.densities.resize(order.len(), 0.0);
        std::mem::swap(particles, scratch);
        scratch.to.resize(order.len(), Vec4::ZERO);
        scratch.velocities.resize(order.len(), Vec4::ZERO);
        let reach = kernel.h + 0.5 * kernel.spacing;
        grid.neighbours(&particles.to, kernel.h, &self.colliders, reach, &mut self.near);
    }

    /// Solves the density constraints: separates particles where they are too dense.
    fn solve_density(&mut self) {
        let least = self.simulation.iterations;
        self.pressures.clear();
        self.pressures.resize(self.particles.to.len(), Pressure::default());
        let mut is_last = least == 1;
        for iteration in 1.. {
            let momentum =
                if is_last { 0.0 } else { (iteration - 1) as f32 / (iteration + 2) as f32 };
            let compression = self.update_multipliers(momentum);
            self.move_particles();
            if is_last {
                break;
            }
            let next = iteration + 1;
            is_last = next >= least && (compression < TOLERANCE || next >= MAX_ITERATIONS);
        }
    }

    /// Updates the multipliers and writes their changes to w beside the positions. Returns the mean
    /// excess density of the compressed particles.
    fn update_multipliers(&mut self, momentum: f32) -> f64 {
        let Self { particles, scratch, near, kernel, pressures, compressions, .. } = self;
        let kernel = *kernel;
        let points = particles.to.as_slice();
        let compliance = COMPLIANCE * kernel.stiffness;
        compressions.resize(near.len(), Compression::default());
        let out = scratch.to.par_chunks_mut(CHUNK).zip(pressures.par_chunks_mut(CHUNK));
        let out = out.zip(compressions.par_iter_mut()).zip(near).enumerate();
        out.for_each(|(chunk, (((out, pressures), compression), near))| {
            *compression = Compression::default();
            for (k, (out, pressure)) in out.iter_mut().zip(pressures).enumerate() {
                let x = points[chunk * CHUNK + k].xyz();
                let (walls, wall_gradient) = wall_density(&kernel, near.contacts(k), x);
                let mut density = kernel.share(0.0) + walls;
                let mut gradient = wall_gradient;
                let mut squares = 0.0;
                for &j in near.of(k) {
                    let offset = x - points[j as usize].xyz();
                    let distance = offset.length();
                    density += kernel.share(distance);
                    let slope = kernel.slope(distance);
                    squares += slope * slope;
                    gradient -= offset * (slope / distance.max(f32::MIN_POSITIVE));
                }
                let excess = density - 1.0;
                if excess > 0.0 {
                    compression.excess += f64::from(excess);
                    compression.count += 1;
                }
                let change = excess / (squares + gradient.length_squared() + compliance);
                let found = (pressure.applied + UNDER_RELAXATION * change).max(0.0);
                let ahead = (found + momentum * (found - pressure.found)).max(0.0);
                *out = x.extend(pressure.applied - ahead);
                *pressure = Pressure { found, applied: ahead };
            }
        });
        // Summed in order: the result must not depend on the number of threads.
        let excess: f64 = compressions.iter().map(|chunk| chunk.excess).sum();
        let count: u32 = compressions.iter().map(|chunk| chunk.count).sum();
        excess / f64::from(count.max(1))
    }

    /// Moves particles by the changes of the multipliers.
    fn move_particles(&mut self) {
        let Self { particles, scratch, near, kernel, colliders, .. } = self;
        let kernel = *kernel;
        let points = scratch.to.as_slice();
        let largest = MAX_CORRECTION * kernel.spacing;
        let close = 0.25 * kernel.spacing * kernel.spacing;
        let repulsion = REPULSION * kernel.spacing * kernel.spacing;
        for_each_particle(&mut particles.to, near, |i, k, near, out| {
            let (x, multiplier) = (points[i].xyz(), points[i].w);
            let contacts = near.contacts(k);
            let mut correction = if contacts.is_empty() || multiplier == 0.0 {
                Vec3::ZERO
            } else {
                multiplier * wall_density(&kernel, contacts, x).1
            };
            for &j in near.of(k) {
                let other = points[j as usize];
                let offset = x - other.xyz();
                let square = offset.length_squared();
                let mut pressure = multiplier + other.w;
                if square < close {
                    pressure -= repulsion * (1.0 - square / close);
                }
                if pressure == 0.0 {
                    continue;
                }
                let distance = square.sqrt();
                if distance < 1e-6 * kernel.spacing {
                    correction -= kernel.slope(0.0) * pressure * separation(i, j as usize);
                } else {
                    correction -= offset * (kernel.slope(distance) * pressure / distance);
                }
            }
            let correction = correction.clamp_length_max(largest);
            *out = colliders.project(contacts, x + correction).extend(0.0);
        });
    }

    /// Completes the movement of the step and derives the velocities from it.
    fn update_velocities(&mut self, dt: f32) {
        let Self { particles, near, colliders, .. } = self;
        let Sorted { from, to, velocities, .. } = particles;
        let moving = from.par_chunks_mut(CHUNK).zip(velocities.par_chunks_mut(CHUNK));
        moving.zip(to.par_chunks_mut(CHUNK)).zip(near).for_each(
            |(((from, velocities), to), near)| {
                for (k, ((from, velocity), to)) in
                    from.iter_mut().zip(velocities).zip(to).enumerate()
                {
                    if !near.contacts(k).is_empty() {
                        *to = colliders.sweep(*from, to.xyz()).extend(0.0);
                    }
                    *velocity = ((to.xyz() - *from) / dt).extend(0.0);
                    *from = to.xyz();
                }
            },
        );
    }

    /// Applies XSPH viscosity, by which velocities approach the local mean, and cohesion; computes the
    /// reported densities in the same loop.
    fn smooth_velocities(&mut self, dt: f32) {
        let Self { particles, scratch, near, kernel, simulation, .. } = self;
        let kernel = *kernel;
        let share = 1.0 - (-simulation.viscosity as f32 * dt).exp();
        let cohesion = simulation.cohesion as f32 * dt / kernel.spacing;
        let Sorted { to, velocities, densities, .. } = particles;
        let (points, known) = (to.as_slice(), velocities.as_slice());
        let out = scratch.velocities.par_chunks_mut(CHUNK).zip(densities.par_chunks_mut(CHUNK));
        out.zip(near).enumerate().for_each(|(chunk, ((velocities, densities), near))| {
            for (k, (velocity, density)) in velocities.iter_mut().zip(densities).enumerate() {
                let i = chunk * CHUNK + k;
                let (x, own) = (points[i].xyz(), known[i]);
                let free: f32 = near
                    .contacts(k)
                    .iter()
                    .map(|&contact| 1.0 - kernel.wall_weight(above(contact, x)))
                    .product();
                let mut sum = kernel.weight(0.0) + 1.0 - free;
                let mut difference = Vec4::ZERO;
                let mut inwards = Vec3::ZERO;
                for &j in near.of(k) {
                    let offset = points[j as usize].xyz() - x;
                    let weight = kernel.weight(offset.length_squared());
                    sum += weight;
                    difference += weight * (known[j as usize] - own);
                    inwards += weight * offset;
                }
                *density = sum;
                *velocity = own + share * difference + (cohesion * inwards).extend(0.0);
            }
        });
        std::mem::swap(velocities, &mut scratch.velocities);
    }
}

/// Calls `set` for each particle with its index, its index in its chunk, and the chunk's neighbours.
fn for_each_particle(
    out: &mut [Vec4],
    near: &[Neighbours],
    set: impl Fn(usize, usize, &Neighbours, &mut Vec4) + Sync,
) {
    out.par_chunks_mut(CHUNK).zip(near).enumerate().for_each(|(chunk, (out, near))| {
        for (k, out) in out.iter_mut().enumerate() {
            set(chunk * CHUNK + k, k, near, out);
        }
    });
}

/// Density that liquid beyond the walls would contribute at `x`, and its gradient. Each wall occludes
/// its share of the support independently, which is nearly exact for two walls at right angles.
#[inline]
fn wall_density(kernel: &Kernel, contacts: &[Contact], x: Vec3) -> (f32, Vec3) {
    let mut free = 1.0;
    let mut gradient = Vec3::ZERO;
    for &contact in contacts {
        let distance = above(contact, x);
        if distance < kernel.h {
            let hidden = kernel.wall_share(distance);
            gradient *= 1.0 - hidden;
            gradient -= free * kernel.wall_slope(distance) * contact.xyz();
            free *= 1.0 - hidden;
        }
    }
    (1.0 - free, gradient)
}

/// A direction that separates two coincident particles, opposite for the two.
#[cold]
fn separation(i: usize, j: usize) -> Vec3 {
    let angle = 2.4 * (i.min(j) % 1000) as f32;
    let direction = Vec3::new(angle.cos(), 0.5, angle.sin()).normalize();
    if i < j { direction } else { -direction }
}
