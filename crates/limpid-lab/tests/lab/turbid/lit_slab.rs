//! Path tracer for a sun or a lamp above a level turbid slab, in one channel.
//!
//! At each place of scattering the light arrives by its refracted ways, found in closed form: straight down, and
//! reflected between the slab's two sides.

use std::f64::consts::TAU;

use limpid::glam::{DVec2, DVec3, Vec3};
use limpid::scene::Light;
use limpid_lab::reference::Ray;
use limpid_lab::reference::optics::{fresnel, refract};
use limpid_lab::reference::turbid::Random;
use rayon::prelude::*;

/// Ways between the sides of the slab.
const WAYS: u32 = 8;
const EVENTS: usize = 10_000;

/// A level slab around the plane y = 0.
pub(super) struct LitSlab {
    pub(super) half: f64,
    pub(super) ior: f64,
    /// 1/m.
    pub(super) extinction: f64,
    pub(super) albedo: f64,
    pub(super) anisotropy: f64,
}

/// Light at a place in the slab.
struct Arrival {
    /// Travels.
    direction: DVec3,
    /// On a surface that faces it, W/m².
    irradiance: f64,
}

impl LitSlab {
    /// Mean scattered radiance, over `samples` paths, along a ray from outside.
    pub(super) fn radiance_along(&self, light: &Light, ray: &Ray, samples: u32) -> f64 {
        let facing = -ray.direction.y.signum();
        let normal = facing * DVec3::Y;
        let start = ray.at((facing * self.half - ray.origin.y) / ray.direction.y);
        let enters = 1.0 - fresnel(ray.direction.y.abs(), self.ior);
        let inside = refract(ray.direction, normal, self.ior).expect("light enters");
        let path = |i: u32| self.path(light, start, inside, &mut Random::new(i.into()));
        let sum: f64 = (0..samples).into_par_iter().map(path).sum();
        enters / (self.ior * self.ior) * sum / f64::from(samples)
    }

    /// Radiance that a random path from `x` towards `d` finds.
    fn path(&self, light: &Light, mut x: DVec3, mut d: DVec3, random: &mut Random) -> f64 {
        let (mut weight, mut sum) = (1.0, 0.0);
        for event in 0..EVENTS {
            let length = -(1.0 - random.unit()).ln() / self.extinction;
            let end = (self.half * d.y.signum() - x.y) / d.y;
            if length >= end {
                if random.unit() >= fresnel(d.y.abs(), 1.0 / self.ior) {
                    return sum;
                }
                x += end * d;
                x.y = self.half * d.y.signum();
                d.y = -d.y;
                continue;
            }
            x += length * d;
            weight *= self.albedo;
            for arrival in self.arrivals(light, x) {
                sum += weight * self.phase(arrival.direction.dot(-d)) * arrival.irradiance;
            }
            if event > 32 {
                if random.unit() >= self.albedo {
                    return sum;
                }
                weight /= self.albedo;
            }
            d = random.scattered(d, self.anisotropy);
        }
        sum
    }

    fn phase(&self, cos: f64) -> f64 {
        let g = self.anisotropy;
        (1.0 - g * g) / (2.0 * TAU * (1.0 + g * g - 2.0 * g * cos).powf(1.5))
    }

    fn arrivals(&self, light: &Light, x: DVec3) -> impl Iterator<Item = Arrival> {
        let depth = self.half - x.y;
        (0..WAYS).map(move |k| {
            let turned = k % 2 == 1;
            // Of the way unfolded.
            let below = 2.0 * self.half * f64::from(k / 2 * 2)
                + if turned { 4.0 * self.half - depth } else { depth };
            let (mut direction, irradiance) = self.below_surface(light, x, below);
            let cos = -direction.y;
            let kept = fresnel(cos, 1.0 / self.ior).powi(k as i32);
            direction.y *= if turned { -1.0 } else { 1.0 };
            let irradiance = kept * (-self.extinction * below / cos).exp() * irradiance;
            Arrival { direction, irradiance }
        })
    }

    /// Direction and irradiance of the light `below` metres under the upper side, without extinction.
    fn below_surface(&self, light: &Light, x: DVec3, below: f64) -> (DVec3, f64) {
        match *light {
            Light::Sun { direction, irradiance } => {
                let d = direction.as_dvec3().normalize();
                let inside = refract(d, DVec3::Y, self.ior).expect("light enters");
                let enters = 1.0 - fresnel(-d.y, self.ior);
                (inside, f64::from(irradiance.x) * enters * d.y / inside.y)
            }
            Light::Point { position, intensity } => {
                let above = position.y - self.half;
                let across = DVec2::new(x.x - position.x, x.z - position.z);
                let distance = across.length().max(1e-9);
                let reach = |sin: f64| {
                    let inner = sin / self.ior;
                    above * sin / (1.0 - sin * sin).sqrt()
                        + below * inner / (1.0 - inner * inner).sqrt()
                };
                let (mut low, mut high) = (0.0, 1.0);
                for _ in 0..60 {
                    let sin = 0.5 * (low + high);
                    if reach(sin) < distance { low = sin } else { high = sin }
                }
                let sin = 0.5 * (low + high);
                let inner = sin / self.ior;
                let (cos_i, cos_t) = ((1.0 - sin * sin).sqrt(), (1.0 - inner * inner).sqrt());
                // Solid angle per area across the beam.
                let slope = above / cos_i.powi(2) + below * cos_i / (self.ior * cos_t.powi(3));
                let spread = sin / (distance * slope * cos_t);
                let enters = 1.0 - fresnel(cos_i, self.ior);
                let outward = inner * across / distance;
                let direction = DVec3::new(outward.x, -cos_t, outward.y);
                (direction, f64::from(intensity.x) * enters * spread)
            }
        }
    }
}

/// A lamp far above lights as a sun does, and a lamp right above a place by the inverse square of its apparent distance.
#[test]
fn lamps_light_as_known() {
    let slab = LitSlab { half: 0.25, ior: 1.33, extinction: 1.0, albedo: 0.5, anisotropy: 0.0 };
    let up = DVec3::new(0.3, 0.9, 0.3).normalize();
    let lamp = Light::Point { position: 1e4 * up, intensity: Vec3::splat(1e8) };
    let sun = Light::Sun { direction: -up.as_vec3(), irradiance: Vec3::ONE };
    let x = DVec3::new(0.05, -0.1, 0.02);
    let (near, far) = (slab.below_surface(&sun, x, 0.35), slab.below_surface(&lamp, x, 0.35));
    assert!((near.1 / far.1 - 1.0).abs() < 1e-3 && near.0.distance(far.0) < 1e-3);
    let above = Light::Point { position: DVec3::Y, intensity: Vec3::ONE };
    let (_, irradiance) = slab.below_surface(&above, DVec3::ZERO, 0.25);
    let expected = (1.0 - fresnel(1.0, 1.33)) / (0.75f64 + 0.25 / 1.33).powi(2);
    assert!((irradiance / expected - 1.0).abs() < 1e-3, "{irradiance} {expected}");
}
