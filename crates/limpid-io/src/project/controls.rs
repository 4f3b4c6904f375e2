//! The table of settings with the name, unit, range and description of each, for panels, help and tests.

use super::overrides::replaced;
use limpid::settings::{Settings, Unit};

/// A setting.
#[derive(Debug, Clone, Copy)]
pub struct Control {
    /// Its table in `[settings]`: the name of its pass.
    pub pass: &'static str,
    /// Its key in that table.
    pub key: &'static str,
    /// Its label in the panel.
    pub label: &'static str,
    /// The type and range of its value.
    pub kind: ControlKind,
    /// Its description.
    pub help: &'static str,
}

/// The type and range of a setting's value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ControlKind {
    /// A number from low to high, in a unit.
    Number(f64, f64, &'static str),
    /// A whole number from low to high, in a unit.
    Whole(u32, u32, &'static str),
    /// As [`ControlKind::Whole`], odd numbers only.
    Odd(u32, u32, &'static str),
    /// On or off.
    Toggle,
    /// One of these names.
    Choice(&'static [&'static str]),
}

/// A setting's value.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// The value of a [`ControlKind::Number`].
    Number(f32),
    /// The value of a [`ControlKind::Whole`] or a [`ControlKind::Odd`].
    Whole(u32),
    /// The value of a [`ControlKind::Toggle`].
    Toggle(bool),
    /// The value of a [`ControlKind::Choice`].
    Choice(String),
}

/// The passes that have settings: the name of the table, and a title.
pub const PASSES: [(&str, &str); 6] = [
    ("classify", "Particles to splats"),
    ("layers", "Splats to layers"),
    ("smooth", "Smoothing of the surface"),
    ("refract", "Light through the liquid"),
    ("caustics", "Caustics"),
    ("tonemap", "Radiance to picture"),
];

const fn control(
    pass: &'static str,
    key: &'static str,
    label: &'static str,
    kind: ControlKind,
    help: &'static str,
) -> Control {
    Control { pass, key, label, kind, help }
}

use ControlKind::{Choice, Number, Odd, Toggle, Whole};

/// All settings, in the panel's order.
pub const CONTROLS: [Control; 47] = [
    control(
        "classify",
        "support",
        "Neighbourhood",
        Number(1.0, 10.0, "r"),
        "Radius within which particles are neighbours, in particle radii.",
    ),
    control(
        "classify",
        "splash_density",
        "Splash density",
        Number(0.0, 1.0, ""),
        "Below this share of the density inside a body at rest, a particle is splash.",
    ),
    control(
        "classify",
        "smoothing",
        "Centre smoothing",
        Number(0.0, 1.0, ""),
        "How far a centre moves to the mean of its neighbours (λ of Yu and Turk).",
    ),
    control(
        "classify",
        "max_ratio",
        "Stretch",
        Number(1.0, 100.0, ""),
        "Largest ratio of the covariance's eigenvalues: 1 draws spheres.",
    ),
    control(
        "classify",
        "kernel",
        "Kernel",
        Choice(&["fitted", "volume"]),
        "What scales the axes: the short one as set, or the volume of a sphere (Yu and Turk).",
    ),
    control(
        "classify",
        "short_axis",
        "Short axis",
        Number(0.01, 100.0, "r"),
        "Short semi-axis of fitted kernels: where the liquid ends.",
    ),
    control(
        "classify",
        "long_axis",
        "Long axis",
        Number(0.01, 100.0, "r"),
        "Longest semi-axis of fitted kernels.",
    ),
    control(
        "classify",
        "splash_radius",
        "Splash radius",
        Number(0.01, 100.0, "r"),
        "Radius at which splashes are drawn.",
    ),
    control(
        "classify",
        "wetting",
        "Wetting",
        Number(0.0, 1000.0, "r"),
        "Liquid this near to a solid reaches down to it.",
    ),
    control(
        "classify",
        "iso_surface",
        "Even surface",
        Toggle,
        "Splats at the surface end at an iso-surface of the density (Löschner et al. 2023). Fitted kernels only.",
    ),
    control(
        "layers",
        "intervals",
        "Intervals",
        Whole(1, 3, ""),
        "Bodies of liquid one behind the other, with air between, that a pixel tells apart.",
    ),
    control(
        "smooth",
        "filter",
        "Filter",
        Choice(&["plane-fit", "bilateral", "narrow-range"]),
        "Planes fitted (Imai et al. 2016), bilateral (Green 2010), narrow-range (Truong and Yuksel 2018).",
    ),
    control(
        "smooth",
        "iterations",
        "Iterations",
        Whole(0, 64, ""),
        "How often the filter runs; 0 shows the splats.",
    ),
    control(
        "smooth",
        "window",
        "Window",
        Number(0.1, 1000.0, "r"),
        "Side of the first iteration's window, in pixels or particle radii.",
    ),
    control(
        "smooth",
        "unit",
        "Window in",
        Choice(&["pixel", "radius"]),
        "Pixels as in the paper, or projected particle radii: near and far liquid are equally smooth.",
    ),
    control("smooth", "taps", "Taps", Odd(3, 33, ""), "Samples across the window, an odd number."),
    control(
        "smooth",
        "sigma",
        "Depth range σ",
        Number(1e-3, 1e6, "r"),
        "Differences in depth beyond this count little. Not used by narrow-range.",
    ),
    control(
        "smooth",
        "delta",
        "One surface δ",
        Number(1e-3, 1e6, "r"),
        "Narrow-range: depths that differ by less are one surface.",
    ),
    control(
        "smooth",
        "mu",
        "Behind μ",
        Number(0.0, 1000.0, "r"),
        "Narrow-range: what is further behind, or empty, counts as this far behind.",
    ),
    control(
        "refract",
        "solver",
        "Intersector",
        Choice(&["guarded", "march", "newton", "secant", "plane", "plane3", "single"]),
        "What finds the interfaces.",
    ),
    control("refract", "iterations", "Iterations", Whole(0, 64, ""), "Steps of newton and secant."),
    control(
        "refract",
        "filter",
        "Planes from mips",
        Toggle,
        "Newton reads its first planes from mip levels (Mayer et al. 2026).",
    ),
    control(
        "refract",
        "stride",
        "March stride",
        Whole(1, 64, "px"),
        "Pixels from one sample of march to the next; 1 is exact.",
    ),
    control(
        "refract",
        "reach",
        "Reach",
        Number(1e-4, 1.0, "× height"),
        "What guarded may step over unseen, as a share of the picture's height.",
    ),
    control("refract", "interfaces", "Interfaces", Whole(1, 8, ""), "Interfaces followed per ray."),
    control(
        "refract",
        "internal_bounces",
        "Internal bounces",
        Whole(0, 8, ""),
        "Strong internal reflections followed per ray.",
    ),
    control(
        "refract",
        "samples",
        "Samples",
        Whole(1, 64, "/px"),
        "Rays per pixel against the same layers: square numbers are best.",
    ),
    control(
        "refract",
        "structure",
        "Structure",
        Number(0.0, 1.0, ""),
        "Contrast between neighbouring pixels from which liquid gets all samples, and one below; 0: all everywhere.",
    ),
    control(
        "refract",
        "edge_samples",
        "Edge samples",
        Whole(1, 64, "/px"),
        "Rays per pixel where a solid's edge is in it and no liquid.",
    ),
    control(
        "refract",
        "filter_patterns",
        "Filter patterns",
        Toggle,
        "Checkers are averaged over a ray's footprint: distant ones do not alias.",
    ),
    control(
        "refract",
        "fresnel",
        "Reflectance",
        Choice(&["exact", "schlick"]),
        "Fresnel's equations, or Schlick's approximation.",
    ),
    control(
        "refract",
        "contact",
        "Contact",
        Number(0.0, 1000.0, "r"),
        "Liquid left this near to a solid ahead wets it.",
    ),
    control(
        "refract",
        "radiance_scaling",
        "Scale by index²",
        Toggle,
        "Radiance changes by the square of the index at each interface: wet floors look darker.",
    ),
    control(
        "refract",
        "solids",
        "Solids",
        Choice(&["exact", "screen"]),
        "Rays outside the liquid meet the solids' shapes, or the G-buffer.",
    ),
    control(
        "refract",
        "reflections",
        "Reflections",
        Choice(&["scene", "environment"]),
        "What reflected rays see that are not followed.",
    ),
    control(
        "refract",
        "transparent",
        "Transparent",
        Toggle,
        "Pixels are covered only as far as they show liquid or a solid.",
    ),
    control(
        "caustics",
        "method",
        "Method",
        Choice(&["straight", "forward", "gather"]),
        "No caustics; a refracted grid (Mayer et al. 2026); or gathered (Granizo-Hidalgo and Holzschuch 2024).",
    ),
    control(
        "caustics",
        "resolution",
        "Map",
        Whole(16, 8192, "texels"),
        "Texels along the longer side of a light's view.",
    ),
    control("caustics", "grid", "Grid", Whole(8, 8192, "cells"), "Cells along that side."),
    control(
        "caustics",
        "subdivide",
        "Parts of a cell",
        Whole(1, 8, ""),
        "Parts along a cell's side in which forward lays its light.",
    ),
    control(
        "caustics",
        "interfaces",
        "Interfaces",
        Whole(1, 2, ""),
        "1: into the liquid; 2: and out of it.",
    ),
    control(
        "caustics",
        "steps",
        "Gather steps",
        Whole(1, 4096, ""),
        "Triangles that gather walks at most for each texel.",
    ),
    control(
        "caustics",
        "blur",
        "Blur",
        Number(0.0, 1e9, "m"),
        "Width of the light's blur: the standard deviation of a Gaussian.",
    ),
    control(
        "caustics",
        "margin",
        "Margin",
        Number(0.0, 10.0, "× liquid"),
        "How far a light's view reaches beyond the liquid.",
    ),
    control(
        "tonemap",
        "exposure",
        "Exposure",
        Number(-64.0, 64.0, "stops"),
        "Radiance is multiplied by 2 to this power.",
    ),
    control("tonemap", "curve", "Curve", Choice(&["none", "aces"]), "What compresses radiance."),
    control(
        "tonemap",
        "dither",
        "Dither",
        Toggle,
        "Whether smooth gradients are dithered against bands.",
    ),
];

impl Control {
    /// The setting's name in `--set` and error messages: `pass.key`.
    pub fn path(&self) -> String {
        format!("{}.{}", self.pass, self.key)
    }

    /// The unit of its value, which may depend on another setting; empty if there is none.
    pub fn unit(&self, settings: &Settings) -> &'static str {
        match self.kind {
            _ if self.key == "window" && settings.smooth.unit == Unit::Pixel => "px",
            Number(_, _, unit) | Whole(_, _, unit) | Odd(_, _, unit) => unit,
            Toggle | Choice(_) => "",
        }
    }

    /// Its value in `settings`.
    pub fn get(&self, settings: &Settings) -> Value {
        self.of(&table(settings))
    }

    /// Its value in the [`table`] of settings.
    pub fn of(&self, table: &toml::Table) -> Value {
        match &table[self.pass][self.key] {
            toml::Value::Float(x) => Value::Number(*x as f32),
            toml::Value::Integer(n) => Value::Whole(*n as u32),
            toml::Value::Boolean(yes) => Value::Toggle(*yes),
            toml::Value::String(name) => Value::Choice(name.clone()),
            other => unreachable!("a setting cannot be a {}", other.type_str()),
        }
    }

    /// Replaces its value; a value of another kind has no effect.
    pub fn set(&self, settings: &mut Settings, value: &Value) {
        if let Ok(changed) = replaced(settings, &[format!("{}={value}", self.path())]) {
            *settings = changed;
        }
    }
}

impl std::fmt::Display for Value {
    /// Formats the value for `--set`: numbers as the shortest text that parses to the same value.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            // With a decimal point: TOML reads a number without one as an integer.
            Self::Number(x) => write!(f, "{x:?}"),
            Self::Whole(n) => write!(f, "{n}"),
            Self::Toggle(yes) => write!(f, "{yes}"),
            Self::Choice(name) => write!(f, "{name}"),
        }
    }
}

/// The settings of `to` that differ from `from`.
pub fn differences(from: &Settings, to: &Settings) -> Vec<(&'static Control, Value)> {
    let (from, to) = (table(from), table(to));
    let values = CONTROLS.iter().map(|control| (control, control.of(&to)));
    values.filter(|(control, value)| control.of(&from) != *value).collect()
}

/// Settings as in a scene file: one table for each pass.
pub fn table(settings: &Settings) -> toml::Table {
    // By their text, which has the fewest digits of 32-bit floats; a table has 64-bit ones.
    let text = toml::to_string(settings).expect("settings serialize to a table");
    text.parse().expect("settings are read as they are written")
}
