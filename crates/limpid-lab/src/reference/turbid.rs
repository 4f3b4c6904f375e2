//! Path tracer for turbid liquids: one random path per sample, scattered as Henyey and Greenstein (1941) say.
//!
//! Solids end a path, and lights are left out except through lit solids in the air: a liquid's true surface refracts
//! their light, which no straight path finds. A sun of a wide [glow](limpid::environment::Glow) stands for one.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, UVec2};
use rayon::prelude::*;

use super::image_plane::ImagePlane;
use super::optics::{TOUCH, interface};
use super::surroundings::Surroundings;
use super::trace::Image;
use super::{Liquid, Ray, wide};
use limpid::camera::Camera;
use limpid::scene::{Medium, Scene};

/// Events of a path after which it may end at random.
const SURE_EVENTS: u32 = 64;
/// Events of a path at most.
const MOST_EVENTS: u32 = 1 << 14;

/// Renders a turbid liquid of one fluid in a scene, with `samples` paths through each pixel of `size`.
///
/// The same input gives the same picture. Its error falls with the root of the samples.
pub fn trace_turbid(
    liquid: &(impl Liquid + ?Sized),
    scene: &Scene,
    camera: &Camera,
    size: UVec2,
    samples: u32,
) -> Image {
    let view = ImagePlane::new(camera, size);
    let tracer = Tracer::new(liquid, scene);
    let inside = liquid.contains(view.eye);
    let mut pixels = vec![DVec3::ZERO; size.x as usize * size.y as usize];
    pixels.par_iter_mut().enumerate().for_each(|(i, pixel)| {
        let mut random = Random::new(i as u64);
        let corner = DVec2::new((i % size.x as usize) as f64, (i / size.x as usize) as f64);
        for _ in 0..samples {
            let at = corner + DVec2::new(random.unit(), random.unit());
            *pixel += tracer.radiance(view.ray(at), inside, &mut random) / f64::from(samples);
        }
    });
    Image { size, pixels }
}

/// The mean radiance, over `samples` paths, that arrives along one ray.
pub fn radiance_along(
    liquid: &(impl Liquid + ?Sized),
    scene: &Scene,
    ray: &Ray,
    samples: u32,
) -> DVec3 {
    let tracer = Tracer::new(liquid, scene);
    let inside = liquid.contains(ray.origin);
    let sum: DVec3 = (0..samples)
        .into_par_iter()
        .map(|i| tracer.radiance(*ray, inside, &mut Random::new(i.into())))
        .sum();
    sum / f64::from(samples)
}

/// Random numbers of a path (`SplitMix64`, S. Vigna 2015).
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// The numbers of a stream.
    pub fn new(stream: u64) -> Self {
        Self(stream.wrapping_mul(0xd134_2543_de82_ef95))
    }

    /// A uniform number from 0 to 1, 1 excluded.
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// The direction of light of direction `d` after scattering of mean cosine `g`, after Henyey and Greenstein.
    pub fn scattered(&mut self, d: DVec3, g: f64) -> DVec3 {
        let xi = self.unit();
        let cos = if g.abs() < 1e-4 {
            2.0 * xi - 1.0
        } else {
            let part = (1.0 - g * g) / (1.0 - g + 2.0 * g * xi);
            (1.0 + g * g - part * part) / (2.0 * g)
        };
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (across, up) = d.any_orthonormal_pair();
        let (y, x) = (TAU * self.unit()).sin_cos();
        (cos * d + sin * (x * across + y * up)).normalize()
    }
}

struct Tracer<'a, L: ?Sized> {
    liquid: &'a L,
    surroundings: Surroundings,
    ior: f64,
    scaled: bool,
    /// 1/m.
    scattering: DVec3,
    extinction: DVec3,
    anisotropy: f64,
}

impl<'a, L: Liquid + ?Sized> Tracer<'a, L> {
    fn new(liquid: &'a L, scene: &Scene) -> Self {
        let Medium { absorption, scattering, anisotropy } = scene.media()[0];
        Self {
            liquid,
            surroundings: Surroundings::new(scene),
            ior: f64::from(scene.liquid.ior),
            scaled: scene.settings.refract.radiance_scaling,
            scattering: wide(scattering),
            extinction: wide(absorption) + wide(scattering),
            anisotropy: f64::from(anisotropy),
        }
    }

    /// The radiance that a random path finds.
    fn radiance(&self, mut ray: Ray, mut inside: bool, random: &mut Random) -> DVec3 {
        let mut weight = DVec3::ONE;
        for event in 0..MOST_EVENTS {
            let crossing = self.liquid.crossing(&ray, inside);
            let solid = self.surroundings.hit(&ray);
            let surface = crossing.map_or(f64::INFINITY, |c| c.t);
            let first = |t: f64| t <= surface + TOUCH * (1.0 + surface.min(t));
            let solid = solid.filter(|hit| first(hit.t));
            let end = solid.as_ref().map_or(surface, |hit| hit.t);
            if inside && self.scatters(&mut ray, &mut weight, end, random) {
                let most = weight.max_element();
                if event > SURE_EVENTS && random.unit() >= most.min(0.95) {
                    return DVec3::ZERO;
                }
                weight /= if event > SURE_EVENTS { most.min(0.95) } else { 1.0 };
                continue;
            }
            if solid.is_some() {
                return weight * self.surroundings.radiance(&ray);
            }
            let Some(crossing) = crossing else {
                let scale = if inside { self.scale(1.0 / self.ior) } else { 1.0 };
                return weight * scale * self.surroundings.radiance(&ray);
            };
            let eta = if inside { 1.0 / self.ior } else { self.ior };
            let interface = interface(&ray, &crossing, inside, eta);
            ray.origin = ray.at(crossing.t);
            match interface.refracted.filter(|_| random.unit() >= interface.reflectance) {
                None => ray.direction = interface.reflected,
                Some(direction) => {
                    ray.direction = direction;
                    weight *= self.scale(eta);
                    inside = !inside;
                }
            }
        }
        DVec3::ZERO
    }

    /// Moves a ray to the place where it is scattered before `end`, in a new direction; `false` if it gets there.
    ///
    /// The length is that of a random channel; the weights are those of all together (Veach and Guibas 1995).
    fn scatters(&self, ray: &mut Ray, weight: &mut DVec3, end: f64, random: &mut Random) -> bool {
        if self.scattering == DVec3::ZERO && self.extinction == DVec3::ZERO {
            return false;
        }
        let channel = (3.0 * random.unit()) as usize % 3;
        let rate = self.extinction[channel];
        let length = if rate > 0.0 { -(1.0 - random.unit()).ln() / rate } else { f64::INFINITY };
        let passed = |length: f64| (-self.extinction * length).exp();
        if length >= end {
            let left = passed(end);
            *weight *= left / (left.element_sum() / 3.0).max(f64::MIN_POSITIVE);
            return false;
        }
        let density = self.extinction * passed(length);
        *weight *= self.scattering * passed(length) / (density.element_sum() / 3.0);
        ray.origin = ray.at(length);
        ray.direction = random.scattered(ray.direction, self.anisotropy);
        true
    }

    /// As the clear tracer's.
    fn scale(&self, eta: f64) -> f64 {
        if self.scaled { 1.0 / (eta * eta) } else { 1.0 }
    }
}
