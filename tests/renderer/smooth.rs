//! Smoothing of layers with a known result: planes stay, spheres recede by a closed form, gaps stay
//! sharp; and the known deviations of filters other than the plane fit.

use glam::{DVec3, Quat, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::liquid::Particles;
use limpid::liquid::classify::{Splat, Splats, classify};
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

/// Screen-space weight of a tap of `bilateral` and `narrow-range`: σ is a quarter of the window, and the
/// outermost taps are at 2 σ.
fn weight(taps: i32, x: i32, y: i32) -> f64 {
    let sigma = f64::from(taps / 2) / 2.0;
    (-f64::from(x * x + y * y) / (2.0 * sigma * sigma)).exp()
}

/// Variance of these weights along an axis, in pixels².
fn variance(taps: i32) -> f64 {
    let reach = -(taps / 2)..=taps / 2;
    let moment = |n| reach.clone().map(|x| f64::from(x).powi(n) * weight(taps, x, 0)).sum::<f64>();
    moment(2) / moment(0)
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

/// With windows in radii, taps move together until they would be closer than half a pixel; later iterations change
/// nothing, so that liquid far away is not smoothed over more radii than liquid near by. A sphere recedes as in
/// [`sphere_recedes_by_the_closed_form`], with the distance between taps for the footprint.
#[test]
fn iterations_end_when_taps_are_half_a_pixel_apart() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(21.0, 3.4);
    let footprint = 20.0 * View::new(&camera, SIZE).footprint();
    let mut scene = fitting(5, 8);
    scene.settings.smooth.unit = Unit::Radius;
    scene.settings.smooth.window = 2.4;
    // The first taps are 4.8 pixels apart.
    let drawn = splats(&[sphere(Vec3::ZERO, 1.0)], &[], (8.0 * footprint) as f32);
    let images = draw(&mut harness, &scene, &camera, &drawn);
    let squares: f64 = [5.0, 2.0, 1.0, 1.0].iter().map(|stride| stride * stride).sum();
    let expected = squares * (25.0 - 1.0) * footprint * footprint / 12.0;
    let middle = SIZE / 2;
    let before = images.at("depth.aggregate_front", middle);
    let moved = images.at("smooth_depth.aggregate_front", middle) - before;
    println!("{moved} m of {expected} m");
    assert!((moved / expected - 1.0).abs() < 0.05, "{moved} m of {expected} m");
}

/// Liquid of particles of different radii is smoothed over each one's own: it moves as it does among particles of its
/// radius alone. There is liquid behind it, so that the sides of gaps are smoothed too.
#[test]
fn particles_are_smoothed_over_their_own_radii() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(21.0, 8.0);
    let footprint = 20.0 * View::new(&camera, SIZE).footprint();
    let bodies = [-0.6, 0.6].map(|x| sphere(Vec3::X * x, 0.5));
    let behind = [-0.6, 0.6].map(|x| sphere(Vec3::new(x, 0.0, -3.0), 0.5));
    let bodies = [bodies, behind].concat();
    let radii = [2.0, 8.0].map(|pixels| (pixels * footprint) as f32);
    for filter in FILTERS {
        let mut scene = fitting(5, 4);
        let smooth = &mut scene.settings.smooth;
        (smooth.filter, smooth.unit, smooth.window) = (filter, Unit::Radius, 2.4);
        let [fine, coarse] =
            radii.map(|r| draw(&mut harness, &scene, &camera, &splats(&bodies, &[], r)));
        let own = |s: &Splat| Splat { radius: radii[usize::from(s.centre[0] > 0.0)], ..*s };
        let mixed =
            Splats { aggregates: bodies.iter().map(own).collect(), ..splats(&[], &[], radii[0]) };
        let mixed = draw(&mut harness, &scene, &camera, &mixed);
        let mut apart = 0;
        for p in mixed.pixels() {
            let alone = if p.x < SIZE.x / 2 { &fine } else { &coarse };
            for side in ["front", "back"] {
                let name = format!("smooth_depth.aggregate_{side}");
                let (found, expected) = (mixed.at(&name, p), alone.at(&name, p));
                assert!(
                    (found - expected).abs() < 1e-5,
                    "{filter:?} at {p}: {found}, not {expected}"
                );
                apart += u32::from((fine.at(&name, p) - coarse.at(&name, p)).abs() > 1e-4);
            }
        }
        println!("{filter:?}: {apart} texels depend on the radius");
        assert!(apart > 1000);
    }
}

/// A slab of particles that are out of place, half of which are twice as large, is as flat on both halves as slabs of one
/// size. Smoothed over the radius of most particles, the coarse half would be 2.2 times as rough.
#[test]
fn coarse_liquid_beside_fine_is_as_smooth_as_alone() {
    let Some(mut harness) = harness() else { return };
    let block = |x: [f32; 2], r: f32| {
        let mut seed = 5;
        let count = ((Vec3::new(x[1] - x[0], 1.0, 0.3)) / (2.0 * r)).round().as_ivec3();
        let place = move |i: i32| {
            let cell = glam::IVec3::new(i % count.x, i / count.x % count.y, i / count.x / count.y);
            let jitter = noise_vector(&mut seed) * Vec3::new(0.3, 0.3, 0.15);
            Vec3::new(x[0], -0.5, -0.3) + r * (2.0 * cell.as_vec3() + 1.0 + jitter)
        };
        (0..count.element_product()).map(place).map(move |x| (x, r)).collect::<Vec<_>>()
    };
    let mut scene = scene();
    scene.settings.smooth = Default::default();
    scene.settings.refract.interfaces = 1;
    let mut tilts = |particles: Vec<(Vec3, f32)>| {
        let (positions, radii) = particles.into_iter().unzip();
        let particles = Particles { positions, radii: Some(radii), ..Default::default() };
        let drawn = classify(&particles, 0.02, &scene.settings.classify);
        let images = draw(&mut harness, &scene, &on_axis(1.6, 40.0), &drawn);
        [20..75, 85..140].map(|columns| {
            let pixels =
                images.pixels().filter(|p| columns.contains(&p.x) && (30..90).contains(&p.y));
            let cosines = pixels.map(|p| images.normal("smooth_normal.aggregate_front", p).z);
            let (sum, count) = cosines
                .fold((0.0, 0), |(sum, n), z| (sum + z.abs().min(1.0).acos().powi(2), n + 1));
            (sum / f64::from(count)).sqrt().to_degrees()
        })
    };
    let [coarse, fine] = [0.025, 0.0125];
    let [left, right] = [[-0.7, 0.0], [0.0, 0.7]];
    let one_coarse = tilts([block(left, coarse), block(right, coarse)].concat());
    let one_fine = tilts([block(left, fine), block(right, fine)].concat());
    let mixed = tilts([block(left, coarse), block(right, fine)].concat());
    println!(
        "root mean square tilts: coarse {one_coarse:.2?}°, fine {one_fine:.2?}°, mixed {mixed:.2?}°"
    );
    assert!((mixed[0] / one_coarse[0] - 1.0).abs() < 0.05);
    assert!((mixed[1] / one_fine[1] - 1.0).abs() < 0.05);
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

/// A surface of constant depth is a fixed point of every filter, up to the picture's borders.
#[test]
fn constant_depth_is_a_fixed_point_of_every_filter() {
    let Some(mut harness) = harness() else { return };
    let drawn = splats(&[sheet(Vec3::NEG_Z * 0.5, Quat::IDENTITY)], &[], 0.05);
    for filter in FILTERS {
        let images = draw(&mut harness, &filtering(filter, 9, 5), &on_axis(2.0, 40.0), &drawn);
        for side in ["front", "back"] {
            let (change, at) = largest_change(&images, side, |_| true);
            println!("{filter:?}: {side} moves by {change} at {at}");
            assert!(change < 4e-6, "{filter:?}: {side} by {change} at {at}");
        }
    }
}

/// On a slope, a mean of depths is biased at the picture's border, where half of the window is missing:
/// Imai et al. (2016), figure 3. Plane fits are not; narrow ranges skip a tap if the opposite one is
/// missing.
///
/// In the interior, the curvature of depth along the column remains, z″ = 2 z′²/z: a drift of half of it
/// times the window's variance.
#[test]
fn averaged_depths_drift_on_slopes_and_warp_at_borders() {
    let Some(mut harness) = harness() else { return };
    let taps = 9;
    let turn = Quat::from_rotation_x(30f32.to_radians());
    let drawn = splats(&[sheet(turn * Vec3::NEG_Z * 0.5, turn)], &[], 0.05);
    let [fit, bilateral, narrow] = FILTERS.map(|filter| {
        draw(&mut harness, &filtering(filter, taps as u32, 1), &on_axis(2.0, 40.0), &drawn)
    });
    let before = |y: i32| fit.at("depth.aggregate_front", UVec2::new(80, y as u32));
    let moved = |images: &FrameImages, y: i32| {
        images.at("smooth_depth.aggregate_front", UVec2::new(80, y as u32)) - before(y)
    };
    for y in [20, 60, 100] {
        let slope = 0.5 * (before(y + 1) - before(y - 1));
        let drift = variance(taps) * slope * slope / before(y);
        println!("row {y}: {:e} and {:e} of {drift:e}", moved(&bilateral, y), moved(&narrow, y));
        assert!(moved(&fit, y).abs() < 6e-6, "row {y}: {}", moved(&fit, y));
        assert!((moved(&bilateral, y) / drift - 1.0).abs() < 0.05, "row {y}");
        assert!((moved(&narrow, y) / drift - 1.0).abs() < 0.05, "row {y}");
    }
    for (y, inwards) in [(0, 1), (SIZE.y as i32 - 1, -1)] {
        let half =
            |f: &dyn Fn(i32) -> f64| (0..=taps / 2).map(|k| f(k) * weight(taps, 0, k)).sum::<f64>();
        let warp = half(&|k| before(y + k * inwards) - before(y)) / half(&|_| 1.0);
        println!("row {y}: {:e} of {warp:e}, {:e}", moved(&bilateral, y), moved(&narrow, y));
        assert!(warp.abs() > 0.005);
        assert!((moved(&bilateral, y) / warp - 1.0).abs() < 0.05, "row {y}");
        assert!(moved(&fit, y).abs() < 6e-6, "row {y}: {}", moved(&fit, y));
        assert!(moved(&narrow, y).abs() < 0.02 * warp.abs(), "row {y}");
    }
}

/// Means of depths flatten a sphere like planes do, by the variance of their window: m₂ a² / R per
/// iteration, where the s × s window of the plane fit has m₂ = (s² − 1)/12.
#[test]
fn sphere_recedes_by_the_variance_of_the_window() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(21.0, 8.0);
    let footprint = 20.0 * View::new(&camera, SIZE).footprint();
    let drawn = splats(&[sphere(Vec3::ZERO, 1.0)], &[], 1.0);
    for filter in [Filter::Bilateral, Filter::NarrowRange] {
        for (taps, iterations) in [(5, 1), (5, 4), (9, 2)] {
            let images = draw(&mut harness, &filtering(filter, taps, iterations), &camera, &drawn);
            for (side, sign, distance) in [("front", 1.0, 1.0), ("back", -1.0, 1.1f64)] {
                let near_middle =
                    |p: &UVec2| p.as_ivec2().distance_squared((SIZE / 2).as_ivec2()) < 64;
                let middle: Vec<_> = images.pixels().filter(near_middle).collect();
                let moved = |&p: &UVec2| {
                    images.at(&format!("smooth_depth.aggregate_{side}"), p)
                        - images.at(&format!("depth.aggregate_{side}"), p)
                };
                let mean = sign * middle.iter().map(moved).sum::<f64>() / middle.len() as f64;
                let footprint = footprint * distance;
                let once = variance(taps as i32) * footprint * footprint;
                let expected = f64::from(iterations) * once;
                println!("{filter:?}, {taps} taps, {iterations}: {side} {mean:e} of {expected:e}");
                assert!((mean / expected - 1.0).abs() < 0.05, "{side}: {mean} not {expected}");
            }
        }
    }
}

/// With two surfaces more than δ apart, the nearer one does not affect the farther one. The edge of the
/// nearer one is rounded as if nothing were behind it, by μ times the weight of the other taps. The same
/// holds for backs, seen from behind.
#[test]
fn narrow_range_separates_surfaces_and_rounds_edges() {
    let Some(mut harness) = harness() else { return };
    let (r, taps) = (0.05f32, 9);
    let disc = ellipsoid(Vec3::new(0.1, 0.05, 0.0), Vec3::new(0.5, 0.5, 1e-4), Quat::IDENTITY);
    let behind = sheet(Vec3::NEG_Z * (0.5 + 20.0 * r), Quat::IDENTITY);
    let mut scene = filtering(Filter::NarrowRange, taps as u32, 1);
    let (apart, alone) = (splats(&[disc, behind], &[], r), splats(&[disc], &[], r));
    for (drawn, side, sign) in
        [(&apart, "front", 1.0), (&alone, "front", 1.0), (&alone, "back", -1.0)]
    {
        let images = draw(&mut harness, &scene, &on_axis(2.0, 40.0), drawn);
        let before = |p| images.at(&format!("depth.aggregate_{side}"), p);
        let on_disc = |p| before(p) > 0.0 && before(p) < 2.1;
        let mut rounded = 0;
        for p in images.pixels().filter(|&p| before(p) > 0.0) {
            let moved = images.at(&format!("smooth_depth.aggregate_{side}"), p) - before(p);
            let (mut total, mut other, mut cut) = (0.0, 0.0, false);
            for (y, x) in (-4..=4).flat_map(|y| (-4..=4).map(move |x| (y, x))) {
                let q = p.as_ivec2() + glam::IVec2::new(x, y);
                cut |= q.min_element() < 0 || q.cmpge(SIZE.as_ivec2()).any();
                total += weight(taps, x, y);
                if !cut && !on_disc(q.as_uvec2()) {
                    other += weight(taps, x, y);
                }
            }
            if cut {
                continue;
            }
            let expected = if on_disc(p) { sign * f64::from(r) * other / total } else { 0.0 };
            // The disc's rim is not exactly at constant depth.
            assert!((moved - expected).abs() < 1e-4, "{side} at {p}: {moved}, not {expected}");
            rounded += u32::from(expected != 0.0);
        }
        println!("{side}: {rounded} rounded");
        assert!(rounded > 500);
    }
    // Within δ they are one surface and mix.
    scene.settings.smooth.delta = 30.0;
    let images = draw(&mut harness, &scene, &on_axis(2.0, 40.0), &apart);
    assert!(largest_change(&images, "front", |_| true).0 > 0.3);
}

/// Each iteration of each filter reduces the bumps that particles make on a plane.
#[test]
fn bumps_decrease_with_every_iteration() {
    let Some(mut harness) = harness() else { return };
    let mut seed = 7;
    let bumps: Vec<_> = (0..24 * 32)
        .map(|i| {
            let place = Vec3::new((i % 32) as f32 - 15.5, (i / 32) as f32 - 11.5, 0.0) * 0.07;
            let jitter = noise_vector(&mut seed) * Vec3::new(0.01, 0.01, 0.03);
            ellipsoid(place + jitter, Vec3::new(0.08, 0.08, 0.05), Quat::IDENTITY)
        })
        .collect();
    let drawn = splats(&bumps, &[], 0.05);
    for filter in FILTERS {
        let roughness = [0, 1, 2, 4, 8].map(|iterations| {
            let images =
                draw(&mut harness, &filtering(filter, 5, iterations), &on_axis(2.0, 35.0), &drawn);
            let depth = |p| images.at("smooth_depth.aggregate_front", p);
            let inner =
                |p: &UVec2| (16..SIZE.x - 16).contains(&p.x) && (16..SIZE.y - 16).contains(&p.y);
            let inner: Vec<_> = images.pixels().filter(inner).collect();
            assert!(inner.iter().all(|&p| depth(p) > 0.0), "the bumps cover the picture");
            let n = inner.len() as f64;
            let mean = inner.iter().map(|&p| depth(p)).sum::<f64>() / n;
            (inner.iter().map(|&p| (depth(p) - mean).powi(2)).sum::<f64>() / n).sqrt()
        });
        println!("{filter:?}: {roughness:?}");
        assert!(roughness.is_sorted_by(|more, less| less < more), "{filter:?}: {roughness:?}");
    }
}

/// Where the ray starts in the liquid, the front is a mark instead of a depth: no filter changes it or
/// uses it as a tap.
#[test]
fn marks_of_rays_that_start_inside_are_kept() {
    let Some(mut harness) = harness() else { return };
    let camera = Camera { near: Some(0.045), ..on_axis(2.0, 40.0) };
    // Beside the eye: its near side is in front of the near plane, its limb beyond.
    let beside = sphere(Vec3::new(0.11, 0.0, 1.95), 0.1);
    let drawn = splats(&[beside, sheet(Vec3::NEG_Z * 0.5, Quat::IDENTITY)], &[], 0.05);
    for filter in FILTERS {
        let images = draw(&mut harness, &filtering(filter, 9, 5), &camera, &drawn);
        let near = f64::from(camera.near());
        let (mut marks, mut beyond) = (0, 0);
        for p in images.pixels() {
            let before = images.at("depth.aggregate_front", p);
            let after = images.at("smooth_depth.aggregate_front", p);
            if before <= near {
                assert_eq!(after, before, "{filter:?} at {p}");
                marks += 1;
            } else {
                assert!(after > near, "{filter:?} at {p}: {after}");
                beyond += u32::from(before < 0.1);
            }
        }
        println!("{filter:?}: {marks} marks, {beyond} beside them");
        assert!(marks > 100 && beyond > 100);
        // The sheet is too far from both to change.
        let far = |p| images.at("depth.aggregate_front", p) > 2.0;
        let (change, at) = largest_change(&images, "front", far);
        assert!(change < 1e-5, "{filter:?}: {change} at {at}");
    }
}
