//! Automatic scenes: the view of bodies of every size and shape, the ground below them, and the colour of
//! the liquid.

use glam::{DVec2, DVec3, Mat3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::liquid::Particles;
use limpid::look::{Body, Look};
use limpid::scene::{Shape, Surface};

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

/// Positions in a picture of 4:3 of particles with this radius: their extent from edge to edge is −1 to 1.
fn extent(camera: &Camera, points: &[DVec3], radius: f32) -> (DVec2, DVec2) {
    let view = camera.uniform(UVec2::new(1024, 768), camera.eye);
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
        let camera = body.camera();
        camera.check().unwrap_or_else(|error| panic!("{name}: {error}"));
        let bulk: Vec<_> = match name {
            "one escaped particle" => places[..places.len() - 1].to_vec(),
            _ => places,
        };
        let (low, high) = extent(&camera, &bulk, radius);
        assert!(low.min_element() > -0.9 && high.max_element() < 0.9, "{name}: {low} to {high}");
        let width = 0.5 * (high - low).x;
        assert!((0.25..=0.70).contains(&width), "{name}: {width} of the width");
        assert!((low + high).abs().max_element() < 0.1, "{name}: {low} to {high} is off-centre");
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
        assert_eq!(same, look != Look::Chart, "{look:?}: {tints:?}");
    }
}
