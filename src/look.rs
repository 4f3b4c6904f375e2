//! Automatic scenes: the surroundings, the light and the camera of particles that come without any.

use std::str::FromStr;

use glam::{DVec2, DVec3, UVec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::environment::{Environment, Glow};
use crate::liquid::{Bulk, Particles, Up};
use crate::scene::{Kind, Light, Liquid, Scene, Shape, Solid, Surface};
use crate::settings::Curve;

/// A style of automatic scene. All but [`Look::Chart`] have an endless lit ground, a sky and a light with
/// caustics, and, but for [`Look::Paint`], tint the liquid in proportion to its size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Look {
    /// A bright seamless backdrop with a large soft light and a key light.
    #[default]
    Studio,
    /// Stone under a blue sky and a warm sun.
    Daylight,
    /// The tiles of a swimming pool in the sun.
    Pool,
    /// A dark ground in the light of one lamp.
    Night,
    /// A high-contrast checkerboard without light, on which refraction is easy to judge; the liquid absorbs
    /// as water does, whatever its size.
    Chart,
    /// Even white light on a neutral ground, in which an opaque liquid, painted and varnished, or coloured by data, shows its
    /// colours as they are.
    Paint,
}

impl Look {
    /// All looks.
    pub const ALL: [Self; 6] =
        [Self::Studio, Self::Daylight, Self::Pool, Self::Night, Self::Chart, Self::Paint];

    /// Its name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Studio => "studio",
            Self::Daylight => "daylight",
            Self::Pool => "pool",
            Self::Night => "night",
            Self::Chart => "chart",
            Self::Paint => "paint",
        }
    }
}

impl FromStr for Look {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|look| look.name() == name);
        found.ok_or_else(|| format!("expected one of {}", names()))
    }
}

/// The pictures that an automatic camera is for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Framing {
    /// Width over height, above 0.
    pub aspect: f64,
    /// Whether the camera is going to turn about its target ([`Camera::turned`]), and is to see the whole body
    /// from every side.
    pub all_round: bool,
}

impl Default for Framing {
    /// One picture of 4:3.
    fn default() -> Self {
        Self { aspect: 4.0 / 3.0, all_round: false }
    }
}

impl Framing {
    /// A picture of `size` pixels.
    pub fn of(size: UVec2) -> Self {
        let size = size.max(UVec2::ONE).as_dvec2();
        Self { aspect: size.x / size.y, ..Self::default() }
    }
}

/// The extent of a body of liquid, on which automatic scenes are based.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Minimum and maximum corner of the [bulk](crate::liquid::Bulk) of the particles' centres, m.
    pub bounds: (DVec3, DVec3),
    /// Particle radius, m.
    pub radius: f32,
    /// Volume of the liquid, m³: a cube of side 2r for each particle.
    pub volume: f64,
    /// A sample of the centres in the bulk, m.
    points: Vec<DVec3>,
    /// Corners of the boxes around the solids that a camera shows with the liquid, m.
    corners: Vec<DVec3>,
    /// Lowest point of all bounded solids, m.
    solids_lowest: f64,
}

impl Body {
    /// Number of sampled centres of a frame.
    const SAMPLES: usize = 16384;

    /// The body of some particles with this radius; `None` without particles.
    pub fn new(particles: &Particles, radius: f32) -> Option<Self> {
        Some(Self::of_bulk(particles, &particles.bulk()?, radius))
    }

    /// As [`Body::new`], of particles whose bulk is known.
    pub fn of_bulk(particles: &Particles, bulk: &Bulk, radius: f32) -> Self {
        let step = particles.len().div_ceil(Self::SAMPLES);
        let places = (0..particles.len()).step_by(step).map(|i| particles.place(i));
        let points: Vec<_> = places.filter(|&x| bulk.holds(x)).collect();
        let count = particles.len() - bulk.outside;
        let volume = count as f64 * (2.0 * f64::from(radius)).powi(3);
        Self { bounds: bulk.bounds, radius, volume, points, ..Self::empty() }
    }

    /// A body of unknown shape that fills a box.
    pub fn filling(min: DVec3, max: DVec3, radius: f32) -> Self {
        let corners = (0..8).map(|i| {
            let at = |bit: u32| f64::from(i >> bit & 1);
            min + (max - min) * DVec3::new(at(0), at(1), at(2))
        });
        let volume = (max - min).element_product();
        Self { bounds: (min, max), radius, volume, points: corners.collect(), ..Self::empty() }
    }

    fn empty() -> Self {
        Self {
            bounds: (DVec3::ZERO, DVec3::ZERO),
            radius: 0.0,
            volume: 0.0,
            points: Vec::new(),
            corners: Vec::new(),
            solids_lowest: f64::INFINITY,
        }
    }

    /// The body of two liquids, or of two frames of one: it covers both.
    #[must_use]
    pub fn with(mut self, other: Self) -> Self {
        let (min, max) = other.bounds;
        self.bounds = (self.bounds.0.min(min), self.bounds.1.max(max));
        self.radius = self.radius.max(other.radius);
        self.volume = self.volume.max(other.volume);
        self.points.extend(other.points);
        self.corners.extend(other.corners);
        self.solids_lowest = self.solids_lowest.min(other.solids_lowest);
        self
    }

    /// The body among solids, in a world of y up. A camera shows those that hold the liquid or lie in it: no more than
    /// three times as long as the liquid and no farther from it than its length. It does not show floors, which lie
    /// below the liquid and reach beyond it on all sides, rooms, and distant things. The ground lies below all.
    #[must_use]
    pub fn among(mut self, solids: &[Solid]) -> Self {
        /// Longest side of a solid that is shown whole, over that of the liquid.
        const LONGEST: f64 = 3.0;
        /// Height of a floor's top above the liquid's lowest particles, over the liquid's height.
        const ABOVE: f64 = 0.05;
        let (size, (min, max)) = (self.size(), self.bounds);
        for corners in solids.iter().filter_map(|solid| solid.shape.corners()) {
            let low = corners.into_iter().fold(corners[0], DVec3::min);
            let high = corners.into_iter().fold(corners[0], DVec3::max);
            self.solids_lowest = self.solids_lowest.min(low.y);
            let is_near = low.cmple(max + size).all() && high.cmpge(min - size).all();
            let reaches_beyond = low.x < min.x && low.z < min.z && high.x > max.x && high.z > max.z;
            let is_floor = reaches_beyond && high.y < min.y + ABOVE * (max.y - min.y);
            if is_near && !is_floor && (high - low).max_element() <= LONGEST * size {
                self.corners.extend(corners);
            }
        }
        self
    }

    /// The body in a world of y up, if this axis points up in its own.
    #[must_use]
    pub fn to_y_up(mut self, up: Up) -> Self {
        let (a, b) = (up.to_y_up(self.bounds.0), up.to_y_up(self.bounds.1));
        self.bounds = (a.min(b), a.max(b));
        self.points.iter_mut().for_each(|x| *x = up.to_y_up(*x));
        debug_assert!(self.corners.is_empty(), "solids are in a world of y up");
        self
    }

    /// Longest side, m; above 0.
    fn size(&self) -> f64 {
        let size = (self.bounds.1 - self.bounds.0).max_element() + 2.0 * f64::from(self.radius);
        if size > 0.0 { size } else { 1.0 }
    }

    /// Length of liquid that light typically crosses, m; above 0: the geometric mean of the side of a cube of
    /// its volume and of its mean thickness across its two longer sides. A pond is thinner than a tank of the
    /// same volume.
    pub fn thickness(&self) -> f64 {
        let mut sides = (self.bounds.1 - self.bounds.0 + 2.0 * f64::from(self.radius)).to_array();
        sides.sort_by(f64::total_cmp);
        let across = self.volume / (sides[1] * sides[2]);
        let length = (self.volume.cbrt() * across).sqrt();
        if length > 0.0 && length.is_finite() { length.min(self.size()) } else { self.size() }
    }

    /// Height of the ground, m: below every particle of the bulk, and below the solids, if they are [known](Self::among).
    pub fn lowest(&self) -> f64 {
        /// Depth below solids, over the liquid's length: a solid's own lower side is not the ground.
        const BELOW_SOLIDS: f64 = 1e-3;
        let liquid = self.bounds.0.y - f64::from(self.radius);
        liquid.min(self.solids_lowest - BELOW_SOLIDS * self.size())
    }

    /// Minimum and maximum corner of a camera's subject: the liquid, and the solids with it.
    fn shown(&self) -> (DVec3, DVec3) {
        let corners = self.corners.iter();
        corners.fold(self.bounds, |(min, max), &corner| (min.min(corner), max.max(corner)))
    }

    /// Horizontal direction from which the body is seen: across its longer side, turned by 25 degrees.
    fn front(&self) -> DVec3 {
        let extent = self.bounds.1 - self.bounds.0;
        let angle: f64 = if extent.z > 1.25 * extent.x { 65.0 } else { 25.0 };
        let (sin, cos) = angle.to_radians().sin_cos();
        DVec3::new(sin, 0.0, cos)
    }

    /// A camera that sees the whole body, and the solids that belong to it, in the middle of the picture, and from
    /// higher up the flatter it is.
    pub fn camera(&self, framing: Framing) -> Camera {
        /// Largest share of the picture's width and height that the body takes.
        const SHARE: DVec2 = DVec2::new(0.64, 0.66);
        /// Vertical field of view, degrees.
        const FOV_Y: f64 = 34.0;
        /// Largest tangent of half the horizontal field of view: that of a picture of 21:9. Wider ones would be
        /// distorted at their sides.
        const WIDEST: f64 = 0.72;
        /// Each corrects the distance and the target by the error that the last one has left.
        const STEPS: usize = 12;

        let (min, max) = self.shown();
        let extent = max - min;
        let size = self.size().max(extent.max_element());
        let across = extent.x.max(extent.z).max(1e-3 * size);
        let flatness = 1.0 - (extent.y / across).clamp(0.0, 1.0);
        let (sin, cos) = (10.0 + 18.0 * flatness).to_radians().sin_cos();
        let back = cos * self.front() + sin * DVec3::Y;
        let right = DVec3::Y.cross(back).normalize();
        let up = back.cross(right);
        let half = (0.5 * FOV_Y).to_radians().tan();
        let (half, fov_y) = match half * framing.aspect > WIDEST {
            true => (WIDEST / framing.aspect, 2.0 * (WIDEST / framing.aspect).atan().to_degrees()),
            false => (half, FOV_Y),
        };
        let tangent = half * DVec2::new(framing.aspect, 1.0);
        let radius = f64::from(self.radius);
        let mut target = 0.5 * (min + max);
        let of_points = self.points.iter().map(|&point| (point, radius));
        let mut seen: Vec<(DVec3, f64)> =
            of_points.chain(self.corners.iter().map(|&corner| (corner, 0.0))).collect();
        if framing.all_round {
            seen = rings(&seen, target, size);
        }

        // Far enough for the eye and the target to differ in 64-bit floats.
        let least = (1e-12 * target.abs().max_element()).max(1e-9);
        let mut distance = (2.0 * size / tangent.y).max(least);
        for _ in 0..STEPS {
            let (mut low, mut high) =
                (DVec2::splat(f64::INFINITY), DVec2::splat(f64::NEG_INFINITY));
            for &(point, radius) in &seen {
                let offset = point - target;
                let depth = (distance - offset.dot(back)).max(0.05 * distance);
                let at = DVec2::new(offset.dot(right), offset.dot(up)) / depth / tangent;
                let reach = radius / depth / tangent;
                (low, high) = (low.min(at - reach), high.max(at + reach));
            }
            if !(low.is_finite() && high.is_finite()) {
                break;
            }
            let middle = 0.5 * (low + high) * tangent * distance;
            // The axis that a camera turns about stays where it is.
            target += match framing.all_round {
                true => middle.y / up.y * DVec3::Y,
                false => middle.x * right + middle.y * up,
            };
            let fill = (0.5 * (high - low) / SHARE).max_element();
            distance = (distance * fill.clamp(0.25, 4.0)).max(least);
        }
        let eye = target + distance * back;
        Camera { eye, target, up: Vec3::Y, fov_y: fov_y as f32, near: None, lens: None }
    }
}

/// Where a camera that turns about the vertical axis through `axis` sees places with what reaches around them: on
/// circles about it. Of places at one height, those farthest from the axis stand for the others.
fn rings(seen: &[(DVec3, f64)], axis: DVec3, size: f64) -> Vec<(DVec3, f64)> {
    /// Heights that are told apart, over the size of the body.
    const HEIGHTS: f64 = 64.0;
    /// Places on a circle, which lie within 1 % of its radius of any other.
    const PLACES: usize = 48;
    let mut farthest = std::collections::BTreeMap::<i64, (f64, f64, f64)>::new();
    for &(point, radius) in seen {
        let offset = point - axis;
        let from_axis = offset.x.hypot(offset.z);
        let height = (offset.y / size * HEIGHTS).round() as i64;
        let known = farthest.entry(height).or_insert((from_axis, offset.y, radius));
        if from_axis > known.0 {
            *known = (from_axis, offset.y, radius);
        }
    }
    let circle = |&(from_axis, height, radius): &(f64, f64, f64)| {
        (0..PLACES).map(move |i| {
            let (sin, cos) = (std::f64::consts::TAU * i as f64 / PLACES as f64).sin_cos();
            (axis + DVec3::new(from_axis * sin, height, from_axis * cos), radius)
        })
    };
    farthest.values().flat_map(circle).collect()
}

/// The light of a look: relative to the direction in which the camera looks.
struct Lighting {
    zenith: Vec3,
    horizon: Vec3,
    nadir: Vec3,
    /// Towards the sun: to the right of the camera's view, up, and back towards the camera.
    towards: Vec3,
    irradiance: Vec3,
    /// The sun's disc and aureole, or lamps: towards them, as for the sun, radiance and sharpness.
    glows: [(Vec3, Vec3, f32); 2],
    /// Albedos of the ground's tiles.
    even: Vec3,
    odd: Vec3,
    /// Exposure, in stops.
    exposure: f32,
}

/// Absorption of a liquid that looks like water if it is 1 m thick, 1/m.
const TINT: Vec3 = Vec3::new(0.95, 0.27, 0.10);

impl Look {
    /// The automatic scene of a body.
    pub fn scene(self, body: &Body) -> Scene {
        let Some(lighting) = self.lighting() else {
            return Scene::around(body.bounds.0, body.bounds.1, body.radius);
        };
        let size = body.size() as f32;
        let front = body.front();
        let world = |v: Vec3| {
            let right = DVec3::Y.cross(front);
            let v = v.as_dvec3();
            (v.x * right + v.y * DVec3::Y + v.z * front).normalize().as_vec3()
        };
        let glow = |(towards, radiance, sharpness)| Glow {
            direction: world(towards),
            radiance,
            sharpness,
        };
        let centre = 0.5 * (body.bounds.0 + body.bounds.1);
        let ground = Solid {
            shape: Shape::Plane {
                origin: centre.with_y(body.lowest()),
                normal: Vec3::Y,
                half_extent: f32::INFINITY,
            },
            surface: Surface::Ground {
                tile: tile(size),
                even: lighting.even,
                odd: lighting.odd,
                fade: 3.0 * size,
            },
            lit: true,
        };
        let mut scene = Scene {
            liquid: Liquid { absorption: TINT / body.thickness() as f32, ..Liquid::default() },
            environment: Environment::Sky {
                zenith: lighting.zenith,
                horizon: lighting.horizon,
                nadir: lighting.nadir,
                glows: lighting.glows.map(glow),
            },
            solids: vec![ground],
            lights: vec![Light::Sun {
                direction: -world(lighting.towards),
                irradiance: lighting.irradiance,
            }],
            ..Scene::default()
        };
        scene.settings.refract.filter_patterns = true;
        // A frame with caustics takes less than twice as long as one without.
        scene.settings.caustics.resolution = 384;
        scene.settings.caustics.grid = 256;
        scene.settings.tonemap.curve = Curve::Aces;
        if self == Self::Paint {
            scene.liquid = Self::paint();
            // A curve would change the colours that stand for values.
            scene.settings.tonemap.curve = Curve::None;
        }
        // The sky and the ground that fades into it are gradients of fewer steps than pixels.
        scene.settings.tonemap.dither = true;
        scene.settings.tonemap.exposure = lighting.exposure;
        scene
    }

    /// The liquid of [`Look::Paint`]: paint under a coat of varnish.
    pub fn paint() -> Liquid {
        Liquid {
            kind: Kind::Opaque,
            ior: 1.4,
            roughness: 0.1,
            color: Vec3::new(0.72, 0.1, 0.035),
            ..Liquid::default()
        }
    }

    /// Its light; `None` for the chart, which has none.
    fn lighting(self) -> Option<Lighting> {
        // Low enough for shadows and caustics to lie beside the body, and from behind it.
        let sun = Vec3::new(-0.55, 1.0, -0.45);
        let low = Vec3::new(-0.7, 0.8, -0.6);
        Some(match self {
            Self::Studio => Lighting {
                zenith: Vec3::new(0.42, 0.5, 0.62),
                horizon: Vec3::new(0.62, 0.65, 0.69),
                nadir: Vec3::new(0.3, 0.3, 0.32),
                towards: sun,
                irradiance: Vec3::new(3.0, 2.85, 2.6),
                glows: [
                    (sun, Vec3::new(14.0, 13.4, 12.6), 900.0),
                    (Vec3::new(0.7, 0.8, 0.5), Vec3::new(1.3, 1.3, 1.3), 14.0),
                ],
                even: Vec3::new(0.4, 0.4, 0.395),
                odd: Vec3::new(0.335, 0.34, 0.345),
                exposure: -0.3,
            },
            Self::Daylight => Lighting {
                zenith: Vec3::new(0.16, 0.34, 0.8),
                horizon: Vec3::new(0.62, 0.76, 0.92),
                nadir: Vec3::new(0.3, 0.28, 0.26),
                towards: low,
                irradiance: Vec3::new(4.2, 3.8, 3.1),
                glows: [
                    (low, Vec3::new(30.0, 27.0, 22.0), 2500.0),
                    (low, Vec3::new(0.5, 0.45, 0.36), 10.0),
                ],
                even: Vec3::new(0.4, 0.35, 0.29),
                odd: Vec3::new(0.34, 0.3, 0.25),
                exposure: -0.4,
            },
            Self::Pool => Lighting {
                zenith: Vec3::new(0.2, 0.42, 0.85),
                horizon: Vec3::new(0.62, 0.8, 0.92),
                nadir: Vec3::new(0.25, 0.35, 0.4),
                towards: sun,
                irradiance: Vec3::new(3.6, 3.4, 3.0),
                glows: [
                    (sun, Vec3::new(26.0, 25.0, 22.0), 2500.0),
                    (sun, Vec3::new(0.4, 0.4, 0.36), 10.0),
                ],
                even: Vec3::new(0.12, 0.36, 0.44),
                odd: Vec3::new(0.19, 0.45, 0.52),
                exposure: -0.3,
            },
            Self::Night => Lighting {
                zenith: Vec3::new(0.010, 0.014, 0.030),
                horizon: Vec3::new(0.035, 0.045, 0.075),
                nadir: Vec3::new(0.01, 0.01, 0.015),
                towards: sun,
                irradiance: Vec3::new(1.1, 1.2, 1.5),
                glows: [
                    (sun, Vec3::new(20.0, 21.0, 24.0), 700.0),
                    (Vec3::new(0.8, 0.5, -0.6), Vec3::new(0.9, 0.5, 0.25), 25.0),
                ],
                even: Vec3::new(0.13, 0.13, 0.15),
                odd: Vec3::new(0.10, 0.10, 0.12),
                exposure: 0.6,
            },
            Self::Paint => Lighting {
                zenith: Vec3::new(0.74, 0.76, 0.79),
                horizon: Vec3::new(0.66, 0.665, 0.675),
                nadir: Vec3::new(0.34, 0.34, 0.34),
                towards: sun,
                irradiance: Vec3::new(2.0, 1.97, 1.9),
                glows: [
                    (sun, Vec3::new(3.0, 2.95, 2.85), 120.0),
                    (Vec3::new(0.7, 0.8, 0.5), Vec3::new(0.6, 0.6, 0.6), 14.0),
                ],
                even: Vec3::new(0.52, 0.52, 0.52),
                odd: Vec3::new(0.48, 0.48, 0.48),
                exposure: -0.2,
            },
            Self::Chart => return None,
        })
    }
}

/// Side of the ground's tiles, m: 1, 2 or 5 times a power of ten, about eight across the body.
fn tile(size: f32) -> f32 {
    let decade = 10f32.powf((size / 8.0).log10().floor());
    let tile = [5.0, 2.0, 1.0].map(|step| step * decade);
    tile.into_iter().find(|&tile| tile <= size / 8.0).unwrap_or(decade)
}
