//! Smoothing of layers with a known result: planes stay, spheres recede by a closed form, gaps stay
//! sharp; and the known deviations of filters other than the plane fit.

mod means;
mod radii;

use glam::{DVec3, Quat, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::liquid::classify::{Splat, Splats};
use limpid::scene::Scene;
use limpid::settings::{Filter, Unit};

use crate::support::frames::{
    FrameImages, Harness, View, ellipsoid, harness, noise_turn, noise_vector, on_axis, scene,
    sphere, splats,
};

const SIZE: UVec2 = UVec2::new(160, 120);

/// The paper's plane fit: a fully sampled window of `taps` pixels.
fn fitting(taps: u32, iterations: u32) -> Scene {
    let mut scene = scene();
    let smooth = &mut scene.settings.smooth;
    (smooth.unit, smooth.taps, smooth.window) = (Unit::Pixel, taps, taps as f32);
    (smooth.iterations, smooth.sigma) = (iterations, 5.3);
    // The cheapest refraction, as only the layers are tested.
    scene.settings.refract.interfaces = 1;
    scene
}

const FILTERS: [Filter; 3] = [Filter::PlaneFit, Filter::Bilateral, Filter::NarrowRange];

/// As [`fitting`], with another filter.
fn filtering(filter: Filter, taps: u32, iterations: u32) -> Scene {
    let mut scene = fitting(taps, iterations);
    scene.settings.smooth.filter = filter;
    scene
}

/// A disc that is flat enough for a plane: 500 km radius of curvature.
fn sheet(centre: Vec3, turn: Quat) -> Splat {
    ellipsoid(centre, Vec3::new(500.0, 500.0, 0.5), turn)
}

/// Largest change of a layer's depth, and its pixel.
fn largest_change(
    images: &FrameImages,
    side: &str,
    within: impl Fn(UVec2) -> bool,
) -> (f64, UVec2) {
    let change = |p| {
        let before = images.at(&format!("depth.aggregate_{side}"), p);
        let after = images.at(&format!("smooth_depth.aggregate_{side}"), p);
        assert_eq!(before > 0.0, after > 0.0, "{side} at {p}: smoothing changed the outline");
        ((after - before).abs(), p)
    };
    let none = (0.0, UVec2::ZERO);
    images
        .pixels()
        .filter(|&p| within(p))
        .map(change)
        .fold(none, |a, b| if b.0 > a.0 { b } else { a })
}

fn draw(harness: &mut Harness, scene: &Scene, camera: &Camera, splats: &Splats) -> FrameImages {
    let images = harness.render(scene, camera, splats, SIZE);
    images.assert_finite();
    images
}

/// A plane is a fixed point up to the picture's borders, at any tilt, for both window units.
///
/// The tolerance covers rounding: eq. 5 divides an error of 1e-7 of the depth by the cosine, and the
/// plane is curved by 1e-4 m at its visible corners.
#[test]
fn plane_is_a_fixed_point() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(2.0, 40.0);
    let mut radii = fitting(5, 5);
    radii.settings.smooth.unit = Unit::Radius;
    radii.settings.smooth.window = 3.0;
    for (tilt, tolerance) in [(0.0f32, 2e-6), (30.0, 2e-6), (60.0, 1e-5)] {
        let turn = Quat::from_rotation_x(tilt.to_radians());
        let drawn = splats(&[sheet(turn * Vec3::NEG_Z * 0.5, turn)], &[], 0.05);
        for scene in [fitting(9, 5), fitting(3, 5), radii.clone()] {
            let images = draw(&mut harness, &scene, &camera, &drawn);
            let (change, at) = largest_change(&images, "front", |_| true);
            println!("{tilt}°: front moves by {change} at {at}");
            // The far parts of the tilted plane are 3 times as deep.
            assert!(change < tolerance * 3.0, "{tilt}°: {change} at {at}");
        }
    }
}

/// A plane seen at 89°, where the fit would divide by almost 0, keeps its depth, as in eq. 5.
#[test]
fn plane_seen_edge_on_is_kept() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(2.0, 1.0);
    let turn = Quat::from_rotation_x(89f32.to_radians());
    let drawn = splats(&[sheet(turn * Vec3::NEG_Z * 0.5, turn)], &[], 0.05);
    let images = draw(&mut harness, &fitting(9, 5), &camera, &drawn);
    let covered = images.channel("depth.aggregate_front").iter().filter(|&&z| z > 0.0).count();
    let (change, at) = largest_change(&images, "front", |_| true);
    println!("89°: moves by {change} at {at}, {covered} pixels");
    assert!(covered > 5000);
    assert!(change < 1e-4, "{change} at {at}");
}

/// Fitted planes flatten a sphere: it recedes by (s² − 1) a² / (12 R) per iteration, with the pixel
/// footprint a. The tolerance of 5 % covers perspective in the window and the flatter cap in later
/// iterations; a wrong weight or window size is off by 20 % or more.
#[test]
fn sphere_recedes_by_the_closed_form() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(21.0, 3.4);
    let footprint = 20.0 * View::new(&camera, SIZE).footprint();
    let drawn = splats(&[sphere(Vec3::ZERO, 1.0)], &[], 1.0);
    for (taps, iterations) in [(3, 4), (5, 1), (5, 4), (9, 1), (9, 3)] {
        let images = draw(&mut harness, &fitting(taps, iterations), &camera, &drawn);
        let side = f64::from(taps);
        let per_iteration = (side * side - 1.0) * footprint * footprint / 12.0;
        for (side, sign) in [("front", 1.0), ("back", -1.0)] {
            let middle = || {
                images
                    .pixels()
                    .filter(|p| p.as_ivec2().distance_squared((SIZE / 2).as_ivec2()) < 64)
            };
            let moved = |p| {
                images.at(&format!("smooth_depth.aggregate_{side}"), p)
                    - images.at(&format!("depth.aggregate_{side}"), p)
            };
            let mean = sign * middle().map(moved).sum::<f64>() / middle().count() as f64;
            // The back is 22/20 as far away, and its footprint is as much wider.
            let footprint_ratio = if side == "back" { (22.0f64 / 20.0).powi(2) } else { 1.0 };
            let expected = f64::from(iterations) * per_iteration * footprint_ratio;
            println!("{taps} taps, {iterations} times, {side}: {mean:e} of {expected:e}");
            assert!((mean / expected - 1.0).abs() < 0.05, "{side}: {mean} not {expected}");
        }
    }
}

/// Layers 20 r apart do not affect each other (σ = 5.3 r gives a weight of 1e-6), and the border of a
/// layer does not warp: neither an empty nor a far neighbour affects its depth or normal.
#[test]
fn gaps_stay_sharp() {
    let Some(mut harness) = harness() else { return };
    let (r, camera) = (0.05f32, on_axis(2.0, 40.0));
    let disc = ellipsoid(Vec3::new(0.1, 0.05, 0.0), Vec3::new(0.5, 0.5, 1e-4), Quat::IDENTITY);
    let behind = sheet(Vec3::NEG_Z * (0.5 + 20.0 * r), Quat::IDENTITY);
    for drawn in [splats(&[disc, behind], &[], r), splats(&[disc], &[], r)] {
        let images = draw(&mut harness, &fitting(9, 5), &camera, &drawn);
        let (change, at) = largest_change(&images, "front", |_| true);
        println!("across the gap: {change} at {at}");
        assert!(change < 1e-3 * f64::from(r), "{change} at {at}");
        for p in images.pixels().filter(|&p| images.at("depth.aggregate_front", p) > 0.0) {
            let normal = images.normal("smooth_normal.aggregate_front", p);
            assert!((normal - DVec3::Z).length() < 0.02, "the normal at {p} is {normal}");
        }
    }
}

/// A pixel without neighbours does not change.
#[test]
fn lone_pixel_is_unchanged() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(2.0, 40.0);
    let view = View::new(&camera, SIZE);
    let p = UVec2::new(43, 71);
    let radius = 0.3 * 2.0 * view.footprint();
    let centre = view.world_point(2.0 * view.through(p) + DVec3::X * 0.3 * radius);
    let drawn = splats(&[sphere(centre.as_vec3(), radius as f32)], &[], 0.05);
    let mut scenes = FILTERS.map(|filter| [filtering(filter, 9, 5), filtering(filter, 5, 5)]);
    for scene in scenes.as_flattened_mut() {
        scene.settings.smooth.unit =
            if scene.settings.smooth.taps == 5 { Unit::Radius } else { Unit::Pixel };
        let images = draw(&mut harness, scene, &camera, &drawn);
        let covered = images.channel("depth.aggregate_front").iter().filter(|&&z| z > 0.0).count();
        assert_eq!(covered, 1);
        for side in ["front", "back"] {
            let name = format!("aggregate_{side}");
            assert_eq!(
                images.at(&format!("smooth_depth.{name}"), p),
                images.at(&format!("depth.{name}"), p)
            );
            let turned = images.normal(&format!("smooth_normal.{name}"), p)
                - images.normal(&format!("normal.{name}"), p);
            assert!(turned.length() < 1e-6, "{side} turned by {turned}");
        }
    }
}

/// A heap of ellipsoids, with curvature, gaps and an outline.
fn heap() -> Splats {
    let mut seed = 11;
    let aggregates: Vec<_> = (0..120)
        .map(|_| {
            let centre = noise_vector(&mut seed) * Vec3::new(0.6, 0.4, 0.4);
            let axes = 0.12 + 0.04 * noise_vector(&mut seed);
            ellipsoid(centre, axes, noise_turn(&mut seed))
        })
        .collect();
    splats(&aggregates, &[sphere(Vec3::new(0.3, 0.3, 0.8), 0.1)], 0.08)
}

/// Without iterations the smoothed layers equal the splatted ones bit by bit, whatever was drawn before.
#[test]
fn no_iterations_change_nothing() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(3.0, 40.0);
    draw(&mut harness, &fitting(9, 5), &camera, &heap());
    let images = draw(&mut harness, &scene(), &camera, &heap());
    for image in ["depth", "normal"] {
        for name in images.channels.keys().filter(|name| name.starts_with(&format!("{image}.agg")))
        {
            let (splatted, smoothed) =
                (images.channel(name), images.channel(&format!("smooth_{name}")));
            let differ = splatted.iter().zip(smoothed).filter(|(a, b)| a != b).count();
            assert_eq!(differ, 0, "texels of smooth_{name} differ from {name}");
        }
    }
}

/// Only aggregates are smoothed: splashes stay as splatted.
#[test]
fn splashes_are_not_smoothed() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(3.0, 40.0);
    let rough = draw(&mut harness, &scene(), &camera, &heap());
    let smoothed = draw(&mut harness, &fitting(9, 5), &camera, &heap());
    for name in ["depth.splash_front", "depth.splash_back", "normal.splash_front.X"] {
        assert_eq!(rough.channel(name), smoothed.channel(name), "{name}");
    }
    // A splash alone also keeps its radiance.
    let alone = splats(&[], &heap().splashes, 0.08);
    let rough = draw(&mut harness, &scene(), &camera, &alone);
    let mut scene = scene();
    scene.settings.smooth.iterations = 5;
    let smoothed = draw(&mut harness, &scene, &camera, &alone);
    assert_eq!(rough.channel("radiance.R"), smoothed.channel("radiance.R"));
}

/// A smoothed texel's plane fits its depth and those of its neighbours: unit normal, and the disparity
/// slope of central differences.
#[test]
fn smoothed_normals_fit_smoothed_depths() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(3.0, 40.0);
    let view = View::new(&camera, SIZE);
    let images = draw(&mut harness, &fitting(9, 3), &camera, &heap());
    for (side, away) in [("front", -1.0), ("back", 1.0)] {
        let depth = |p: UVec2| images.at(&format!("smooth_depth.aggregate_{side}"), p);
        let (mut compared, mut worst) = (0, (0f64, UVec2::ZERO));
        for p in images.pixels() {
            let normal = images.normal(&format!("smooth_normal.aggregate_{side}"), p);
            let covered = depth(p) > 0.0;
            assert!((normal.length() - f64::from(u8::from(covered))).abs() < 1e-6, "{p}: {normal}");
            // Outward: towards the eye on fronts.
            assert!(!covered || away * normal.dot(view.through(p)) > 0.0, "{p} faces inwards");
            if !(1..SIZE.x - 1).contains(&p.x) || !(1..SIZE.y - 1).contains(&p.y) {
                continue;
            }
            let [left, right] = [p - UVec2::X, p + UVec2::X];
            let [above, below] = [p - UVec2::Y, p + UVec2::Y];
            // Excludes gaps and creases, where the slope is one-sided.
            let smooth = |a, b| {
                let both = depth(a) > 0.0 && depth(b) > 0.0;
                both && (depth(a) + depth(b) - 2.0 * depth(p)).abs() < 0.1 * 0.08
                    && (depth(a) - depth(b)).abs() < 0.06
            };
            if !covered || !smooth(left, right) || !smooth(above, below) {
                continue;
            }
            let slope = |a, b| 0.5 * (depth(b).recip() - depth(a).recip()) / view.footprint();
            // D(u) = π·ω(u), and ω changes by the footprint per pixel, to the right and down.
            let (x, y) = (slope(left, right), -slope(above, below));
            let omega = view.through(p);
            let z = x * omega.x + y * omega.y - depth(p).recip();
            let expected = away * DVec3::new(x, y, z).normalize();
            let turned = (normal - expected).length();
            compared += 1;
            if turned > worst.0 {
                worst = (turned, p);
            }
        }
        println!("{side}: {worst:?} of {compared}");
        assert!(compared > 2000 && worst.0 < 1e-3, "{side}: {worst:?} of {compared}");
    }
}
