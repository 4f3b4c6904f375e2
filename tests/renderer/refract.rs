//! Refraction through layers, against closed forms or 64-bit ray tracing by the rules documented in
//! `shaders/refract/interfaces.wgsl`.

mod bodies;
mod solids;

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Quat, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::liquid::Particles;
use limpid::liquid::classify::{Splats, classify};
use limpid::scene::{Scene, Shape, Solid, Surface};
use limpid::settings::{Reflections, Solver};

use crate::support::frames::{
    Ellipsoid, View, ellipsoid, glowing, harness, mean_difference, noise, noise_turn, noise_vector,
    on_axis, scene, sphere, splats,
};

/// Odd, so that the middle pixel's ray is the camera's axis.
const SIZE: UVec2 = UVec2::new(161, 121);
const MIDDLE: UVec2 = UVec2::new(80, 60);
const ETA: f64 = 1.33;

/// Unpolarised reflectance and transmitted cosine.
fn fresnel(cos_i: f64, eta: f64) -> (f64, f64) {
    let sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t)
}

/// Transmittance at normal incidence.
fn straight() -> f64 {
    1.0 - fresnel(1.0, ETA).0
}

/// Result of tracing a ray through one convex body, without internal bounces.
struct Light {
    radiance: DVec3,
    /// Length inside the body.
    inside: f64,
    /// Direction after the exit.
    out: DVec3,
    exit: DVec3,
    /// Weight of the transmitted ray.
    weight: DVec3,
    /// Radiance of the two reflections.
    reflected: DVec3,
}

fn through(
    body: &Ellipsoid,
    ray: DVec3,
    sigma: DVec3,
    environment: impl Fn(DVec3) -> DVec3,
) -> Option<Light> {
    let d = ray.normalize();
    let entry = body.hits(DVec3::ZERO, d)?[0] * d;
    let n = body.normal(entry);
    let cos_i = -d.dot(n);
    let (f1, cos_t) = fresnel(cos_i, ETA);
    let within = (d / ETA + (cos_i / ETA - cos_t) * n).normalize();
    let inside = body.hits(entry, within)?[1];
    let exit = entry + inside * within;
    let m = -body.normal(exit);
    let cos_j = -within.dot(m);
    let (f2, cos_u) = fresnel(cos_j, ETA.recip());
    let out = (within * ETA + (cos_j * ETA - cos_u) * m).normalize();
    let absorbed = DVec3::from_array((-sigma * inside).to_array().map(f64::exp));
    let reflected = f1 * environment(d.reflect(n))
        + (1.0 - f1) * f2 * absorbed * environment(within.reflect(m));
    let weight = (1.0 - f1) * (1.0 - f2) * absorbed;
    let radiance = reflected + weight * environment(out);
    Some(Light { radiance, inside, out, exit, weight, reflected })
}

/// Distance between the ray and the body's centre.
fn off_axis(body: &Ellipsoid, ray: DVec3) -> f64 {
    (body.centre - body.centre.project_onto(ray)).length()
}

/// An environment map whose radiance encodes the direction, plus 1.
fn compass() -> Environment {
    let size = UVec2::new(512, 256);
    let pixels = (0..size.x * size.y)
        .map(|i| {
            let longitude = (f64::from(i % size.x) + 0.5) / f64::from(size.x) * TAU - PI;
            let latitude = (f64::from(i / size.x) + 0.5) / f64::from(size.y) * PI;
            let (s, c) = latitude.sin_cos();
            let d = DVec3::new(longitude.sin() * s, c, -longitude.cos() * s);
            (d + 1.0).as_vec3().extend(1.0).to_array()
        })
        .collect();
    Environment::Map { size, pixels }
}

fn compass_radiance(d: DVec3) -> DVec3 {
    d + 1.0
}

/// A scene in which only a wall at `z` emits light, and reflections see only the black environment.
fn wall(z: f32) -> Scene {
    let mut scene = scene();
    scene.environment = Environment::Constant(Vec3::ZERO);
    let shape = Shape::Plane {
        origin: DVec3::Z * f64::from(z),
        normal: Vec3::Z,
        half_extent: f32::INFINITY,
    };
    scene.solids = vec![glowing(shape, Vec3::ONE)];
    scene.settings.refract.reflections = Reflections::Environment;
    scene.settings.refract.contact = 0.0;
    scene
}

/// 300 particles like those of a file: a body with a rough surface, and spray.
fn cloud(settings: &Scene) -> Splats {
    let mut seed = 5;
    let positions = (0..300)
        .map(|i| {
            let reach = if i < 250 { Vec3::new(0.35, 0.25, 0.35) } else { Vec3::splat(0.8) };
            reach * noise_vector(&mut seed)
        })
        .collect();
    let particles = Particles { positions, ..Default::default() };
    classify(&particles, 0.06, &settings.settings.classify)
}

/// A scene for the cloud: checkered floor, sky, absorption, default settings.
fn tank() -> Scene {
    Scene::around(DVec3::splat(-0.8), DVec3::splat(0.8), 0.06)
}

fn above() -> Camera {
    let eye = DVec3::new(0.7, 1.2, 2.4);
    Camera { eye, target: DVec3::ZERO, up: Vec3::Y, fov_y: 40.0, near: None, lens: None }
}

/// Through a ball, all pixels at least two from the rim have the analytic chord length, and the analytic
/// directions of refracted and reflected rays, which the environment encodes.
///
/// The layer has one plane per pixel: over half a pixel, R/90 here, the sphere deviates from it by
/// 1e-4 R, and its normal by 0.01, half of which remains after refraction. With half the pixel size the
/// error must halve.
#[test]
fn ball_refracts_by_snells_law() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(8.0, 20.0);
    let ball = sphere(Vec3::new(0.1, -0.05, 0.0), 1.0);
    let mut scene = scene();
    scene.environment = compass();
    scene.settings.refract.internal_bounces = 0;
    let cases = [
        (Solver::Guarded, false, SIZE),
        (Solver::Guarded, false, SIZE * 2),
        (Solver::Guarded, true, SIZE),
        (Solver::March, false, SIZE),
        (Solver::March, false, SIZE * 2),
    ];
    for (solver, splash, size) in cases {
        let view = View::new(&camera, size);
        let body = Ellipsoid::new(&view, &ball);
        let pixel = view.footprint() * 8.0;
        scene.settings.refract.solver = solver;
        let drawn = match splash {
            true => splats(&[], &[ball], 0.1),
            false => splats(&[ball], &[], 0.1),
        };
        let images = harness.render(&scene, &camera, &drawn, size);
        images.assert_finite();
        let (mut pixels, mut long, mut total) = (0, 0, 0.0);
        let (mut longest, mut widest) = (0f64, 0f64);
        for p in images.pixels() {
            let ray = view.through(p);
            if 1.0 - off_axis(&body, ray) < 2.0 * pixel {
                continue;
            }
            let expected = through(&body, ray, DVec3::ZERO, compass_radiance).expect("covered");
            let length = (images.at("inside", p) - expected.inside).abs();
            let off = (images.radiance(p) - expected.radiance).abs().max_element();
            longest = longest.max(length);
            widest = widest.max(off);
            total += off;
            pixels += 1;
            long += u32::from(length > 1e-3);
            assert_eq!(images.at("interfaces", p), 2.0, "{p}");
        }
        let mean = total / f64::from(pixels);
        println!(
            "{solver:?} at {size}: length off by {longest:.2e}, {long} of {pixels} beyond 1e-3;"
        );
        println!("    direction off by {widest:.2e}, on the average by {mean:.2e}");
        assert!(pixels > 5000 && long * 100 <= pixels, "{long} of {pixels}");
        assert!(widest < 0.06 && mean < 0.33 * pixel, "{widest}, {mean}");
        assert!(images.channel("failures").iter().all(|&n| n == 0.0));
    }
}

/// A ray at half a radius from a ball's axis has a chord of 1.85329 R and a deviation of 15.8352°.
#[test]
fn ray_at_half_the_radius() {
    let Some(mut harness) = harness() else { return };
    // A pixel is R/250: the exit normal is accurate to 0.1°.
    let camera = on_axis(8.0, 3.466);
    let view = View::new(&camera, SIZE);
    let ball = sphere(Vec3::new(0.5, 0.0, 0.0), 1.0);
    let body = Ellipsoid::new(&view, &ball);
    let expected =
        through(&body, view.through(MIDDLE), DVec3::ZERO, compass_radiance).expect("a hit");
    // The reference itself against the published figures.
    let deviation = expected.out.angle_between(DVec3::NEG_Z).to_degrees();
    assert!((deviation - 15.8352).abs() < 1e-4 && (expected.inside - 1.85329).abs() < 1e-5);
    let mut scene = scene();
    scene.environment = compass();
    scene.settings.refract.internal_bounces = 0;
    for solver in [Solver::Guarded, Solver::March] {
        scene.settings.refract.solver = solver;
        let images = harness.render(&scene, &camera, &splats(&[ball], &[], 0.1), SIZE);
        let inside = images.at("inside", MIDDLE);
        // The radiance without the reflections encodes the direction of the transmitted ray.
        let out = (images.radiance(MIDDLE) - expected.reflected) / expected.weight - 1.0;
        let deviation = out.angle_between(DVec3::NEG_Z).to_degrees();
        println!("{solver:?}: chord {inside}, deviation {deviation}°, |out| {}", out.length());
        assert!((inside - 1.85329).abs() < 1e-4, "{inside}");
        assert!((deviation - 15.8352).abs() < 0.1, "{deviation}");
        assert!((out.length() - 1.0).abs() < 1e-3, "{out}");
    }
}

/// Absorption follows Beer's law over the chord: F₁ + (1 − F₁) e^(−σl) under a white sky, which the ray
/// reflected at the far side sees too.
#[test]
fn ball_absorbs_by_its_chord() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(8.0, 20.0);
    let view = View::new(&camera, SIZE);
    let ball = sphere(Vec3::ZERO, 1.0);
    let body = Ellipsoid::new(&view, &ball);
    let mut scene = scene();
    scene.liquid.absorption = Vec3::new(1.0, 0.3, 0.01);
    scene.settings.refract.internal_bounces = 0;
    let sigma = scene.liquid.absorption.as_dvec3();
    let images = harness.render(&scene, &camera, &splats(&[ball], &[], 0.1), SIZE);
    let middle = through(&body, view.through(MIDDLE), sigma, |_| DVec3::ONE).expect("a hit");
    let f = 1.0 - straight();
    assert!((middle.radiance.x - (f + (1.0 - f) * (-2f64).exp())).abs() < 1e-9);
    let mut worst = 0f64;
    for p in images.pixels() {
        let ray = view.through(p);
        let Some(expected) = through(&body, ray, sigma, |_| DVec3::ONE) else { continue };
        if off_axis(&body, ray) < 0.9 {
            worst = worst.max((images.radiance(p) - expected.radiance).abs().max_element());
        }
    }
    println!("middle {}, worst {worst:.2e}", images.radiance(MIDDLE));
    assert!((images.radiance(MIDDLE) - middle.radiance).abs().max_element() < 1e-4);
    assert!(worst < 1e-3, "{worst}");
}

/// A slab of 0.2 m, wide enough to be flat, over a checkered floor, the only emitter.
fn slab_over_floor() -> (Scene, Splats) {
    let mut scene = wall(0.0);
    scene.solids = vec![Solid {
        shape: Shape::Plane { origin: DVec3::NEG_Y, normal: Vec3::Y, half_extent: 40.0 },
        surface: Surface::Checker { tile: 0.2, even: Vec3::ONE, odd: Vec3::ZERO },
        lit: false,
    }];
    let slab = ellipsoid(Vec3::ZERO, Vec3::new(50.0, 0.1, 50.0), Quat::IDENTITY);
    (scene, splats(&[slab], &[], 0.01))
}

/// Views of the slab from straight above and at 45°.
fn at_the_slab() -> [Camera; 2] {
    let camera = Camera { eye: DVec3::Y * 2.0, up: Vec3::NEG_Z, ..on_axis(0.0, 35.0) };
    [camera, Camera { eye: DVec3::new(0.0, 2.0, 2.0), up: Vec3::Y, ..camera }]
}

/// A flat slab displaces an inclined ray by `t sin(θ − θ_t) / cos θ_t` without changing its direction,
/// tested by the position on a checkered floor to a fiftieth of a tile.
#[test]
fn slab_displaces_rays_without_deviation() {
    let Some(mut harness) = harness() else { return };
    let (scene, drawn) = slab_over_floor();
    let in_tiles = |x: DVec3| x / f64::from(0.2f32);
    let even = |x: DVec3| {
        let tiles = in_tiles(x).floor();
        (tiles.x + tiles.z).rem_euclid(2.0) == 0.0
    };
    let near_an_edge = |x: DVec3| {
        let off = (in_tiles(x) - in_tiles(x).round()).abs();
        off.x.min(off.z) < 0.02
    };
    for camera in at_the_slab() {
        let view = View::new(&camera, SIZE);
        let body = Ellipsoid::new(&view, &drawn.aggregates[0]);
        let images = harness.render(&scene, &camera, &drawn, SIZE);
        let land = |from: DVec3, d: DVec3| {
            let (from, d) = (view.world_point(from), view.world_vector(d));
            from + (-1.0 - from.y) / d.y * d
        };
        let (mut compared, mut wrong, mut wrong_if_straight, mut beyond) = (0, 0, 0, 0);
        for p in images.pixels() {
            let ray = view.through(p);
            let light = through(&body, ray, DVec3::ZERO, |_| DVec3::ZERO).expect("it is wide");
            assert!(light.out.angle_between(ray) < 1e-3, "the reference deviates");
            // Rays that exit outside of the picture cannot be exact.
            let at = view.pixel(light.exit);
            if at.min_element() < 0.0 || (at - SIZE.as_dvec2()).max_element() > 0.0 {
                beyond += 1;
                continue;
            }
            let landed = land(light.exit, light.out);
            if near_an_edge(landed) {
                continue;
            }
            let seen = if even(landed) { light.weight.x } else { 0.0 };
            compared += 1;
            wrong += u32::from((images.radiance(p).x - seen).abs() > 2e-3);
            wrong_if_straight += u32::from(even(land(DVec3::ZERO, ray)) != even(landed));
        }
        let theta = camera.eye.z.atan2(camera.eye.y);
        let theta_t = (theta.sin() / ETA).asin();
        let inside = images.at("inside", MIDDLE);
        println!("{wrong} of {compared} wrong, {wrong_if_straight} if straight, {beyond} beyond;");
        println!("    length {inside}");
        assert!((inside - 0.2 / theta_t.cos()).abs() < 1e-5, "{inside}");
        assert!(wrong == 0 && compared > 15_000, "{wrong} of {compared}");
        assert!(theta == 0.0 || wrong_if_straight * 5 > compared, "the test is not sensitive");
    }
}

/// A ray is traced through the requested number of interfaces, then sees what is ahead.
#[test]
fn interfaces_are_limited_to_the_requested_number() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(8.0, 20.0);
    let mut scene = wall(-5.0);
    let drawn = splats(&[sphere(Vec3::NEG_Z, 1.0)], &[sphere(Vec3::Z * 1.5, 0.5)], 0.1);
    for (asked, length) in [(1, 0.0), (2, 1.0), (3, 1.0), (4, 3.0), (8, 3.0)] {
        scene.settings.refract.interfaces = asked;
        let images = harness.render(&scene, &camera, &drawn, SIZE);
        images.assert_finite();
        let crossed = asked.min(4);
        assert_eq!(images.at("interfaces", MIDDLE), f64::from(crossed));
        assert!((images.at("inside", MIDDLE) - length).abs() < 1e-4, "{asked}");
        let expected = straight().powi(crossed as i32);
        assert!((images.at("radiance.R", MIDDLE) - expected).abs() < 1e-4, "{asked}");
    }
}

/// White furnace test: in uniform surroundings and without absorption, liquid is invisible. Every split,
/// bounce and terminated ray must conserve energy.
#[test]
fn white_furnace() {
    let Some(mut harness) = harness() else { return };
    let mut scene = scene();
    let mut smoothed = scene.clone();
    smoothed.settings.smooth.iterations = 5;
    let ball = splats(&[sphere(Vec3::new(0.1, 0.0, 0.0), 1.0)], &[], 0.1);
    for (scene, drawn, camera) in [
        (&scene, &ball, on_axis(4.0, 40.0)),
        (&scene, &cloud(&scene), above()),
        (&smoothed, &cloud(&scene), above()),
    ] {
        let mut scene = scene.clone();
        for (bounces, interfaces) in [(4, 4), (0, 4), (8, 8), (4, 1)] {
            scene.settings.refract.internal_bounces = bounces;
            scene.settings.refract.interfaces = interfaces;
            let images = harness.render(&scene, &camera, drawn, SIZE);
            images.assert_finite();
            let off = |p| (images.radiance(p) - 1.0).abs().max_element();
            let worst = images.pixels().map(off).fold(0.0, f64::max);
            println!("{bounces} bounces, {interfaces} interfaces: {worst:.2e}");
            assert!(worst < 1e-5, "{worst}");
        }
    }
    // Without emitters the picture is black.
    scene.environment = Environment::Constant(Vec3::ZERO);
    let images = harness.render(&scene, &above(), &cloud(&scene), SIZE);
    assert!(images.pixels().all(|p| images.radiance(p) == DVec3::ZERO));
}

/// Radiance is η² times as large inside the liquid: an eye in it sees a white sky as η², also by total
/// reflection; without radiance scaling, as 1.
#[test]
fn eye_in_the_liquid_sees_scaled_radiance() {
    let Some(mut harness) = harness() else { return };
    let ball = splats(&[sphere(Vec3::ZERO, 1.0)], &[], 0.1);
    let camera =
        Camera { eye: DVec3::new(0.3, 0.6, 0.2), target: DVec3::NEG_Z, ..on_axis(0.0, 60.0) };
    let mut scene = scene();
    for (scaled, iterations) in [(true, 0), (true, 5), (false, 0)] {
        scene.settings.refract.radiance_scaling = scaled;
        scene.settings.smooth.iterations = iterations;
        let images = harness.render(&scene, &camera, &ball, SIZE);
        images.assert_finite();
        let expected = if scaled { ETA * ETA } else { 1.0 };
        let off = |p| (images.radiance(p) - expected).abs().max_element();
        let worst = images.pixels().map(off).fold(0.0, f64::max);
        println!("scaled {scaled}, smoothed {iterations} times: {worst:.2e}");
        assert!(worst < 1e-5, "{worst}");
    }
}

/// Where the near plane cuts the surface, each pixel's ray starts inside or enters, and smoothing does
/// not blend the two cases.
#[test]
fn smoothing_preserves_rays_that_start_inside() {
    let Some(mut harness) = harness() else { return };
    let ball = sphere(Vec3::ZERO, 1.0);
    let camera = Camera { near: Some(0.104), ..on_axis(1.1, 90.0) };
    let mut scene = scene();
    for iterations in [0, 5] {
        scene.settings.smooth.iterations = iterations;
        let images = harness.render(&scene, &camera, &splats(&[ball], &[], 0.1), SIZE);
        images.assert_finite();
        let (mut started, mut wrong) = (0, Vec::new());
        for p in images.pixels() {
            let inside = images.at("depth.aggregate_front", p) == f64::from(0.104f32);
            let expected = if inside { ETA * ETA } else { 1.0 };
            started += u32::from(inside);
            if (images.radiance(p) - expected).abs().max_element() > 1e-4 {
                wrong.push((p, images.radiance(p).x, images.at("smooth_depth.aggregate_front", p)));
            }
        }
        println!("smoothed {iterations} times: {} of {started} wrong", wrong.len());
        assert!((1000..15_000).contains(&started));
        assert!(wrong.is_empty(), "{} pixels, the first {:?}", wrong.len(), wrong[0]);
    }
}

/// `newton` fails for some rays but never yields NaN; on a ball's axis its tangent plane is exact.
#[test]
fn newton_is_finite_and_right_where_it_converges() {
    let Some(mut harness) = harness() else { return };
    let mut tank = tank();
    tank.settings.refract.solver = Solver::Newton;
    for iterations in [0, 1, 4, 20] {
        tank.settings.refract.iterations = iterations;
        harness.render(&tank, &above(), &cloud(&tank), SIZE).assert_finite();
    }
    let camera = on_axis(8.0, 20.0);
    let view = View::new(&camera, SIZE);
    let ball = sphere(Vec3::ZERO, 1.0);
    let body = Ellipsoid::new(&view, &ball);
    let mut scene = scene();
    scene.environment = compass();
    scene.settings.refract.solver = Solver::Newton;
    scene.settings.refract.internal_bounces = 0;
    let images = harness.render(&scene, &camera, &splats(&[ball], &[], 0.1), SIZE);
    images.assert_finite();
    assert!((images.at("inside", MIDDLE) - 2.0).abs() < 1e-4);
    // Over the ball's inner half, where four iterations pass the 1-pixel test.
    let mut worst = 0f64;
    for p in images.pixels() {
        let ray = view.through(p);
        if off_axis(&body, ray) < 0.5 {
            let expected = through(&body, ray, DVec3::ZERO, compass_radiance).expect("a hit");
            worst = worst.max((images.radiance(p) - expected.radiance).abs().max_element());
        }
    }
    println!("newton: worst {worst:.2e}");
    assert!(worst < 0.02, "{worst}");
}

/// `guarded`, which takes strides, agrees with `march`, which visits every texel, on a body's smoothed
/// surface: lengths differ only where the ray passes a dent, or re-enters by a side, narrower than a stride. Spray
/// and rough surfaces have many of them, and bounces multiply them: there only the mean is bounded.
#[test]
fn guarded_agrees_with_march() {
    let Some(mut harness) = harness() else { return };
    let mut scene = tank();
    let all = cloud(&scene);
    assert!(all.splashes.len() > 20 && all.aggregates.len() > 150);
    let bodies = Splats { splashes: Vec::new(), ..all.clone() };
    for (drawn, bounces, lengths, most) in [(&bodies, 0, 0.02, 0.02), (&all, 4, 0.3, 0.06)] {
        scene.settings.refract.internal_bounces = bounces;
        let [guarded, march] = [Solver::Guarded, Solver::March].map(|solver| {
            scene.settings.refract.solver = solver;
            let images = harness.render(&scene, &above(), drawn, SIZE);
            images.assert_finite();
            images
        });
        let liquid = march.channel("interfaces").iter().filter(|&&n| n > 0.0).count() as f64;
        let difference = mean_difference(&guarded, &march) * f64::from(SIZE.x * SIZE.y) / liquid;
        let off = |p: &UVec2| (guarded.at("inside", *p) - march.at("inside", *p)).abs() > 0.01;
        let apart = march.pixels().filter(off).count() as f64 / liquid;
        println!("{bounces} bounces: differ by {difference:.2e}; of {liquid} lengths {apart:.4}");
        assert!(difference < most && apart < lengths, "{difference}, {apart}");
    }
}

/// Samples intersect the same layers from different points of the pixel. On planar layers, more samples
/// converge to the mean of the 16 pixels of a picture of four times the size.
#[test]
fn samples_converge_to_the_pixel_mean() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, slab) = slab_over_floor();
    let camera = at_the_slab()[1];
    let fine = harness.render(&scene, &camera, &slab, SIZE * 4);
    let means: Vec<_> = (0..SIZE.x * SIZE.y)
        .map(|i| {
            let p = 4 * UVec2::new(i % SIZE.x, i / SIZE.x);
            let within = (0..16).map(|k| p + UVec2::new(k % 4, k / 4));
            within.map(|q| fine.radiance(q).x).sum::<f64>() / 16.0
        })
        .collect();
    let [one, four, seven, sixteen] = [1, 4, 7, 16].map(|samples| {
        scene.settings.refract.samples = samples;
        let images = harness.render(&scene, &camera, &slab, SIZE);
        images.assert_finite();
        let off = images.pixels().zip(&means).map(|(p, mean)| (images.radiance(p).x - mean).abs());
        off.sum::<f64>() / means.len() as f64
    });
    println!("off the mean, by samples: 1 {one:.4}, 4 {four:.4}, 7 {seven:.4}, 16 {sixteen:.4}");
    assert!(four < 0.6 * one && seven < 0.6 * one && sixteen < 0.6 * one);
}

/// Radiance is finite and not negative for random splats and eyes.
#[test]
fn random_clouds_are_finite() {
    let Some(mut harness) = harness() else { return };
    let mut seed = 23;
    let scene = tank();
    for _ in 0..6 {
        let drawn: Vec<_> = (0..80)
            .map(|_| {
                let axes = Vec3::from_array([(); 3].map(|()| (4.0 * noise(&mut seed) - 5.0).exp()));
                ellipsoid(noise_vector(&mut seed), axes, noise_turn(&mut seed))
            })
            .collect();
        let (aggregates, splashes) = drawn.split_at(60);
        let eye = 1.5 * noise_vector(&mut seed).as_dvec3();
        let camera = Camera { eye, ..above() };
        let images = harness.render(&scene, &camera, &splats(aggregates, splashes, 0.06), SIZE);
        images.assert_finite();
        assert!(images.pixels().all(|p| images.radiance(p).min_element() >= 0.0));
    }
}

/// At half a radius from the axis of a ball of radius 1 with an absorption of 1, the transmittance of the
/// chord is e^(−1.85329) = 0.156721.
#[test]
fn chord_at_half_the_radius_absorbs() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(8.0, 3.466);
    let view = View::new(&camera, SIZE);
    let ball = sphere(Vec3::new(0.5, 0.0, 0.0), 1.0);
    let body = Ellipsoid::new(&view, &ball);
    let mut scene = wall(-50.0);
    scene.liquid.absorption = Vec3::ONE;
    scene.settings.refract.internal_bounces = 0;
    let clear = through(&body, view.through(MIDDLE), DVec3::ZERO, |_| DVec3::ZERO).expect("a hit");
    let images = harness.render(&scene, &camera, &splats(&[ball], &[], 0.1), SIZE);
    let kept = images.radiance(MIDDLE).x / clear.weight.x;
    println!("kept {kept}");
    assert!((kept - 0.156_721).abs() < 2e-5, "{kept}");
}

/// A disc of no thickness transmits at both its faces, and absorbs nothing.
#[test]
fn disc_without_thickness_absorbs_nothing() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(8.0, 20.0);
    let mut scene = wall(-5.0);
    scene.liquid.absorption = Vec3::splat(10.0);
    let disc = ellipsoid(Vec3::ZERO, Vec3::new(1.0, 1.0, 1e-6), Quat::IDENTITY);
    for solver in [Solver::Guarded, Solver::March] {
        scene.settings.refract.solver = solver;
        let images = harness.render(&scene, &camera, &splats(&[disc], &[], 0.1), SIZE);
        images.assert_finite();
        println!("{solver:?}: {}", images.radiance(MIDDLE).x);
        assert!((images.radiance(MIDDLE).x - straight().powi(2)).abs() < 1e-3);
        assert!(images.at("inside", MIDDLE) < 1e-4);
    }
}
