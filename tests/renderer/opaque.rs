//! Opaque bodies and the colours of their particles, against closed forms and sums in 64 bits.

use std::f64::consts::PI;

use glam::{DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::liquid::classify::{Splats, classify};
use limpid::liquid::{ColorMap, Colors, Particles};
use limpid::scene::{Kind, Light, Liquid, Scene, Shape, Solid, Surface};

use crate::support::frames::{
    FrameImages, View, diagnosed, ellipsoid, harness, noise_turn, noise_vector, on_axis, render,
    scene, sphere, splats,
};

const SIZE: UVec2 = UVec2::new(97, 73);

/// A body of this colour without a coat in the dark.
fn opaque(color: Vec3) -> Scene {
    let liquid = Liquid { kind: Kind::Opaque, ior: 1.0, color, ..Liquid::default() };
    Scene { liquid, environment: Environment::Constant(Vec3::ZERO), ..scene() }
}

fn sun(direction: Vec3, irradiance: f32) -> Light {
    Light::Sun { direction, irradiance: Vec3::splat(irradiance) }
}

/// Outward normal of the nearest front in view space, and the point that it is at; `None` without liquid.
fn surface(images: &FrameImages, view: &View, p: UVec2) -> Option<(DVec3, DVec3)> {
    let depth = images.at("depth.aggregate_front", p);
    let at = depth * view.through(p);
    (depth > 0.0).then(|| (at, images.normal("normal.aggregate_front", p)))
}

/// In light of one radiance from everywhere, a white body reflects what it receives and cannot be seen; with a coat,
/// which loses no light, neither. Several bodies light each other.
#[test]
fn white_bodies_vanish_in_a_furnace() {
    let Some(mut harness) = harness() else { return };
    let mut seed = 7;
    let pile = |_| {
        let (centre, turn) = (0.5 * noise_vector(&mut seed), noise_turn(&mut seed));
        ellipsoid(centre, Vec3::new(0.35, 0.3, 0.25), turn)
    };
    let bodies = splats(&(0..9).map(pile).collect::<Vec<_>>(), &[], 0.05);
    for (ior, roughness) in [(1.0, 0.0), (1.5, 0.1), (1.5, 0.4)] {
        let mut scene = opaque(Vec3::ONE);
        scene.environment = Environment::Constant(Vec3::ONE);
        (scene.liquid.ior, scene.liquid.roughness) = (ior, roughness);
        for camera in [on_axis(4.0, 35.0), on_axis(2.0, 60.0)] {
            let images = harness.render(&scene, &camera, &bodies, SIZE);
            images.assert_finite();
            for p in images.pixels() {
                let radiance = images.radiance(p);
                let off = (radiance - 1.0).abs().max_element();
                assert!(off <= 0.02, "index {ior}, roughness {roughness}, {p}: {radiance}");
            }
        }
    }
}

/// A matt sphere in the sun has the radiance of Lambert's law on the side that faces it, and none on the other.
#[test]
fn matt_spheres_follow_lambert() {
    let Some(mut harness) = harness() else { return };
    let albedo = Vec3::new(0.8, 0.4, 0.1);
    let mut scene = opaque(albedo);
    let direction = Vec3::new(-1.0, -0.5, -0.7).normalize();
    scene.lights = vec![sun(direction, 3.0)];
    let camera = on_axis(4.0, 35.0);
    let view = View::new(&camera, SIZE);
    let body = splats(&[sphere(Vec3::ZERO, 1.0)], &[], 0.05);
    let images = harness.render(&scene, &camera, &body, SIZE);
    let (mut lit, mut dark) = (0, 0);
    for p in images.pixels() {
        let Some((_, normal)) = surface(&images, &view, p) else { continue };
        let cos_theta = -view.world_vector(normal).dot(direction.as_dvec3());
        let expected = albedo.as_dvec3() * 3.0 * cos_theta.max(0.0) / PI;
        if cos_theta.abs() < 0.1 {
            // The terminator may lie a particle's radius off.
            continue;
        }
        let off = (images.radiance(p) - expected).abs().max_element();
        assert!(off <= 0.01, "{p}: {} instead of {expected}", images.radiance(p));
        if cos_theta > 0.0 { lit += 1 } else { dark += 1 }
    }
    assert!(lit > 500 && dark > 100, "{lit} lit and {dark} dark pixels");
}

/// A body shades another one, and lit solids; a solid shades a body.
#[test]
fn bodies_and_solids_shade_each_other() {
    const RADIUS: f32 = 0.3;
    let Some(mut harness) = harness() else { return };
    let mut scene = opaque(Vec3::splat(0.5));
    scene.lights = vec![sun(Vec3::NEG_X, 2.0)];
    let camera = on_axis(5.0, 40.0);
    let view = View::new(&camera, SIZE);
    let mut both =
        vec![sphere(Vec3::new(-1.0, 0.0, 0.0), 0.5), sphere(Vec3::new(1.0, 0.0, 0.0), 0.5)];
    // A string between them, or one would be a lone droplet, which lights' views leave out.
    both.extend((1..10).map(|i| sphere(Vec3::new(0.2 * i as f32 - 1.0, -0.4, -0.3), 0.05)));
    let radiance = |images: &FrameImages, at: Vec3| {
        let u = view.pixel(view.point(at.as_dvec3()));
        images.radiance(u.as_uvec2()).x
    };
    // Towards the sun and the eye.
    let [left, right] = [-1.0, 1.0].map(|x| Vec3::new(x + 0.43, 0.0, 0.25));
    let alone = harness.render(&scene, &camera, &splats(&both[..1], &[], RADIUS), SIZE);
    let lit = radiance(&alone, left);
    assert!(lit > 0.1, "{lit} in the sun");
    let shaded = harness.render(&scene, &camera, &splats(&both, &[], RADIUS), SIZE);
    assert!(radiance(&shaded, left) < 1e-3, "the right one shades the left");
    assert!((radiance(&shaded, right) - lit).abs() < 0.02, "nothing shades the right one");

    let wall = |x: f64| Solid {
        shape: Shape::Box { min: DVec3::new(x, -0.6, -0.6), max: DVec3::new(x + 0.1, 0.6, 0.6) },
        surface: Surface::Color(Vec3::splat(0.5)),
        lit: true,
    };
    scene.solids = vec![wall(2.0)];
    let behind = harness.render(&scene, &camera, &splats(&both[1..2], &[], RADIUS), SIZE);
    assert!(radiance(&behind, right) < 1e-3, "the wall shades the body");
    scene.solids = vec![wall(-2.0)];
    let on_wall = Vec3::new(-1.9, 0.0, 0.05);
    scene.lights = vec![sun(Vec3::new(-1.0, 0.0, -0.05), 2.0)];
    let camera = Camera { eye: DVec3::new(1.0, 1.5, 4.0), ..camera };
    let view = View::new(&camera, SIZE);
    let radiance = |images: &FrameImages| {
        let u = view.pixel(view.point(on_wall.as_dvec3()));
        images.radiance(u.as_uvec2()).x
    };
    let below = splats(&[sphere(Vec3::new(1.0, -2.0, 0.0), 0.5)], &[], RADIUS);
    let lit = radiance(&harness.render(&scene, &camera, &below, SIZE));
    assert!((lit - 0.5 * 2.0 / PI).abs() < 0.02, "{lit} on the wall in the sun");
    let shaded =
        radiance(&harness.render(&scene, &camera, &splats(&both[1..2], &[], RADIUS), SIZE));
    assert!(shaded < 1e-3, "{shaded} on the wall behind the body");
}

/// The coat mirrors the sun as Walter et al. (2007) say, and dims what is below it.
#[test]
fn coats_mirror_the_sun() {
    let Some(mut harness) = harness() else { return };
    let (eta, alpha, irradiance) = (1.5, 0.3f64, 2.0);
    let mut scene = opaque(Vec3::ZERO);
    (scene.liquid.ior, scene.liquid.roughness) = (eta as f32, alpha as f32);
    let direction = Vec3::new(-0.3, -0.6, -1.0).normalize();
    scene.lights = vec![sun(direction, irradiance)];
    let camera = on_axis(4.0, 35.0);
    let view = View::new(&camera, SIZE);
    let body = splats(&[sphere(Vec3::ZERO, 1.0)], &[], 0.05);
    let images = harness.render(&scene, &camera, &body, SIZE);
    let mut bright = 0;
    for p in images.pixels() {
        let Some((x, normal)) = surface(&images, &view, p) else { continue };
        let (n, o) = (view.world_vector(normal), -view.world_vector(x).normalize());
        let i = -direction.as_dvec3();
        let (cos_i, cos_o) = (n.dot(i), n.dot(o));
        if cos_i < 0.1 || cos_o < 0.1 {
            continue;
        }
        let h = (i + o).normalize();
        let facets = |c: f64| alpha * alpha / (PI * (c * c * (alpha * alpha - 1.0) + 1.0).powi(2));
        let shadowing = |c: f64| 2.0 / (1.0 + (1.0 + alpha * alpha * (1.0 / (c * c) - 1.0)).sqrt());
        let (cos_h, cos_d) = (n.dot(h), i.dot(h));
        let cos_t = (1.0 - (1.0 - cos_d * cos_d) / (eta * eta)).sqrt();
        let parallel = (eta * cos_d - cos_t) / (eta * cos_d + cos_t);
        let across = (cos_d - eta * cos_t) / (cos_d + eta * cos_t);
        let fresnel = 0.5 * (parallel * parallel + across * across);
        let lobe = facets(cos_h) * shadowing(cos_i) * shadowing(cos_o) / (4.0 * cos_i * cos_o);
        let expected = fresnel * lobe * f64::from(irradiance) * cos_i;
        let found = images.radiance(p).x;
        assert!((found - expected).abs() <= 0.01 + 0.02 * expected, "{p}: {found}, not {expected}");
        bright += u32::from(expected > 0.02);
    }
    assert!(bright > 100, "{bright} pixels in the highlight");
}

/// A cloud of particles whose surface is not level, with their splats.
fn cloud(radius: f32) -> (Particles, Splats) {
    let mut seed = 3;
    let mut positions = Vec::new();
    for i in 0..20 * 12 * 20 {
        let cell = Vec3::new((i % 20) as f32, (i / 400) as f32, (i / 20 % 20) as f32);
        let x = 2.0 * radius * (cell - Vec3::new(10.0, 6.0, 10.0))
            + 0.3 * radius * noise_vector(&mut seed);
        if x.y < 0.12 + 0.1 * (6.0 * x.x).sin() {
            positions.push(x);
        }
    }
    let particles =
        Particles { origin: DVec3::new(40.0, 7.0, -9.0), ..Particles::from_positions(positions) };
    let mut settings = opaque(Vec3::ONE).settings.classify;
    settings.wetting = 0.0;
    let splats = classify(&particles, radius, &settings);
    (particles, splats)
}

fn map(range: [f32; 2]) -> ColorMap {
    ColorMap { colors: vec![Vec3::new(0.0, 0.1, 0.9), Vec3::new(0.9, 0.5, 0.3)], range }
}

/// Mean of the values around a place, as a cubic spline of four radii weighs them.
fn kernel_mean(particles: &Particles, values: &[f32], radius: f64, x: DVec3) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for (position, &value) in particles.positions.iter().zip(values) {
        let q = (particles.origin + position.as_dvec3()).distance(x) / (2.0 * radius);
        let weight = match q {
            ..1.0 => 1.0 - 1.5 * q * q + 0.75 * q.powi(3),
            1.0..2.0 => 0.25 * (2.0 - q).powi(3),
            _ => 0.0,
        };
        if value.is_finite() {
            sum += weight * f64::from(value);
            total += weight;
        }
    }
    sum / total
}

/// Surfaces have the kernel's mean of their particles' values: 99 of 100 places within a 255th of the range.
#[test]
fn colors_are_the_kernels_mean() {
    let Some(mut harness) = harness() else { return };
    let radius = 0.03;
    let (particles, splats) = cloud(radius);
    let mut seed = 11;
    let value = |x: &Vec3| 20.0 + 30.0 * x.x + 8.0 * (9.0 * x.z).sin() + noise_vector(&mut seed).x;
    let mut values: Vec<f32> = particles.positions.iter().map(value).collect();
    values[17] = f32::NAN;
    // The map's range leaves some out on either side.
    let range = [10.0, 30.0];
    let colors = Colors::by_value(&particles, radius, &splats, &values, map(range)).unwrap();
    // By whatever map they were before.
    for other in [[11.5, 11.75], [-1e6, 1e6]] {
        let before = Colors::by_value(&particles, radius, &splats, &values, map(other)).unwrap();
        assert!(before != colors && before.over(map(range)).unwrap() == colors, "{other:?}");
    }
    let splats = Splats { colors: Some(colors), ..splats };
    let mut scene = opaque(Vec3::ONE);
    // From the eye, so that no light bounces into shadows.
    scene.lights = vec![sun(Vec3::new(-0.8, -1.2, -1.6), 3.0)];
    let target = particles.origin;
    let camera = Camera { eye: target + DVec3::new(0.8, 1.2, 1.6), target, ..on_axis(1.0, 40.0) };
    let size = UVec2::new(320, 240);
    let view = View::new(&camera, size);
    let input = diagnosed(&scene, &camera, &splats, size);
    let harness = &mut *harness;
    let images = render(&harness.gpu, &mut harness.renderer, input);
    let (mut places, mut off) = (0, 0);
    for p in images.pixels() {
        let depth = images.at("smooth_depth.aggregate_front", p);
        if depth == 0.0 {
            continue;
        }
        let x = view.world_point(depth * view.through(p));
        let expected = kernel_mean(&particles, &values, radius.into(), x);
        places += 1;
        off += usize::from((images.at("value", p) - expected).abs() > 20.0 / 255.0);
        // Its colour is the map's.
        let color = map(range).color(images.at("value", p) as f32).as_dvec3();
        let light = images.radiance(p).z / color.z.max(1e-3);
        let tint = images.radiance(p) - light * color;
        assert!(tint.abs().max_element() < 0.01, "{p}: {} is not {color}", images.radiance(p));
    }
    assert!(places > 10_000, "{places} places");
    assert!(off * 100 <= places, "{off} of {places} places are off");
}

/// Particles of one colour give it to their surface, wherever they are; colours need one for each particle.
#[test]
fn given_colors_are_shown() {
    let Some(mut harness) = harness() else { return };
    let radius = 0.03;
    let (particles, splats) = cloud(radius);
    let color = Vec3::new(0.9, 0.3, 0.05);
    let colors = vec![color; particles.len()];
    let few = Colors::given(&particles, radius, &splats, &colors[1..]);
    let error = few.expect_err("a colour is missing").to_string();
    assert!(error.contains(&format!("{} for {}", colors.len() - 1, colors.len())), "{error}");
    let colors = Colors::given(&particles, radius, &splats, &colors).unwrap();
    let lone = |color| Scene { environment: Environment::Constant(Vec3::ONE), ..opaque(color) };
    let camera = Camera {
        eye: particles.origin + DVec3::new(0.8, 1.2, 1.6),
        target: particles.origin,
        ..on_axis(1.0, 40.0)
    };
    let harness = &mut *harness;
    let scene = lone(Vec3::ZERO);
    let colored = Splats { colors: Some(colors), ..splats.clone() };
    let input = diagnosed(&scene, &camera, &colored, SIZE);
    let given = render(&harness.gpu, &mut harness.renderer, input);
    let one = harness.render(&lone(color), &camera, &splats, SIZE);
    for p in given.pixels() {
        let off = (given.radiance(p) - one.radiance(p)).abs().max_element();
        assert!(off <= 0.005, "{p}: {} instead of {}", given.radiance(p), one.radiance(p));
    }
}

/// A ball of clear liquid around an opaque ball of one colour.
fn ball_in_ball(radius: f32, color: Vec3) -> Splats {
    let inner = splats(&[sphere(INNER, 0.4)], &[], radius);
    let particles = Particles::from_positions(vec![INNER]);
    let colors = Colors::given(&particles, 0.4, &inner, &[color]).expect("one colour");
    let opaque = Some(Box::new(Splats { colors: Some(colors), ..inner }));
    Splats { opaque, ..splats(&[sphere(Vec3::ZERO, 1.0)], &[], radius) }
}

const INNER: Vec3 = Vec3::new(0.4, -0.2, 0.2);

/// A white fluid in a clear one, with light of one radiance from everywhere, cannot be seen.
#[test]
fn white_fluids_vanish_in_a_furnace() {
    let Some(mut harness) = harness() else { return };
    let liquid = ball_in_ball(0.05, Vec3::ONE);
    for camera in [on_axis(4.0, 35.0), on_axis(2.0, 60.0)] {
        let images = harness.render(&scene(), &camera, &liquid, SIZE);
        images.assert_finite();
        for p in images.pixels() {
            let radiance = images.radiance(p);
            let off = (radiance - 1.0).abs().max_element();
            assert!(off <= 0.02, "{p}: {radiance}");
        }
    }
}

/// A black fluid in a clear one is seen, refracted, where rays of geometrical optics meet it.
#[test]
fn opaque_fluids_are_refracted() {
    const RADIUS: f32 = 0.02;
    let Some(mut harness) = harness() else { return };
    let (camera, liquid) = (on_axis(4.0, 35.0), ball_in_ball(RADIUS, Vec3::ZERO));
    let view = View::new(&camera, SIZE);
    let images = harness.render(&scene(), &camera, &liquid, SIZE);
    // A film of the clear fluid always covers the opaque one.
    let inner = 0.4 - 0.5 * f64::from(RADIUS);
    let meets = |p: UVec2| {
        let (o, d) = (camera.eye, view.world_vector(view.through(p)).normalize());
        let x = o + entry(o, d, 1.0)? * d;
        let cos_i = -d.dot(x);
        let sin2_t = (1.0 - cos_i * cos_i) / (1.33 * 1.33);
        let inside = d / 1.33 + (cos_i / 1.33 - (1.0 - sin2_t).sqrt()) * x;
        entry(x - INNER.as_dvec3(), inside.normalize(), inner)
    };
    let (mut dark, mut off) = (0, 0);
    for p in images.pixels() {
        let expected = meets(p).is_some();
        // Near its outline much of the light is reflected.
        let seen = images.radiance(p).x < 0.5;
        dark += u32::from(expected);
        off += u32::from(expected != seen);
    }
    assert!(dark > 400, "{dark} rays meet it");
    assert!(off * 12 <= dark, "{off} pixels are wrong, {dark} rays meet it");
}

/// Distance to a sphere around the origin.
fn entry(o: DVec3, d: DVec3, radius: f64) -> Option<f64> {
    let along = -o.dot(d);
    let square = radius * radius - (o + along * d).length_squared();
    (square > 0.0).then(|| along - square.sqrt())
}
