//! A breaking wave in a tank, as its lip falls.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::RangeInclusive;

use glam::{DVec2, DVec3, Vec3Swizzles as _};
use serde::{Deserialize, Serialize};

use super::Droplet;
use super::body::{Body, cuboid, cut, ellipse, join, ramp};
use crate::rng::splitmix64;
use crate::waves::{WaveSpectrum, Waves};

/// A wave that travels along +x and breaks progressively along z: at the tank's front, z > 0, the lip
/// hangs over the hollow; at the back it has fallen into the trough and thrown up a sheet.
///
/// The tank's bottom is at y = 0 and its centre at x = z = 0. Its walls are not drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Breaker {
    /// The tank's extent along x, m: 0.001 to 1000.
    pub length: f64,
    /// The tank's extent along z, m.
    pub width: f64,
    /// Depth of the calm water, m.
    pub depth: f64,
    /// Height of the crest above the calm water, m.
    pub height: f64,
    /// Number of particles.
    pub count: f64,
    /// Fraction of them in droplets: 0 to 0.5.
    pub spray: f64,
    /// Seed of ripples, droplets and the particles' arrangement.
    #[serde(default)]
    pub seed: u32,
}

/// Height of the hollow's centre above the calm water, in crest heights.
const HOLLOW: f64 = 0.42;

/// The hollow's semi-axes, in crest heights.
const SEMI_AXES: DVec2 = DVec2::new(0.62, 0.43);

/// Number of jets that throw droplets.
const JETS: f64 = 90.0;

impl Breaker {
    pub(super) fn ranges(
        self,
        size: RangeInclusive<f64>,
    ) -> Vec<(&'static str, f64, RangeInclusive<f64>)> {
        vec![
            ("length", self.length, size.clone()),
            ("width", self.width, size.clone()),
            ("depth", self.depth, size.clone()),
            ("height", self.height, size),
            ("spray", self.spray, 0.0..=0.5),
        ]
    }

    /// Centre of the hollow at z, in (x, y).
    fn hollow(&self, z: f64) -> DVec2 {
        let across = z / self.width;
        // The crest is curved.
        let bend = 0.35 * (across + 0.5).powi(2) + 0.05 * (9.0 * across + 0.4).sin();
        DVec2::new(0.06 * self.length + bend * self.height, self.depth + HOLLOW * self.height)
    }

    /// Progress of the breaking at z: 0 at the front, 1 at the back.
    fn broken(&self, z: f64) -> f64 {
        ramp(0.55, -0.45, z / self.width)
    }

    /// Angle of the lip's tip about the hollow at z: 0 is horizontal, −π/2 the bottom.
    fn tip(&self, z: f64) -> f64 {
        0.35 - 1.25 * self.broken(z)
    }

    pub(super) fn body(&self) -> Body {
        let wave = *self;
        let Self { length, width, depth, height, .. } = wave;
        let seed = u64::from(self.seed) << 8;
        let ripples = Waves::new(&WaveSpectrum {
            count: 10,
            wavelengths: [0.16 * height, 1.1 * height],
            rms_slope: 0.09,
            seed,
        });
        let streaks = noise([0.05 * height, 0.4 * height], seed + 1);
        let fingers = noise([0.10 * height, 0.6 * height], seed + 2);
        let min = DVec3::new(-0.5 * length, 0.0, -0.5 * width);
        let max = DVec3::new(0.5 * length, depth + 1.12 * height, 0.5 * width);
        let inside = move |x: DVec3| {
            let (along, z) = (x.xy() - wave.hollow(x.z), x.z);
            let streak = streaks.height(DVec2::new(0.08 * x.x, z));
            let crest = -0.3 * SEMI_AXES.x * height;
            // The main body: a long back, a steep front, ripples on both.
            let behind = (along.x - crest) / height;
            let rise = if behind < 0.0 {
                (behind / 1.15).cosh().powi(-2)
            } else {
                0.96 * (-(behind / 0.16).powi(2)).exp()
            };
            let calm = ramp(0.0, 2.0 * height, along.x.abs());
            let surface = depth + height * rise + (0.3 + 0.7 * calm) * ripples.height(x.xz())
                - 0.06 * height * (-(along.x / height - 0.5).powi(2) / 0.2).exp();
            let steep = 1.0 + (0.9 * rise).powi(2);
            let water = (x.y - surface) / steep;
            let hollow = ellipse(along, SEMI_AXES * height);
            let water = cut(water, hollow, 0.04 * height);

            // The lip: a sheet around the hollow, thinner towards its tip.
            let tip = wave.tip(z) + 0.10 * fingers.height(DVec2::new(0.0, z));
            let angle = (along.y / SEMI_AXES.y).atan2(along.x / SEMI_AXES.x);
            let angle = if angle < -FRAC_PI_2 { angle + TAU } else { angle };
            let fallen = ramp(2.2, tip, angle);
            let thickness = height * (0.17 - 0.115 * fallen) * (1.0 + 0.14 * streak * fallen);
            let middle = ellipse(along, SEMI_AXES * height + 0.5 * thickness);
            let beyond = (tip - angle).max(angle - 2.3).max(0.0) * along.length();
            let lip = middle.hypot(beyond) - 0.5 * thickness;
            let water = join(water, lip, 0.05 * height);

            // A ragged sheet and a mound, thrown up where the lip has fallen in.
            let fall = ramp(0.45, 0.95, wave.broken(z));
            let impact = 0.60 * height;
            let up = (x.y - depth) / height;
            let lean = impact + height * (0.12 + 0.30 * up + 0.25 * up * up);
            let top = fall * (0.34 + 0.10 * fingers.height(DVec2::new(0.7, 1.3 * z)));
            let thick = height * (0.055 - 0.03 * (up / 0.45).clamp(0.0, 1.0));
            let sheet = ((along.x - lean).abs() / 1.2 - 0.5 * thick)
                .max((up - top) * height)
                .max(-up * height - 0.05 * height);
            let mound = ellipse(
                DVec2::new(along.x - impact, x.y - depth + 0.06 * height),
                height * DVec2::new(0.30, 0.02 + 0.16 * fall * (1.0 + 0.25 * streak)),
            );
            let water = join(join(water, mound, 0.08 * height), sheet, 0.05 * height);
            water.max(cuboid(x, min, max))
        };
        Body::new(min, max, inside)
    }

    /// An endless sequence of droplets in jets: torn from the lip's tip, blown off the crest, thrown up
    /// by the impact. `None` stands for a droplet outside the tank.
    pub(super) fn droplets(self) -> impl Iterator<Item = Option<Droplet>> {
        let seed = (u64::from(self.seed) << 8) + 3;
        let mut state = seed;
        let (h, width) = (self.height, self.width);
        let drops = std::iter::repeat_with(move || {
            let mut unit = || splitmix64(&mut state);
            let jet = (unit() * JETS).floor();
            // 0 at the jet's root, 1 at its end, with more droplets towards the end.
            let along = unit().sqrt();
            let scatter = DVec3::new(unit() - 0.5, unit() - 0.5, unit() - 0.5);
            // Few large drops, many small.
            let size = if unit() < 0.8 { 0.0 } else { 1.0 + 0.9 * unit().powi(4) };

            let mut state = seed ^ (jet as u64 + 1) << 20;
            let mut unit = || splitmix64(&mut state);
            let mut z = width * (unit() - 0.5);
            let around = |z: f64, angle: f64, out: f64| {
                self.hollow(z) + h * (SEMI_AXES + out) * DVec2::from_angle(angle)
            };
            // Speeds in √(g h), times in √(h/g): a free fall of time t is then t²/2 crest heights.
            let (from, velocity, time) = if jet < 0.36 * JETS {
                let angle = self.tip(z) + 0.06 - (0.12 + 0.5 * unit()) * along;
                (around(z, angle, 0.03), DVec3::ZERO, 0.0)
            } else if jet < 0.5 * JETS {
                let from = around(z, 1.75 - 0.8 * unit(), 0.15);
                (from, DVec3::new(-0.35, 0.75, 0.3 * unit() - 0.15), 0.35 + 0.4 * unit())
            } else {
                z = width * (0.78 * unit() - 0.48);
                let foot = DVec2::new(0.62 + 0.25 * unit(), 0.02 - HOLLOW);
                let speed = (0.55 + 0.55 * unit()) * (0.35 + 0.65 * self.broken(z));
                let velocity = DVec3::new(0.1 + 0.8 * unit(), 1.35, 0.9 * (unit() - 0.5));
                (self.hollow(z) + h * foot, speed * velocity, 0.55 + 0.35 * unit())
            };
            let fall = 0.5 * time * time * along;
            let center = from.extend(z) + h * (along * velocity * time - fall * DVec3::Y);
            Droplet { center: center + 0.11 * h * (0.35 + along) * scatter, size }
        });
        let tank = 0.48 * DVec2::new(self.length, self.width);
        drops.map(move |drop| Some(drop).filter(|drop| drop.center.xz().abs().cmplt(tank).all()))
    }
}

/// Two-dimensional noise of about unit amplitude.
pub(super) fn noise(wavelengths: [f64; 2], seed: u64) -> Waves {
    let mut noise = Waves::new(&WaveSpectrum { count: 7, wavelengths, rms_slope: 1.0, seed });
    for wave in &mut noise.waves {
        wave.amplitude = (2.0 / 7f64).sqrt();
    }
    noise
}
