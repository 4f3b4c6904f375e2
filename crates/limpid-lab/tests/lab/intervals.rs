//! Intervals of liquid along straight rays, found by occupancy on the device, by peeling on the CPU, and not at
//! all: how far each is from the true surface. With `--nocapture` and `LIMPID_REFERENCE` it prints the
//! reference scenes' table.

use glam::{DVec3, UVec2};
use limpid::camera::Camera;
use limpid::liquid::classify::{Splat, Splats};
use limpid::scene::Scene;
use limpid_io::input::Input;
use limpid_lab::reference::mesh::{Mesh, Reconstruction};
use limpid_lab::reference::trace::intervals;
use rayon::prelude::*;

use crate::support::frames::{Ellipsoid, Harness, View, harness};

const SIZE: UVec2 = UVec2::new(160, 120);

/// As in `shaders/gaps/`: scale of the ellipsoids among which gaps are searched, and the shortest gap between
/// them in particle radii.
const CLOSING: f64 = 1.3;
const SHORTEST: f64 = 1.0;

/// Total length of intervals.
fn length(intervals: &[[f64; 2]]) -> f64 {
    intervals.iter().map(|[enter, leave]| leave - enter).sum()
}

/// Depths along a ray at which it is in ellipsoids scaled by `scale`; those less than `gap` apart are joined.
fn union(near: &[&Splat], view: &View, d: DVec3, scale: f32, gap: f64) -> Vec<[f64; 2]> {
    let scaled = |splat: &Splat| {
        let [diagonal, off_diagonal] =
            [splat.diagonal, splat.off_diagonal].map(|v| v.map(|x| scale * x));
        Ellipsoid::new(view, &Splat { diagonal, off_diagonal, ..*splat })
    };
    let mut hits: Vec<_> = near.iter().filter_map(|s| scaled(s).hits(DVec3::ZERO, d)).collect();
    hits.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut union: Vec<[f64; 2]> = Vec::new();
    for hit in hits {
        match union.last_mut() {
            Some(last) if hit[0] - last[1] <= gap => last[1] = last[1].max(hit[1]),
            _ => union.push(hit),
        }
    }
    union
}

/// The first two intervals by peeling: gaps are searched among swollen ellipsoids, as the device does, but exactly
/// along the pixel's own ray; each interval then reaches from its first front to its last back.
fn peeled(near: &[&Splat], view: &View, d: DVec3, radius: f64) -> Vec<[f64; 2]> {
    let bodies = union(near, view, d, CLOSING as f32, SHORTEST * radius);
    let parts = union(near, view, d, 1.0, 0.0);
    let mut found: Vec<[f64; 2]> = bodies
        .iter()
        .filter_map(|body| {
            let within = |part: &&[f64; 2]| part[1] > body[0] && part[0] < body[1];
            let (first, last) = (parts.iter().find(within)?, parts.iter().rev().find(within)?);
            Some([first[0], last[1]])
        })
        .collect();
    if let Some(last) = found.last().copied().filter(|_| found.len() > 2) {
        found.truncate(2);
        found[1][1] = last[1];
    }
    found
}

/// Mean errors of the length of straight rays in liquid, in particle radii, over the pixels of several true
/// intervals and over those of one: of one interval a pixel, of occupancy, and of peeling.
fn errors(
    harness: &mut Harness,
    scene: &Scene,
    camera: &Camera,
    splats: &Splats,
    mesh: &Mesh,
) -> [[f64; 3]; 2] {
    let mut scene = scene.clone();
    scene.liquid.ior = 1.0003;
    scene.solids.clear();
    scene.lights.clear();
    let mut lengths = |intervals: u32| {
        scene.settings.layers.intervals = intervals;
        let frame = harness.render(&scene, camera, splats, SIZE);
        frame.channel("inside").iter().map(|&l| f64::from(l)).collect::<Vec<_>>()
    };
    let (one, two) = (lengths(1), lengths(2));
    let view = View::new(camera, SIZE);
    let radius = f64::from(splats.radius);
    let all: Vec<&Splat> = splats.aggregates.iter().chain(&splats.splashes).collect();
    let truths = intervals(mesh, camera, SIZE);
    let found: Vec<_> = (0..SIZE.element_product())
        .into_par_iter()
        .map(|i| {
            let d = view.through(UVec2::new(i % SIZE.x, i / SIZE.x)).normalize();
            let near: Vec<_> = (all.iter().copied())
                .filter(|s| {
                    let body = Ellipsoid::new(&view, s);
                    let beside = (body.centre - body.centre.dot(d) * d).length();
                    beside <= CLOSING * 3.0 * radius
                })
                .collect();
            let peeled = peeled(&near, &view, d, radius);
            let i = i as usize;
            let exact = length(&truths[i]);
            let errors = [one[i], two[i], length(&peeled)].map(|l| (l - exact).abs() / radius);
            (truths[i].len(), errors)
        })
        .collect();
    [true, false].map(|several| {
        let chosen = found.iter().filter(|(n, _)| if several { *n > 1 } else { *n == 1 });
        let count = chosen.clone().count().max(1) as f64;
        [0, 1, 2].map(|k| chosen.clone().map(|(_, errors)| errors[k]).sum::<f64>() / count)
    })
}

fn measured(harness: &mut Harness, scene: &str) -> [[f64; 3]; 2] {
    let (input, project) = Input::open(scene).and_then(Input::resolve).expect("a scene");
    let frame = &input.sequence.frames[0];
    let frame = (input.frame)
        .and_then(|number| input.sequence.frames.iter().find(|f| f.number == number))
        .unwrap_or(frame);
    let particles = input.particles(frame).expect("particles");
    let loaded = input.prepare(frame, &particles, &project.scene).expect("splats");
    let how = Reconstruction::among(&project.scene.solids);
    let mesh = Mesh::reconstruct(&particles.positions, loaded.splats.radius, &how).expect("a mesh");
    let camera = project.camera_for(loaded.bulk.bounds);
    let errors = errors(harness, &project.scene, &camera, &loaded.splats, &mesh);
    let [several, one] = errors.map(|e| e.map(|e| format!("{e:.2}")).join(" | "));
    println!("| {scene} | {several} | {one} |");
    errors
}

/// Occupancy is worth nearly what peeling is: where there are several true intervals, it halves the error of the
/// length at least, and elsewhere it costs nothing.
#[test]
fn occupancy_finds_what_peeling_finds() {
    let Some(mut harness) = harness() else { return };
    println!("| scene | one interval | occupancy | peeling | one interval | occupancy | peeling |");
    let demo = concat!(env!("CARGO_MANIFEST_DIR"), "/../../sims/demo.toml");
    let [several, one] = measured(&mut harness, demo);
    assert!(several[1] < 0.5 * several[0], "{several:?}");
    assert!(several[1] < 1.3 * several[2], "{several:?}");
    assert!(one[1] < 1.05 * one[0], "{one:?}");
    let Ok(folder) = std::env::var("LIMPID_REFERENCE") else { return };
    for name in ["double_dam_break_front", "double_dam_break_low", "knot"] {
        measured(&mut harness, &format!("{folder}/scenes/{name}.toml"));
    }
}
