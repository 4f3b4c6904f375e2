//! Scene description: the liquid's optics, solids, lights, environment and settings.

use std::sync::Arc;

use glam::{BVec3, DVec3, Vec3, Vec3Swizzles as _};
use serde::{Deserialize, Serialize};

use crate::camera::is_position;
use crate::environment::{Environment, is_radiance};
use crate::error::{Error, Result};
use crate::mesh::{Mesh, Placement, Texture};
use crate::settings::Settings;

/// Maximum number of solids in a scene: 64 KiB of uniform memory.
pub const MAX_SOLIDS: usize = 512;

/// Maximum number of lights in a scene.
pub const MAX_LIGHTS: usize = 16;

/// Maximum number of fluids in a scene.
pub const MAX_FLUIDS: usize = 16;

/// Largest mean cosine of the scattering angle, and its negative the smallest.
pub const MAX_ANISOTROPY: f32 = 0.99;

/// Everything that a picture shows except the particles and the camera.
///
/// Later versions may add fields: write `Scene { solids, ..Scene::default() }`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scene {
    /// The liquid's optics.
    pub liquid: Liquid,
    /// The medium of each fluid; empty for a single liquid. All fluids share the index of refraction of
    /// [`Scene::liquid`].
    pub fluids: Vec<Medium>,
    /// Radiance of rays that hit neither liquid nor a solid.
    pub environment: Environment,
    /// A picture behind everything, in place of the environment where the picture shows it. It fills the
    /// picture and keeps its shape. Rays that leave the picture, or do not go on ahead, see the environment.
    pub background: Option<Arc<Texture>>,
    /// Opaque bodies.
    pub solids: Vec<Solid>,
    /// Lights, which illuminate lit solids.
    pub lights: Vec<Light>,
    /// Settings of every pass.
    pub settings: Settings,
}

/// Behaviour of light at the liquid's surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub enum Kind {
    /// It enters and leaves, refracted and absorbed.
    #[default]
    Clear,
    /// It does not enter: paint, plastic, lava, or data that a picture shows.
    Opaque,
}

/// Optical properties of a liquid's inside.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Medium {
    /// Absorption coefficients of red, green and blue light, 1/m.
    pub absorption: Vec3,
    /// Scattering coefficients, 1/m; 0 for a clear liquid.
    pub scattering: Vec3,
    /// Mean cosine of the scattering angle, above -1 and below 1: g of Henyey and Greenstein (1941).
    pub anisotropy: f32,
}

/// The liquid's optics.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Liquid {
    /// Behaviour of light at the surface.
    pub kind: Kind,
    /// Index of refraction relative to the surrounding medium (0.3 to 3; water 1.33, an air bubble in
    /// water 1/1.33). Of an opaque body, that of its coat, 1 to 3; 1 for none.
    pub ior: f32,
    /// Absorption coefficients of red, green and blue light, 1/m.
    pub absorption: Vec3,
    /// Scattering coefficients, 1/m; 0 for a clear liquid.
    pub scattering: Vec3,
    /// Mean cosine of the scattering angle; see [`Medium::anisotropy`].
    pub anisotropy: f32,
    /// Albedo of an opaque body, linear RGB from 0 to 1, unless its particles have
    /// [colours](crate::liquid::classify::Splats::colors).
    pub color: Vec3,
    /// Roughness of an opaque body's coat: the α of GGX microfacets, 0 to 1 (Walter et al. 2007).
    pub roughness: f32,
}

impl Default for Liquid {
    fn default() -> Self {
        Self {
            kind: Kind::Clear,
            ior: 1.33,
            absorption: Vec3::new(1.2, 0.35, 0.12),
            scattering: Vec3::ZERO,
            anisotropy: 0.0,
            color: Vec3::splat(0.5),
            roughness: 0.1,
        }
    }
}

/// An opaque body.
#[derive(Debug, Clone, PartialEq)]
pub struct Solid {
    /// Shape and position.
    pub shape: Shape,
    /// Colour.
    pub surface: Surface,
    /// Whether the colour is the albedo of a Lambertian surface under the lights; otherwise it is
    /// emitted radiance.
    pub lit: bool,
}

/// Shape and position of a solid, in world space, m. Positions are 64-bit, so that a scene may be
/// anywhere.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Shape {
    /// A square, or an unbounded plane if `half_extent` is infinite.
    Plane {
        /// Centre of the square.
        origin: DVec3,
        /// Unit normal.
        normal: Vec3,
        /// Half the side, along the two coordinate axes closest to the plane.
        half_extent: f32,
    },
    /// An axis-aligned box.
    Box {
        /// Minimum corner.
        min: DVec3,
        /// Maximum corner.
        max: DVec3,
    },
    /// A sphere.
    Sphere {
        /// Centre.
        center: DVec3,
        /// Radius.
        radius: f32,
    },
    /// A triangle mesh. A closed one has an inside; an open one is a sheet, as a plane is.
    Mesh {
        /// The triangles.
        #[serde(serialize_with = "as_digest")]
        mesh: Arc<Mesh>,
        /// Where they are.
        placement: Placement,
    },
}

/// Writes a number that differs between meshes: they are too large for a record.
fn as_digest<S: serde::Serializer>(mesh: &Arc<Mesh>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u64(mesh.digest())
}

impl Shape {
    /// Signed distance from `x` to the surface, negative inside, and the unit normal there. Beside a
    /// plane's square or an open mesh the distance is infinite.
    pub fn distance(&self, x: DVec3) -> (f64, DVec3) {
        self.distance_within(x, f64::INFINITY).unwrap_or((f64::INFINITY, DVec3::Y))
    }

    /// As [`Shape::distance`], or `None` if the surface is farther than `limit`, m. Much faster for meshes.
    pub fn distance_within(&self, x: DVec3, limit: f64) -> Option<(f64, DVec3)> {
        let found = match *self {
            Self::Mesh { ref mesh, placement } => {
                let at = placement.mesh_from_world(x) - mesh.origin();
                let nearest = mesh.nearest(at, limit / placement.scale)?;
                if nearest.on_rim {
                    return None;
                }
                (placement.scale * nearest.distance, placement.rotate * nearest.normal)
            }
            Self::Plane { origin, normal, half_extent } => {
                let offset = x - origin;
                let normal = normal.as_dvec3();
                let above = offset.dot(normal);
                let a = normal.abs();
                // Drops the axis closest to the normal, as `plane_coordinates` in WGSL does.
                let within = if a.y >= a.x.max(a.z) {
                    offset.xz()
                } else if a.x >= a.z {
                    offset.zy()
                } else {
                    offset.xy()
                };
                let beside = within.abs().max_element() - f64::from(half_extent);
                (if beside > 0.0 { f64::INFINITY } else { above }, normal)
            }
            Self::Box { min, max } => {
                let offset = x - 0.5 * (min + max);
                let face = offset.abs() - 0.5 * (max - min);
                let outside = face.max(DVec3::ZERO);
                let nearest = if outside == DVec3::ZERO {
                    let largest = face.cmpeq(DVec3::splat(face.max_element()));
                    DVec3::select(largest, DVec3::ONE, DVec3::ZERO)
                } else {
                    outside
                };
                let distance = outside.length() + face.max_element().min(0.0);
                (distance, (nearest * offset.signum()).normalize())
            }
            Self::Sphere { center, radius } => {
                let offset = x - center;
                (offset.length() - f64::from(radius), offset.normalize_or(DVec3::Y))
            }
        };
        (found.0.abs() <= limit).then_some(found)
    }

    /// Corners of a box around it, with its axes or the world's, m; `None` for an unbounded plane.
    pub fn corners(&self) -> Option<[DVec3; 8]> {
        let of_box = |min: DVec3, max: DVec3| {
            std::array::from_fn(|i| {
                let at_max = |bit: usize| i >> bit & 1 == 1;
                DVec3::select(BVec3::new(at_max(0), at_max(1), at_max(2)), max, min)
            })
        };
        Some(match *self {
            Self::Plane { origin, normal, half_extent } => {
                if !half_extent.is_finite() {
                    return None;
                }
                let (normal, half) = (normal.as_dvec3(), f64::from(half_extent));
                let a = normal.abs();
                // The axis closest to the normal, along which the square is slanted; see `distance`.
                let axis = if a.y >= a.x.max(a.z) {
                    DVec3::Y
                } else if a.x >= a.z {
                    DVec3::X
                } else {
                    DVec3::Z
                };
                let beside = DVec3::splat(half) * (DVec3::ONE - axis);
                of_box(-beside, beside)
                    .map(|x| origin + x - axis * (normal.dot(x) / normal.dot(axis)))
            }
            Self::Box { min, max } => of_box(min, max),
            Self::Sphere { center, radius } => {
                of_box(center - f64::from(radius), center + f64::from(radius))
            }
            Self::Mesh { ref mesh, placement } => {
                let (low, high) = mesh.bounds();
                of_box(low.as_dvec3(), high.as_dvec3())
                    .map(|x| placement.world_from_mesh(mesh.origin() + x))
            }
        })
    }

    /// Whether the shape has two sides and no inside: planes and open meshes.
    pub fn is_sheet(&self) -> bool {
        match self {
            Self::Plane { .. } => true,
            Self::Mesh { mesh, .. } => !mesh.is_closed(),
            Self::Box { .. } | Self::Sphere { .. } => false,
        }
    }
}

/// A solid's colour, linear RGB.
#[derive(Debug, Clone, PartialEq)]
pub enum Surface {
    /// One colour.
    Color(Vec3),
    /// A checkerboard of cubes aligned with the world origin.
    Checker {
        /// Side of a tile, m.
        tile: f32,
        /// Colour of tiles whose integer coordinates have an even sum.
        even: Vec3,
        /// Colour of the other tiles.
        odd: Vec3,
    },
    /// A checkerboard that fades into the environment: at the distance d from the solid's origin or
    /// centre, a share of 1 − exp(−(d/fade)²) of its radiance is the environment's at the horizon.
    Ground {
        /// As for [`Surface::Checker`].
        tile: f32,
        /// As for [`Surface::Checker`].
        even: Vec3,
        /// As for [`Surface::Checker`].
        odd: Vec3,
        /// Distance of the fade, m.
        fade: f32,
    },
    /// A picture that repeats every `tile` on planes and boxes, with its middle at the solid's, upright on
    /// walls; on level sides its top is towards −z. It goes around a sphere once.
    Texture {
        /// The picture.
        texture: Arc<Texture>,
        /// Width of the picture, m.
        tile: f32,
    },
    /// A mesh's own colours and textures.
    Own,
}

/// A light, which illuminates lit solids.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Light {
    /// A directional light.
    Sun {
        /// Direction in which the light travels; any length.
        direction: Vec3,
        /// Irradiance on a surface that faces the sun, W/m² per channel.
        irradiance: Vec3,
    },
    /// A point light.
    Point {
        /// Position, m.
        position: DVec3,
        /// Radiant intensity, W/sr per channel.
        intensity: Vec3,
    },
}

impl Scene {
    /// Returns a default scene for particles in a box: a checkered floor below them, a pale sky.
    pub fn around(min: DVec3, max: DVec3, radius: f32) -> Self {
        let margin = f64::from(radius);
        let size = (max - min).max_element().max(2.0 * margin) as f32;
        let size = if size > 0.0 { size } else { 1.0 };
        // About eight tiles across the liquid, sized 1, 2 or 5 times a power of ten.
        let decade = 10f32.powf((size / 8.0).log10().floor());
        let tile = [5.0, 2.0, 1.0].map(|step| step * decade);
        let tile = tile.into_iter().find(|&tile| tile <= size / 8.0).unwrap_or(decade);
        let centre = 0.5 * (min + max);
        Self {
            environment: Environment::Gradient {
                zenith: Vec3::new(0.30, 0.50, 0.85),
                horizon: Vec3::new(0.75, 0.82, 0.90),
                nadir: Vec3::new(0.35, 0.33, 0.30),
            },
            solids: vec![Solid {
                shape: Shape::Plane {
                    origin: DVec3::new(centre.x, min.y - margin, centre.z),
                    normal: Vec3::Y,
                    half_extent: 6.0 * size,
                },
                surface: Surface::Checker {
                    tile,
                    even: Vec3::new(0.85, 0.80, 0.70),
                    odd: Vec3::new(0.15, 0.20, 0.30),
                },
                lit: false,
            }],
            ..Self::default()
        }
    }

    /// The medium of each fluid; never empty.
    pub fn media(&self) -> Vec<Medium> {
        match self.fluids.as_slice() {
            [] => vec![self.liquid.medium()],
            fluids => fluids.to_vec(),
        }
    }

    /// Absorption coefficient of each fluid, 1/m; never empty.
    pub fn absorptions(&self) -> Vec<Vec3> {
        self.media().into_iter().map(|medium| medium.absorption).collect()
    }

    /// Whether the scene has a light, and something that shows it: a lit solid, an opaque body or a turbid liquid.
    pub fn is_lit(&self) -> bool {
        let shows = |solid: &Solid| solid.lit;
        let body = self.is_opaque() || self.is_turbid();
        !self.lights.is_empty() && (body || self.solids.iter().any(shows))
    }

    /// Whether the liquid scatters light.
    pub fn is_turbid(&self) -> bool {
        let scatters = |medium: &Medium| medium.scattering != Vec3::ZERO;
        !self.is_opaque() && self.media().iter().any(scatters)
    }

    /// Whether no light enters the liquid.
    pub fn is_opaque(&self) -> bool {
        self.liquid.kind == Kind::Opaque
    }

    /// Checks all values against their ranges.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the first value out of range.
    pub fn check(&self) -> Result<()> {
        let fail = |origin: &str, problem: &str| Err(Error::invalid(origin, problem));
        if !(0.3..=3.0).contains(&self.liquid.ior) {
            return fail("liquid", "ior must be between 0.3 and 3");
        }
        if self.is_opaque() && self.liquid.ior < 1.0 {
            return fail(
                "liquid",
                "the ior of an opaque body's coat must be at least 1; 1 is no coat",
            );
        }
        let is_share = |x: f32| (0.0..=1.0).contains(&x);
        if !self.liquid.color.to_array().into_iter().all(is_share) {
            return fail("liquid", "color must be between 0 and 1");
        }
        if !is_share(self.liquid.roughness) {
            return fail("liquid", "roughness must be between 0 and 1");
        }
        if let Some(problem) = self.liquid.medium().problem() {
            return fail("liquid", problem);
        }
        if let Some(problem) = self.fluids.iter().find_map(Medium::problem) {
            return fail("[fluid]", problem);
        }
        let scatters = |medium: &Medium| medium.scattering != Vec3::ZERO;
        if self.is_opaque() && self.media().iter().any(scatters) {
            return fail("liquid", "an opaque body has no scattering inside; leave it 0");
        }
        if self.fluids.len() > MAX_FLUIDS {
            return fail("[fluid]", &format!("at most {MAX_FLUIDS} fluids can be drawn"));
        }
        if self.solids.len() > MAX_SOLIDS {
            return fail("[solid]", &format!("at most {MAX_SOLIDS} solids can be drawn"));
        }
        if self.lights.len() > MAX_LIGHTS {
            return fail("[light]", &format!("at most {MAX_LIGHTS} lights can be drawn"));
        }
        if !self.environment.is_drawable() {
            return fail("environment", "radiances must be 0 to 1e12");
        }
        for (number, solid) in (1..).zip(&self.solids) {
            if let Some(problem) = solid.problem() {
                return fail("[solid]", &format!("{number}: {problem}"));
            }
        }
        for (number, light) in (1..).zip(&self.lights) {
            if let Some(problem) = light.problem() {
                return fail("[light]", &format!("{number}: {problem}"));
            }
        }
        self.settings.check()
    }
}

impl Liquid {
    /// Its medium.
    pub fn medium(&self) -> Medium {
        let Self { absorption, scattering, anisotropy, .. } = *self;
        Medium { absorption, scattering, anisotropy }
    }

    /// The same liquid with another medium.
    #[must_use]
    pub fn with(self, medium: Medium) -> Self {
        let Medium { absorption, scattering, anisotropy } = medium;
        Self { absorption, scattering, anisotropy, ..self }
    }
}

impl Medium {
    /// A clear medium of this absorption, 1/m.
    pub fn clear(absorption: Vec3) -> Self {
        Self { absorption, ..Self::default() }
    }

    /// Describes the first invalid value.
    fn problem(&self) -> Option<&'static str> {
        let is_coefficient = |a: Vec3| a.is_finite() && a.min_element() >= 0.0;
        if !is_coefficient(self.absorption) {
            return Some("absorption must not be negative");
        }
        if !is_coefficient(self.scattering) {
            return Some("scattering must not be negative");
        }
        let is_drawable = (-MAX_ANISOTROPY..=MAX_ANISOTROPY).contains(&self.anisotropy);
        (!is_drawable).then_some("anisotropy must be between -0.99 and 0.99")
    }
}

impl Solid {
    /// Describes the first invalid value.
    fn problem(&self) -> Option<&'static str> {
        let shape = match self.shape {
            Shape::Mesh { placement: Placement { translate, rotate, scale }, .. } => [
                (is_position(translate), "translate must be finite"),
                (rotate.is_normalized(), "rotate must be a unit quaternion"),
                ((1e-12..=1e12).contains(&scale), "scale must be 1e-12 to 1e12"),
            ],
            Shape::Plane { origin, normal, half_extent } => [
                (is_position(origin), "origin must be finite"),
                (normal.is_normalized(), "normal must be of length 1"),
                (half_extent > 0.0, "half_extent must be above 0"),
            ],
            Shape::Box { min, max } => [
                (is_position(min), "min must be finite"),
                (is_position(max), "max must be finite"),
                (min.cmplt(max).all(), "min must be below max"),
            ],
            Shape::Sphere { center, radius } => [
                (is_position(center), "center must be finite"),
                (radius.is_finite(), "radius must be finite"),
                (radius > 0.0, "radius must be above 0"),
            ],
        };
        let surface = match self.surface {
            Surface::Color(color) => [(is_radiance(color), "color must be 0 to 1e12"), (true, "")],
            Surface::Checker { tile, even, odd } => [
                (tile > 0.0 && tile.is_finite(), "a checker's tile must be above 0"),
                (is_radiance(even) && is_radiance(odd), "a checker's colours must be 0 to 1e12"),
            ],
            Surface::Ground { tile, even, odd, fade } => [
                (
                    [tile, fade].iter().all(|&length| length > 0.0 && length.is_finite()),
                    "a ground's tile and fade must be above 0",
                ),
                (is_radiance(even) && is_radiance(odd), "a ground's colours must be 0 to 1e12"),
            ],
            Surface::Texture { tile, .. } => [
                (tile > 0.0 && tile.is_finite(), "a texture's tile must be above 0"),
                (
                    !matches!(self.shape, Shape::Mesh { .. }),
                    "a mesh's texture belongs to its materials",
                ),
            ],
            Surface::Own => [
                (matches!(self.shape, Shape::Mesh { .. }), "only a mesh has colours of its own"),
                (true, ""),
            ],
        };
        let mut checks = shape.into_iter().chain(surface);
        checks.find_map(|(good, problem)| (!good).then_some(problem))
    }
}

impl Light {
    /// Describes the first invalid value.
    fn problem(&self) -> Option<&'static str> {
        let (is_placed, power, problem) = match *self {
            Self::Sun { direction, irradiance } => (
                direction.try_normalize().is_some(),
                irradiance,
                "a sun's direction must be finite and not zero",
            ),
            Self::Point { position, intensity } => {
                (is_position(position), intensity, "a point's position must be finite")
            }
        };
        match (is_placed, is_radiance(power)) {
            (false, _) => Some(problem),
            (_, false) => Some("irradiance and intensity must be 0 to 1e12"),
            _ => None,
        }
    }
}
