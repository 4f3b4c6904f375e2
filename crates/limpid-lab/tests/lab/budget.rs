//! Budgets of passes: the counts of the model, and that every pass has a model.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use glam::{DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::light_view::LightView;
use limpid::liquid::classify::{Splat, Splats};
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::scene::{Light, Medium, Scene, Shape, Solid, Surface};
use limpid::settings::{Method, Solids, Solver};
use limpid::wgpu;
use limpid_lab::report::passes::{Counts, eye_counts, light_counts, measure_frame, work};
use limpid_lab::report::rates::{self, Rates};

use crate::support::frames::{
    ellipsoid, gpu, noise, noise_turn, noise_vector, on_axis, render, scene, sphere, splats,
};
use crate::support::noop::noop;

const SIZE: UVec2 = UVec2::new(160, 120);

const RATES: Rates = Rates { bytes_per_s: 1e9, operations_per_s: 1e10 };

#[track_caller]
fn assert_close(got: f64, expected: f64, tolerance: f64) {
    assert!((got / expected - 1.0).abs() <= tolerance, "{got}, not {expected}");
}

fn floor() -> Solid {
    let shape = Shape::Plane { origin: DVec3::NEG_Y, normal: Vec3::Y, half_extent: 9.0 };
    Solid { shape, surface: Surface::Color(Vec3::ONE), lit: true }
}

fn sun() -> Light {
    Light::Sun { direction: Vec3::new(0.2, -1.0, 0.1), irradiance: Vec3::ONE }
}

/// The model against a case counted by hand: one ball in the middle of the view, as a splash and as
/// an aggregate.
#[test]
fn counts_of_one_ball() {
    let (distance, radius) = (4.0f64, 0.5f64);
    let camera = on_axis(distance as f32, 40.0);
    let ball = sphere(Vec3::ZERO, radius as f32);
    let counts = eye_counts(&scene(), &camera, &splats(&[ball], &[], 0.1), SIZE);
    // The slope of the tangent cone.
    let slope = radius / (distance * distance - radius * radius).sqrt();
    let pixels_per_slope = f64::from(SIZE.y) / 2.0 / 20f64.to_radians().tan();
    let area = PI * (slope * pixels_per_slope).powi(2);
    assert_close(counts.aggregate_fragments, area, 0.02);
    let n = counts.aggregate_fragments;
    assert_eq!([counts.aggregate_pixels, counts.liquid_pixels, counts.rays], [n; 3]);
    assert_eq!(
        [counts.aggregates, counts.splashes, counts.classes, counts.sides],
        [1., 0., 1., 2.]
    );
    assert_eq!(counts.background_rays, f64::from(SIZE.element_product()) - n);
    assert_eq!(counts.tiles, 20.0 * 15.0);
    assert!(counts.liquid_tiles >= n / 64.0 && counts.liquid_tiles <= 4.0 * n / 64.0);
    // Read the splat, write where it is placed, and both sides of each pixel.
    let pixels = f64::from(SIZE.element_product());
    let (bytes, operations) = work("splat", &counts).expect("a model");
    assert_eq!(bytes, 112.0 + 2.0 * 16.0 * pixels);
    assert_eq!(operations, 300.0 + 60.0 * n + 2.0 * 60.0 * n);
    assert_eq!(work("light splat", &counts), Some((bytes, operations)));

    // The same ball twice: twice the fragments on the same pixels. And as splashes.
    let twice = eye_counts(&scene(), &camera, &splats(&[ball, ball], &[], 0.1), SIZE);
    assert_eq!([twice.aggregate_fragments, twice.aggregate_pixels], [2.0 * n, n]);
    let spray = eye_counts(&scene(), &camera, &splats(&[], &[ball, ball], 0.1), SIZE);
    assert_eq!([spray.splash_fragments, spray.splash_pixels, spray.liquid_pixels], [2.0 * n, n, n]);
    assert_eq!([spray.aggregate_pixels, spray.classes], [0.0, 2.0]);

    // Outside the picture, and behind the eye.
    for place in [Vec3::X * 9.0, Vec3::Z * 9.0] {
        let one = splats(&[sphere(place, radius as f32)], &[], 0.1);
        assert_eq!(eye_counts(&scene(), &camera, &one, SIZE).liquid_pixels, 0.0);
    }
}

/// The model's coverage of ellipsoids in any position matches the pixels that the device renders.
#[test]
fn coverage_matches_rendered_pixels() {
    let Some(gpu) = gpu() else { return };
    let mut renderer = Renderer::new(&gpu);
    let mut seed = 5;
    let mut ellipsoids = |count: usize| -> Vec<Splat> {
        let any = |_| {
            let axes = 0.05 + 0.25 * (0.5 + 0.5 * noise_vector(&mut seed));
            let place = 1.2 * noise_vector(&mut seed) + Vec3::Z * noise(&mut seed);
            ellipsoid(place, axes, noise_turn(&mut seed))
        };
        (0..count).map(any).collect()
    };
    let many = splats(&ellipsoids(40), &ellipsoids(5), 0.1);
    let camera = on_axis(4.0, 40.0);
    let counts = eye_counts(&scene(), &camera, &many, SIZE);
    let images = render(&gpu, &mut renderer, FrameInput::new(&scene(), &camera, &many, SIZE));
    let drawn = |class: &str| {
        let depths = images.channel(&format!("depth.{class}_front"));
        depths.iter().filter(|&&depth| depth > 0.0).count() as f64
    };
    assert!(counts.aggregate_fragments > 1.1 * counts.aggregate_pixels);
    assert_close(counts.aggregate_pixels, drawn("aggregate"), 1e-3);
    assert_close(counts.splash_pixels, drawn("splash"), 1e-3);

    // Ellipsoids next to the camera, clipped by the near plane.
    let beside = [(); 8].map(|()| {
        let axes = 0.05 + 0.1 * (0.5 + 0.5 * noise_vector(&mut seed));
        let place = noise_vector(&mut seed) * Vec3::new(0.5, 0.4, 0.1) + 3.5 * Vec3::Z;
        ellipsoid(place, axes, noise_turn(&mut seed))
    });
    let near = splats(&beside, &[], 0.1);
    let camera = Camera { near: Some(0.5), ..on_axis(4.0, 70.0) };
    let counts = eye_counts(&scene(), &camera, &near, SIZE);
    let images = render(&gpu, &mut renderer, FrameInput::new(&scene(), &camera, &near, SIZE));
    let depths = images.channel("depth.aggregate_front");
    let drawn = depths.iter().filter(|&&depth| depth > 0.0).count() as f64;
    let cut = depths.iter().filter(|&&depth| depth > 0.0 && depth <= 0.50001).count() as f64;
    assert!(cut > 0.1 * drawn && drawn < 0.8 * counts.pixels, "{cut} of {drawn}");
    assert_close(counts.aggregate_pixels, drawn, 1e-3);
}

/// The lights' counts: under a sun a ball covers a circle of its own size at any distance, and the
/// vertices are those of the grid.
#[test]
fn light_counts_of_one_ball() {
    let mut scene = Scene { solids: vec![floor()], lights: vec![sun()], ..scene() };
    scene.settings.caustics.resolution = 256;
    scene.settings.caustics.grid = 64;
    let radius = 0.3;
    let mut ball = splats(&[sphere(Vec3::ZERO, radius as f32)], &[], 0.1);
    ball.aggregates[0].radius = radius as f32;
    let counts = light_counts(&scene, &ball);
    assert_eq!(counts.len(), 1);
    let bounds = (DVec3::splat(-radius), DVec3::splat(radius));
    let view = LightView::new(&sun(), bounds, &scene.solids, 0.1, 256, None).expect("a view");
    let texel = 2.0 * view.half_extent.x / f64::from(view.size.x);
    assert_close(counts[0].aggregate_fragments, PI * (radius / texel).powi(2), 0.02);
    assert_eq!(counts[0].pixels, f64::from(view.size.element_product()));
    assert!(counts[0].vertices <= 65.0 * 65.0 && counts[0].vertices > 32.0 * 32.0);
    assert_eq!((counts[0].forward, counts[0].gather), (1.0, 0.0));
    // Nothing lit, nothing rendered.
    scene.solids[0].lit = false;
    assert!(light_counts(&scene, &ball).is_empty());
}

/// An empty frame has finite, non-negative costs, which are those of writing empty layers.
#[test]
fn costs_of_an_empty_frame() {
    let nothing = Splats { radius: 0.1, ..Default::default() };
    let counts = eye_counts(&scene(), &on_axis(4.0, 40.0), &nothing, SIZE);
    assert_eq!([counts.liquid_pixels, counts.liquid_tiles, counts.rays], [0.0; 3]);
    for pass in ["splat", "mixture", "tiles", "smooth", "gbuffer", "mips", "refract", "tonemap"] {
        let (bytes, operations) = work(pass, &counts).expect("a model");
        let floor = RATES.floor_ms(bytes, operations);
        assert!(floor.is_finite() && floor > 0.0 && operations >= 0.0, "{pass}");
    }
    assert_eq!(work("splat", &counts), Some((32.0 * f64::from(SIZE.element_product()), 0.0)));
    assert_eq!(work("smooth", &counts), Some((32.0 * f64::from(SIZE.element_product()), 0.0)));
    assert_eq!(work("splat", &Counts::default()), Some((0.0, 0.0)));
}

/// Every pass that any frame times has a model. Runs on the no-op device.
#[test]
fn every_pass_has_a_model() {
    let required_features = wgpu::Features::TIMESTAMP_QUERY;
    let (device, queue) = noop(&wgpu::DeviceDescriptor { required_features, ..Default::default() });
    let gpu = Gpu::from_device(device, queue);
    let mut renderer = Renderer::new(&gpu);
    let ball = |x: f32, fluid: u32| Splat { tags: fluid, ..sphere(Vec3::X * x, 0.2) };
    let splats = splats(&[ball(0.0, 0), ball(0.5, 1)], &[ball(-0.5, 0)], 0.1);
    let point = Light::Point { position: DVec3::Y * 5.0, intensity: Vec3::ONE };
    let mut names = BTreeSet::new();
    for method in Method::ALL {
        for solver in Solver::ALL {
            let mut scene = Scene { solids: vec![floor()], lights: vec![sun(), point], ..scene() };
            scene.fluids = [Vec3::X, Vec3::X * 2.0].map(Medium::clear).to_vec();
            scene.settings.smooth.iterations = 2;
            scene.settings.refract.solver = solver;
            scene.settings.refract.solids = Solids::Screen;
            scene.settings.caustics.method = method;
            scene.settings.caustics.resolution = 32;
            scene.settings.caustics.blur = 0.1;
            let target = Picture::new(&gpu, SIZE).expect("a picture");
            let camera = on_axis(4.0, 40.0);
            let input = FrameInput::new(&scene, &camera, &splats, SIZE);
            let input = FrameInput { timing: true, ..input };
            let times = renderer.render(input, &target).expect("drawn");
            names.extend(times.iter().map(|time| time.name));
            let eye = eye_counts(&scene, &camera, &splats, SIZE);
            assert_eq!(light_counts(&scene, &splats).len(), 2);
            for name in times.iter().map(|time| time.name) {
                let (bytes, _) = work(name, &eye).unwrap_or_else(|| panic!("{name}: no model"));
                assert!(bytes.is_finite() && bytes > 0.0, "{name}");
            }
        }
    }
    let seen: Vec<_> = names.iter().copied().collect();
    assert!(seen.len() >= 14 && seen.contains(&"mips") && seen.contains(&"mixture"), "{seen:?}");
    assert_eq!(work("a pass that is new", &Counts::default()), None);
}

/// The printed table has a row for each pass that ran, in order, with non-negative figures, and
/// correct sums.
#[test]
fn frames_have_rows_and_sums() {
    let Some(gpu) = gpu() else { return };
    let rates = rates::measure(&gpu).expect("measured");
    println!("{rates:?}");
    if let Some(rates) = rates {
        assert!(rates.bytes_per_s > 1e6 && rates.bytes_per_s < 1e15);
        assert!(rates.operations_per_s > 1e6 && rates.operations_per_s < 1e17);
    }
    let mut scene = Scene { solids: vec![floor()], lights: vec![sun()], ..scene() };
    scene.settings.smooth.iterations = 2;
    scene.settings.caustics.resolution = 64;
    scene.settings.caustics.grid = 64;
    let camera = on_axis(4.0, 40.0);
    let splats =
        splats(&[sphere(Vec3::ZERO, 0.5), sphere(Vec3::X, 0.4)], &[sphere(Vec3::Y, 0.2)], 0.1);
    let mut renderer = Renderer::new(&gpu);
    let drawn = (&scene, &camera, &splats);
    let rows = measure_frame(&gpu, &mut renderer, rates.as_ref(), "balls", drawn, SIZE, 3)
        .expect("measured");
    let names: Vec<&str> = rows.iter().map(|row| row.pass.as_str()).collect();
    if rates.is_some() {
        assert_eq!(
            names,
            [
                "light splat",
                "light splashes",
                "light gaps",
                "light tiles",
                "light smooth",
                "light smooth gaps",
                "light gbuffer",
                "caustics",
                "splat",
                "splat splashes",
                "gaps",
                "tiles",
                "smooth",
                "smooth gaps",
                "bounds",
                "refract",
                "tonemap",
                "all for the lights",
                "all for the camera"
            ]
        );
    }
    for row in &rows {
        let numbers = [row.floor_ms, row.ms, row.ratio()].map(|number| number.unwrap_or(0.0));
        assert!(numbers.iter().all(|n| n.is_finite() && *n >= 0.0), "{row:?}");
        assert!(row.bytes > 0.0 && row.operations >= 0.0, "{row:?}");
    }
    let sum =
        |rows: &[limpid_lab::report::passes::Budget]| rows.iter().map(|row| row.bytes).sum::<f64>();
    if let [passes @ .., lights, camera] = &rows[..] {
        assert_close(sum(passes), lights.bytes + camera.bytes, 1e-12);
    }
}
