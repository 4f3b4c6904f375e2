//! Solids: wet, lit by the sky through liquid, and seen.

use std::f64::consts::PI;

use limpid::environment::EvenLight;
use limpid::glam::{DVec2, DVec3, UVec3, Vec3};
use limpid_lab::reference::Liquid;
use limpid_lab::reference::analytic::Block;
use limpid_lab::reference::mesh::{Mesh, Reconstruction};
use limpid_lab::reference::optics::transmittance;
use limpid_lab::reference::surroundings::Surroundings;

use super::{Random, WATER, ray, scene, seen_down};
use crate::even_light::even_light;

/// A solid in the liquid ends the ray after the path to it, through one interface, with radiance
/// scaled by the squared index.
#[test]
fn a_wet_floor_is_seen_through_one_interface() {
    let text = "[liquid]\nior = 1.33\nabsorption = [1.0, 0.5, 0.0]\n[environment]\n\
        radiance = [0.0, 0.0, 0.0]\n[[solid]]\nshape = \"plane\"\norigin = [0.0, -0.4, 0.0]\n\
        half_extent = 100.0\ncolor = [1.0, 1.0, 1.0]";
    let r = (0.33f64 / 2.33).powi(2);
    let expected = transmittance(DVec3::new(1.0, 0.5, 0.0), 0.4) * (1.0 - r) / (WATER * WATER);
    // The bottom of the liquid on the floor, and below it.
    for bottom in [-0.4, -0.9] {
        let (low, high) = (DVec3::new(-9.0, bottom, -9.0), DVec3::new(9.0, 0.0, 9.0));
        let found = seen_down(&Block { min: low, max: high }, &scene(text));
        assert!((found - expected).length() < 2e-3, "{bottom}: {found} {expected}");
    }
}

/// Ambient light of the sky on wet solids: reflected at the surface and absorbed on its way down,
/// as in the closed form, with or without walls around; unattenuated without liquid.
#[test]
fn ambient_light_is_attenuated_with_depth() {
    let absorption = DVec3::new(1.0, 0.3, 0.0);
    let text = |depth: f64| {
        format!(
            "[liquid]\nior = 1.33\nabsorption = [1.0, 0.3, 0.0]\n[environment]\n\
             radiance = [0.5, 0.5, 0.5]\n[[solid]]\nshape = \"plane\"\norigin = [0.0, -{depth:?}, 0.0]\n\
             half_extent = 100.0\ncolor = [0.8, 0.8, 0.8]\nlit = true\n"
        )
    };
    let r = (0.33f64 / 2.33).powi(2);
    for depth in [0.2, 1.0, 4.0] {
        let (low, high) = (DVec3::new(-90.0, -depth, -90.0), DVec3::new(90.0, 0.0, 90.0));
        let sea = Block { min: low, max: high };
        let down = transmittance(absorption, depth);
        let floor = 0.4 * even_light(WATER, absorption, depth);
        let expected = (1.0 - r) / (WATER * WATER) * down * floor + r * 0.5;
        let found = seen_down(&sea, &scene(&text(depth)));
        let off = ((found - expected) / expected).abs().max_element();
        println!("{depth} m: {found}, by the closed form {expected}: off by {off:.4}");
        assert!(off < 0.004, "{depth}: {found} {expected}");

        // A shaft of the same depth with black walls, which occlude no ambient light, as in the
        // air.
        let wall = |min: [f64; 3], max: [f64; 3]| {
            format!(
                "[[solid]]\nshape = \"box\"\nmin = {min:?}\nmax = {max:?}\ncolor = [0.0, 0.0, 0.0]\n"
            )
        };
        let shaft = text(depth)
            + &wall([-0.6, -5.0, -0.5], [-0.5, 0.0, 0.5])
            + &wall([0.5, -5.0, -0.5], [0.6, 0.0, 0.5])
            + &wall([-0.6, -5.0, -0.6], [0.6, 0.0, -0.5])
            + &wall([-0.6, -5.0, 0.5], [0.6, 0.0, 0.6]);
        let (low, high) = (DVec3::new(-0.5, -depth, -0.5), DVec3::new(0.5, 0.0, 0.5));
        let in_shaft = seen_down(&Block { min: low, max: high }, &scene(&shaft));
        assert!(((in_shaft - found) / found).abs().max_element() < 1e-6, "{in_shaft} {found}");
    }
    let air = Block { min: DVec3::splat(50.0), max: DVec3::splat(51.0) };
    assert!((seen_down(&air, &scene(&text(1.0))) - 0.5 * 0.8).length() < 1e-7);
}

/// The renderer's two paths for ambient light agree with the closed form within the tolerance of
/// `EvenLight`, from the surface down to where nothing is left.
#[test]
fn two_paths_approximate_the_whole_sky() {
    for ior in [1.2_f32, 1.333, 1.5, 2.0, 3.0] {
        let EvenLight { shares, paths } = EvenLight::below(ior);
        for (depth, tolerance) in [(0.0, 1e-5), (0.1, 1e-3), (0.5, 1e-3), (2.0, 1e-3), (8.0, 3e-3)]
        {
            let path = |i: usize| f64::from(shares[i]) * (-depth * f64::from(paths[i])).exp();
            let expected = even_light(ior.into(), DVec3::ONE, depth).x;
            let off = (path(0) + path(1)) / expected - 1.0;
            assert!(
                off.abs() < tolerance,
                "index {ior}, {depth} absorption lengths: off by {off:e}"
            );
        }
    }
}

/// Liquid among solids wets all solids that it touches, in any order, for either direction of a
/// plane's normal and however thin a box is, and never protrudes behind a box.
#[test]
fn all_touched_solids_are_wet() {
    let scene = scene(
        "[[solid]]\nshape = \"plane\"\norigin = [0.0, 0.3, 0.5]\nnormal = [1.0, 0.0, 0.0]\n\
        [[solid]]\nshape = \"plane\"\norigin = [0.0, 0.0, 0.0]\n\
        [[solid]]\nshape = \"plane\"\norigin = [1.0, 0.3, 0.5]\nnormal = [1.0, 0.0, 0.0]\n\
        half_extent = 2.0\n\
        [[solid]]\nshape = \"box\"\nmin = [-1.0, 0.0, -0.5]\nmax = [2.0, 2.0, 0.0]\n\
        [[solid]]\nshape = \"box\"\nmin = [-1.0, 0.0, 1.0]\nmax = [2.0, 2.0, 1.001]\n\
        [[solid]]\nshape = \"sphere\"\ncenter = [0.5, 0.1, 0.5]\nradius = 0.2",
    );
    let (radius, ball) = (0.05, Vec3::new(0.5, 0.1, 0.5));
    // Centres at least a radius away from all solids.
    let lattice = (0..10 * 7 * 10).map(|i| {
        let place = UVec3::new(i % 10, i / 100, i / 10 % 10).as_vec3();
        2.0 * radius * (place + 0.5)
    });
    let particles: Vec<Vec3> = lattice.filter(|x| x.distance(ball) >= 0.2 + radius).collect();
    let how = Reconstruction::among(&scene.solids);
    let mesh = Mesh::reconstruct(&particles, radius, &how).unwrap();
    let surroundings = Surroundings::new(&scene);
    // Up to the solid, or beyond it by no more than coordinates are rounded.
    let touches = |hit: f64, crossing: f64| hit <= crossing + 1e-6 * (1.0 + crossing);
    let mut random = Random(5);
    let mut met = [0; 6];
    for i in 0..3000 {
        let mut on = || random.range(0.15, 0.85);
        let low = 0.1 + 0.4 * on();
        let (a, b) = (on(), on());
        let (origin, to, behind) = match i % 5 {
            0 => (DVec3::new(0.5, low, 0.5), DVec3::new(0.0, low, b), DVec3::NEG_X),
            1 => (DVec3::new(a, 0.5, b), DVec3::new(a, 0.0, b), DVec3::NEG_Y),
            2 => (DVec3::new(0.5, low, 0.5), DVec3::new(1.0, low, b), DVec3::X),
            3 => (DVec3::new(0.5, low, 0.5), DVec3::new(a, low, 0.0), DVec3::NEG_Z),
            _ => (DVec3::new(0.5, low, 0.5), DVec3::new(a, low, 1.0), DVec3::Z),
        };
        // From the liquid to the solid, except where the ball leaves less room than a particle
        // needs.
        let narrow = i % 5 == 1 && (0.12..0.4).contains(&DVec2::new(a - 0.5, b - 0.5).length());
        if mesh.contains(origin) && !narrow {
            let inwards = ray(origin, to - origin);
            let hit = surroundings.hit(&inwards).expect("a solid");
            met[hit.solid] += 1;
            let crossing = mesh.crossing(&inwards, true);
            let wet = crossing.is_none_or(|c| touches(hit.t, c.t));
            assert!(wet, "gap before solid {}: {inwards:?} {crossing:?}", hit.solid);
        }
        // And from behind a box; a plane is the face of a thick solid.
        if i % 5 < 3 {
            continue;
        }
        let outwards = ray(to + 0.6 * behind, -behind);
        let hit = surroundings.hit(&outwards).expect("a solid");
        let crossing = mesh.crossing(&outwards, false);
        let hidden = crossing.is_none_or(|c| touches(hit.t, c.t));
        assert!(hidden, "liquid behind solid {}: {outwards:?} {crossing:?}", hit.solid);
    }
    assert!(met.iter().all(|&count| count > 40), "{met:?}");
}

/// Solids and lights: the nearest solid is visible, in its colour, under Lambert's law.
#[test]
fn surroundings_match_the_scene() {
    let surroundings = Surroundings::new(&scene(
        "[environment]\nradiance = [0.1, 0.2, 0.3]\n\
        [[light]]\nsun = { direction = [0.0, -2.0, 0.0], irradiance = [3.0, 3.0, 3.0] }\n\
        [[light]]\npoint = { position = [0.0, 4.0, 0.0], intensity = [8.0, 0.0, 0.0] }\n\
        [[solid]]\nshape = \"plane\"\norigin = [0.0, 0.0, 0.0]\nhalf_extent = 6.0\n\
        color = [0.5, 0.5, 1.0]\nlit = true\n\
        [[solid]]\nshape = \"box\"\nmin = [2.0, -1.0, -1.0]\nmax = [4.0, 1.0, 1.0]\n\
        checker = { tile = 0.5, even = [1.0, 1.0, 1.0], odd = [0.0, 0.0, 0.0] }\n\
        [[solid]]\nshape = \"sphere\"\ncenter = [-4.0, 1.0, 0.0]\nradius = 1.0\n\
        color = [0.7, 0.6, 0.5]",
    ));
    let down = |x: f64| ray(DVec3::new(x, 2.0, 0.1), DVec3::NEG_Y);
    let floor = surroundings.radiance(&ray(DVec3::Y, DVec3::NEG_Y));
    let expected = DVec3::new(0.5, 0.5, 1.0)
        * (DVec3::new(0.1, 0.2, 0.3) + (DVec3::splat(3.0) + 0.5 * DVec3::X) / PI);
    assert!((floor - expected).length() < 1e-6, "{floor} {expected}");
    assert_eq!(surroundings.hit(&down(3.2)).map(|h| (h.t, h.solid)), Some((1.0, 1)));
    assert_eq!(surroundings.radiance(&down(3.2)), DVec3::ONE);
    assert_eq!(surroundings.radiance(&down(3.7)), DVec3::ZERO);
    let sphere = surroundings.radiance(&ray(DVec3::new(-4.0, 5.0, 0.0), DVec3::NEG_Y));
    assert!((sphere - DVec3::new(0.7, 0.6, 0.5)).length() < 1e-6);
    assert!((surroundings.radiance(&down(9.0)) - DVec3::new(0.1, 0.2, 0.3)).length() < 1e-6);
}
