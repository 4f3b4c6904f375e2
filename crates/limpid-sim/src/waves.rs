//! Surface waves as a sum of sines, exact at any point.

use std::f64::consts::TAU;

use crate::rng::splitmix64;
use glam::DVec2;
use serde::{Deserialize, Serialize};

/// Acceleration of gravity, m/s².
const GRAVITY: f64 = 9.81;

/// Parameters of random waves: isotropic, with wavelengths in a band and equal mean slopes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WaveSpectrum {
    /// Number of sines, 1 to 10,000.
    pub count: u32,
    /// Shortest and longest wavelength, m; uniformly distributed on a logarithmic scale.
    pub wavelengths: [f64; 2],
    /// Root mean square of the surface's slope along x, and along z.
    pub rms_slope: f64,
    /// Seed of the directions, lengths and phases.
    pub seed: u64,
}

/// A sine: height = amplitude·sin(k·x + phase).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wave {
    /// Wave vector (x, z), rad/m.
    pub k: DVec2,
    /// Amplitude, m.
    pub amplitude: f64,
    /// Phase, rad.
    pub phase: f64,
}

/// A height field above y = 0, as a function of (x, z).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Waves {
    /// The sines; none for flat water.
    pub waves: Vec<Wave>,
}

impl Waves {
    /// Draws the sines of `spectrum`, all of equal mean slope.
    pub fn new(spectrum: &WaveSpectrum) -> Self {
        let mut state = spectrum.seed;
        let mut unit = move || splitmix64(&mut state);
        let [shortest, longest] = spectrum.wavelengths;
        let waves = (0..spectrum.count)
            .map(|_| {
                let length = shortest * (longest / shortest).powf(unit());
                let k = DVec2::from_angle(TAU * unit()) * (TAU / length);
                // Slope of one sine along either axis, averaged over directions: (a k)² / 4.
                let amplitude =
                    2.0 * spectrum.rms_slope / (k.length() * f64::from(spectrum.count).sqrt());
                Wave { k, amplitude, phase: TAU * unit() }
            })
            .collect();
        Self { waves }
    }

    /// Height at (x, z), m.
    pub fn height(&self, at: DVec2) -> f64 {
        self.waves.iter().map(|w| w.amplitude * (w.k.dot(at) + w.phase).sin()).sum()
    }

    /// Slope at (x, z): the height's derivatives along x and z.
    pub fn slope(&self, at: DVec2) -> DVec2 {
        self.waves.iter().map(|w| w.k * (w.amplitude * (w.k.dot(at) + w.phase).cos())).sum()
    }

    /// Height and slope at (x, z), at little more than the cost of one.
    pub fn height_and_slope(&self, at: DVec2) -> (f64, DVec2) {
        let (mut height, mut slope) = (0.0, DVec2::ZERO);
        for w in &self.waves {
            let (sin, cos) = (w.k.dot(at) + w.phase).sin_cos();
            height += w.amplitude * sin;
            slope += w.k * (w.amplitude * cos);
        }
        (height, slope)
    }

    /// The waves at `time`, s: each sine travels along its wave vector, with the angular frequency of
    /// deep water, √(g |k|) (Airy, Tides and waves, 1845).
    pub fn at(&self, time: f64) -> Self {
        let moved = |w: &Wave| {
            let advance = (GRAVITY * w.k.length()).sqrt() * time;
            Wave { phase: (w.phase - advance).rem_euclid(TAU), ..*w }
        };
        // Bit-identical at time 0.
        if time == 0.0 {
            self.clone()
        } else {
            Self { waves: self.waves.iter().map(moved).collect() }
        }
    }

    /// Upper bound of the absolute height, m.
    pub fn bound(&self) -> f64 {
        self.waves.iter().map(|w| w.amplitude.abs()).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The slope is the height's derivative, its RMS is that of the spectrum, and no height exceeds the
    /// bound.
    #[test]
    fn slopes_are_derivatives_with_the_specified_rms() {
        let spectrum =
            WaveSpectrum { count: 60, wavelengths: [0.7, 2.5], rms_slope: 0.056, seed: 1 };
        let waves = Waves::new(&spectrum);
        let mut state = 7;
        let mut squares = DVec2::ZERO;
        let count = 20_000;
        for _ in 0..count {
            let at = 40.0 * DVec2::new(splitmix64(&mut state), splitmix64(&mut state));
            let slope = waves.slope(at);
            let step = 1e-5;
            let difference = DVec2::new(
                waves.height(at + step * DVec2::X) - waves.height(at - step * DVec2::X),
                waves.height(at + step * DVec2::Y) - waves.height(at - step * DVec2::Y),
            ) / (2.0 * step);
            assert!((slope - difference).length() < 1e-7, "{slope} {difference}");
            let (height, both) = waves.height_and_slope(at);
            assert!((height - waves.height(at)).abs() < 1e-14 && (both - slope).length() < 1e-14);
            assert!(waves.height(at).abs() <= waves.bound());
            squares += slope * slope;
        }
        // A sample of 60 directions is not quite isotropic, so both axes are averaged.
        let rms = (squares.element_sum() / (2 * count) as f64).sqrt();
        assert!((rms - 0.056).abs() < 0.002, "{rms}");
    }

    /// A sine of 1.6 m travels one wavelength along its wave vector per period (1.012 s by the
    /// dispersion relation), and time 0 changes nothing.
    #[test]
    fn waves_obey_the_deep_water_dispersion_relation() {
        let length = 1.6;
        let k = DVec2::from_angle(0.7) * (TAU / length);
        let waves = Waves { waves: vec![Wave { k, amplitude: 0.01, phase: 0.3 }] };
        let period = (TAU * length / 9.81).sqrt();
        assert!((period - 1.0123).abs() < 1e-4);
        let at = DVec2::new(0.2, -0.5);
        let along = k.normalize() * length;
        for share in [0.0, 0.1, 0.35, 1.0, 7.6] {
            let later = waves.at(share * period);
            assert!((later.height(at + share * along) - waves.height(at)).abs() < 1e-12);
        }
        assert_eq!(waves.at(0.0), waves);
    }
}
