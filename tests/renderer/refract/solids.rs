//! Solids in and behind the liquid, and the background beside it.

use super::{ETA, MIDDLE, SIZE, above, at_the_slab, slab_over_floor, straight};
use crate::support::frames::{
    FrameImages, ellipsoid, glowing, harness, on_axis, scene, sphere, splats,
};
use glam::{DVec3, IVec2, Quat, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::scene::{Shape, Solid, Surface};
use limpid::settings::{Reflections, Solids, Solver};

/// Liquid near a solid wets it: there is no interface, and the ray ends on the solid without the radiance
/// scaling of an exit. Without contact there is a film of air.
#[test]
fn contact_wets_solids() {
    let Some(mut harness) = harness() else { return };
    let (r, half) = (0.05f32, 0.2f32);
    let gap = 1.5 * r;
    let pool = ellipsoid(Vec3::Y * (gap + half), Vec3::new(2.0, half, 2.0), Quat::IDENTITY);
    let camera = Camera {
        eye: DVec3::Y * 3.0,
        target: DVec3::ZERO,
        up: Vec3::NEG_Z,
        fov_y: 20.0,
        near: None,
        lens: None,
    };
    let sky = 0.3;
    let mut scene = scene();
    scene.environment = Environment::Constant(Vec3::splat(sky));
    scene.liquid.absorption = Vec3::new(2.0, 0.5, 0.0);
    scene.settings.refract.reflections = Reflections::Environment;
    let floor = Shape::Plane { origin: DVec3::ZERO, normal: Vec3::Y, half_extent: f32::INFINITY };
    scene.solids = vec![glowing(floor, Vec3::ONE)];
    let (f, t) = (1.0 - straight(), straight());
    let sky = f64::from(sky);
    for contact in [2.0, 1.0, 0.0] {
        scene.settings.refract.contact = contact;
        let images = harness.render(&scene, &camera, &splats(&[pool], &[], r), SIZE);
        for (i, color) in ["R", "G", "B"].into_iter().enumerate() {
            let sigma = f64::from(scene.liquid.absorption[i]);
            let absorbed = |length: f32| (-sigma * f64::from(length)).exp();
            let expected = if contact > 1.5 {
                f * sky + t / (ETA * ETA) * absorbed(2.0 * half + gap)
            } else {
                f * sky + t * absorbed(2.0 * half) * (f * sky + t)
            };
            let found = images.at(&format!("radiance.{color}"), MIDDLE);
            println!("contact {contact}, {color}: {found} of {expected}");
            assert!((found - expected).abs() < 1e-4, "contact {contact}: {found} not {expected}");
        }
        let inside = if contact > 1.5 { 2.0 * half + gap } else { 2.0 * half };
        assert!((images.at("inside", MIDDLE) - f64::from(inside)).abs() < 1e-4);
        // Nor does a ray fail that ends on a solid in the liquid.
        assert_eq!(images.at("failures", MIDDLE), 0.0);
    }
}

/// A solid hides the liquid behind it, and a submerged solid ends the ray.
#[test]
fn solids_hide_liquid_and_end_rays() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(8.0, 20.0);
    let ball = splats(&[sphere(Vec3::ZERO, 1.0)], &[], 0.1);
    let color = Vec3::new(0.2, 0.4, 0.6);
    let mut scene = scene();
    scene.liquid.absorption = Vec3::new(1.0, 0.3, 0.01);
    let before = Shape::Sphere { center: DVec3::Z * 3.0, radius: 0.3 };
    let cube = Shape::Box { min: DVec3::splat(-0.2), max: DVec3::splat(0.2) };
    for solver in [Solver::Guarded, Solver::March] {
        scene.settings.refract.solver = solver;
        scene.solids = vec![glowing(before.clone(), color)];
        let images = harness.render(&scene, &camera, &ball, SIZE);
        images.assert_finite();
        assert_eq!(images.radiance(MIDDLE), color.as_dvec3());
        assert_eq!(images.at("interfaces", MIDDLE), 0.0);
        assert!(images.at("interfaces", MIDDLE + UVec2::new(25, 0)) > 0.0);

        scene.solids = vec![glowing(cube.clone(), color)];
        let images = harness.render(&scene, &camera, &ball, SIZE);
        images.assert_finite();
        let f = 1.0 - straight();
        let sigma = scene.liquid.absorption.as_dvec3();
        let absorbed = DVec3::from_array((-0.8 * sigma).to_array().map(f64::exp));
        let expected = f + (1.0 - f) / (ETA * ETA) * absorbed * color.as_dvec3();
        let found = images.radiance(MIDDLE);
        println!("{solver:?}: submerged {found} of {expected}");
        assert!((found - expected).abs().max_element() < 1e-4, "{found}, not {expected}");
        assert_eq!(images.at("interfaces", MIDDLE), 1.0);
        assert!((images.at("inside", MIDDLE) - 0.8).abs() < 1e-4);
        assert_eq!(images.at("failures", MIDDLE), 0.0);
    }
}

/// Edges in the background are antialiased even with one sample per pixel, also in tiles that liquid
/// partly covers.
#[test]
fn background_edges_are_antialiased() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, _) = slab_over_floor();
    let camera = at_the_slab()[1];
    let none = splats(&[], &[], 0.01);
    scene.settings.refract.samples = 16;
    scene.settings.refract.edge_samples = 1;
    let fine = harness.render(&scene, &camera, &none, SIZE * 4);
    let mean = |p: UVec2| {
        let within = (0..16).map(|k| 4 * p + UVec2::new(k % 4, k / 4));
        within.map(|q| fine.radiance(q).x).sum::<f64>() / 16.0
    };
    scene.settings.refract.samples = 1;
    let [hard, smooth] = [1, 16].map(|edge_samples| {
        scene.settings.refract.edge_samples = edge_samples;
        harness.render(&scene, &camera, &none, SIZE)
    });
    let off = |images: &FrameImages| {
        images.pixels().map(|p| (images.radiance(p).x - mean(p)).abs()).sum::<f64>()
    };
    println!("off the mean: {:.1} without, {:.1} with edge samples", off(&hard), off(&smooth));
    assert!(off(&smooth) < 0.15 * off(&hard));

    let ball = harness.render(&scene, &camera, &splats(&[sphere(Vec3::ZERO, 0.3)], &[], 0.1), SIZE);
    let liquid = |p: &UVec2| ball.at("interfaces", *p) > 0.0;
    assert!(ball.pixels().filter(liquid).count() > 100);
    for p in ball.pixels().filter(|p| !liquid(p)) {
        assert_eq!(ball.radiance(p), smooth.radiance(p), "at {p}");
    }
}

/// Further rays go where the picture has structure, and nowhere else: there the picture stays that of one ray, to the
/// bit, and where its second difference exceeds the setting it becomes the mean of all.
#[test]
fn further_rays_go_where_the_picture_has_structure() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, _) = slab_over_floor();
    let camera = at_the_slab()[1];
    let ball = splats(&[sphere(Vec3::ZERO, 0.3)], &[], 0.1);
    // The background around the liquid is the same with any number of rays.
    scene.settings.refract.edge_samples = 16;
    let mut draw = |samples: u32, structure: f32| {
        (scene.settings.refract.samples, scene.settings.refract.structure) = (samples, structure);
        harness.render(&scene, &camera, &ball, SIZE)
    };
    let [one, all] = [draw(1, 0.1), draw(16, 0.0)];
    let at = |p: IVec2| one.radiance(p.clamp(IVec2::ZERO, SIZE.as_ivec2() - 1).as_uvec2());
    // The least share at which a pixel has no structure.
    let structure = |p: UVec2| {
        let p = p.as_ivec2();
        let middle = at(p);
        let bend = |step| (at(p - step) + at(p + step) - 2.0 * middle).abs().max_element();
        let most = [IVec2::ZERO, IVec2::X, IVec2::Y, IVec2::NEG_X, IVec2::NEG_Y]
            .map(|step| at(p + step).max_element());
        bend(IVec2::X).max(bend(IVec2::Y)) / most.into_iter().fold(0.0, f64::max)
    };
    for threshold in [0.1f32, 0.4] {
        let some = draw(16, threshold);
        let (mut kept, mut changed, mut off, mut off_one) = (0, 0, 0.0, 0.0);
        for p in some.pixels().filter(|&p| some.at("interfaces", p) > 0.0) {
            let share = structure(p) / f64::from(threshold);
            let same = some.radiance(p) == one.radiance(p);
            assert!(same || share > 0.999, "{p} has further rays with a share of {share}");
            kept += usize::from(same);
            if share > 1.001 {
                changed += usize::from(!same);
                off += (some.radiance(p) - all.radiance(p)).length();
                off_one += (one.radiance(p) - all.radiance(p)).length();
            }
        }
        println!(
            "{threshold}: {kept} kept, {changed} changed, off {off:.2} instead of {off_one:.2}"
        );
        assert!(kept > 100 && changed > 50 && off < 0.35 * off_one, "{kept} {changed}");
    }
}

/// Solids from the G-buffer match the exact ones within a texel: every pixel equals itself or a neighbour
/// with exact solids. Tiles are several texels wide up to the horizon.
#[test]
fn screen_solids_match_exact_solids() {
    let Some(mut harness) = harness() else { return };
    let mut scene = scene();
    scene.solids = vec![Solid {
        shape: Shape::Plane { origin: DVec3::NEG_Y * 0.8, normal: Vec3::Y, half_extent: 2.0 },
        surface: Surface::Checker { tile: 0.5, even: Vec3::ONE, odd: Vec3::splat(0.2) },
        lit: false,
    }];
    scene.settings.refract.contact = 0.0;
    scene.settings.refract.internal_bounces = 0;
    // A lens: a ball would compress half of the scene into its outermost pixels.
    let lens = ellipsoid(Vec3::Y * 0.1, Vec3::new(0.9, 0.15, 0.9), Quat::IDENTITY);
    let drawn = splats(&[lens], &[], 0.06);
    let exact = harness.render(&scene, &above(), &drawn, SIZE);
    scene.settings.refract.solids = Solids::Screen;
    let screen = harness.render(&scene, &above(), &drawn, SIZE);
    screen.assert_finite();
    let off = |p: UVec2, q: UVec2| (screen.radiance(p) - exact.radiance(q)).abs().max_element();
    let around = |p: UVec2| {
        let row = move |y| (p.x - 1..=p.x + 1).map(move |x| UVec2::new(x, y));
        (p.y - 1..=p.y + 1).flat_map(row)
    };
    let liquid: Vec<_> = exact.pixels().filter(|&p| exact.at("interfaces", p) > 0.0).collect();
    let unlike = liquid.iter().filter(|&&p| around(p).all(|q| off(p, q) > 0.05)).count();
    let equal = liquid.iter().filter(|&&p| off(p, p) < 0.01).count();
    println!("of {}: {equal} equal, {unlike} unlike any neighbour", liquid.len());
    assert!(liquid.len() > 3000 && unlike * 100 < liquid.len() && equal * 10 > liquid.len() * 9);
    // Pixels beside the liquid do not change.
    let beside = exact.pixels().filter(|&p| exact.at("interfaces", p) == 0.0);
    let changed = beside.filter(|&p| off(p, p) > 1e-6).count();
    println!("{changed} pixels of the background changed");
    assert!(changed * 200 < (SIZE.x * SIZE.y) as usize, "{changed}");
}
