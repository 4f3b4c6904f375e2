//! Closed-form standing waves in a tank.

use std::f64::consts::PI;

use glam::Vec3;
use rayon::prelude::*;

use super::{Simulation, State, emitter};
use crate::waves::Waves;

/// A lattice of particles displaced by standing waves of small amplitude in a rectangular tank (Airy,
/// Tides and waves, 1845). Particles stay inside the tank, and volume is conserved to first order. Each
/// sine of the scene's waves is replaced by the nearest mode of the tank.
pub(super) struct Swell {
    rest: Vec<Vec3>,
    /// Particles along each axis.
    counts: [usize; 3],
    modes: Vec<Mode>,
}

/// A standing wave, as a product of factors along each axis, tabulated.
struct Mode {
    /// cos and sin of `k_x x` and `k_z z`.
    x: Vec<[f32; 2]>,
    z: Vec<[f32; 2]>,
    /// sinh k(y + D) / sinh kD and cosh k(y + D) / sinh kD, with the depth D.
    y: Vec<[f32; 2]>,
    /// Direction of the wave vector.
    direction: [f32; 2],
    amplitude: f64,
    frequency: f64,
    phase: f64,
}

impl Swell {
    pub(super) fn new(simulation: &Simulation) -> Self {
        let spacing = 2.0 * simulation.radius;
        let block = &simulation.blocks[0];
        let (min, max) = block.extent();
        let counts = emitter::lattice(min, max, spacing);
        let rest = emitter::places(block, spacing);
        let (size, depth) = (max - min, max.y - min.y);
        let gravity = simulation.gravity.as_dvec3().length();
        // Positions along an axis, relative to the tank's lowest corner.
        let along = |count: f64, length: f64| -> Vec<f64> {
            let first = 0.5 * (length - spacing * (count - 1.0));
            (0..count as u32).map(|i| first + spacing * f64::from(i)).collect()
        };
        let [x, y, z] = [(counts.x, size.x), (counts.y, size.y), (counts.z, size.z)]
            .map(|(count, length)| along(count, length));
        let waves = simulation.waves.as_ref().map(Waves::new).unwrap_or_default();
        let modes = waves.waves.iter().filter_map(|wave| {
            let [kx, kz] = [(wave.k.x, size.x), (wave.k.y, size.z)]
                .map(|(k, length)| (k.abs() * length / PI).round() * PI / length);
            let k = kx.hypot(kz);
            if k == 0.0 {
                return None;
            }
            let table = |k: f64, places: &[f64]| -> Vec<[f32; 2]> {
                let (sin, cos) = (|x: &f64| (k * x).sin() as f32, |x: &f64| (k * x).cos() as f32);
                places.iter().map(|x| [cos(x), sin(x)]).collect()
            };
            // sinh a / sinh b and cosh a / sinh b for 0 <= a <= b, without overflow.
            let profile = |height: f64| {
                let (up, down) = (k * (height - depth), -k * (height + depth));
                let whole = 1.0 - (-2.0 * k * depth).exp();
                [(up.exp() - down.exp()) / whole, (up.exp() + down.exp()) / whole]
                    .map(|share| share as f32)
            };
            Some(Mode {
                x: table(kx, &x),
                z: table(kz, &z),
                y: y.iter().map(|&height| profile(height)).collect(),
                direction: [(kx / k) as f32, (kz / k) as f32],
                amplitude: wave.amplitude,
                frequency: (gravity * k * (k * depth).tanh()).sqrt(),
                phase: wave.phase,
            })
        });
        Self {
            modes: modes.collect(),
            rest: rest.iter().map(|x| x.as_vec3()).collect(),
            counts: counts.to_array().map(|count| count as usize),
        }
    }

    /// The particles at `time`, s.
    pub(super) fn at(&self, time: f64) -> State {
        let [nx, _, nz] = self.counts;
        let now: Vec<[f32; 2]> = self
            .modes
            .iter()
            .map(|mode| {
                let (sin, cos) = (mode.frequency * time + mode.phase).sin_cos();
                [mode.amplitude * cos, -mode.amplitude * mode.frequency * sin].map(|a| a as f32)
            })
            .collect();
        let moved = (0..self.rest.len()).into_par_iter().map(|i| {
            let (x, z, y) = (i % nx, i / nx % nz, i / nx / nz);
            let (mut offset, mut velocity) = (Vec3::ZERO, Vec3::ZERO);
            for (mode, &[height, rate]) in self.modes.iter().zip(&now) {
                let ([cx, sx], [cz, sz], [rise, sway]) = (mode.x[x], mode.z[z], mode.y[y]);
                let [east, south] = mode.direction;
                let shape =
                    Vec3::new(-east * sx * cz * sway, cx * cz * rise, -south * cx * sz * sway);
                offset += height * shape;
                velocity += rate * shape;
            }
            (self.rest[i] + offset, velocity)
        });
        let (positions, velocities) = moved.unzip();
        let count = self.rest.len();
        State {
            positions,
            velocities,
            densities: vec![1.0; count],
            ids: (0..count as u64).collect(),
        }
    }
}
