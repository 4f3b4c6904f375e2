//! Images of the first interface: depth, normal, motion, coverage and masks.

use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3, UVec2, Vec3};
use limpid::camera::{Camera, Lens, View};
use limpid::diffuse::{Diffuse, DiffuseKind};
use limpid::frame::FrameInput;
use limpid::liquid::classify::{Splat, Splats};
use limpid::motion::Motion;
use limpid::scene::{Medium, Scene, Shape};

use crate::support::frames::{
    self, Harness, diagnosed, glowing, harness, noise_vector, on_axis, render, scene, sphere,
    splats,
};

const SIZE: UVec2 = UVec2::new(120, 90);

fn draw(
    harness: &mut Harness,
    motion: &Motion,
    scene: &Scene,
    camera: &Camera,
    splats: &Splats,
) -> frames::FrameImages {
    let input = FrameInput { surface: Some(motion), ..diagnosed(scene, camera, splats, SIZE) };
    let images = render(&harness.gpu, &mut harness.renderer, input);
    images.assert_finite();
    images
}

/// Pixel position of a point, in 64 bits.
fn pixel(camera: &Camera, x: DVec3) -> DVec2 {
    let view = frames::View::new(camera, SIZE);
    let at = view.point(x);
    match camera.lens {
        Some(Lens::Orthographic { height }) => {
            let size = SIZE.as_dvec2();
            DVec2::new(at.x, -at.y) * size.y / height + 0.5 * size
        }
        _ => view.pixel(at),
    }
}

/// A ball has the depth and normals of a sphere, and solids hide it; AOVs agree with the layers.
#[test]
fn a_ball_has_its_depth_and_normal() {
    let Some(mut harness) = harness() else { return };
    let (centre, radius) = (DVec3::new(0.2, 0.1, -0.3), 0.7);
    let splats = splats(&[sphere(centre.as_vec3(), radius as f32)], &[], radius as f32);
    let camera = on_axis(3.0, 40.0);
    let mut scene = scene();
    let wall = Shape::Box { min: DVec3::new(-2.0, -2.0, 1.0), max: DVec3::new(0.0, 2.0, 1.2) };
    scene.solids.push(glowing(wall, Vec3::ONE));
    let images = draw(&mut harness, &Motion::default(), &scene, &camera, &splats);
    let view = frames::View::new(&camera, SIZE);
    let (mut seen, mut hidden) = (0, 0);
    for p in images.pixels() {
        let (z, layer) = (images.at("depth.Z", p), images.at("depth.aggregate_front", p));
        let solid = images.at("solid_depth", p);
        let shown = layer > 0.0 && (solid == 0.0 || layer < solid);
        hidden += i32::from(layer > 0.0 && !shown);
        assert_eq!(z > 0.0, shown, "{p}");
        assert_eq!(images.at("coverage.A", p), f64::from(u8::from(shown)), "{p}");
        assert_eq!(images.at("mask.fluid1", p), images.at("coverage.A", p));
        if !shown {
            continue;
        }
        seen += 1;
        let x = view.world_point(z * view.through(p));
        let normal = view.world_vector(images.normal("normal", p));
        assert!((x.distance(centre) - radius).abs() < 1e-4, "{p}: {x}");
        let facing = normal.dot((view.world_point(DVec3::ZERO) - x).normalize());
        assert!(normal.distance((x - centre) / radius) < 1e-3 || facing < 0.05, "{p}: {normal}");
    }
    assert!(seen > 500 && hidden > 300, "{seen} pixels are seen, {hidden} hidden");
}

/// A cloud of balls, numbered in order.
fn cloud(count: u32, radius: f64) -> (Vec<DVec3>, Vec<Splat>) {
    let mut seed = 7;
    let places: Vec<_> = (0..count).map(|_| 0.7 * noise_vector(&mut seed).as_dvec3()).collect();
    let ball =
        |(x, particle): (&DVec3, u32)| Splat { particle, ..sphere(x.as_vec3(), radius as f32) };
    let balls = places.iter().zip(0..).map(ball).collect();
    (places, balls)
}

/// Motion vectors are the difference between where a surface point is and where it was: of a cloud that moves,
/// seen by a camera that moves, in perspective and with parallel rays.
#[test]
fn motion_is_that_of_the_projected_points() {
    let Some(mut harness) = harness() else { return };
    let (places, balls) = cloud(300, 0.12);
    let splats = splats(&balls, &[], 0.12);
    let velocity = DVec3::new(1.1, -0.4, 2.0);
    let seconds = 0.03;
    for lens in [None, Some(Lens::Orthographic { height: 2.5 })] {
        let camera = Camera { eye: DVec3::new(0.3, 0.2, 3.0), lens, ..on_axis(3.0, 45.0) };
        let before = Camera { eye: DVec3::new(0.1, 0.3, 3.2), ..camera };
        let motion = Motion {
            velocities: vec![velocity.as_vec3(); places.len()],
            seconds: seconds as f32,
            previous: Some(View::from(&before)),
        };
        let images = draw(&mut harness, &motion, &scene(), &camera, &splats);
        let view = frames::View::new(&camera, SIZE);
        let mut count = 0;
        for p in images.pixels().filter(|p| images.at("depth.Z", *p) > 0.0) {
            count += 1;
            let z = images.at("depth.Z", p);
            let x = match lens {
                None => view.world_point(z * view.through(p)),
                Some(_) => {
                    let beside = p.as_dvec2() + 0.5 - 0.5 * SIZE.as_dvec2();
                    let side = 2.5 / f64::from(SIZE.y);
                    view.world_point(DVec3::new(side * beside.x, -side * beside.y, -z))
                }
            };
            let expected = pixel(&camera, x) - pixel(&before, x - seconds * velocity);
            let found = DVec2::new(images.at("motion.X", p), images.at("motion.Y", p));
            assert!(found.distance(expected) < 2e-3, "{p}: {found}, expected {expected}");
        }
        assert!(count > 1000, "{count} pixels");
        // A checker that can fail: without the camera's motion, vectors differ.
        let still = Motion { previous: None, ..motion };
        let still = draw(&mut harness, &still, &scene(), &camera, &splats);
        let differs =
            |p: &UVec2| (still.at("motion.X", *p) - images.at("motion.X", *p)).abs() > 0.5;
        assert!(images.pixels().filter(differs).count() > count / 2);
    }
}

/// Pixels under foam and spray have their motion: that of one ball, and of a sheet of balls smaller than a pixel. The liquid
/// beside them and before balls in it keeps its own.
#[test]
fn foam_and_spray_have_their_motion() {
    let Some(mut harness) = harness() else { return };
    let harness = &mut *harness;
    let splats = splats(&[sphere(Vec3::ZERO, 0.7)], &[], 0.7);
    let before = Camera { eye: DVec3::new(0.1, 0.05, 3.1), ..on_axis(3.0, 45.0) };
    let camera = on_axis(3.0, 45.0);
    let (liquid, air, seconds) = (DVec3::new(-0.6, 0.2, 0.0), DVec3::new(0.9, -0.5, 1.5), 0.03);
    let motion = Motion {
        velocities: vec![liquid.as_vec3()],
        seconds: seconds as f32,
        previous: Some(View::from(&before)),
    };
    // In the air, before the liquid and beside it; then in the liquid.
    let ball = DVec3::new(0.1, 0.1, 1.0);
    let sheet = |k: u32| {
        DVec3::new(-0.9 + 0.005 * f64::from(k % 60), -0.2 + 0.005 * f64::from(k / 60), 1.0)
    };
    let small: Vec<DVec3> = (0..3600).map(sheet).collect();
    let places: Vec<DVec3> = [&[ball, DVec3::new(0.1, -0.2, 0.2)], &small[..]].concat();
    let radius = |i: usize| if i < 2 { 0.12 } else { 0.005 };
    let kind = |i: usize| if i == 1 { DiffuseKind::Bubble } else { DiffuseKind::Foam };
    let diffuse = Diffuse {
        velocities: Some(vec![air.as_vec3(); places.len()]),
        radii: (0..places.len()).map(radius).collect(),
        kinds: (0..places.len()).map(kind).collect(),
        ..Diffuse::from_positions(places.iter().map(|x| x.as_vec3()).collect(), 0.1)
    };
    let mut draw = |diffuse: Option<Diffuse>| {
        let (diffuse, scene) = (diffuse.map(Arc::new), scene());
        let input = FrameInput {
            surface: Some(&motion),
            diffuse: diffuse.as_ref(),
            ..diagnosed(&scene, &camera, &splats, SIZE)
        };
        render(&harness.gpu, &mut harness.renderer, input)
    };
    let at = |images: &frames::FrameImages, x: DVec3| {
        let p = pixel(&camera, x).floor().as_uvec2();
        DVec2::new(images.at("motion.X", p), images.at("motion.Y", p))
    };
    let expected =
        |x: DVec3, velocity: DVec3| pixel(&camera, x) - pixel(&before, x - seconds * velocity);
    let (with, without) = (draw(Some(diffuse.clone())), draw(None));
    for x in [ball, ball + DVec3::new(0.05, 0.04, 0.0)] {
        let found = at(&with, x);
        assert!(found.distance(expected(ball, air)) < 1e-3, "{found} of the ball");
    }
    for k in [1830, 1850, 1210] {
        let found = at(&with, small[k]);
        let expected = expected(small[k], air);
        // Neighbours move by other amounts, as far from the camera's axis.
        assert!(found.distance(expected) < 0.05, "{found} of the sheet, expected {expected}");
    }
    // In the liquid and beside the foam, all is as without it.
    for x in [DVec3::new(0.1, -0.2, 0.7), DVec3::new(0.3, 0.4, 0.3)] {
        assert_eq!(at(&with, x), at(&without, x), "{x}");
        assert!(at(&with, x).distance(expected(x, air)) > 0.5, "{x}");
    }
    // Foam of unknown velocity is at rest.
    let still = draw(Some(Diffuse { velocities: None, ..diffuse }));
    assert!(at(&still, ball).distance(expected(ball, DVec3::ZERO)) < 1e-3);
}

/// The vectors of a turning cloud match the finite difference of its points, up to what a turn moves the
/// surface past the centres of its particles, which lie a radius below it.
#[test]
fn motion_of_a_turning_cloud_is_that_of_its_particles() {
    let Some(mut harness) = harness() else { return };
    let (angular, seconds, radius) = (DVec3::new(0.0, 2.0, 0.5), 0.02, 0.06);
    let turn = DQuat::from_scaled_axis(angular * seconds);
    let (places, balls) = cloud(20_000, radius);
    let splats = splats(&balls, &[], radius as f32);
    let camera = on_axis(3.0, 45.0);
    let velocities = places.iter().map(|x| angular.cross(*x).as_vec3()).collect();
    let motion = Motion { velocities, seconds: seconds as f32, previous: None };
    let images = draw(&mut harness, &motion, &scene(), &camera, &splats);
    let view = frames::View::new(&camera, SIZE);
    let (mut total, mut lengths, mut count) = (0.0, 0.0, 0);
    for p in images.pixels().filter(|p| images.at("depth.Z", *p) > 0.0) {
        let z = images.at("depth.Z", p);
        let x = view.world_point(z * view.through(p));
        let expected = pixel(&camera, x) - pixel(&camera, turn.inverse() * x);
        let found = DVec2::new(images.at("motion.X", p), images.at("motion.Y", p));
        let error = found.distance(expected);
        // Neighbours that are averaged add a part of the distance to them.
        let most = 2.0 * angular.length() * radius * seconds / (z * view.footprint());
        assert!(error < most, "{p}: {found}, expected {expected}, {error} of {most}");
        total += error;
        lengths += expected.length();
        count += 1;
    }
    let share = total / lengths;
    println!("mean error {share:.4} of the mean length, {:.3} pixels", lengths / f64::from(count));
    assert!(count > 1000 && share < 0.1, "{share} of {count} pixels");
}

/// With several rays per pixel the coverage is the share of rays that meet liquid: that of the picture over
/// nothing, and that which a picture over black and one over white recover.
#[test]
fn coverage_is_the_share_of_rays() {
    let Some(mut harness) = harness() else { return };
    let (_, balls) = cloud(40, 0.12);
    let splats = splats(&balls[..20], &balls[20..], 0.12);
    let camera = on_axis(3.0, 45.0);
    let mut scene = scene();
    scene.settings.refract.samples = 16;
    scene.settings.refract.transparent = true;
    let images = draw(&mut harness, &Motion::default(), &scene, &camera, &splats);
    for p in images.pixels() {
        let coverage = images.at("coverage.A", p);
        let alpha = f64::from(images.picture.get_pixel(p.x, p.y).0[3]) / 255.0;
        assert!((coverage - alpha).abs() <= 0.5 / 255.0 + 1e-6, "{p}: {coverage}, {alpha}");
    }
    // A solid hides a part of the rays of the pixels at its edge.
    let wall = Shape::Box { min: DVec3::new(-2.0, -2.0, 1.0), max: DVec3::new(0.013, 2.0, 1.2) };
    scene.solids.push(glowing(wall, Vec3::ONE));
    let images = draw(&mut harness, &Motion::default(), &scene, &camera, &splats);
    let partial = |p: &UVec2| (1..16).any(|k| images.at("coverage.A", *p) == f64::from(k) / 16.0);
    let edge: Vec<_> = images.pixels().filter(partial).collect();
    assert!(edge.len() > 10 && edge.iter().all(|p| p.x == edge[0].x), "{edge:?}");
}

/// Each fluid's mask is the coverage where its particles are in front.
#[test]
fn masks_tell_fluids_apart() {
    let Some(mut harness) = harness() else { return };
    let left = sphere(Vec3::new(-0.5, 0.0, 0.0), 0.3);
    let right = Splat { tags: 1, ..sphere(Vec3::new(0.5, 0.0, 0.0), 0.3) };
    let splats = splats(&[left], &[right], 0.3);
    let scene = Scene { fluids: [Vec3::ONE, Vec3::X].map(Medium::clear).to_vec(), ..scene() };
    let camera = on_axis(3.0, 45.0);
    let images = draw(&mut harness, &Motion::default(), &scene, &camera, &splats);
    let mut counts = [0, 0];
    for p in images.pixels() {
        let masks = ["mask.fluid1", "mask.fluid2"].map(|name| images.at(name, p));
        assert_eq!(masks[0] + masks[1], images.at("coverage.A", p), "{p}");
        let side = usize::from(p.x >= SIZE.x / 2);
        assert_eq!(masks[1 - side], 0.0, "{p}");
        counts[side] += usize::from(masks[side] > 0.0);
    }
    assert!(counts.iter().all(|&count| count > 200), "{counts:?}");
}

/// Velocities that do not belong to the frame are refused; others are drawn.
#[test]
fn motion_belongs_to_its_frame() {
    let Some(mut harness) = harness() else { return };
    let harness = &mut *harness;
    let (_, balls) = cloud(20, 0.2);
    let splats = splats(&balls[..18], &balls[18..], 0.2);
    let (scene, camera) = (scene(), on_axis(3.0, 45.0));
    let motion = |count| Motion { velocities: vec![Vec3::X; count], ..Motion::default() };
    let input = diagnosed(&scene, &camera, &splats, SIZE);
    let wrong = motion(19);
    let error =
        harness.renderer.prepare(FrameInput { surface: Some(&wrong), ..input }).unwrap_err();
    assert!(error.to_string().contains("19 velocities are given for 20 particles"), "{error}");

    let right = motion(20);
    let frame = harness.renderer.prepare(FrameInput { surface: Some(&right), ..input }).unwrap();
    let mut encoder = harness.gpu.device.create_command_encoder(&Default::default());
    harness.renderer.record(frame, &mut encoder);
    harness.gpu.queue.submit([encoder.finish()]);
    harness.gpu.check().expect("the recorded frame is that of `prepare`");
    assert!(harness.renderer.images().surface.is_some());
}

/// Surfaces behind the eye of the frame before have no motion, rather than an infinite one.
#[test]
fn motion_from_behind_the_eye_is_none() {
    let Some(mut harness) = harness() else { return };
    let splats = splats(&[sphere(Vec3::ZERO, 0.7)], &[], 0.7);
    let camera = on_axis(3.0, 45.0);
    // Turned away, and in the plane through the ball.
    for eye in [DVec3::Z * -3.0, DVec3::X * 5.0] {
        let before = Camera { eye, target: eye - DVec3::Z, ..camera };
        let previous = Some(View::from(&before));
        let motion = Motion { previous, ..Motion::default() };
        let images = draw(&mut harness, &motion, &scene(), &camera, &splats);
        let most = images.channel("motion.X").iter().fold(0.0f32, |most, x| most.max(x.abs()));
        if eye.z < -1.0 {
            assert_eq!(most, 0.0, "{eye}");
        }
    }
}
