//! Splatted layers against the same ellipsoids in 64 bits: depth, normal and coverage.

use glam::{DVec3, Quat, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::frame::FrameInput;
use limpid::liquid::classify::Splat;
use limpid::offscreen::Picture;

use crate::support::frames::{
    Ellipsoid, FrameImages, View, ellipsoid, harness, mean_difference, noise, noise_turn,
    noise_vector, on_axis, scene, sphere, splats,
};

const SIZE: UVec2 = UVec2::new(160, 120);

/// One layer's texel.
struct Texel {
    depth: f64,
    normal: DVec3,
    /// |n·v|, which is small at the rim.
    cosine: f64,
}

/// Texel of the layer of all splats in 64 bits, and whether rounding decides its coverage.
fn truth(view: &View, bodies: &[Ellipsoid], p: UVec2, back: bool) -> (Option<Texel>, bool) {
    let omega = view.through(p);
    let mut nearest: Option<(f64, DVec3)> = None;
    let mut on_a_rim = false;
    for body in bodies {
        // A thousandth of a pixel; beyond 300 radii, rounding of the camera rotation displaces the
        // outline by more.
        let in_radii = body.centre.length() / body.radius;
        on_a_rim |= rim_distance(view, body, p) < 1e-3f64.max(3e-6 * in_radii);
        let Some([front, end]) = body.hits(DVec3::ZERO, omega) else { continue };
        on_a_rim |= (end - view.near).abs() < 1e-5 * view.near;
        if end < view.near {
            continue;
        }
        let z = if back { end } else { front };
        let hit = if z < view.near { (view.near, DVec3::Z) } else { (z, body.normal(z * omega)) };
        if nearest.is_none_or(|(z, _)| if back { hit.0 > z } else { hit.0 < z }) {
            nearest = Some(hit);
        }
    }
    let texel = nearest.map(|(depth, normal)| Texel {
        depth,
        normal,
        cosine: normal.dot(omega.normalize()).abs(),
    });
    (texel, on_a_rim)
}

/// Distance in pixels from the centre of p to a nearby ellipsoid outline.
fn rim_distance(view: &View, body: &Ellipsoid, p: UVec2) -> f64 {
    const STEP: f64 = 1e-4;
    let u = p.as_dvec2() + 0.5;
    let at = |x: f64, y: f64| {
        let omega = view.omega(u + glam::DVec2::new(x, y));
        body.discriminant(DVec3::ZERO, omega)
    };
    let slope = glam::DVec2::new(at(STEP, 0.0) - at(-STEP, 0.0), at(0.0, STEP) - at(0.0, -STEP));
    at(0.0, 0.0).abs() / (slope.length() / (2.0 * STEP)).max(1e-30)
}

/// Largest errors of the layers of one class. Errors near the rim, where n·v < 0.3, are separate: there
/// the root of a small discriminant amplifies rounding in any arithmetic.
#[derive(Default, Debug)]
struct Errors {
    /// Number of compared texels.
    texels: usize,
    /// Relative error of depth.
    depth: f64,
    rim_depth: f64,
    /// Error of the unit normal.
    normal: f64,
    rim_normal: f64,
    /// Error of back minus front, m.
    thickness: f64,
    rim_thickness: f64,
}

fn errors(shot: &FrameImages, camera: &Camera, class: &str, drawn: &[Splat]) -> Errors {
    shot.assert_finite();
    let view = View::new(camera, shot.size);
    let bodies: Vec<_> = drawn.iter().map(|splat| Ellipsoid::new(&view, splat)).collect();
    let mut errors = Errors::default();
    for p in shot.pixels() {
        let mut thickness = 0.0;
        let mut cosine = 1f64;
        for back in [false, true] {
            let name = format!("{class}_{}", if back { "back" } else { "front" });
            let depth = shot.at(&format!("depth.{name}"), p);
            let normal = shot.normal(&format!("normal.{name}"), p);
            let (expected, on_a_rim) = truth(&view, &bodies, p, back);
            let expected = match expected {
                Some(texel) if depth > 0.0 => texel,
                None if depth == 0.0 => {
                    assert_eq!(normal, DVec3::ZERO, "the empty texel {p} has a normal");
                    continue;
                }
                _ => {
                    assert!(on_a_rim, "{name} at {p}: covered is {}, wrongly", depth > 0.0);
                    continue;
                }
            };
            if on_a_rim {
                continue;
            }
            let off = depth - expected.depth;
            let turned = (normal - expected.normal).length();
            let at_rim = expected.cosine < 0.3;
            let (worst_depth, worst_normal) = match at_rim {
                true => (&mut errors.rim_depth, &mut errors.rim_normal),
                false => (&mut errors.depth, &mut errors.normal),
            };
            *worst_depth = worst_depth.max(off.abs() / expected.depth);
            *worst_normal = worst_normal.max(turned);
            thickness += if back { off } else { -off };
            cosine = cosine.min(expected.cosine);
            errors.texels += 1;
        }
        let worst = if cosine < 0.3 { &mut errors.rim_thickness } else { &mut errors.thickness };
        *worst = worst.max(thickness.abs());
    }
    errors
}

fn askew() -> Camera {
    let eye = DVec3::new(1.2, -0.7, 2.5);
    let target = DVec3::new(0.1, 0.2, -0.3);
    Camera { eye, target, up: Vec3::new(0.3, 1.0, 0.2), fov_y: 30.0, near: None, lens: None }
}

/// Every covered pixel has the exact front and back root in an oblique view. Depth is accurate to 1e-6 in
/// 32-bit floats; normals lose accuracy towards the rim in proportion to the cosine.
#[test]
fn sphere_and_ellipsoid_match_their_rays() {
    let Some(mut harness) = harness() else { return };
    let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.5, 1.1, -0.4);
    let centre = Vec3::new(0.1, 0.25, -0.3);
    let shapes = [
        (sphere(Vec3::new(0.15, 0.1, -0.2), 0.5), 1e-5),
        (ellipsoid(centre, Vec3::new(0.2, 0.4, 0.8), turn), 3e-5),
        // A disc: along its edge the normal changes by 1e-4 within 1e-6 m.
        (ellipsoid(centre, Vec3::new(0.05, 0.7, 0.7), turn), 1e-3),
    ];
    for (splat, tolerance) in shapes {
        let drawn = [splat];
        let shot = harness.render(&scene(), &askew(), &splats(&drawn, &[], 0.1), SIZE);
        let errors = errors(&shot, &askew(), "aggregate", &drawn);
        println!("{errors:?}");
        assert!(errors.texels > 4000, "{errors:?}");
        assert!(
            errors.depth < 2e-6 && errors.normal < tolerance && errors.rim_depth < 1e-5,
            "{errors:?}"
        );
    }
}

/// At the silhouette the normal is perpendicular to the ray: not NaN, and not turned towards the eye by
/// amplified rounding.
#[test]
fn silhouette_normals_are_perpendicular_to_the_ray() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(5.0, 20.0);
    let view = View::new(&camera, SIZE);
    let radius = 0.05;
    let depths = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
    let touched = |i: usize| UVec2::new(20 + 25 * i as u32, 60);
    let drawn: Vec<_> = depths
        .iter()
        .enumerate()
        .map(|(i, depth)| {
            // Displaced from the pixel's ray so that the ray enters by `depth` of the radius.
            let omega = view.through(touched(i));
            let side = omega.cross(DVec3::X).normalize();
            let centre = 5.0 * omega + side * f64::from(radius) * (1.0 - depth);
            sphere(view.world_point(centre).as_vec3(), radius)
        })
        .collect();
    let shot = harness.render(&scene(), &camera, &splats(&drawn, &[], radius), SIZE);
    shot.assert_finite();
    for (i, depth) in depths.iter().enumerate() {
        let ray = view.through(touched(i)).normalize();
        for (side, sign) in [("front", -1.0), ("back", 1.0)] {
            let normal = shot.normal(&format!("normal.aggregate_{side}"), touched(i));
            if normal == DVec3::ZERO {
                assert!(*depth < 1e-5, "{side} misses a chord of {depth}");
                continue;
            }
            // √(2 depth) for the sphere, plus the minimum cosine of a plane, 1e-3.
            let cosine = sign * normal.dot(ray);
            assert!((0.0..=(2.0 * depth).sqrt() * 1.2 + 1e-3).contains(&cosine), "{cosine}");
        }
    }
}

/// Distant ellipsoids keep their precision: the naive discriminant loses half of the thickness at a
/// distance of 1e3 radii, and all of it at 1e4. The remaining error is the rounding of the camera
/// rotation, which displaces the whole ellipsoid, and at 1e4 the last digit of depth.
#[test]
fn distant_splats_keep_their_precision() {
    let Some(mut harness) = harness() else { return };
    for (distance, tolerance) in [(1e3, 3e-4), (1e4, 5e-3)] {
        let camera = Camera {
            eye: DVec3::new(0.6, 0.0, 0.8) * distance,
            target: DVec3::ZERO,
            up: Vec3::Y,
            fov_y: (2.4 / distance).to_degrees() as f32,
            near: None,
            lens: None,
        };
        for drawn in [
            [sphere(Vec3::new(0.1, -0.1, 0.0), 1.0)],
            [ellipsoid(Vec3::ZERO, Vec3::new(0.3, 0.6, 1.2), Quat::from_rotation_z(0.7))],
        ] {
            let shot = harness.render(&scene(), &camera, &splats(&drawn, &[], 1.0), SIZE);
            let errors = errors(&shot, &camera, "aggregate", &drawn);
            println!("{distance}: {errors:?}");
            assert!(errors.texels > 2000 && errors.thickness < tolerance, "{errors:?}");
            assert!(errors.normal < 10.0 * tolerance, "{errors:?}");
        }
    }
}

/// Coverage is exact for any ellipsoid: small, long, cut by the picture's border or the near plane, or
/// around the eye. `errors` fails for any wrong pixel farther than 1e-3 pixels from an outline.
#[test]
fn coverage_is_exact_for_any_ellipsoid() {
    let Some(mut harness) = harness() else { return };
    let mut seed = 7;
    for i in 0..40 {
        let camera = Camera {
            eye: DVec3::ZERO,
            target: noise_vector(&mut seed).as_dvec3(),
            up: noise_vector(&mut seed),
            fov_y: [20.0, 60.0, 100.0, 140.0][i % 4],
            near: Some(0.05),
            lens: None,
        };
        let view = View::new(&camera, SIZE);
        // From the picture's centre to beyond its borders, and from around the eye to far away.
        let depth = 4.0 * noise(&mut seed);
        let sideways = 1.3 * noise_vector(&mut seed).as_dvec3();
        let place = DVec3::new(sideways.x * view.tangent.x, sideways.y * view.tangent.y, -1.0);
        let centre = view.world_point(place * f64::from(depth)).as_vec3();
        let axes = Vec3::from_array([(); 3].map(|()| (4.0 * noise(&mut seed) - 3.5).exp()));
        let drawn = [ellipsoid(centre, axes, noise_turn(&mut seed))];
        let shot = harness.render(&scene(), &camera, &splats(&drawn, &[], 0.1), SIZE);
        let errors = errors(&shot, &camera, "aggregate", &drawn);
        println!("{i} at {depth} of {axes}: {errors:?}");
        assert!(errors.depth < 1e-5 && errors.rim_depth < 1e-4, "{i}: {errors:?}");
    }
}

/// Of overlapping splats, the nearest front and the farthest back remain.
#[test]
fn nearest_fronts_and_farthest_backs_remain() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(6.0, 30.0);
    let pair = [sphere(Vec3::ZERO, 0.8), sphere(Vec3::new(0.5, 0.2, -0.7), 0.8)];
    let mut seed = 3;
    let cloud: Vec<_> = (0..60)
        .map(|_| {
            let axes = 0.25 + 0.2 * noise_vector(&mut seed);
            ellipsoid(1.2 * noise_vector(&mut seed), axes, noise_turn(&mut seed))
        })
        .collect();
    for drawn in [&pair[..], &cloud] {
        let shot = harness.render(&scene(), &camera, &splats(drawn, &[], 0.1), SIZE);
        let found = errors(&shot, &camera, "aggregate", drawn);
        println!("{found:?}");
        assert!(found.depth < 1e-5 && found.normal < 3e-4, "{found:?}");
        // In any order.
        let turned: Vec<_> = drawn.iter().rev().copied().collect();
        let again = harness.render(&scene(), &camera, &splats(&turned, &[], 0.1), SIZE);
        for name in ["depth.aggregate_front", "depth.aggregate_back"] {
            assert_eq!(shot.channel(name), again.channel(name));
        }
    }
}

/// For an eye in the liquid, the front is a mark at the near plane, and the back is the ellipsoid's. If
/// the near plane cuts the surface, both kinds of front occur at their pixels.
#[test]
fn rays_of_an_eye_in_the_liquid_start_at_the_near_plane() {
    let Some(mut harness) = harness() else { return };
    let turn = Quat::from_rotation_y(0.6);
    let drawn = [ellipsoid(Vec3::ZERO, Vec3::new(0.5, 1.0, 2.0), turn)];
    let looking = |eye: Vec3, along: Vec3, near: f32| Camera {
        eye: eye.as_dvec3(),
        target: (eye + along).as_dvec3(),
        up: Vec3::Y,
        fov_y: 70.0,
        near: Some(near),
        lens: None,
    };
    for eye in [Vec3::ZERO, Vec3::new(0.2, -0.3, 0.4)] {
        let camera = looking(eye, Vec3::new(0.3, 0.2, -1.0), 0.01);
        let shot = harness.render(&scene(), &camera, &splats(&drawn, &[], 0.1), SIZE);
        let errors = errors(&shot, &camera, "aggregate", &drawn);
        assert!(errors.depth < 2e-6 && errors.normal < 3e-5, "{errors:?}");
        assert!(shot.channel("depth.aggregate_front").iter().all(|&z| z == 0.01));
    }
    // The eye in front of the long axis' tip, the near plane behind the tip: pixels of both kinds.
    let tip = turn * Vec3::Z * 2.0;
    let camera = looking(1.1 * tip, -tip, 0.25);
    let shot = harness.render(&scene(), &camera, &splats(&drawn, &[], 0.1), SIZE);
    let errors = errors(&shot, &camera, "aggregate", &drawn);
    let fronts = shot.channel("depth.aggregate_front");
    let started = fronts.iter().filter(|&&z| z == 0.25).count();
    let entered = fronts.iter().filter(|&&z| z > 0.25).count();
    println!("{errors:?}, {started} start inside, {entered} enter");
    // The depths are a tenth of the ellipsoid's length, so their relative precision is a digit less.
    assert!(errors.depth < 1e-5 && errors.normal < 1e-4, "{errors:?}");
    assert!(errors.rim_depth < 2e-4, "{errors:?}");
    assert!(started > 500 && entered > 500, "{started} start inside, {entered} enter");
}

/// An eye outside of the liquid stays outside, however low it is and however far the target: a pool 1 cm
/// below an eye whose target is 100 m away looks as with a near plane of 1 mm, while the default near
/// plane of 10 cm would put the eye in the pool. The default still applies bit by bit if the eye is in
/// the liquid, also in a gap between particles, and if no liquid is near.
#[test]
fn low_eye_with_a_far_target_is_outside_of_the_pool() {
    let Some(mut harness) = harness() else { return };
    let spacing = 0.02;
    let pool = (0..4).flat_map(|y| (0..40).flat_map(move |x| (0..50).map(move |z| (x, y, z))));
    let pool: Vec<_> = pool
        .map(|(x, y, z)| Vec3::new(x as f32 - 19.5, -y as f32 - 0.5, -z as f32) * spacing)
        .collect();
    let drawn = |axis: f32| -> Vec<_> {
        pool.iter().map(|&at| Splat { radius: 0.5 * spacing, ..sphere(at, axis) }).collect()
    };
    let (full, touching) = (drawn(0.9 * spacing), drawn(0.5 * spacing));
    let top = 0.4 * f64::from(spacing);
    let eye_at = |eye: DVec3| Camera {
        eye,
        target: eye - 100.0 * DVec3::Z,
        up: Vec3::Y,
        fov_y: 60.0,
        near: None,
        lens: None,
    };
    let mut shot = |camera: Camera, near: Option<f32>, drawn: &[Splat]| {
        let camera = Camera { near, ..camera };
        harness.render(&scene(), &camera, &splats(drawn, &[], 0.5 * spacing), SIZE)
    };
    let low = eye_at(DVec3::new(0.0, top + 0.01, -0.3));
    let [found, expected, cut] = [None, Some(1e-3), Some(0.1)].map(|near| shot(low, near, &full));
    let error = mean_difference(&found, &expected);
    println!(
        "off by {error:e}; {} with a near plane in the pool",
        mean_difference(&cut, &expected)
    );
    assert!(error < 1e-3, "off by {error:e}");
    assert!(mean_difference(&cut, &expected) > 0.02, "the near plane has no effect");

    let inside = DVec3::new(0.0, -0.04, -0.31);
    for (what, eye, drawn) in [
        ("in the pool", inside, &full),
        ("in a gap", inside, &touching),
        ("high up", DVec3::new(0.0, 0.3, 0.2), &full),
    ] {
        let [found, expected] = [None, Some(0.1)].map(|near| shot(eye_at(eye), near, drawn));
        assert_eq!(found.picture, expected.picture, "{what}");
    }
}

/// Splats behind the eye, however large or close, and splats beside the picture are not drawn.
#[test]
fn nothing_behind_the_eye_is_drawn() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(0.0, 60.0);
    let camera = Camera { target: -DVec3::Z, near: Some(0.1), ..camera };
    let behind = [
        sphere(Vec3::Z * 5.0, 1.0),
        sphere(Vec3::Z * 1.001, 1.0),
        sphere(Vec3::Z * 0.95, 1.0), // in front of the eye, not of the near plane
        sphere(Vec3::Z * 1000.0, 999.9),
        ellipsoid(Vec3::Z, Vec3::new(30.0, 30.0, 0.9), Quat::IDENTITY),
        sphere(Vec3::new(40.0, 0.0, -5.0), 1.0),
    ];
    for splat in behind {
        let shot = harness.render(&scene(), &camera, &splats(&[splat], &[splat], 0.1), SIZE);
        shot.assert_finite();
        for name in ["aggregate_front", "aggregate_back", "splash_front", "splash_back"] {
            assert!(shot.channel(&format!("depth.{name}")).iter().all(|&z| z == 0.0), "{splat:?}");
        }
    }
}

/// A frame without liquid equals the background bit by bit, at any size.
#[test]
fn no_particles_leave_the_background() {
    let Some(mut harness) = harness() else { return };
    let mut scene = scene();
    let sky = Vec3::new(0.25, 0.5, 0.75);
    scene.environment = limpid::environment::Environment::Constant(sky);
    for size in [SIZE, UVec2::ONE, UVec2::new(17, 13), UVec2::new(1, 40)] {
        let shot = harness.render(&scene, &on_axis(3.0, 40.0), &splats(&[], &[], 0.1), size);
        shot.assert_finite();
        for name in ["depth.aggregate_front", "depth.aggregate_back", "interfaces", "inside"] {
            assert!(shot.channel(name).iter().all(|&v| v == 0.0), "{name}");
        }
        assert!(shot.pixels().all(|p| shot.radiance(p) == sky.as_dvec3()));
        assert!(!shot.has("depth.splash_front"), "a splash layer without splashes");
        // sRGB of 0.25, 0.5, 0.75.
        assert!(shot.picture.pixels().all(|p| p.0 == [137, 188, 225, 255]));
    }
}

/// Picture sizes need not be multiples of the tile size.
#[test]
fn odd_sizes_are_drawn_to_their_borders() {
    let Some(mut harness) = harness() else { return };
    let drawn = [sphere(Vec3::new(0.2, 0.1, 0.0), 1.0)];
    for size in [UVec2::ONE, UVec2::new(17, 13), UVec2::new(3, 50), UVec2::new(161, 9)] {
        let camera = on_axis(3.0, 45.0);
        let shot = harness.render(&scene(), &camera, &splats(&drawn, &[], 0.1), size);
        let errors = errors(&shot, &camera, "aggregate", &drawn);
        assert!(errors.texels > 0 && errors.depth < 2e-6, "{size}: {errors:?}");
        // Exactly the covered pixels have interfaces.
        let interfaces = shot.channel("interfaces");
        let fronts = shot.channel("depth.aggregate_front");
        assert!(interfaces.iter().zip(fronts).all(|(&n, &z)| (n > 0.0) == (z > 0.0)), "{size}");
    }
}

/// Each class has its own layers: neither hides the other, and splash layers are absent without splashes.
#[test]
fn splashes_and_aggregates_have_separate_layers() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(6.0, 30.0);
    let aggregates = [sphere(Vec3::new(-0.2, 0.0, -1.0), 0.8)];
    let splashes = [sphere(Vec3::new(0.3, 0.1, 1.0), 0.4), sphere(Vec3::new(0.8, 0.6, 0.5), 0.2)];
    let both = harness.render(&scene(), &camera, &splats(&aggregates, &splashes, 0.1), SIZE);
    for (class, drawn) in [("aggregate", &aggregates[..]), ("splash", &splashes)] {
        let errors = errors(&both, &camera, class, drawn);
        assert!(errors.texels > 1000 && errors.depth < 2e-6 && errors.normal < 5e-5, "{errors:?}");
    }
    let one = harness.render(&scene(), &camera, &splats(&aggregates, &[], 0.1), SIZE);
    assert!(!one.has("depth.splash_front") && !one.has("normal.splash_back.X"));
    assert!(harness.renderer.images().splash.is_none());
    assert_eq!(one.channel("depth.aggregate_front"), both.channel("depth.aggregate_front"));
}

/// All scales at which 32-bit floats represent squared areas give the same picture; other scales are
/// refused instead of drawn without the liquid.
#[test]
fn extreme_scales_are_drawn_or_refused() {
    let Some(mut harness) = harness() else { return };
    let mut seed = 5;
    let body: Vec<_> = (0..40)
        .map(|_| (0.5 * noise_vector(&mut seed), Vec3::splat(0.2), noise_turn(&mut seed)))
        .collect();
    // The product of radius and distance is the square of the scale.
    let scaled = |scale: f32| {
        let drawn: Vec<_> = body
            .iter()
            .map(|&(at, axes, turn)| ellipsoid(scale * at, scale * axes, turn))
            .collect();
        (on_axis(5.0 * scale, 30.0), splats(&drawn, &[], 0.2 * scale))
    };
    let mut refused = |scale: f32| {
        let (camera, splats) = scaled(scale);
        let frame = Picture::new(&harness.gpu, SIZE).unwrap();
        let scene = scene();
        harness.renderer.render(FrameInput::new(&scene, &camera, &splats, SIZE), &frame).err()
    };
    for scale in [3e9, 3e-10] {
        let error = refused(scale).expect("the scale is refused").to_string();
        assert!(error.contains("unit of length"), "{error}");
    }
    let mut picture = |scale: f32| {
        let (camera, splats) = scaled(scale);
        harness.render(&scene(), &camera, &splats, SIZE)
    };
    let one = picture(1.0);
    for scale in [0.9e9, 1e4, 1e-4, 1.1e-9] {
        let error = mean_difference(&one, &picture(scale));
        assert!(error < 2e-3, "at {scale}: {error}");
    }
}
