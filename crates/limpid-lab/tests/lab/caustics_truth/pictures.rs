//! Pictures of lit scenes, traced in 64 bits, against closed forms.

use std::f64::consts::PI;
use std::path::Path;

use limpid::camera::Camera;
use limpid::glam::{DVec2, DVec3, UVec2, Vec3};
use limpid_io::project::Project;
use limpid_lab::reference::analytic::{Ball, Block, Pool};
use limpid_lab::reference::caustics::{CausticMap, beams};
use limpid_lab::reference::optics::{fresnel, transmittance};
use limpid_lab::reference::trace::{MAX_DEPTH, trace, trace_lit};
use limpid_lab::reference::{Liquid, Ray};
use limpid_sim::recipe::Recipe;

use super::*;

fn looking(eye: DVec3, target: DVec3, up: Vec3) -> Camera {
    Camera { eye, target, up, fov_y: 40.0, near: None, lens: None }
}

const SUN: &str = "[environment]\nradiance = [0.1, 0.2, 0.3]\n[[light]]\n\
    sun = { direction = [1.0, -2.0, 0.0], irradiance = [3.0, 2.0, 1.0] }\n";

/// Exact shadows: in a picture from above the shadow of a box ends at its closed form.
#[test]
fn shadows_have_their_closed_form() {
    let scene = clear(&format!(
        "{SUN}{FLOOR}color = [0.5, 0.5, 1.0]\nlit = true\n\
         [[solid]]\nshape = \"box\"\nmin = [-0.5, -0.4, -0.3]\nmax = [0.1, 0.2, 0.5]\n\
         color = [0.0, 0.0, 0.0]"
    ));
    let size = UVec2::new(120, 90);
    let camera = looking(9.0 * DVec3::Y, DVec3::ZERO, Vec3::NEG_Z);
    let none = Ball { center: 500.0 * DVec3::Y, radius: 1.0 };
    let picture = trace(&none, &scene, &camera, size, 1, MAX_DEPTH);
    let color = DVec3::new(0.5, 0.5, 1.0);
    let ambient = color * DVec3::new(0.1, 0.2, 0.3);
    let lit = ambient + color * POWER * (2.0 / 5f64.sqrt()) / PI;
    let mut shadowed = 0;
    for (i, &found) in picture.pixels.iter().enumerate() {
        let u = DVec2::new((i % 120) as f64, (i / 120) as f64) + 0.5;
        let ndc = (2.0 * u / size.as_dvec2() - 1.0) * DVec2::new(4.0 / 3.0, 1.0);
        let slope = ndc * 20f64.to_radians().tan();
        let (on_floor, on_top) = (10.0 * slope, 8.8 * slope);
        let covered =
            |at: DVec2, low: f64, high: f64| at.x > low && at.x < high && at.y > -0.3 && at.y < 0.5;
        // The box's sides are visible too, around its top.
        if found == DVec3::ZERO {
            assert!(covered(on_top, -0.5, 0.1) || covered(9.4 * slope, -0.5, 0.1));
            continue;
        }
        // Light that passes the box's lower left edge, and its upper right one.
        let expected = if covered(on_floor, -0.5 + 0.3, 0.1 + 0.6) { ambient } else { lit };
        shadowed += u32::from(expected == ambient);
        assert!(close(found, expected, 1e-6), "{u}: {found} {expected}");
    }
    assert!(shadowed > 50, "{shadowed}");
}

/// Without caustics light passes straight through a plate by T² exp(−σ l) and into water by T
/// exp(−σ l); with caustics a wet floor has the light of the map.
#[test]
fn liquid_transmits_light_to_lit_solids() {
    let scene = scene(&format!(
        "[liquid]\nior = 1.33\nabsorption = [1.0, 0.5, 0.1]\n{}{FLOOR}color = [0.5, 0.5, 0.5]\n\
         lit = true\n",
        SUN.replace("[0.1, 0.2, 0.3]", "[0.0, 0.0, 0.0]")
    ));
    let (ior, absorption) = (f64::from(scene.liquid.ior), scene.liquid.absorption.as_dvec3());
    let cos = 2.0 / 5f64.sqrt();
    let t = 1.0 - fresnel(cos, ior);
    let low = looking(DVec3::new(0.0, -0.8, 0.0), DVec3::new(0.0, -1.0, 0.0), Vec3::X);
    let seen = |liquid: &Block, maps: &[Option<Vec<CausticMap>>]| {
        trace_lit(liquid, &scene, &low, UVec2::ONE, 1, MAX_DEPTH, maps).pixels[0]
    };
    let full = POWER * (0.5 * cos / PI);
    let wide = |bottom: f64| Block {
        min: DVec3::new(-50.0, bottom, -50.0),
        max: DVec3::new(50.0, 0.0, 50.0),
    };
    let above = seen(&wide(-0.5), &[]);
    let expected = full * t * t * transmittance(absorption, 0.5 / cos);
    assert!(close(above, expected, 1e-7), "{above} {expected}");
    let within = seen(&wide(-1.0), &[]);
    let eye = transmittance(absorption, 0.2);
    let expected = full * t * eye * transmittance(absorption, 1.0 / cos);
    assert!(close(within, expected, 1e-6), "{within} {expected}");

    let light = scene.lights[0];
    let view = light_view(&light, -DVec3::ONE, DVec3::new(1.0, 0.0, 1.0), &scene, 32);
    let inner = (1.0 - (1.0 - cos * cos) / (ior * ior)).sqrt();
    let map = beams(&wide(-1.0), &scene, &light, &view, 1, 1);
    let within = seen(&wide(-1.0), &[Some(vec![map])]);
    let expected = full * t * eye * transmittance(absorption, 1.0 / inner);
    assert!(close(within, expected, 1e-6), "{within} {expected}");
    let map = beams(&wide(-0.5), &scene, &light, &view, 2, 1);
    let above = seen(&wide(-0.5), &[Some(vec![map])]);
    let expected = full * t * t * transmittance(absorption, 0.5 / inner);
    assert!(close(above, expected, 1e-6), "{above} {expected}");
    // Next to the liquid the sun is unchanged, with or without a map.
    let beside = Block { min: DVec3::new(0.6, -1.0, -1.0), max: DVec3::new(1.0, 0.0, 1.0) };
    let map = beams(&beside, &scene, &light, &view, 1, 1);
    for maps in [&[][..], &[Some(vec![map])]] {
        assert!(close(seen(&beside, maps), full, 1e-6));
    }
}

/// The shortcut for steep rays through waves: downwards into the water and upwards out of it they
/// cross at the height of the waves, with the normal there, and never twice.
#[test]
fn steep_rays_cross_waves_once() {
    let pool = Pool {
        waves: waves(0.1),
        min: DVec2::splat(-5.0),
        max: DVec2::splat(5.0),
        bottom: f64::NEG_INFINITY,
    };
    let bound = pool.waves.bound();
    for i in 0..2000 {
        let unit = |step: f64| (0.5 + f64::from(i) * step).fract() - 0.5;
        let at = DVec2::new(8.0 * unit(0.618_034), 8.0 * unit(0.414_214));
        let side = DVec2::new(unit(0.732_051), unit(0.236_068));
        let up = i % 2 == 0;
        let direction = DVec3::new(side.x, if up { 1.0 } else { -1.0 }, side.y).normalize();
        // From far away and from among the waves.
        let off = if i % 3 == 0 { 0.3 * bound } else { 40.0 };
        let surface = pool.waves.height(at);
        let origin = DVec3::new(at.x, surface, at.y) - off * direction;
        if pool.contains(origin) != up && off < 1.0 {
            continue;
        }
        let ray = Ray { origin, direction };
        let crossing = pool.crossing(&ray, up).unwrap();
        let x = ray.at(crossing.t);
        if crossing.normal.y == 0.0 {
            let side = x.abs();
            assert!((side.x.max(side.z) - 5.0).abs() < 1e-12);
            continue;
        }
        assert!((crossing.t - off).abs() < 1e-10, "{i}: {} {off}", crossing.t);
        let slope = pool.waves.slope(at);
        let normal = DVec3::new(-slope.x, 1.0, -slope.y).normalize();
        assert!((crossing.normal - normal).length() < 1e-8);
        let beyond = Ray { origin: x, direction };
        assert!(pool.crossing(&beyond, !up).is_none_or(|c| c.normal.y == 0.0), "{i}");
    }
}

/// A recipe's `time` moves its waves, and a negative one is rejected.
#[test]
fn pools_move_with_time() {
    let text = "[recipe]\nkind = \"pool\"\nhalf_extent = [2.0, 2.0]\ndepth = 1.0\nhull = 0.2\n\
        count = 1000\nwaves = { count = 9, wavelengths = [0.3, 1.0], rms_slope = 0.1, seed = 1 }\n";
    let surface = |text: &str| match project(text).source.recipe() {
        Some(Recipe::Pool(pool)) => pool.surface(),
        _ => unreachable!(),
    };
    let still = surface(text);
    assert_eq!(surface(&format!("{text}time = 0.0\n")), still);
    let later = surface(&format!("{text}time = 1.5\n"));
    assert_eq!(later, still.at(1.5));
    assert!((later.height(DVec2::ONE) - still.height(DVec2::ONE)).abs() > 1e-4);
    let error = Project::parse(&format!("{text}time = -1.0\n"), "t", Path::new(""));
    assert!(error.unwrap_err().to_string().contains("time"));
}
