//! Ray tracer for a liquid and its surroundings that follows both branches at every interface.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, UVec2};
use image::{Rgb, RgbImage};
use rayon::prelude::*;

use super::caustics::{CausticMap, Spot};
use super::image_plane::ImagePlane;
use super::optics::{TOUCH, fresnel, interface, transmittance};
use super::solids::SolidHit;
use super::surroundings::{Direct, Surroundings};
use super::{Crossing, Liquid, Ray, wide};
use limpid::camera::Camera;
use limpid::passes::tonemap::srgb_byte;
use limpid::scene::Scene;

/// Number of interfaces on one path that suffices for pictures.
pub const MAX_DEPTH: u32 = 24;

/// Share of a sample's light above which a path splits in two; below it, the path takes the
/// brighter branch with all of the light.
const SPLIT: f64 = 1e-3;

/// Step from one crossing to the start of the search for the next in [`first_last`], m and
/// relative.
const ONWARD: f64 = 1e-9;

/// A picture in linear radiance.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Width and height, pixels.
    pub size: UVec2,
    /// Linear RGB, row by row from the top left.
    pub pixels: Vec<DVec3>,
}

impl Image {
    /// Converts the picture to 8-bit sRGB (IEC 61966-2-1), clamped and rounded to nearest.
    pub fn to_srgb(&self) -> RgbImage {
        RgbImage::from_fn(self.size.x, self.size.y, |x, y| {
            let pixel = self.pixels[y as usize * self.size.x as usize + x as usize];
            Rgb(pixel.to_array().map(srgb_byte))
        })
    }
}

/// Maximum number of interfaces between a solid and a light.
const MAX_STRAIGHT: u32 = 64;

/// Number of rays to the sky per pixel, over all samples, for ambient light in the liquid.
const SKY_RAYS: u32 = 384;

/// Renders a liquid in a scene, with `samples` rays through each pixel of `size` and at most
/// `max_depth` interfaces on a path (see [`MAX_DEPTH`]).
///
/// Absorption, Fresnel reflectance and, if the scene's settings enable it, the scaling of radiance
/// by the squared index are exact; a solid ends a path. Nothing is random.
///
/// Light from lights passes straight through the liquid, less what its interfaces reflect and what
/// it absorbs; [`trace_lit`] refracts it. Ambient light is refracted in both.
pub fn trace(
    liquid: &(impl Liquid + ?Sized),
    scene: &Scene,
    camera: &Camera,
    size: UVec2,
    samples: u32,
    max_depth: u32,
) -> Image {
    trace_lit(liquid, scene, camera, size, samples, max_depth, &[])
}

/// [`trace`] with the light that passes through liquid taken from caustic maps, one or more per
/// light of the scene in their order, as [`super::caustics::on_solids`] makes them; a light without
/// maps passes straight through. Shadows of solids are exact.
pub fn trace_lit(
    liquid: &(impl Liquid + ?Sized),
    scene: &Scene,
    camera: &Camera,
    size: UVec2,
    samples: u32,
    max_depth: u32,
    maps: &[Option<Vec<CausticMap>>],
) -> Image {
    let view = ImagePlane::new(camera, size);
    let tracer = Tracer {
        liquid,
        surroundings: Surroundings::new(scene).before_background(scene, view),
        ior: f64::from(scene.liquid.ior),
        absorption: wide(scene.liquid.absorption),
        radiance_scaling: scene.settings.refract.radiance_scaling,
        max_depth,
        maps,
        sky_rays: (SKY_RAYS / samples.max(1)).clamp(6, 48),
    };
    let inside = liquid.contains(view.eye);
    let offsets = sample_offsets(samples.max(1));
    let mut pixels = vec![DVec3::ZERO; size.x as usize * size.y as usize];
    pixels.par_chunks_mut(size.x.max(1) as usize).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.iter_mut().enumerate() {
            let corner = DVec2::new(x as f64, y as f64);
            let sum: DVec3 = (offsets.iter())
                .map(|&offset| tracer.radiance(view.ray(corner + offset), inside, DVec3::ONE, 0))
                .sum();
            *pixel = sum / offsets.len() as f64;
        }
    });
    Image { size, pixels }
}

/// Stratified points of a pixel: Hammersley's, each in its own row and column.
fn sample_offsets(count: u32) -> Vec<DVec2> {
    let n = f64::from(count);
    // Reversed binary digits (van der Corput 1935), shifted so that their mean is the centre.
    let reversed = |i: u32| f64::from(i.reverse_bits()) / 2f64.powi(32);
    let mean = (0..count).map(reversed).sum::<f64>() / n;
    let point = |i| DVec2::new((f64::from(i) + 0.5) / n, reversed(i) + 0.5 - mean);
    (0..count).map(point).collect()
}

/// Hashes a point to a number from 0 to 1 (`SplitMix64`, S. Vigna 2015).
fn scattered(point: DVec3) -> f64 {
    let mix = |seed: u64, x: f64| {
        let z = (seed ^ x.to_bits()).wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    let bits = point.to_array().into_iter().fold(0, mix);
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

struct Tracer<'a, L: ?Sized> {
    liquid: &'a L,
    surroundings: Surroundings,
    ior: f64,
    /// 1/m.
    absorption: DVec3,
    radiance_scaling: bool,
    max_depth: u32,
    maps: &'a [Option<Vec<CausticMap>>],
    /// Number of rays to the sky from a wet solid that is seen by a whole sample.
    sky_rays: u32,
}

impl<L: Liquid + ?Sized> Tracer<'_, L> {
    /// Traces the radiance seen along a ray that starts in the liquid or outside; `weight` is its
    /// contribution to the sample, `depth` the number of interfaces so far.
    fn radiance(&self, ray: Ray, inside: bool, weight: DVec3, depth: u32) -> DVec3 {
        let within = |length: f64| {
            if inside { transmittance(self.absorption, length) } else { DVec3::ONE }
        };
        let crossing = self.liquid.crossing(&ray, inside);
        if let Some(hit) = self.surroundings.hit(&ray) {
            let first = |c: &Crossing| hit.t <= c.t + TOUCH * (1.0 + c.t);
            if crossing.as_ref().is_none_or(first) {
                let arriving = |light: usize, direct: Option<&Direct>| {
                    self.arriving(light, direct, &hit, ray.direction, inside)
                };
                let ambient = self.ambient(&hit, ray.direction, inside, weight);
                let radiance =
                    self.surroundings.solid_radiance(&hit, ray.direction, ambient, arriving);
                return within(hit.t) * radiance;
            }
        }
        // Unbounded liquid, or a path at the depth limit: continues straight as if it left the
        // liquid here, so that no light is lost.
        let Some(crossing) = crossing.filter(|_| depth < self.max_depth) else {
            let scale = if inside { self.scale(1.0 / self.ior) } else { 1.0 };
            return scale * self.surroundings.radiance(&ray);
        };

        let eta = if inside { 1.0 / self.ior } else { self.ior };
        let interface = interface(&ray, &crossing, inside, eta);
        let origin = ray.at(crossing.t);
        let passed = within(crossing.t);
        let weight = weight * passed;
        let reflected = |weight: DVec3| {
            let ray = Ray { origin, direction: interface.reflected };
            self.radiance(ray, inside, weight, depth + 1)
        };
        let Some(direction) = interface.refracted else { return passed * reflected(weight) };
        let refracted = |weight: DVec3| {
            let ray = Ray { origin, direction };
            self.scale(eta) * self.radiance(ray, !inside, weight, depth + 1)
        };

        let reflectance = interface.reflectance;
        let lesser = reflectance.min(1.0 - reflectance);
        passed
            * if weight.max_element() * lesser >= SPLIT {
                reflectance * reflected(reflectance * weight)
                    + (1.0 - reflectance) * refracted((1.0 - reflectance) * weight)
            } else if reflectance > 0.5 {
                reflected(weight)
            } else {
                refracted(weight)
            }
    }

    /// The transmitted share of the ambient light at a solid seen along `direction`. In the air it
    /// is 1, whatever the orientation and the surroundings of the solid. In the liquid it is
    /// likewise independent of these: the share of the light that falls on a horizontal patch, by
    /// rays through the liquid's true surface. Solids act as mirrors for these rays, so that they
    /// neither remove nor add light. Light that surfaces scatter back into the liquid is lost.
    fn ambient(&self, hit: &SolidHit, direction: DVec3, inside: bool, weight: DVec3) -> DVec3 {
        if !inside || !self.surroundings.is_lit(hit.solid) {
            return DVec3::ONE;
        }
        // The squared sine of the refracted cone's half-angle, from the vertical. Each ray is a
        // pair of its squared sine and its share of the cosine-weighted hemisphere.
        let edge = (1.0 / (self.ior * self.ior)).min(1.0);
        // Rays in the cone to which a level surface refracts the whole sky; a third as many outside
        // it, where light arrives through waves only.
        let cone_rays = (f64::from(self.sky_rays) * weight.max_element()).ceil().max(3.0);
        let cone = (0..cone_rays as u32).map(|i| {
            // Uniform steps of the cosine in the air: grazing light is reflected most.
            let cos = (f64::from(i) + 0.5) / cone_rays;
            (edge * (1.0 - cos * cos), edge * 2.0 * cos / cone_rays)
        });
        let outer_rays = (cone_rays / 3.0).ceil();
        let beyond = (0..outer_rays as u32).map(|i| {
            let width = (1.0 - edge) / outer_rays;
            (edge + (f64::from(i) + 0.5) * width, width)
        });
        // A different azimuth offset at each point, so that waves show no pattern of the rays.
        let azimuth_offset = scattered(hit.point);
        let rays = cone.chain(beyond).enumerate().map(|(i, (sin2, share))| {
            // By the golden angle: all azimuths differ.
            let (sin, cos) = (TAU * (azimuth_offset + 0.618_033_988_749_895 * i as f64)).sin_cos();
            let up = DVec3::new(sin2.sqrt() * cos, (1.0 - sin2).sqrt(), sin2.sqrt() * sin);
            share * self.sky_share(Ray { origin: hit.point, direction: up }, hit.facing(direction))
        });
        self.ior * self.ior * rays.sum::<DVec3>()
    }

    /// The share of ambient light that arrives along a ray from the sky at a solid of this normal,
    /// in the liquid; not scaled by the index.
    fn sky_share(&self, mut ray: Ray, normal: DVec3) -> DVec3 {
        /// Maximum number of mirrors and interfaces on a path.
        const MAX_EVENTS: u32 = 16;
        let mirrored = |ray: Ray, point: DVec3, normal: DVec3| {
            let along = ray.direction.dot(normal);
            let direction = ray.direction - 2.0 * along.min(0.0) * normal;
            // Offset from the surface by more than rounding.
            Ray { origin: point + TOUCH * (1.0 + point.abs().max_element()) * normal, direction }
        };
        ray = mirrored(ray, ray.origin, normal);
        let mut left = DVec3::ONE;
        let mut inside = true;
        for _ in 0..MAX_EVENTS {
            let crossing = self.liquid.crossing(&ray, inside);
            let solid = self.surroundings.hit(&ray).filter(|_| inside);
            let first = |hit: &SolidHit| {
                crossing.as_ref().is_none_or(|c| hit.t <= c.t + TOUCH * (1.0 + c.t))
            };
            if let Some(hit) = solid.filter(first) {
                left *= transmittance(self.absorption, hit.t);
                ray = mirrored(ray, hit.point, hit.facing(ray.direction));
                continue;
            }
            // Unbounded liquid counts as none, as in `radiance`.
            let Some(crossing) = crossing else { return left };
            let eta = if inside { 1.0 / self.ior } else { self.ior };
            let interface = interface(&ray, &crossing, inside, eta);
            let Some(direction) = interface.refracted else { return DVec3::ZERO };
            let absorption = if inside { self.absorption } else { DVec3::ZERO };
            left *= (1.0 - interface.reflectance) * transmittance(absorption, crossing.t);
            ray = Ray { origin: ray.at(crossing.t), direction };
            inside = !inside;
        }
        DVec3::ZERO
    }

    /// Irradiance by a light on a solid seen along `direction`, in the liquid or outside.
    fn arriving(
        &self,
        light: usize,
        direct: Option<&Direct>,
        hit: &SolidHit,
        direction: DVec3,
        inside: bool,
    ) -> DVec3 {
        let along = |direct: &Direct| Ray { origin: hit.point, direction: direct.towards };
        let Some(maps) = self.maps.get(light).and_then(Option::as_ref) else {
            return direct.map_or(DVec3::ZERO, |direct| {
                direct.irradiance * self.straight(&along(direct), direct.distance, inside)
            });
        };
        let normal = hit.facing(direction);
        let spot = Spot { solid: hit.solid, part: hit.part, point: hit.point, normal };
        let map = maps.iter().find(|map| map.takes(&spot));
        let caustic = map.map_or(DVec3::ZERO, |map| map.at(&spot));
        let Some(direct) = direct.filter(|_| !inside) else { return caustic };
        let in_the_way = |c: Crossing| c.t < direct.distance;
        if self.liquid.crossing(&along(direct), false).is_some_and(in_the_way) {
            return caustic;
        }
        direct.irradiance + caustic
    }

    /// The transmitted share of light that arrives from `distance` against the direction of a ray,
    /// unbent. Each interface reflects as it would from outside.
    fn straight(&self, ray: &Ray, distance: f64, mut inside: bool) -> DVec3 {
        let mut left = DVec3::ONE;
        let mut ray = *ray;
        let mut distance = distance;
        for _ in 0..MAX_STRAIGHT {
            let crossing = self.liquid.crossing(&ray, inside).filter(|c| c.t < distance);
            let length = crossing.map_or(distance, |c| c.t);
            // Unbounded liquid counts as none, as in `radiance`.
            if inside && length.is_finite() {
                left *= transmittance(self.absorption, length);
            }
            let Some(crossing) = crossing else { break };
            left *= 1.0 - fresnel(ray.direction.dot(crossing.shading).abs(), self.ior);
            ray.origin = ray.at(crossing.t);
            distance -= crossing.t;
            inside = !inside;
        }
        left
    }

    /// The factor on radiance from behind an interface: L/n² is invariant.
    fn scale(&self, eta: f64) -> f64 {
        if self.radiance_scaling { 1.0 / (eta * eta) } else { 1.0 }
    }
}

/// A surface seen through pixel centres, row by row from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenSurface {
    /// Depth, m: the negative z of view space; 0 where empty.
    pub depths: Vec<f64>,
    /// Unit normals out of the liquid, in view space; 0 where empty.
    pub normals: Vec<DVec3>,
}

/// Finds the first surface at which straight camera rays enter a liquid, and the last at which they
/// leave it; solids do not hide them.
pub fn first_last(
    liquid: &(impl Liquid + ?Sized),
    camera: &Camera,
    size: UVec2,
) -> [SeenSurface; 2] {
    let view = ImagePlane::new(camera, size);
    let view_from_world = view.world_from_view.transpose();
    let eye_inside = liquid.contains(view.eye);
    let width = size.x.max(1) as usize;
    let texels: Vec<_> = (0..size.x as usize * size.y as usize)
        .into_par_iter()
        .map(|i| {
            let center = DVec2::new((i % width) as f64, (i / width) as f64) + 0.5;
            let ray = view.ray(center);
            first_last_along(liquid, &ray, eye_inside).map(|crossing| match crossing {
                Some(crossing) => {
                    let depth = -(view_from_world * (crossing.t * ray.direction)).z;
                    (depth, view_from_world * crossing.shading)
                }
                None => (0.0, DVec3::ZERO),
            })
        })
        .collect();
    [0, 1].map(|side| SeenSurface {
        depths: texels.iter().map(|texel| texel[side].0).collect(),
        normals: texels.iter().map(|texel| texel[side].1).collect(),
    })
}

/// Finds the intervals of liquid, with air between them, along the straight camera rays through pixel centres, row
/// by row from the top left: the distances from the eye at which a ray enters and leaves, m. Solids do not hide them.
pub fn intervals(
    liquid: &(impl Liquid + ?Sized),
    camera: &Camera,
    size: UVec2,
) -> Vec<Vec<[f64; 2]>> {
    let view = ImagePlane::new(camera, size);
    let eye_inside = liquid.contains(view.eye);
    let width = size.x.max(1) as usize;
    (0..size.x as usize * size.y as usize)
        .into_par_iter()
        .map(|i| {
            let center = DVec2::new((i % width) as f64, (i / width) as f64) + 0.5;
            let (mut found, mut entered) = (Vec::new(), 0.0);
            crossings_along(liquid, &view.ray(center), eye_inside, |crossing, leaves| {
                if leaves {
                    found.push([entered, crossing.t]);
                }
                entered = crossing.t;
            });
            found
        })
        .collect()
}

/// Finds the first crossing into the liquid and the last out of it.
pub(crate) fn first_last_along(
    liquid: &(impl Liquid + ?Sized),
    ray: &Ray,
    inside: bool,
) -> [Option<Crossing>; 2] {
    let mut found = [None; 2];
    crossings_along(liquid, ray, inside, |crossing, leaves| {
        if leaves {
            found[1] = Some(crossing);
        } else {
            found[0].get_or_insert(crossing);
        }
    });
    found
}

/// Calls `act` with each crossing along a ray, which starts in the liquid if `inside`, and whether the ray
/// leaves the liquid there.
fn crossings_along(
    liquid: &(impl Liquid + ?Sized),
    ray: &Ray,
    mut inside: bool,
    mut act: impl FnMut(Crossing, bool),
) {
    let mut from = *ray;
    let mut start = 0.0;
    while let Some(crossing) = liquid.crossing(&from, inside) {
        let t = start + crossing.t;
        act(Crossing { t, ..crossing }, inside);
        // Advances slightly, so that a ray along an edge proceeds.
        start = t + ONWARD * (1.0 + t);
        from.origin = ray.at(start);
        inside = !inside;
    }
}
