//! A calm water surface with waves: a sum of sines, exact at any point.

use std::f64::consts::TAU;

use glam::DVec2;
use serde::Deserialize;

/// How waves are drawn at random: isotropic, with wavelengths from a band and slopes of one size.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WaveSpectrum {
    /// Number of sines, 1 to 10,000.
    pub count: u32,
    /// Shortest and longest wavelength, m; each is as likely as any other on a logarithmic scale.
    pub wavelengths: [f64; 2],
    /// Root mean square of the surface's slope along x, and along z.
    pub rms_slope: f64,
    /// Chooses directions, lengths and phases.
    pub seed: u64,
}

/// One sine: height amplitude·sin(k·x + phase).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wave {
    /// Wave vector (x, z), rad/m.
    pub k: DVec2,
    /// Amplitude, m.
    pub amplitude: f64,
    /// Phase, rad.
    pub phase: f64,
}

/// A height above y = 0 for every (x, z).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Waves {
    /// The sines; none for flat water.
    pub waves: Vec<Wave>,
}

impl Waves {
    /// Waves of equal mean slope each, that of all together as `spectrum` says.
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

    /// A height that the surface nowhere exceeds, above or below, m.
    pub fn bound(&self) -> f64 {
        self.waves.iter().map(|w| w.amplitude.abs()).sum()
    }
}

/// The next number in 0..1 of a sequence that depends on its seed alone (Steele, Lea and Flood,
/// Fast splittable pseudorandom number generators, 2014).
pub(crate) fn splitmix64(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Protects what scenes are specified by: the slope is the height's derivative, its size is the
    /// one asked for, and no height exceeds the bound.
    #[test]
    fn slopes_are_derivatives_of_the_size_asked_for() {
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
            assert!(waves.height(at).abs() <= waves.bound());
            squares += slope * slope;
        }
        // One draw of 60 directions is not quite isotropic: the mean over both axes is.
        let rms = (squares.element_sum() / (2 * count) as f64).sqrt();
        assert!((rms - 0.056).abs() < 0.002, "{rms}");
    }
}
