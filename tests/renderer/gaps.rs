//! Liquid behind liquid: lengths of rays in it, against closed forms. The index of refraction is nearly 1, so
//! that rays are straight and the length is that of the union of the ellipsoids along the pixel's ray.

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Quat, UVec2, Vec3};
use limpid::liquid::classify::{Splat, Splats};
use limpid::scene::Scene;

use crate::support::frames::{
    Ellipsoid, FrameImages, View, ellipsoid, harness, noise_vector, on_axis, scene, sphere, splats,
};

const SIZE: UVec2 = UVec2::new(161, 121);
const MIDDLE: UVec2 = UVec2::new(80, 60);
const DISTANCE: f32 = 5.0;
/// Share of a body's extent that a length may be off: as for a single ball, whose planes lie up to half a pixel
/// beside the ray.
const TOLERANCE: f64 = 0.01;

fn straight(intervals: u32) -> Scene {
    let mut scene = scene();
    scene.liquid.ior = 1.0003;
    scene.settings.layers.intervals = intervals;
    scene.settings.refract.interfaces = 2 * intervals.max(2);
    scene
}

/// Depths at which the pixel's ray enters and leaves the union of the ellipsoids.
fn intervals(liquid: &Splats, p: UVec2) -> Vec<[f64; 2]> {
    let view = View::new(&on_axis(DISTANCE, 30.0), SIZE);
    let all = liquid.aggregates.iter().chain(&liquid.splashes);
    let mut hits: Vec<_> = all
        .filter_map(|s| Ellipsoid::new(&view, s).hits(DVec3::ZERO, view.through(p).normalize()))
        .collect();
    hits.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut union: Vec<[f64; 2]> = Vec::new();
    for hit in hits {
        match union.last_mut() {
            Some(last) if hit[0] <= last[1] => last[1] = last[1].max(hit[1]),
            _ => union.push(hit),
        }
    }
    union
}

fn length(intervals: &[[f64; 2]]) -> f64 {
    intervals.iter().map(|[enter, leave]| leave - enter).sum()
}

fn draw(liquid: &Splats, intervals: u32) -> Option<FrameImages> {
    let mut harness = harness()?;
    Some(harness.render(&straight(intervals), &on_axis(DISTANCE, 30.0), liquid, SIZE))
}

/// Pixels away from rims: their union has `count` intervals, and so have those within three pixels; all gaps are
/// wider than `gap`.
fn clear_pixels(liquid: &Splats, count: usize, gap: f64) -> Vec<UVec2> {
    let inner = |p: UVec2| p.min_element() >= 3 && (p + 3).cmplt(SIZE).all();
    let is_clear = |p: UVec2| {
        let near = [-3, 0, 3].into_iter().flat_map(|x| [-3, 0, 3].map(|y| (x, y)));
        near.into_iter().all(|(x, y)| {
            let at = UVec2::new(p.x.wrapping_add_signed(x), p.y.wrapping_add_signed(y));
            let union = intervals(liquid, at);
            union.len() == count && union.windows(2).all(|two| two[1][0] - two[0][1] > gap)
        })
    };
    (0..SIZE.y)
        .step_by(2)
        .flat_map(|y| (0..SIZE.x).step_by(2).map(move |x| UVec2::new(x, y)))
        .filter(|&p| inner(p) && is_clear(p))
        .collect()
}

/// The length in the liquid of a clear pixel's ray is that of the union; `least` pixels at least are compared.
#[track_caller]
fn lengths_are_exact(
    what: &str,
    liquid: &Splats,
    drawn: u32,
    count: usize,
    extent: f64,
    least: usize,
) {
    let Some(frame) = draw(liquid, drawn) else { return };
    let pixels = clear_pixels(liquid, count, 4.0 * f64::from(liquid.radius));
    assert!(pixels.len() >= least, "{what}: {} pixels are clear", pixels.len());
    for p in pixels {
        let (found, exact) = (frame.at("inside", p), length(&intervals(liquid, p)));
        assert!(
            (found - exact).abs() <= TOLERANCE * extent,
            "{what}: {found} instead of {exact} at {p}"
        );
    }
}

fn drops_in_a_row(count: u8) -> Vec<Splat> {
    (0..count).map(|i| sphere(Vec3::new(0.1, 0.05, 1.0 - f32::from(i)), 0.25)).collect()
}

/// Two drops in a row are two drops, whatever their class: light is not absorbed along the air between them.
#[test]
fn drops_in_a_row_are_apart() {
    let drops = drops_in_a_row(2);
    lengths_are_exact("bodies", &splats(&drops, &[], 0.1), 2, 2, 0.5, 30);
    lengths_are_exact("splashes", &splats(&[], &drops, 0.1), 2, 2, 0.5, 30);
    lengths_are_exact("a body and a splash", &splats(&drops[..1], &drops[1..], 0.1), 2, 2, 0.5, 30);
}

/// Three drops in a row need three intervals.
#[test]
fn three_drops_need_three_intervals() {
    let drops = drops_in_a_row(3);
    lengths_are_exact("bodies", &splats(&drops, &[], 0.1), 3, 3, 0.5, 20);
    lengths_are_exact("splashes", &splats(&[], &drops, 0.1), 3, 3, 0.5, 20);
}

/// Small drops far apart, as of spray: 1 cm drops a metre apart.
#[test]
fn small_drops_far_apart_are_apart() {
    let drops = [-0.5, 0.5].map(|z| sphere(Vec3::Z * z, 0.005));
    let liquid = splats(&[], &drops, 0.004);
    let Some(mut harness) = harness() else { return };
    let frame = harness.render(&straight(2), &on_axis(DISTANCE, 0.5), &liquid, SIZE);
    let found = frame.at("inside", MIDDLE);
    assert!((found - 0.02).abs() < 0.0005, "{found} m instead of 2 cm");
}

/// Two drops of one particle each that part along the ray: the air between them appears at once, when it is two
/// particle radii long at most, and stays. So pixels of a sequence change by less than two radii of liquid.
#[test]
fn air_appears_below_two_radii_and_stays() {
    let (r, radius) = (0.1, 0.145);
    let mut gap_shown = None;
    for step in 0..30 {
        let gap = 0.01 * step as f32;
        let drops = [-0.5, 0.5].map(|side| sphere(Vec3::Z * side * (2.0 * radius + gap), radius));
        let Some(frame) = draw(&splats(&drops, &[], r), 2) else { return };
        let excess = frame.at("inside", MIDDLE) - f64::from(4.0 * radius);
        let shown = excess.abs() < 0.5 * TOLERANCE;
        assert!(shown || (excess - f64::from(gap)).abs() < TOLERANCE, "{gap}: {excess}");
        if shown && gap > 0.02 {
            gap_shown.get_or_insert(gap);
        }
        assert!(shown || gap_shown.is_none(), "the air of {gap_shown:?} is gone at {gap}");
    }
    assert!(gap_shown.is_some_and(|gap| gap < 2.0 * r), "{gap_shown:?}");
}

/// Particles that fill only a hull have one interval: the space inside is liquid.
#[test]
fn hulls_have_one_interval() {
    let hull = Splats { is_hull: true, ..splats(&drops_in_a_row(2), &[], 0.1) };
    let filled = Splats { is_hull: false, ..hull.clone() };
    let (Some(two), Some(one)) = (draw(&hull, 2), draw(&filled, 1)) else { return };
    assert_eq!(two.channel("inside"), one.channel("inside"));
}

/// The check fails for one interval per pixel: that reaches from the first front to the last back.
#[test]
fn one_interval_reaches_through_the_air() {
    let drops = drops_in_a_row(2);
    let Some(frame) = draw(&splats(&drops, &[], 0.1), 1) else { return };
    let p = clear_pixels(&splats(&drops, &[], 0.1), 2, 0.4)[0];
    assert!(frame.at("inside", p) > 1.0, "{}", frame.at("inside", p));
}

/// A drop before a pool.
#[test]
fn a_drop_before_a_pool_is_apart() {
    let pool = ellipsoid(Vec3::new(0.0, 0.0, -1.0), Vec3::new(3.0, 3.0, 0.4), Quat::IDENTITY);
    let drop = sphere(Vec3::new(0.2, 0.1, 0.7), 0.3);
    lengths_are_exact("a drop before a pool", &splats(&[pool, drop], &[], 0.1), 2, 2, 1.4, 50);
    lengths_are_exact("the pool beside it", &splats(&[pool, drop], &[], 0.1), 2, 1, 1.4, 500);
}

/// Two slabs with air between, seen straight and at a slant.
#[test]
fn slabs_with_air_between_are_apart() {
    for angle in [0.0, 0.4, 0.9] {
        let turn = Quat::from_rotation_x(angle);
        let slab = |z: f32| ellipsoid(turn * Vec3::Z * z, Vec3::new(2.0, 2.0, 0.2), turn);
        let liquid = splats(&[slab(0.5), slab(-0.5)], &[], 0.1);
        lengths_are_exact(&format!("slabs at {angle}"), &liquid, 2, 2, 1.5, 300);
    }
}

/// Balls of a particle's size, no farther apart than particles are, at points of a surface.
fn skin(points: impl Iterator<Item = Vec3>, radius: f32) -> Splats {
    let balls: Vec<_> = points.map(|at| sphere(at, 1.45 * radius)).collect();
    splats(&balls, &[], radius)
}

/// A ring seen edge-on: its near and its far half.
#[test]
fn a_ring_seen_edge_on_is_apart() {
    let at = |i: u8| Quat::from_rotation_y(f32::from(i) / 60.0 * TAU) * Vec3::X;
    let liquid = skin((0..60).map(at), 0.1);
    lengths_are_exact("ring", &liquid, 2, 2, 1.0, 20);
}

/// A hollow hemisphere that opens towards the eye at a slant: its wall, air, and its wall.
#[test]
fn a_hollow_hemisphere_is_apart() {
    let turn = Quat::from_rotation_x(1.1);
    // A spiral of even density (Vogel 1979).
    let at = |i: u16| {
        let z = f32::from(i) / 900.0;
        let around = f32::from(i) * PI * (3.0 - 5f32.sqrt());
        turn * ((1.0 - z * z).sqrt() * Vec3::new(around.cos(), around.sin(), 0.0) - z * Vec3::Z)
    };
    let liquid = skin((0..900).map(at), 0.06);
    lengths_are_exact("hemisphere", &liquid, 2, 2, 1.0, 100);
}

/// A ray is never absorbed along more liquid than there is: with two intervals the length in a cloud exceeds that
/// of the union in the mean by less than what gaps below a particle's spacing add, and with one it is far longer.
#[test]
fn absorption_needs_liquid() {
    let mut seed = 3;
    let balls: Vec<_> = (0..60).map(|_| sphere(noise_vector(&mut seed), 0.12)).collect();
    let liquid = splats(&balls, &[], 0.08);
    let exact: f64 = pixels().map(|p| length(&intervals(&liquid, p))).sum();
    let longer = |intervals| {
        let frame = draw(&liquid, intervals)?;
        Some(pixels().map(|p| frame.at("inside", p)).sum::<f64>() / exact)
    };
    let (Some(one), Some(two), Some(three)) = (longer(1), longer(2), longer(3)) else { return };
    println!("lengths over those of the union: {one:.3}, {two:.3}, {three:.3}");
    assert!(one > 1.4 && two < 1.25 && three < two + 0.01, "{one}, {two}, {three}");
}

fn pixels() -> impl Iterator<Item = UVec2> {
    (0..SIZE.y).flat_map(|y| (0..SIZE.x).map(move |x| UVec2::new(x, y)))
}

/// Bodies without gaps are drawn the same to the bit, whatever number of intervals is distinguished.
#[test]
fn bodies_without_gaps_are_the_same() {
    let mut seed = 8;
    let body: Vec<_> = (0..40).map(|_| sphere(0.3 * noise_vector(&mut seed), 0.3)).collect();
    let liquid = splats(&body, &[sphere(Vec3::new(0.9, 0.4, 0.0), 0.1)], 0.2);
    let (Some(one), Some(two)) = (draw(&liquid, 1), draw(&liquid, 2)) else { return };
    for channel in ["radiance.R", "inside", "interfaces", "depth.aggregate_front"] {
        assert_eq!(one.channel(channel), two.channel(channel), "{channel}");
    }
}
