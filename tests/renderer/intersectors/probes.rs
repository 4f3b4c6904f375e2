//! Rays that are traced through layers of planes on the device.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3, UVec2};
use limpid::gpu::Gpu;
use limpid::wgpu;

use crate::support::view::{View, case, round3, vec3};
use crate::support::{Kernel, Random, texture, uniform};

pub(super) const GUARDED: &str = "refract/guarded.wgsl";
pub(super) const MARCH: &str = "refract/march.wgsl";
pub(super) const NEWTON: &str = "refract/newton.wgsl";
pub(super) const SECANT: &str = "refract/secant.wgsl";
pub(super) const PLANE: &str = "refract/plane.wgsl";

/// Intersectors that are exact on planar layers.
pub(super) const EXACT_ON_PLANES: [&str; 5] = [GUARDED, MARCH, NEWTON, SECANT, PLANE];

/// Whether an intersector tests one layer at a time: inside the liquid, only its backs.
pub(super) fn tests_one_layer(solver: &str) -> bool {
    [NEWTON, SECANT, PLANE].contains(&solver)
}

/// A query to an intersector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Query {
    /// Exit of a ray inside the liquid.
    Exit,
    /// Entry of a ray outside the liquid.
    Entry,
    /// Hit on the opaque scene.
    Opaque,
}

/// A ray, and the texel at its start.
#[derive(Debug, Clone, Copy)]
pub(super) struct Probe {
    pub(super) query: Query,
    pub(super) o: DVec3,
    pub(super) d: DVec3,
    pub(super) texel: DVec2,
}

impl Probe {
    /// Rounds the ray to the device's precision.
    pub(super) fn new(query: Query, o: DVec3, d: DVec3, u: DVec2) -> Self {
        Self { query, o: round3(o), d: round3(d), texel: u.floor() }
    }
}

/// Result of an intersector.
#[derive(Debug, Clone, Copy)]
pub(super) struct Answer {
    pub(super) found: bool,
    pub(super) position: DVec3,
    pub(super) plane: DVec3,
    pub(super) failures: f64,
}

/// Layers of planes: the liquid's fronts and backs, and the opaque scene.
pub(super) struct Picture {
    pub(super) size: UVec2,
    pub(super) layers: wgpu::TextureView,
    pub(super) splashes: Option<wgpu::TextureView>,
    pub(super) opaque: wgpu::TextureView,
    /// Of the tiles, as `bounds.wgsl` finds them. Splashes may be anywhere.
    pub(super) bounds: wgpu::TextureView,
}

impl Picture {
    /// Builds the layers from functions of the pixel centre; `None` is empty.
    pub(super) fn new(
        gpu: &Gpu,
        view: &View,
        front: impl Fn(DVec2) -> Option<DVec3>,
        back: impl Fn(DVec2) -> Option<DVec3>,
    ) -> Self {
        let size = view.pixels();
        let texels = |plane: &dyn Fn(DVec2) -> Option<DVec3>| -> Vec<[f32; 4]> {
            pixels(size)
                .map(|p| {
                    let u = p.as_dvec2() + 0.5;
                    plane(u).map_or([0.0; 4], |pi| {
                        let z = 1.0 / pi.dot(view.omega(u));
                        case(&[&pi.to_array(), &[z]])
                    })
                })
                .collect()
        };
        let bounds = bounds(view, &front, &back);
        let bounds = texture(gpu, size.map(|n| n.div_ceil(TILE)), &[&bounds]);
        let (front, back) = (texels(&front), texels(&back));
        let layers = texture(gpu, size, &[&front, &back]);
        Self { size, layers, splashes: None, opaque: texture(gpu, size, &[&front]), bounds }
    }

    /// Runs an intersector with the default number of Newton iterations.
    pub(super) fn run(
        &self,
        gpu: &Gpu,
        view: &View,
        solver: &str,
        probes: &[Probe],
    ) -> Vec<Answer> {
        self.run_with(4, gpu, view, solver, probes)
    }

    pub(super) fn run_with(
        &self,
        iterations: u32,
        gpu: &Gpu,
        view: &View,
        solver: &str,
        probes: &[Probe],
    ) -> Vec<Answer> {
        assert_eq!(self.size, view.pixels());
        let camera = uniform(gpu, &view.uniform);
        let params =
            limpid::passes::refract::Params { reach: 0.01, ..bytemuck::Zeroable::zeroed() };
        let params = uniform(gpu, &params);
        let view_of = |texture| wgpu::BindingResource::TextureView(texture);
        let mut resources = vec![
            (0, 0, camera.as_entire_binding()),
            (1, 1, view_of(&self.layers)),
            (1, 2, view_of(self.splashes.as_ref().unwrap_or(&self.layers))),
            (1, 3, view_of(&self.opaque)),
        ];
        let mut constants = vec![
            ("SPLASH", f64::from(u8::from(self.splashes.is_some()))),
            ("ITERATIONS", iterations.into()),
        ];
        if solver == GUARDED {
            resources.push((1, 0, params.as_entire_binding()));
            resources.push((1, 4, view_of(&self.bounds)));
            constants.push(("BOUNDS", 1.0));
        }
        let kernel = Kernel {
            imports: &[solver],
            body: "fn test(x: array<f32, 9>) -> array<f32, 8> {
                diagnosed = Diagnostics();
                let ray = screen_ray(vec3f(x[0], x[1], x[2]), vec3f(x[3], x[4], x[5]), NOTHING);
                var hit: Interface;
                if x[8] == 0.0 {
                    hit = liquid_exit(ray, vec2i(i32(x[6]), i32(x[7])));
                } else if x[8] == 1.0 {
                    hit = liquid_entry(ray);
                } else {
                    hit = opaque_entry(ray);
                }
                return array(select(0.0, 1.0, hit.found), hit.position.x, hit.position.y,
                    hit.position.z, hit.plane.x, hit.plane.y, hit.plane.z, diagnosed.failures);
            }",
            constants: &constants,
            resources: &resources,
        };
        let cases: Vec<[f32; 9]> = probes
            .iter()
            .map(|p| {
                let query = f64::from(p.query as u8);
                case(&[&p.o.to_array(), &p.d.to_array(), &p.texel.to_array(), &[query]])
            })
            .collect();
        let results: Vec<[f32; 8]> = kernel.run(gpu, &cases);
        let answers = results.iter().map(|r| Answer {
            found: r[0] == 1.0,
            position: vec3(&r[1..]),
            plane: vec3(&r[4..]),
            failures: r[7].into(),
        });
        let answers: Vec<_> = answers.collect();
        for (probe, answer) in probes.iter().zip(&answers) {
            assert!(answer.position.is_finite() && answer.plane.is_finite(), "{solver} {probe:?}");
        }
        answers
    }
}

/// The plane through a point with a normal.
pub(super) fn plane_through(point: DVec3, normal: DVec3) -> DVec3 {
    normal / normal.dot(point)
}

/// Parameter t at which o + t d meets a plane.
pub(super) fn meets(pi: DVec3, o: DVec3, d: DVec3) -> f64 {
    (1.0 - pi.dot(o)) / pi.dot(d)
}

/// Refracted direction by Snell's law; `None` for total reflection.
pub(super) fn refracted(d: DVec3, n: DVec3, eta: f64) -> Option<DVec3> {
    let cos_i = -d.dot(n);
    let across = (d + cos_i * n) / eta;
    let rest = 1.0 - across.length_squared();
    (rest > 0.0).then(|| across - rest.sqrt() * n)
}

/// Whether a pixel position is inside the picture by at least `margin`, which may be negative.
pub(super) fn in_picture(view: &View, u: DVec2, margin: f64) -> bool {
    u.cmpgt(DVec2::splat(margin)).all() && u.cmplt(view.size - margin).all()
}

/// A pair of planes that bound a wedge of liquid between depths of about 4 and 5.
pub(super) fn wedge(random: &mut Random) -> [DVec3; 2] {
    [4.0, 5.0].map(|z| {
        let tilt = DVec3::new(random.range(-0.2, 0.2), random.range(-0.2, 0.2), -1.0);
        round3(plane_through(DVec3::new(0.0, 0.0, -z), tilt))
    })
}

/// A wavy surface, as a sum of sine waves in disparity: height, wave vector per pixel and phase.
pub(super) struct Waves(Vec<(f64, DVec2, f64)>);

impl Waves {
    /// Waves of 25 to 100 pixels with slopes of up to about 0.3 at a depth of 4.
    pub(super) fn new(random: &mut Random) -> Self {
        let wave = |_| {
            let length = random.magnitude(25.0, 100.0);
            let (sin, cos) = random.range(0.0, TAU).sin_cos();
            (2e-5 * length, DVec2::new(cos, sin) * TAU / length, random.range(0.0, TAU))
        };
        Self((0..6).map(wave).collect())
    }

    pub(super) fn plane(&self, view: &View, depth: f64, u: DVec2) -> DVec3 {
        let mut disparity = 1.0 / depth;
        let mut slope = DVec2::ZERO;
        for &(height, k, phase) in &self.0 {
            let (sin, cos) = (k.dot(u) + phase).sin_cos();
            disparity += height * sin;
            slope += height * cos * k;
        }
        view.plane(u, disparity, slope)
    }
}

const TILE: u32 = 8;

/// The bounds of each tile, from the planes at the corners of its pixels.
fn bounds(
    view: &View,
    front: &dyn Fn(DVec2) -> Option<DVec3>,
    back: &dyn Fn(DVec2) -> Option<DVec3>,
) -> Vec<[f32; 4]> {
    let size = view.pixels();
    let mut bounds = Vec::new();
    for tile in pixels(size.map(|n| n.div_ceil(TILE))) {
        let [mut nearest, mut farthest] = [0.0f64, f64::INFINITY];
        for p in pixels(UVec2::splat(TILE)).map(|p| tile * TILE + p).filter(|p| p.cmplt(size).all())
        {
            let u = p.as_dvec2() + 0.5;
            let (Some(front), Some(back)) = (front(u), back(u)) else { continue };
            for corner in pixels(UVec2::splat(2)) {
                let omega = view.omega((p + corner).as_dvec2());
                nearest = nearest.max(front.dot(omega));
                farthest = farthest.min(back.dot(omega));
            }
        }
        // Splashes are in front of everything, and behind it.
        bounds.push([nearest as f32, farthest.min(1e30) as f32, 1e30, 0.0]);
    }
    bounds
}

fn pixels(size: UVec2) -> impl Iterator<Item = UVec2> {
    (0..size.y).flat_map(move |y| (0..size.x).map(move |x| UVec2::new(x, y)))
}
