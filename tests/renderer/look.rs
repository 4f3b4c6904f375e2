//! Automatic scenes: the view of bodies of every size and shape, the ground below them, and the colour of
//! the liquid.

use glam::{DVec2, DVec3, Mat3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::liquid::Particles;
use limpid::look::{Body, Framing, Look};
use limpid::scene::{Shape, Solid, Surface};

/// Uniform in 0 to 1, from a linear congruential generator (Knuth's MMIX).
fn noise(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*seed >> 11) as f64 / (1u64 << 53) as f64
}

/// Particles in a box, evenly distributed.
fn filled(min: DVec3, max: DVec3, count: usize) -> Vec<DVec3> {
    let mut seed = 5;
    let mut point = || DVec3::from_array([(); 3].map(|()| noise(&mut seed)));
    (0..count).map(|_| min + (max - min) * point()).collect()
}

/// Bodies of liquid as strangers have them, with their particle radius.
fn bodies() -> Vec<(&'static str, Vec<DVec3>, f32)> {
    let tank = |scale: f64, origin: DVec3| -> Vec<DVec3> {
        let block = filled(DVec3::ZERO, DVec3::new(2.0, 0.6, 1.0), 3000);
        block.into_iter().map(|x| origin + scale * x).collect()
    };
    let mut spray = filled(DVec3::splat(-1.0), DVec3::ONE, 900);
    spray.retain(|x| x.length() < 1.0);
    let mut escaped = tank(1.0, DVec3::ZERO);
    escaped.push(DVec3::new(3.0, -400.0, 5.0));
    let river: Vec<_> = filled(DVec3::ZERO, DVec3::new(0.8, 0.15, 12.0), 4000)
        .into_iter()
        .map(|x| x + (0.4 * x.z).sin() * DVec3::X)
        .collect();
    let mut drop = filled(DVec3::splat(-0.5), DVec3::splat(0.5), 2000);
    drop.retain(|x| x.length() < 0.5);
    vec![
        ("spray", spray, 0.02),
        ("sheet", filled(DVec3::ZERO, DVec3::new(3.0, 0.02, 3.0), 3000), 0.02),
        ("upright sheet", filled(DVec3::ZERO, DVec3::new(1.5, 1.0, 0.02), 3000), 0.02),
        ("drop", drop, 0.03),
        ("tank", tank(1.0, DVec3::ZERO), 0.03),
        ("river", river, 0.05),
        ("millimetres", tank(1e-3, DVec3::ZERO), 3e-5),
        ("kilometres", tank(1e3, DVec3::ZERO), 30.0),
        ("one escaped particle", escaped, 0.03),
        ("far from the origin", tank(1.0, DVec3::new(4e5, 300.0, 5.2e6)), 0.03),
    ]
}

/// Positions in a picture of particles with this radius: its extent from edge to edge is −1 to 1.
fn extent(camera: &Camera, size: UVec2, points: &[DVec3], radius: f32) -> (DVec2, DVec2) {
    let view = camera.uniform(size, camera.eye);
    let turn = Mat3::from_cols_array_2d(&view.view_from_world.map(|[x, y, z, _]| [x, y, z]));
    let tangent = view.tangent.as_dvec2();
    let (mut low, mut high) = (DVec2::splat(f64::INFINITY), DVec2::splat(f64::NEG_INFINITY));
    for &point in points {
        let x = turn.as_dmat3() * (point - camera.eye);
        let at = x.truncate() / -x.z / tangent;
        let reach = f64::from(radius) / -x.z / tangent;
        (low, high) = (low.min(at - reach), high.max(at + reach));
    }
    (low, high)
}

/// The automatic camera shows the whole body in the middle of the picture, 25 to 70 % of its width, whatever
/// its size, shape and place; a particle far from all others does not count.
#[test]
fn bodies_fill_half_of_the_picture() {
    for (name, places, radius) in bodies() {
        let particles = Particles::from_places(&places);
        let body = Body::new(&particles, radius).expect("particles");
        let camera = body.camera(Framing::default());
        camera.check().unwrap_or_else(|error| panic!("{name}: {error}"));
        let bulk: Vec<_> = match name {
            "one escaped particle" => places[..places.len() - 1].to_vec(),
            _ => places,
        };
        let (low, high) = extent(&camera, UVec2::new(1024, 768), &bulk, radius);
        assert!(low.min_element() > -0.9 && high.max_element() < 0.9, "{name}: {low} to {high}");
        let width = 0.5 * (high - low).x;
        assert!((0.25..=0.70).contains(&width), "{name}: {width} of the width");
        assert!((low + high).abs().max_element() < 0.1, "{name}: {low} to {high} is off-centre");
    }
}

/// Whatever the picture's shape, the whole body is in its middle and fills most of its width or of its height; with a
/// field of view in which nothing is distorted.
#[test]
fn pictures_of_every_shape_show_the_whole_body() {
    let sizes = [[180, 320], [300, 300], [1920, 1080], [2560, 1080], [4096, 64], [64, 4096]];
    for (name, places, radius) in bodies().into_iter().filter(|(name, ..)| !name.starts_with("one"))
    {
        let body = Body::new(&Particles::from_places(&places), radius).expect("particles");
        for size in sizes.map(UVec2::from) {
            let camera = body.camera(Framing::of(size));
            camera.check().unwrap_or_else(|error| panic!("{name}, {size}: {error}"));
            let (low, high) = extent(&camera, size, &places, radius);
            let filled = (0.5 * (high - low)).max_element();
            assert!((0.55..0.75).contains(&filled), "{name}, {size}: {low} to {high}");
            assert!((low + high).abs().max_element() < 0.1, "{name}, {size}: {low} to {high}");
            let view = camera.uniform(size, camera.eye);
            assert!(
                view.tangent.x <= 0.7201,
                "{name}, {size}: half the width is {}",
                view.tangent.x
            );
        }
    }
}

/// A camera that turns about its target sees the whole body from every side, and begins where it would stand still.
#[test]
fn turning_cameras_cut_nothing_at_any_angle() {
    for (name, places, radius) in bodies().into_iter().filter(|(name, ..)| !name.starts_with("one"))
    {
        let body = Body::new(&Particles::from_places(&places), radius).expect("particles");
        for size in [[1024, 768], [180, 320], [1280, 400]].map(UVec2::from) {
            let camera = body.camera(Framing { all_round: true, ..Framing::of(size) });
            let direction = |camera: &Camera| (camera.eye - camera.target).normalize();
            let still = body.camera(Framing::of(size));
            assert!(direction(&camera).abs_diff_eq(direction(&still), 1e-6), "{name}, {size}");
            let mut widest: f64 = 0.0;
            for degrees in 0..360 {
                let turned = camera.turned(f64::from(degrees).to_radians());
                let (low, high) = extent(&turned, size, &places, radius);
                widest = widest.max(high.max(-low).max_element());
                assert!(
                    low.min_element() > -0.9 && high.max_element() < 0.9,
                    "{name}, {size}, {degrees}: {low} to {high}"
                );
            }
            assert!(widest > 0.5, "{name}, {size}: the body is small, {widest}");
        }
    }
}

/// A camera shows the tank that holds the liquid, with its rim and its floor, but neither a floor beneath the liquid, a
/// room around it, nor what is far away; and the ground lies below all of them that have an end.
#[test]
fn tanks_are_shown_whole_and_rooms_are_not() {
    let size = UVec2::new(1024, 768);
    let water = filled(DVec3::ZERO, DVec3::new(1.0, 0.4, 0.5), 3000);
    let solid = |shape| Solid { shape, surface: Surface::Color(Vec3::ONE), lit: false };
    let of_box =
        |min: [f64; 3], max: [f64; 3]| solid(Shape::Box { min: min.into(), max: max.into() });
    let body = |solids: &[Solid]| {
        Body::new(&Particles::from_places(&water), 0.02).expect("particles").among(solids)
    };
    let alone = body(&[]);
    let tank = of_box([-0.05, -0.1, -0.05], [2.0, 1.2, 0.55]);
    let shown = body(std::slice::from_ref(&tank));
    let corners = tank.shape.corners().expect("a box");
    let (low, high) = extent(&shown.camera(Framing::of(size)), size, &corners, 0.0);
    assert!(low.min_element() > -0.9 && high.max_element() < 0.9, "the tank is at {low} to {high}");
    let (low, high) = extent(&alone.camera(Framing::of(size)), size, &corners, 0.0);
    assert!(low.min_element() < -1.0 || high.max_element() > 1.0, "without it, {low} to {high}");
    assert!(shown.lowest() < -0.1 && shown.lowest() > -0.11, "the ground is at {}", shown.lowest());

    let plane = |half_extent| {
        let origin = DVec3::new(0.5, -0.05, 0.25);
        solid(Shape::Plane { origin, normal: Vec3::Y, half_extent })
    };
    let others = [
        ("a floor", of_box([-0.5, -0.3, -0.5], [1.5, -0.02, 1.0]), -0.3),
        ("a tray without a rim", plane(0.8), -0.05),
        ("an endless plane", plane(f32::INFINITY), alone.lowest()),
        ("a room", of_box([-8.0, -0.1, -8.0], [8.0, 5.0, 8.0]), -0.1),
        ("a distant rock", of_box([30.0, -0.5, 0.0], [31.0, 0.5, 1.0]), -0.5),
    ];
    for (name, solid, lowest) in others {
        let body = body(&[solid]);
        assert_eq!(body.camera(Framing::of(size)), alone.camera(Framing::of(size)), "{name}");
        assert!((body.lowest() - lowest).abs() < 0.01 && body.lowest() <= lowest, "{name}");
    }
}

/// Every look's scene is valid, its ground lies below every particle of the bulk, and a look scales with the
/// body: the same body in millimetres and in kilometres transmits the same share of light.
#[test]
fn looks_scale_with_the_body() {
    for look in Look::ALL {
        let mut tints = Vec::new();
        for (name, places, radius) in bodies() {
            let body = Body::new(&Particles::from_places(&places), radius).expect("particles");
            let scene = look.scene(&body);
            scene.check().unwrap_or_else(|error| panic!("{look:?}, {name}: {error}"));
            let Shape::Plane { origin, normal, .. } = scene.solids[0].shape else {
                panic!("{look:?} has no ground");
            };
            assert_eq!(normal, Vec3::Y);
            let lowest =
                places.iter().filter(|x| x.y > -300.0).fold(f64::INFINITY, |y, x| y.min(x.y));
            assert!(origin.y <= lowest, "{look:?}, {name}: the ground is at {}", origin.y);
            let depth = scene.liquid.absorption * body.thickness() as f32;
            if ["tank", "millimetres", "kilometres"].contains(&name) {
                tints.push(depth);
            }
            if look != Look::Chart {
                assert!(scene.is_lit() && scene.settings.refract.filter_patterns, "{look:?}");
                assert!(matches!(scene.solids[0].surface, Surface::Ground { .. }), "{look:?}");
            }
        }
        let same = tints.iter().all(|tint| tint.abs_diff_eq(tints[0], 1e-3 * tints[0].x));
        // The chart's is that of water, and paint absorbs nothing.
        let scales = ![Look::Chart, Look::Paint].contains(&look);
        assert_eq!(same, scales, "{look:?}: {tints:?}");
    }
}
