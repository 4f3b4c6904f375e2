//! Settings: one struct per pass, the same names as in a scene file's `[settings]` tables.
//!
//! Lengths marked *r* are multiples of the particle radius, so that one set of defaults serves
//! drops of millimetres and dams of metres.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// All settings of the renderer. The defaults are those of the README's first row.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Splash or aggregate, and the shape of each splat.
    pub classify: Classify,
    /// Plane fitting on the aggregate layers.
    pub smooth: Smooth,
    /// Light through the layers.
    pub refract: Refract,
    /// Radiance to display.
    pub tonemap: Tonemap,
}

/// How the kernel's semi-axes get their scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kernel {
    /// The short semi-axis is held at [`Classify::short_axis`], so that the drawn surface lies
    /// where the liquid ends.
    #[default]
    Fitted,
    /// The kernel keeps the volume of a sphere of radius r, no axis longer than 1.2 r
    /// (Yu and Turk 2013; Imai et al. 2016).
    Volume,
}

/// Settings of [`crate::passes::classify`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Classify {
    /// Neighbourhood h, in r: 1 to 10, default 4.
    pub support: f32,
    /// A particle is splash below this density, as a share of that inside a body at rest: 0 to 1,
    /// default 0.12. A lone particle has 0.06, a pair 0.11, three 0.16, a sheet of one layer 0.42.
    pub splash_density: f32,
    /// λ: how far a centre moves to its neighbours' mean: 0 to 1, default 0.8.
    pub smoothing: f32,
    /// `k_r`: the largest ratio of covariance eigenvalues: 1 to 100, default 1.8 (Yu and Turk: 4).
    pub max_ratio: f32,
    /// Which rule scales the axes.
    pub kernel: Kernel,
    /// Short semi-axis of `fitted` kernels, in r: 0.01 to 100, default 1.45.
    pub short_axis: f32,
    /// Longest semi-axis of `fitted` kernels, in r: 0.01 to 100, default 2.2.
    pub long_axis: f32,
    /// Radius of a splash, in r: 0.01 to 100, default 1.2.
    pub splash_radius: f32,
    /// Aggregates whose centre is this near to a solid reach down to it, in r: 0 (none does) to
    /// 1000, default 3.3.
    pub wetting: f32,
}

impl Default for Classify {
    fn default() -> Self {
        Self {
            support: 4.0,
            splash_density: 0.12,
            smoothing: 0.8,
            max_ratio: 1.8,
            kernel: Kernel::Fitted,
            short_axis: 1.45,
            long_axis: 2.2,
            splash_radius: 1.2,
            wetting: 3.3,
        }
    }
}

/// What lengths on the screen are measured in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// Pixels, as Imai et al. (2016).
    #[default]
    Pixel,
    /// Projected particle radii: near and far liquid are equally smooth.
    Radius,
}

/// Settings of [`crate::passes::smooth`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Smooth {
    /// Number of plane-fitting iterations: 0 to 64, default 5.
    pub iterations: u32,
    /// Side of the first iteration's square window, in `unit`s: 0.1 to 1000, default 3.
    pub window: f32,
    /// Unit of `window`.
    pub unit: Unit,
    /// Samples across the window: odd, 3 to 33, default 5. Each further iteration takes them half
    /// as far apart, but never nearer than a pixel; so a window of as many pixels as taps is the
    /// paper's, the same in every iteration.
    pub taps: u32,
    /// σ of the depth weight, in r: 0.001 to 10⁶, default 1.5 (Imai et al.: 5.3).
    pub sigma: f32,
}

impl Default for Smooth {
    fn default() -> Self {
        Self { iterations: 5, window: 3.0, unit: Unit::Radius, taps: 5, sigma: 1.5 }
    }
}

/// Which intersector finds the interfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Newton's method on disparity, bracketed.
    #[default]
    Guarded,
    /// Every texel along the ray.
    March,
    /// A fixed number of tangent-plane iterations (Mayer et al. 2026).
    Newton,
}

/// Which reflectance formula.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fresnel {
    /// Fresnel's equations for a dielectric.
    #[default]
    Exact,
    /// Schlick's approximation, as Imai et al. (2016).
    Schlick,
}

/// How rays outside the liquid find the solids.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solids {
    /// Against their shapes: exact, also where the picture does not show them.
    #[default]
    Exact,
    /// In the G-buffer by the same intersector, and exactly where it finds nothing.
    Screen,
}

/// What reflected rays that are not followed see.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reflections {
    /// Solids and environment.
    #[default]
    Scene,
    /// The environment only, as Imai et al. (2016).
    Environment,
}

/// Settings of [`crate::passes::refract`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Refract {
    /// The intersector.
    pub solver: Solver,
    /// Iterations of the `newton` intersector: 0 to 64, default 4.
    pub iterations: u32,
    /// Interfaces followed per ray: 1 to 8, default 4.
    pub interfaces: u32,
    /// Strong internal reflections followed per ray: 0 (Imai et al.) to 8, default 4.
    pub internal_bounces: u32,
    /// Rays per pixel against the same layers: 1 to 64, default 1; square numbers are best.
    pub samples: u32,
    /// Which reflectance formula.
    pub fresnel: Fresnel,
    /// Liquid that a ray leaves this near to the solid ahead of it wets that solid, in r: 0 (never)
    /// to 1000, default 1. For what rests further off there is [`Classify::wetting`].
    pub contact: f32,
    /// Scale radiance by the square of the index at each interface.
    pub radiance_scaling: bool,
    /// How rays outside the liquid find the solids.
    pub solids: Solids,
    /// What reflected rays that are not followed see.
    pub reflections: Reflections,
}

impl Default for Refract {
    fn default() -> Self {
        Self {
            solver: Solver::Guarded,
            iterations: 4,
            interfaces: 4,
            internal_bounces: 4,
            samples: 1,
            fresnel: Fresnel::Exact,
            contact: 1.0,
            radiance_scaling: true,
            solids: Solids::Exact,
            reflections: Reflections::Scene,
        }
    }
}

/// Which curve compresses radiance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Curve {
    /// None: what an unlit solid emits is what the picture shows.
    #[default]
    None,
    /// A fit of the ACES reference curve (Narkowicz 2015).
    Aces,
}

/// Settings of [`crate::passes::tonemap`].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Tonemap {
    /// Exposure in stops, −64 to 64, default 0: radiance is multiplied by 2 to this power.
    pub exposure: f32,
    /// The curve after it.
    pub curve: Curve,
}

impl Settings {
    /// These settings with some replaced: each override is `pass.name=value`.
    ///
    /// # Errors
    /// [`Error::Scene`] naming the override, and the nearest key for an unknown one.
    pub fn with(&self, overrides: &[String]) -> Result<Self> {
        let mut settings = self.clone();
        for text in overrides {
            settings = settings.with_one(text).map_err(|problem: String| Error::Scene {
                origin: format!("--set {text}"),
                problem,
            })?;
        }
        Ok(settings)
    }

    fn with_one(&self, text: &str) -> Result<Self, String> {
        let (path, value) = text.split_once('=').ok_or("expected pass.name=value")?;
        let (pass, name) = path.trim().split_once('.').ok_or("expected pass.name=value")?;
        // A bare word is a string: `refract.solver=march` needs no quotes.
        let value: toml::Value = format!("v = {value}")
            .parse::<toml::Table>()
            .ok()
            .and_then(|mut table| table.remove("v"))
            .unwrap_or_else(|| toml::Value::String(value.trim().to_owned()));
        let mut table = toml::Table::try_from(self).map_err(|e| e.to_string())?;
        let pass = table
            .entry(pass)
            .or_insert_with(|| toml::Value::Table(toml::Table::new()))
            .as_table_mut()
            .ok_or("expected pass.name=value")?;
        // An integer is a number too.
        let value = match (pass.get(name), value) {
            (Some(toml::Value::Float(_)), toml::Value::Integer(i)) => toml::Value::Float(i as f64),
            (_, value) => value,
        };
        pass.insert(name.to_owned(), value);
        let written = toml::to_string(&table).map_err(|e| e.to_string())?;
        toml::from_str(&written).map_err(|e| match crate::scene::toml_error("", "", &e) {
            Error::Scene { problem, .. } => problem,
            other => other.to_string(),
        })
    }

    /// Checks every number against its range.
    ///
    /// # Errors
    /// [`Error::Scene`] naming the first that is outside.
    pub fn check(&self) -> Result<()> {
        let (c, s, r) = (&self.classify, &self.smooth, &self.refract);
        let checks = [
            ("classify.support", c.support, 1.0, 10.0),
            ("classify.splash_density", c.splash_density, 0.0, 1.0),
            ("classify.smoothing", c.smoothing, 0.0, 1.0),
            ("classify.max_ratio", c.max_ratio, 1.0, 100.0),
            ("classify.short_axis", c.short_axis, 0.01, 100.0),
            ("classify.long_axis", c.long_axis, 0.01, 100.0),
            ("classify.splash_radius", c.splash_radius, 0.01, 100.0),
            ("classify.wetting", c.wetting, 0.0, 1000.0),
            ("smooth.iterations", s.iterations as f32, 0.0, 64.0),
            ("smooth.window", s.window, 0.1, 1000.0),
            ("smooth.taps", s.taps as f32, 3.0, 33.0),
            ("smooth.sigma", s.sigma, 1e-3, 1e6),
            ("refract.iterations", r.iterations as f32, 0.0, 64.0),
            ("refract.interfaces", r.interfaces as f32, 1.0, 8.0),
            ("refract.internal_bounces", r.internal_bounces as f32, 0.0, 8.0),
            ("refract.samples", r.samples as f32, 1.0, 64.0),
            ("refract.contact", r.contact, 0.0, 1000.0),
            ("tonemap.exposure", self.tonemap.exposure, -64.0, 64.0),
        ];
        for (key, value, low, high) in checks {
            if !(low..=high).contains(&value) {
                return Err(Error::Scene {
                    origin: "settings".into(),
                    problem: format!("{key} is {value}, expected {low} to {high}"),
                });
            }
        }
        if s.taps % 2 == 0 {
            return Err(Error::Scene {
                origin: "settings".into(),
                problem: format!("smooth.taps is {}, expected an odd number", s.taps),
            });
        }
        Ok(())
    }
}
