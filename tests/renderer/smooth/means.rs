//! Filters that average depths: bilateral and narrow-range, beside the plane fit.

use glam::{Quat, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::settings::Filter;

use super::{FILTERS, SIZE, draw, filtering, largest_change, sheet};
use crate::support::frames::{
    FrameImages, View, ellipsoid, harness, noise_vector, on_axis, sphere, splats,
};

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
