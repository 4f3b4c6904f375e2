//! Renderer settings: one struct per pass, with the same names as the `[settings]` tables of a scene file.
//!
//! Lengths marked *r* are multiples of the particle radius, so that one set of defaults works for
//! millimetre drops and for dams of many metres.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// All settings of the renderer.
///
/// In a scene file, `[settings]` may name a [`Preset`], which supplies the values that the tables do
/// not set: `preset = "imai2016"`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Classification into splashes and aggregates, and splat shapes.
    pub classify: Classify,
    /// Intervals of the layers.
    pub layers: Layers,
    /// Smoothing of the aggregate layers.
    pub smooth: Smooth,
    /// Refraction through the layers.
    pub refract: Refract,
    /// Caustics of the lights.
    pub caustics: Caustics,
    /// Tone mapping.
    pub tonemap: Tonemap,
}

/// How the kernel's semi-axes are scaled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kernel {
    /// The short semi-axis is fixed at [`Classify::short_axis`], so that the drawn surface coincides
    /// with the liquid's boundary.
    #[default]
    Fitted,
    /// The kernel has the volume of a sphere of radius r, with no axis longer than 1.2 r
    /// (Yu and Turk 2013; Imai et al. 2016).
    Volume,
}

/// Settings of [`crate::liquid::classify`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Classify {
    /// Neighbourhood radius h, in r: 1 to 10, default 4.
    pub support: f32,
    /// Density below which a particle is a splash, relative to the density inside a body at rest: 0 to
    /// 1, default 0.12. A lone particle has 0.06, a pair 0.11, three 0.16, a single-layer sheet 0.42.
    pub splash_density: f32,
    /// λ: how far a centre moves towards its neighbours' mean: 0 to 1, default 0.8.
    pub smoothing: f32,
    /// `k_r`: largest ratio of covariance eigenvalues: 1 to 100, default 1.8 (Yu and Turk: 4).
    pub max_ratio: f32,
    /// Scaling of the semi-axes.
    pub kernel: Kernel,
    /// Short semi-axis of `fitted` kernels, in r: 0.01 to 100, default 1.45.
    pub short_axis: f32,
    /// Longest semi-axis of `fitted` kernels, in r: 0.01 to 100, default 2.2.
    pub long_axis: f32,
    /// Radius of a splash, in r: 0.01 to 100, default 1.2.
    pub splash_radius: f32,
    /// Distance from a solid within which the centre of an aggregate must lie for the aggregate to wet
    /// that solid, in r: 0 (never) to 1000, default 3.3.
    pub wetting: f32,
    /// Whether the splats at the surface of bodies are moved so that they end at an iso-surface of the SPH
    /// density, smoothed once, which evens out the bumps that single particles leave; default true, false in
    /// the presets of papers. The level 0.6 and the smoothing are those of meshes of SPH: Löschner, Böttcher,
    /// Jeske and Bender, "Weighted Laplacian Smoothing for Surface Reconstruction of Particle-based Fluids"
    /// (2023), and its program splashsurf. Only with `fitted` kernels, and not in crowds, where nearly all
    /// particles are neighbours of each other.
    pub iso_surface: bool,
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
            iso_surface: true,
        }
    }
}

/// Settings of the layers that the liquid is splatted into: [`crate::passes::gaps`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Layers {
    /// Intervals of liquid, with air between them, that a pixel distinguishes in each class: 1 (from the first
    /// front to the last back, as in the papers) to 3, default 2. With 1, crests in front of pools and drops in a row
    /// appear filled with liquid. Particles that fill only a hull, as those of the recipe `pool`, have one.
    pub intervals: u32,
}

impl Default for Layers {
    fn default() -> Self {
        Self { intervals: 2 }
    }
}

/// Unit of screen-space lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// Pixels, as in Imai et al. (2016).
    #[default]
    Pixel,
    /// Projected particle radii: near and far liquid are smoothed equally.
    Radius,
}

/// Depth smoothing filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Filter {
    /// Plane fit over the window (Imai et al. 2016): preserves slopes and borders.
    #[default]
    PlaneFit,
    /// Bilateral filter: the mean of the window's depths, weighted by one Gaussian of screen distance
    /// and one of depth difference (Green 2010; Imai et al. 2014). Biased inwards at borders.
    Bilateral,
    /// Narrow-range filter: a Gaussian mean of the depths within a range; rounds off steps and borders
    /// (Truong and Yuksel 2018).
    NarrowRange,
}

/// Settings of [`crate::passes::smooth`].
///
/// The screen-space Gaussian of `bilateral` and `narrow-range` has a σ of a quarter of the window: the
/// window ends at 2 σ.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Smooth {
    /// Filter.
    pub filter: Filter,
    /// Number of iterations: 0 to 64, default 5.
    pub iterations: u32,
    /// Side of the first iteration's square window, in `unit`s: 0.1 to 1000, default 2.4.
    pub window: f32,
    /// Unit of `window`.
    pub unit: Unit,
    /// Samples across the window: odd, 3 to 33, default 5. Each further iteration halves their
    /// spacing. In radii, it ends where they would be less than half a pixel apart, so that liquid
    /// far away is not smoothed over more radii. In pixels, the spacing stays at one; a window of as
    /// many pixels as taps is thus the paper's, the same in every iteration.
    pub taps: u32,
    /// σ of the depth weight exp(−Δz²/σ²), in r: 0.001 to 10⁶, default 1.5 (Imai et al.: 5.3). Not used
    /// by `narrow-range`.
    pub sigma: f32,
    /// δ of `narrow-range`, in r: 0.001 to 10⁶, default 10 (Truong and Yuksel). Depths that differ
    /// by less belong to one surface.
    pub delta: f32,
    /// μ of `narrow-range`, in r: 0 to 1000, default 1 (Truong and Yuksel). A tap that is empty, or
    /// more than δ behind the pixel, counts as this far behind it.
    pub mu: f32,
}

impl Default for Smooth {
    fn default() -> Self {
        Self {
            filter: Filter::PlaneFit,
            iterations: 5,
            window: 2.4,
            unit: Unit::Radius,
            taps: 5,
            sigma: 1.5,
            delta: 10.0,
            mu: 1.0,
        }
    }
}

/// Intersector, which finds the interfaces along a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Bracketed Newton's method on disparity.
    #[default]
    Guarded,
    /// Ray march over every texel, or every [`Refract::stride`]th (`McGuire` and Mara 2014).
    March,
    /// A fixed number of tangent-plane iterations (Mayer et al. 2026).
    Newton,
    /// A fixed number of secant steps (Imai et al. 2014, 2016).
    Secant,
    /// One tangent plane (Mayer and Assarsson, poster, method 1).
    Plane,
    /// One plane through three depths (the poster's method 2).
    Plane3,
    /// One lookup, offset by the normal (Sousa 2005).
    Single,
}

impl Solver {
    /// All intersectors, simplest first.
    pub const ALL: [Self; 7] = [
        Self::Single,
        Self::Plane,
        Self::Plane3,
        Self::Secant,
        Self::Newton,
        Self::March,
        Self::Guarded,
    ];
}

/// Reflectance formula.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fresnel {
    /// Fresnel's equations for a dielectric.
    #[default]
    Exact,
    /// Schlick's approximation, as in Imai et al. (2016).
    Schlick,
}

/// How rays outside the liquid are intersected with the solids.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solids {
    /// Analytically: exact, also outside the picture.
    #[default]
    Exact,
    /// In the G-buffer by the same intersector, with the analytic test as fallback.
    Screen,
}

/// Radiance that a reflected ray receives if it is not traced further.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reflections {
    /// Solids and environment.
    #[default]
    Scene,
    /// The environment only, as in Imai et al. (2016).
    Environment,
}

/// Settings of [`crate::passes::refract`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Refract {
    /// Intersector.
    pub solver: Solver,
    /// Iterations of `newton` and `secant`: 0 to 64, default 4.
    pub iterations: u32,
    /// Whether `newton` reads its first planes from mip levels (Mayer et al. 2026, section 2.1).
    pub filter: bool,
    /// Pixels between samples of `march`: 1 (exact for the layers) to 64, default 1.
    pub stride: u32,
    /// Largest unchecked step of `guarded`, as a share of the picture height: 0.0001 to 1, default 0.01.
    /// Narrower gaps and obstacles can be missed. At least 4 pixels inside liquid, 8 outside.
    pub reach: f32,
    /// Interfaces followed per ray: 1 to 8, default 4.
    pub interfaces: u32,
    /// Strong internal reflections followed per ray: 0 (Imai et al.) to 8, default 4.
    pub internal_bounces: u32,
    /// Rays per pixel against the same layers: 1 to 64, default 1; square numbers are best.
    pub samples: u32,
    /// Liquid pixels get one ray, and [`Refract::samples`] where the picture has structure: where its second difference
    /// between neighbouring pixels exceeds this share of their radiance. 0 (all pixels get them) to 1, default 0.1.
    pub structure: f32,
    /// Rays per pixel that has no liquid but an edge of a solid or of its pattern: 1 to 64, default 16.
    /// No effect unless above `samples`.
    pub edge_samples: u32,
    /// Whether checkers are averaged over the footprint of a ray, so that distant ones neither alias nor
    /// need many rays.
    pub filter_patterns: bool,
    /// Reflectance formula.
    pub fresnel: Fresnel,
    /// Distance between a ray's exit point and the solid ahead below which the liquid wets that solid,
    /// in r: 0 (never) to 1000, default 0.5. For larger gaps see [`Classify::wetting`].
    pub contact: f32,
    /// Whether radiance is scaled by the squared index of refraction at each interface.
    pub radiance_scaling: bool,
    /// How rays outside the liquid are intersected with the solids.
    pub solids: Solids,
    /// Radiance that a reflected ray receives if it is not traced further.
    pub reflections: Reflections,
    /// Whether a pixel is covered only as far as it shows liquid or a solid, for pictures that lie over
    /// others; otherwise the environment fills it.
    pub transparent: bool,
}

impl Default for Refract {
    fn default() -> Self {
        Self {
            solver: Solver::Guarded,
            iterations: 4,
            filter: false,
            stride: 1,
            reach: 0.01,
            interfaces: 4,
            internal_bounces: 4,
            samples: 1,
            structure: 0.1,
            edge_samples: 16,
            filter_patterns: false,
            fresnel: Fresnel::Exact,
            contact: 0.5,
            radiance_scaling: true,
            solids: Solids::Exact,
            reflections: Reflections::Scene,
            transparent: false,
        }
    }
}

/// Caustics method: how light through liquid is matched to receivers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Unrefracted light, attenuated by reflection and absorption: no caustics.
    Straight,
    /// Forward from the liquid surface to the receivers, by the cells of a grid (Mayer et al. 2026).
    #[default]
    Forward,
    /// Backward from each receiver to the surface point that sends light there (Granizo-Hidalgo and
    /// Holzschuch 2024). Only receivers in liquid, and one path per receiver.
    Gather,
}

impl Method {
    /// All methods, simplest first.
    pub const ALL: [Self; 3] = [Self::Straight, Self::Forward, Self::Gather];
}

/// Settings of [`crate::passes::caustics`]. Each light has a map; none is drawn without a lit solid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Caustics {
    /// Method.
    pub method: Method,
    /// Texels along the longer side of a light's view: 16 to 8192, default 512.
    pub resolution: u32,
    /// Grid cells along that side: 8 to 8192, default 512.
    pub grid: u32,
    /// Parts into which `forward` divides each side of a cell: 1 to 8, default 2. Interpolates landing
    /// points between grid vertices: finer than the grid at a fraction of its cost.
    pub subdivide: u32,
    /// Interfaces that light is traced through: 1 (into the liquid; enough where solids bound it, as in
    /// a pool) or 2 (also out of it), default 2.
    pub interfaces: u32,
    /// Maximum number of triangles that `gather` walks per texel: 1 to 4096, default 256.
    pub steps: u32,
    /// Blur of the map, which approximates an area light: standard deviation of a Gaussian across the
    /// light direction, m; default 0.
    pub blur: f32,
    /// How far a light's view extends beyond the liquid, as a share of the liquid's extent: 0 to 10,
    /// default 0.1. Light that leaves the view is lost.
    pub margin: f32,
}

impl Default for Caustics {
    fn default() -> Self {
        Self {
            method: Method::Forward,
            resolution: 512,
            grid: 512,
            subdivide: 2,
            interfaces: 2,
            steps: 256,
            blur: 0.0,
            margin: 0.1,
        }
    }
}

/// Tone curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Curve {
    /// None: an unlit solid appears in its own colour.
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
    /// Curve applied after exposure.
    pub curve: Curve,
    /// Whether 8-bit sRGB pictures are dithered, by up to half a step, so that smooth gradients have no bands. The
    /// default is false: error measures see the steps.
    pub dither: bool,
}

/// Settings that reproduce a published method, for comparison with it.
///
/// Where a paper does not state a parameter, the substitute is listed below: a related paper's value
/// or limpid's default. [`Settings::caustics`] and [`Settings::tonemap`] belong to the picture, not to
/// the method, and have their defaults in every preset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// The defaults.
    Limpid,
    /// Imai, Kanamori, Fukui and Mitani, Real-Time Screen-Space Liquid Rendering with Two-Sided
    /// Refractions (2014), as Imai et al. (2016) describe it in section 3.1: all particles are
    /// spheres in one pair of layers, smoothed by an iterated bilateral filter, and two refractions
    /// are found by the secant method.
    ///
    /// The later paper does not state this filter's window, σ and iterations. The preset uses those of
    /// the later paper's own filter, so that the two presets differ in the filter alone. All else as in
    /// [`Preset::Imai2016`].
    Imai2014,
    /// Imai, Kanamori and Mitani, Real-Time Screen-Space Liquid Rendering with Complex Refractions
    /// (2016).
    ///
    /// - Section 4.1: splash or aggregate by density. Threshold and neighbourhood are unstated:
    ///   defaults.
    /// - Section 4.2: splashes of radius r; ellipsoids after Yu and Turk (2013), none longer than
    ///   1.2 r. λ = 0.9 and `k_r` = 4 are Yu and Turk's.
    /// - Sections 4.3 and 5: planes fitted to 9 × 9 pixels, σ = 5.3 r; 5 iterations, as for its
    ///   "steps" scene and its million-particle scene ("wave": 2).
    /// - Section 4.4: secant steps; their number is unstated: default.
    /// - Section 4.5: four interfaces, Schlick's formula; reflected rays look up the background and
    ///   are not traced. Multisampling is not mentioned: one ray per pixel. The intersection with the
    ///   background's shapes is unstated: exact.
    /// - Contact of liquid and solids is unstated: wetting, contact and radiance scaling, which only
    ///   affects wet solids, are the defaults. Without them, an air film under the liquid and an
    ///   overbright floor would hide every other difference.
    Imai2016,
    /// Mayer, Assarsson and Sintorn, Ultrafast Screen-Space Refractions and Caustics via Newton's
    /// Method (2026), with the parameters of their Buddha, the scene with two-sided refraction.
    ///
    /// - Section 2.1: tangent-plane iterations. Table 1: 5 of them for the Buddha (3 for the pool, 4
    ///   for the boat).
    /// - Section 2.3: two interfaces from front and back faces, then the scene behind by the same
    ///   iterations in the G-buffer: `solids = "screen"`.
    /// - Reflectance is unstated: Schlick's formula, as in their published code. All other light
    ///   transport is unstated too: as in [`Preset::Imai2016`].
    /// - Their liquid is a mesh: `classify` and `smooth`, which build the surface here, are the
    ///   defaults without `iso_surface`, and with the window of 3 r that suits such a surface.
    Mayer2026,
}

impl Preset {
    /// All presets.
    pub const ALL: [Self; 4] = [Self::Limpid, Self::Imai2014, Self::Imai2016, Self::Mayer2026];

    /// Returns the preset's settings.
    pub fn settings(self) -> Settings {
        match self {
            Self::Limpid => Settings::default(),
            Self::Imai2014 => {
                let later = Self::Imai2016.settings();
                Settings {
                    classify: Classify {
                        // All particles are aggregates: undisplaced spheres.
                        splash_density: 0.0,
                        max_ratio: 1.0,
                        smoothing: 0.0,
                        ..later.classify
                    },
                    smooth: Smooth { filter: Filter::Bilateral, ..later.smooth },
                    refract: Refract { interfaces: 2, ..later.refract },
                    ..later
                }
            }
            Self::Imai2016 => Settings {
                classify: Classify {
                    smoothing: 0.9,
                    max_ratio: 4.0,
                    kernel: Kernel::Volume,
                    splash_radius: 1.0,
                    iso_surface: false,
                    ..Classify::default()
                },
                layers: Layers { intervals: 1 },
                smooth: Smooth {
                    filter: Filter::PlaneFit,
                    iterations: 5,
                    window: 9.0,
                    unit: Unit::Pixel,
                    taps: 9,
                    sigma: 5.3,
                    ..Smooth::default()
                },
                refract: Refract {
                    solver: Solver::Secant,
                    interfaces: 4,
                    internal_bounces: 0,
                    samples: 1,
                    fresnel: Fresnel::Schlick,
                    solids: Solids::Exact,
                    reflections: Reflections::Environment,
                    ..Refract::default()
                },
                ..Self::Limpid.settings()
            },
            Self::Mayer2026 => Settings {
                classify: Classify { iso_surface: false, ..Classify::default() },
                smooth: Smooth { window: 3.0, ..Smooth::default() },
                refract: Refract {
                    solver: Solver::Newton,
                    iterations: 5,
                    interfaces: 2,
                    solids: Solids::Screen,
                    ..Self::Imai2016.settings().refract
                },
                layers: Layers { intervals: 1 },
                ..Settings::default()
            },
        }
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Limpid => "limpid",
            Self::Imai2014 => "imai2014",
            Self::Imai2016 => "imai2016",
            Self::Mayer2026 => "mayer2026",
        })
    }
}

impl Settings {
    /// Checks every number against its range.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the first value out of range.
    pub fn check(&self) -> Result<()> {
        let (c, s, r) = (&self.classify, &self.smooth, &self.refract);
        let caustics = &self.caustics;
        let checks = [
            ("classify.support", c.support, 1.0, 10.0),
            ("classify.splash_density", c.splash_density, 0.0, 1.0),
            ("classify.smoothing", c.smoothing, 0.0, 1.0),
            ("classify.max_ratio", c.max_ratio, 1.0, 100.0),
            ("classify.short_axis", c.short_axis, 0.01, 100.0),
            ("classify.long_axis", c.long_axis, 0.01, 100.0),
            ("classify.splash_radius", c.splash_radius, 0.01, 100.0),
            ("classify.wetting", c.wetting, 0.0, 1000.0),
            ("layers.intervals", self.layers.intervals as f32, 1.0, 3.0),
            ("smooth.iterations", s.iterations as f32, 0.0, 64.0),
            ("smooth.window", s.window, 0.1, 1000.0),
            ("smooth.taps", s.taps as f32, 3.0, 33.0),
            ("smooth.sigma", s.sigma, 1e-3, 1e6),
            ("smooth.delta", s.delta, 1e-3, 1e6),
            ("smooth.mu", s.mu, 0.0, 1000.0),
            ("refract.iterations", r.iterations as f32, 0.0, 64.0),
            ("refract.stride", r.stride as f32, 1.0, 64.0),
            ("refract.reach", r.reach, 1e-4, 1.0),
            ("refract.interfaces", r.interfaces as f32, 1.0, 8.0),
            ("refract.internal_bounces", r.internal_bounces as f32, 0.0, 8.0),
            ("refract.samples", r.samples as f32, 1.0, 64.0),
            ("refract.structure", r.structure, 0.0, 1.0),
            ("refract.edge_samples", r.edge_samples as f32, 1.0, 64.0),
            ("refract.contact", r.contact, 0.0, 1000.0),
            ("caustics.resolution", caustics.resolution as f32, 16.0, 8192.0),
            ("caustics.grid", caustics.grid as f32, 8.0, 8192.0),
            ("caustics.subdivide", caustics.subdivide as f32, 1.0, 8.0),
            ("caustics.interfaces", caustics.interfaces as f32, 1.0, 2.0),
            ("caustics.steps", caustics.steps as f32, 1.0, 4096.0),
            ("caustics.blur", caustics.blur, 0.0, 1e9),
            ("caustics.margin", caustics.margin, 0.0, 10.0),
            ("tonemap.exposure", self.tonemap.exposure, -64.0, 64.0),
        ];
        for (key, value, low, high) in checks {
            if !(low..=high).contains(&value) {
                return Err(Error::invalid(
                    "settings",
                    format!("{key} is {value}, expected {low} to {high}"),
                ));
            }
        }
        if s.taps % 2 == 0 {
            return Err(Error::invalid(
                "settings",
                format!("smooth.taps is {}, expected an odd number", s.taps),
            ));
        }
        Ok(())
    }
}
