//! Rays through several bodies.

use super::{ETA, Light, MIDDLE, SIZE, fresnel, straight, through, wall};
use crate::support::frames::{Ellipsoid, View, ellipsoid, harness, on_axis, sphere, splats};
use glam::{DVec3, Quat, UVec2, Vec3};
use limpid::liquid::classify::Splat;
use limpid::settings::Solver;

/// A ball beside the axis, and the path of the middle pixel's ray through it.
fn ball_beside_the_axis(view: &View, size: UVec2) -> (Splat, Light) {
    let ball = sphere(Vec3::new(0.5, 0.0, 0.0), 1.0);
    let body = Ellipsoid::new(view, &ball);
    let light = through(&body, view.through(size / 2), DVec3::ZERO, |_| DVec3::ZERO).expect("hit");
    (ball, light)
}

/// A ray along the axis of balls in a row crosses the expected number of interfaces and length of liquid,
/// for every order of the classes, with the transmittance T at each interface.
#[test]
fn balls_in_a_row_form_unions_of_intervals() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(8.0, 20.0);
    let ball = |z: f32, radius: f32| sphere(Vec3::Z * z, radius);
    let none: &[_] = &[];
    let cases = [
        ("one ball", &[ball(0.0, 1.0)][..], none, 2, 2.0),
        ("splash before aggregate", &[ball(-1.0, 1.0)], &[ball(1.5, 0.5)], 4, 3.0),
        ("aggregate before splash", &[ball(1.0, 1.0)], &[ball(-1.5, 0.5)], 4, 3.0),
        ("splash inside", &[ball(0.0, 1.0)], &[ball(0.3, 0.5)], 2, 2.0),
        ("splash over the front", &[ball(0.0, 1.0)], &[ball(0.8, 0.5)], 2, 2.3),
        ("splash over the back", &[ball(0.0, 1.0)], &[ball(-0.8, 0.5)], 2, 2.3),
        ("aggregate inside splash", &[ball(0.1, 0.5)], &[ball(0.0, 1.0)], 2, 2.0),
        ("the same ball twice", &[ball(0.0, 1.0)], &[ball(0.0, 1.0)], 2, 2.0),
        ("two aggregates", &[ball(1.5, 0.5), ball(-1.0, 1.0)], none, 4, 3.0),
        ("two splashes", none, &[ball(1.5, 0.5), ball(-1.0, 1.0)], 4, 3.0),
    ];
    // One interval reaches from the nearest front of a class to its farthest back.
    let in_one = [("two aggregates", 2, 4.0), ("two splashes", 2, 4.0)];
    let mut scene = wall(-5.0);
    let modes =
        [(Solver::Guarded, 2), (Solver::March, 2), (Solver::Guarded, 1), (Solver::March, 1)];
    for (solver, intervals) in modes {
        scene.settings.refract.solver = solver;
        scene.settings.layers.intervals = intervals;
        for (name, aggregates, splashes, interfaces, length) in cases {
            let joined = in_one.into_iter().find(|case| case.0 == name && intervals == 1);
            let (_, interfaces, length) = joined.unwrap_or((name, interfaces, length));
            let images = harness.render(&scene, &camera, &splats(aggregates, splashes, 0.1), SIZE);
            images.assert_finite();
            let transmitted = straight().powi(interfaces);
            println!(
                "{solver:?}, {intervals}, {name}: {} interfaces, {} m, {}",
                images.at("interfaces", MIDDLE),
                images.at("inside", MIDDLE),
                images.at("radiance.R", MIDDLE)
            );
            assert_eq!(images.at("interfaces", MIDDLE), f64::from(interfaces), "{name}");
            assert!((images.at("inside", MIDDLE) - length).abs() < 1e-4, "{name}");
            assert!((images.at("radiance.R", MIDDLE) - transmitted).abs() < 1e-4, "{name}");
        }
    }
    assert!((straight() - 0.97994).abs() < 1e-5);
}

/// A ray deviated by 15.8352° in a first drop hits a second drop, which is beside the first in the
/// picture, near its centre, and crosses four interfaces in total, for all combinations of classes.
#[test]
fn second_drops_are_hit_for_all_classes() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(8.0, 40.0);
    let size = UVec2::new(641, 481);
    let view = View::new(&camera, size);
    let (first, light) = ball_beside_the_axis(&view, size);
    let reach = 40.0;
    let second = view.world_point(light.exit + reach * light.out).as_vec3();
    let second = sphere(second, 1.0);
    let mut scene = wall(-100.0);
    scene.settings.refract.internal_bounces = 0;
    let of = |splash: bool, drop| if splash { (vec![], vec![drop]) } else { (vec![drop], vec![]) };
    for (a, b) in [(false, false), (false, true), (true, false), (true, true)] {
        let ((mut aggregates, mut splashes), (more, spray)) = (of(a, first), of(b, second));
        aggregates.extend(more);
        splashes.extend(spray);
        let images = harness.render(&scene, &camera, &splats(&aggregates, &splashes, 0.1), size);
        images.assert_finite();
        let (interfaces, inside) =
            (images.at("interfaces", size / 2), images.at("inside", size / 2));
        println!("splash {a}, then {b}: {interfaces} interfaces, {inside} m");
        assert_eq!(interfaces, 4.0, "splash {a}, then {b}");
        // The normal of the first exit is that of a texel of R/80, so the ray misses the second centre by
        // 0.2.
        assert!((inside - 1.85329 - 2.0).abs() < 0.1, "splash {a}, then {b}: {inside}");
    }
}

/// A ray crosses a long body from side to side. Its sides hold the lines of sight, so that no pixel shows them:
/// they are found, and their normals, by the body's outline in the picture.
#[test]
fn sides_that_no_pixel_shows_are_crossed() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(8.0, 40.0);
    let size = UVec2::new(321, 241);
    let view = View::new(&camera, size);
    let (first, light) = ball_beside_the_axis(&view, size);
    let middle = light.exit + 6.0 * light.out;
    let centre = view.world_point(middle).as_vec3();
    let sight = (centre - Vec3::Z * 8.0).normalize();
    let turn = Quat::from_rotation_arc(Vec3::Z, sight);
    let second = ellipsoid(centre, Vec3::new(0.5, 0.5, 6.0), turn);
    let long = Ellipsoid::new(&view, &second);
    // The closed form of the second chord.
    let entry = light.exit + long.hits(light.exit, light.out).expect("hit")[0] * light.out;
    let n = long.normal(entry);
    let cos_i = -light.out.dot(n);
    let (_, cos_t) = fresnel(cos_i, ETA);
    let within = (light.out / ETA + (cos_i / ETA - cos_t) * n).normalize();
    let chord = long.hits(entry, within).expect("hit")[1];
    let mut scene = wall(-100.0);
    scene.settings.refract.internal_bounces = 0;
    for solver in [Solver::Guarded, Solver::March] {
        scene.settings.refract.solver = solver;
        let images = harness.render(&scene, &camera, &splats(&[first, second], &[], 0.1), size);
        images.assert_finite();
        let interfaces = images.at("interfaces", size / 2);
        let inside = images.at("inside", size / 2) - light.inside;
        println!("{solver:?}: {interfaces} interfaces, {inside} m of {chord} m");
        assert_eq!(interfaces, 4.0, "{solver:?}");
        assert!((inside - chord).abs() < 0.1 * chord, "{solver:?}: {inside} m of {chord} m");
    }
}
