//! Water with waves at y = 0 in a basin, and the reef that may stand in it.

use std::ops::RangeInclusive;

use glam::{DVec2, DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::body::Body;
use crate::rng::splitmix64;
use crate::waves::{WaveSpectrum, Waves};
use limpid::scene::{Shape, Solid, Surface};

/// Calm water with waves, after the pool of Mayer, Assarsson and Sintorn (2026). Only a hull is filled
/// with particles, since the interior is never visible.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pool {
    /// Half the extent along x and z, m.
    pub half_extent: DVec2,
    /// Depth of the bottom below y = 0, m.
    pub depth: f64,
    /// Thickness of the hull of particles, m.
    pub hull: f64,
    /// The waves of the surface.
    pub waves: WaveSpectrum,
    /// Time, s: 0 to 1,000,000, default 0. The waves travel as in deep water.
    #[serde(default)]
    pub time: f64,
    /// Number of particles.
    pub count: f64,
    /// Seed of the arrangement.
    #[serde(default)]
    pub seed: u32,
    /// The reef on the bottom.
    #[serde(default)]
    pub reef: Option<Reef>,
}

/// Bumps on the bottom and thin upright blades: a hard case for screen-space refraction, like the boat
/// scene of Mayer et al. (2026).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reef {
    /// Number of blades, at most 400.
    pub blades: u32,
    /// Number of bumps, at most 100.
    pub bumps: u32,
    /// Seed of their positions.
    #[serde(default)]
    pub seed: u32,
    /// Whether their colours are albedos under the lights, as for other solids.
    #[serde(default)]
    pub lit: bool,
}

impl Pool {
    pub(super) fn ranges(
        &self,
        size: RangeInclusive<f64>,
    ) -> Vec<(&'static str, f64, RangeInclusive<f64>)> {
        let [shortest, longest] = self.waves.wavelengths;
        let thickness = 1e-3..=self.depth.min(self.half_extent.min_element());
        let reef = self.reef.unwrap_or(Reef { blades: 0, bumps: 0, seed: 0, lit: false });
        vec![
            ("half_extent", self.half_extent.x, size.clone()),
            ("half_extent", self.half_extent.y, size.clone()),
            ("depth", self.depth, size.clone()),
            ("hull", self.hull, thickness),
            ("waves.count", self.waves.count.into(), 0.0..=1e4),
            ("waves.wavelengths", shortest, size.clone()),
            ("waves.wavelengths", longest, shortest..=*size.end()),
            ("waves.rms_slope", self.waves.rms_slope, 0.0..=1.0),
            ("time", self.time, 0.0..=1e6),
            ("reef.blades", reef.blades.into(), 0.0..=400.0),
            ("reef.bumps", reef.bumps.into(), 0.0..=100.0),
        ]
    }

    /// The surface at [`Pool::time`].
    pub fn surface(&self) -> Waves {
        Waves::new(&self.waves).at(self.time)
    }

    pub(super) fn body(&self) -> Body {
        let Self { half_extent, depth, hull, .. } = *self;
        let waves = self.surface();
        let bound = waves.bound();
        let corner = DVec3::new(half_extent.x, bound, half_extent.y);
        let min = DVec3::new(-half_extent.x, -depth, -half_extent.y);
        Body::new(min, corner, move |x| {
            // Far from the waves, the distance to the mean surface is accurate enough.
            let far = (x.y.abs() - bound).max(0.0) > 2.0 * hull;
            let height = if far { 0.0 } else { waves.height(DVec2::new(x.x, x.z)) };
            let beside = DVec2::new(x.x, x.z).abs() - half_extent;
            let whole = (x.y - height).max(-depth - x.y).max(beside.max_element());
            whole.max(-hull - whole)
        })
    }

    /// The solids of the reef: blades are boxes, thin along x or z, and bumps are spherical caps.
    pub(super) fn solids(&self) -> Vec<Solid> {
        let Some(reef) = self.reef else { return Vec::new() };
        let mut state = u64::from(reef.seed);
        let mut range = |low: f64, high: f64| low + (high - low) * splitmix64(&mut state);
        let mut solids = Vec::new();
        let [width, depth] = self.half_extent.to_array();
        for _ in 0..reef.bumps {
            let radius = range(0.3, 1.2) * self.depth;
            let top = range(0.1, 0.45) * self.depth;
            let (x, z) = (range(-width, width), range(-depth, depth));
            let center = DVec3::new(x, -self.depth + top - radius, z);
            let shade = range(0.5, 1.0) as f32;
            let even = Vec3::new(0.75, 0.65, 0.45) * shade;
            solids.push(Solid {
                shape: Shape::Sphere { center, radius: radius as f32 },
                surface: Surface::Checker { tile: 0.2 * self.depth as f32, even, odd: 0.6 * even },
                lit: reef.lit,
            });
        }
        for _ in 0..reef.blades {
            let at = DVec2::new(range(-width, width), range(-depth, depth)) * 0.97;
            let height = range(0.4, 1.15) * self.depth;
            let mut half = DVec2::new(range(0.02, 0.05), range(0.006, 0.012)) * self.depth;
            if range(0.0, 1.0) < 0.5 {
                half = DVec2::new(half.y, half.x);
            }
            let green = range(0.3, 0.8) as f32;
            solids.push(Solid {
                shape: Shape::Box {
                    min: DVec3::new(at.x - half.x, -self.depth, at.y - half.y),
                    max: DVec3::new(at.x + half.x, height - self.depth, at.y + half.y),
                },
                surface: Surface::Color(Vec3::new(0.25 * green, green, 0.15 * green)),
                lit: reef.lit,
            });
        }
        solids
    }
}
