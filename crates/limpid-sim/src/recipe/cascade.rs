//! Water running down a staircase into a basin.

use std::ops::RangeInclusive;

use glam::{DVec2, DVec3, Vec3Swizzles as _};
use serde::{Deserialize, Serialize};

use super::Droplet;
use super::body::{Body, cuboid, join, ramp};
use super::breaker::noise;
use crate::rng::splitmix64;
use crate::waves::{WaveSpectrum, Waves};

/// Gravity, m/s².
const GRAVITY: f64 = 9.81;

/// Films on the treads of a staircase, sheets falling between them, and a basin at the foot.
///
/// The stairs descend along +x and are centred at z = 0. Tread i from the top is the rectangle
/// x = i·tread to (i + 1)·tread at y = (steps − i)·riser; the basin's floor is at y = 0, from
/// x = steps·tread on. The stairs themselves are solids of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cascade {
    /// Number of treads: 1 to 100.
    pub steps: u32,
    /// Depth of a tread along x, m.
    pub tread: f64,
    /// Height of a riser, m.
    pub riser: f64,
    /// Width of the flow along z, m.
    pub width: f64,
    /// Thickness of the film on the treads, m.
    pub film: f64,
    /// Speed of the film at a tread's edge, m/s.
    pub speed: f64,
    /// Extent of the basin along x, along z, and its depth, m.
    pub basin: DVec3,
    /// Number of particles.
    pub count: f64,
    /// Fraction of them in droplets: 0 to 0.5.
    pub spray: f64,
    /// Seed of ripples, droplets and the particles' arrangement.
    #[serde(default)]
    pub seed: u32,
}

/// Number of jets that throw droplets where a sheet lands.
const JETS: f64 = 18.0;

impl Cascade {
    pub(super) fn ranges(
        self,
        size: RangeInclusive<f64>,
    ) -> Vec<(&'static str, f64, RangeInclusive<f64>)> {
        vec![
            ("steps", self.steps.into(), 1.0..=100.0),
            ("tread", self.tread, size.clone()),
            ("riser", self.riser, size.clone()),
            ("width", self.width, size.clone()),
            ("film", self.film, size.clone()),
            ("speed", self.speed, size.clone()),
            ("basin", self.basin.x, size.clone()),
            ("basin", self.basin.y, size.clone()),
            ("basin", self.basin.z, size),
            ("spray", self.spray, 0.0..=0.5),
        ]
    }

    /// Height of the stairs at x.
    fn stairs(&self, x: f64) -> f64 {
        let step = (x / self.tread).floor().max(0.0);
        (f64::from(self.steps) - step).max(0.0) * self.riser
    }

    /// Distance from `x` to the nearest of the step under it and the one behind it, m.
    fn clearance(&self, x: DVec3) -> f64 {
        let (step, steps) = ((x.x / self.tread).floor(), f64::from(self.steps));
        let to = |step: f64| {
            let beyond =
                DVec2::new(x.x - (step + 1.0) * self.tread, x.y - (steps - step) * self.riser);
            beyond.max(DVec2::ZERO).length() + beyond.max_element().min(0.0)
        };
        let near = [step - 1.0, step].into_iter().filter(|step| (0.0..steps).contains(step));
        near.map(to).fold(f64::INFINITY, f64::min)
    }

    /// Horizontal distance from the edge to where a sheet lands, m.
    fn reach(&self) -> f64 {
        self.speed * (2.0 * self.riser / GRAVITY).sqrt()
    }

    pub(super) fn body(&self) -> Body {
        let flow = *self;
        let Self { steps, tread, riser, width, film, speed, basin, .. } = flow;
        let steps = f64::from(steps);
        let seed = u64::from(self.seed) << 8;
        let ripples = Waves::new(&WaveSpectrum {
            count: 8,
            wavelengths: [1.4 * film, 0.5 * tread],
            rms_slope: 0.13,
            seed,
        });
        let strands = noise([0.06 * width, 0.35 * width], seed + 1);
        let foot = steps * tread;
        let half_width = 0.5 * width.max(basin.y);
        let min = DVec3::new(0.0, 0.0, -half_width);
        let max = DVec3::new(foot + basin.x, steps * riser + 3.0 * film, half_width);
        let reach = flow.reach();
        let inside = move |x: DVec3| {
            let ripple = ripples.height(x.xz());
            let step = (x.x / tread).floor().clamp(0.0, steps);
            let side =
                x.z.abs() - 0.5 * width * (1.0 + 0.03 * strands.height(DVec2::new(0.3 * x.x, 0.2)));
            // Two treads contribute: the film of this one, and the sheet and film of the one above.
            let mut water = f64::INFINITY;
            for step in [step, step - 1.0] {
                if step < 0.0 || step >= steps {
                    continue;
                }
                let (top, edge) = ((steps - step) * riser, (step + 1.0) * tread);
                let back = edge - tread;
                // Deep where the stream from above lands, shallow where it accelerates.
                let landing = (x.x - back - reach) / (0.5 * tread);
                let inflow =
                    if step == 0.0 { 1.0 - ramp(0.0, 0.7 * tread, x.x - back) } else { 0.0 };
                let pile = if step > 0.0 { 0.5 * (-4.0 * landing * landing).exp() } else { 0.0 };
                let strand = strands.height(DVec2::new(0.1 * x.x, x.z + 0.37 * step * width));
                let faster = ramp(0.5 * tread, tread, x.x - back);
                let thickness =
                    film * (0.95 + pile + 1.3 * inflow - 0.1 * faster + 0.18 * strand) + ripple;
                let over = (x.y - top - thickness).max(top - x.y);
                let on_tread = over.max(back - x.x).max(x.x - edge - 0.3 * film);
                water = join(water, on_tread.max(side), 0.4 * film);

                // The sheet: a jet's parabola, thinner with speed, torn into strands.
                let out = x.x - edge;
                let fallen = ((top - x.y) / riser).clamp(0.0, 1.0);
                let middle = top + film * (0.45 + 0.5 * fallen * strand)
                    - GRAVITY * (out * out.max(0.0)) / (2.0 * speed * speed);
                let slope = GRAVITY * out.max(0.0) / (speed * speed);
                let stretch = 1.0 / (1.0 + fallen * 2.0 * GRAVITY * riser / (speed * speed)).sqrt();
                let thin = 0.95 * film * stretch.max(0.55) * (1.0 + fallen * (0.85 * strand - 0.1));
                let sheet = (x.y - middle).abs() / slope.hypot(1.0) - 0.5 * thin;
                let sheet =
                    sheet.max(-out - 0.5 * film).max(top - riser - x.y).max(x.y - top - film);
                water = join(water, sheet.max(side), 0.3 * film);
            }
            let churned = (-((x.x - foot - reach) / (0.35 * tread)).powi(2)).exp()
                * ramp(0.55 * width, 0.45 * width, x.z.abs());
            let level = basin.z + ripple + churned * (0.4 * film + 1.5 * ripple);
            let pool = cuboid(
                x,
                DVec3::new(foot, 0.0, -0.5 * basin.y),
                DVec3::new(foot + basin.x, level, 0.5 * basin.y),
            );
            let water = join(water, pool, 0.5 * film);
            // Fillets must not bulge into the stairs or below the floor.
            water.max(-flow.clearance(x)).max(-x.y)
        };
        Body::new(min, max, inside)
    }

    /// An endless sequence of droplets in jets: thrown up where the sheets land, torn off beside them.
    /// `None` stands for a droplet inside the stairs or beyond the basin.
    pub(super) fn droplets(self) -> impl Iterator<Item = Option<Droplet>> {
        let seed = (u64::from(self.seed) << 8) + 2;
        let mut state = seed;
        let steps = f64::from(self.steps);
        let drops = std::iter::repeat_with(move || {
            let mut unit = || splitmix64(&mut state);
            // Half of the jets are where the last sheet plunges into the basin.
            let jet = (unit() * JETS * (steps + 1.0)).floor();
            let step = (jet / JETS).floor().min(steps - 1.0);
            let last = step + 1.0 == steps;
            let along = unit().sqrt();
            let scatter = DVec3::new(unit() - 0.5, unit() - 0.5, unit() - 0.5);
            let size = if unit() < 0.75 { 0.0 } else { 1.0 + 0.5 * unit().powi(2) };

            let mut state = seed ^ (jet as u64 + 1) << 20;
            let mut unit = || splitmix64(&mut state);
            let z = 0.98 * self.width * (unit() - 0.5);
            let edge = (step + 1.0) * self.tread;
            let floor = self.stairs(edge + 0.5 * self.tread);
            let level = if last { self.basin.z } else { self.film };
            // The impact speed, part of which is turned upwards.
            let speed = (2.0 * GRAVITY * self.riser).sqrt();
            let up = speed * (0.25 + 0.35 * unit()) * if last { 1.25 } else { 1.0 };
            let velocity = DVec3::new(speed * (0.30 * unit() - 0.04), up, 0.5 * (unit() - 0.5));
            let time = (0.6 + 0.6 * unit()) * up / GRAVITY;
            let from = DVec3::new(edge + self.reach() * (1.0 + 0.2 * unit()), floor + level, z);
            let fall = 0.5 * GRAVITY * time * time * along;
            let center = from + along * velocity * time - fall * DVec3::Y;
            Droplet { center: center + self.film * (0.5 + 1.5 * along) * scatter, size }
        });
        let margin = self.film;
        let free = move |drop: &Droplet| {
            let x = drop.center;
            let below = [x.x - margin, x.x, x.x + margin].map(|at| self.stairs(at));
            x.y - margin > below.into_iter().fold(0.0, f64::max)
                && x.x < steps * self.tread + self.basin.x
                && x.z.abs() < 0.5 * self.basin.y
        };
        drops.map(move |drop| Some(drop).filter(free))
    }
}
