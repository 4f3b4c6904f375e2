//! Windows in multiples of the particle radius.

use glam::Vec3;
use limpid::liquid::Particles;
use limpid::liquid::classify::{Splat, Splats, classify};
use limpid::settings::Unit;

use super::{FILTERS, SIZE, draw, fitting};
use crate::support::frames::{View, harness, noise_vector, on_axis, scene, sphere, splats};

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
