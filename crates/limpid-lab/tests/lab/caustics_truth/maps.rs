//! Maps of irradiance against closed forms and against independent methods.

mod layers;
mod solids;

use std::f64::consts::{PI, TAU};

use limpid::glam::{DVec2, DVec3, Vec3};
use limpid::scene::{Light, Scene};
use limpid_lab::reference::analytic::Ball;
use limpid_lab::reference::caustics::{
    CausticMap, Spot, beams, beams_with_error, on_solids, photons,
};
use limpid_lab::reference::optics::{fresnel, refract, transmittance};
use limpid_lab::reference::{Crossing, Liquid, Ray};
use limpid_sim::waves::Waves;

use super::*;

/// Under flat water the irradiance is that of the sun times the interface's transmittance, the
/// cosine and the absorption, everywhere; and light at 35.264 degrees from the vertical continues
/// at 25.728.
#[test]
fn flat_water_gives_uniform_irradiance() {
    let absorption = DVec3::new(0.8, 0.3, 0.0);
    let text = "[liquid]\nior = 1.33\nabsorption = [0.8, 0.3, 0.0]\n";
    let scene = scene(&format!("{text}{FLOOR}"));
    let liquid = water(Waves::default());
    // Settings are in 32 bits.
    let ior = f64::from(scene.liquid.ior);
    let absorption_read = scene.liquid.absorption.as_dvec3();
    assert!((absorption_read - absorption).length() < 1e-6);

    let map = beams(&liquid, &scene, &sun(DVec3::NEG_Y), &overhead(0.5, 16), 1, 3);
    check_accounts(&map);
    let t = 1.0 - fresnel(1.0, ior);
    let expected = t * POWER * transmittance(absorption_read, 1.0);
    for &found in &map.irradiance {
        assert!(close(found, expected, 1e-9), "{found} {expected}");
    }

    let light = sun(OBLIQUE);
    let view = light_view(&light, DVec3::splat(-1.0), DVec3::new(1.0, 0.0, 1.0), &scene, 40);
    let map = beams(&liquid, &scene, &light, &view, 1, 2);
    check_accounts(&map);
    let Light::Sun { direction, .. } = light else { unreachable!() };
    let cos = -direction.as_dvec3().normalize().y;
    let inner = (1.0 - (1.0 - cos * cos) / (ior * ior)).sqrt();
    assert!((inner.acos().to_degrees() - 25.728).abs() < 2e-3);
    let t = 1.0 - fresnel(cos, ior);
    let expected = t * cos * POWER * transmittance(absorption_read, 1.0 / inner);
    // Light lands short of where it would without refraction, along the picture's rows.
    let short = (cos.acos().tan() - inner.acos().tan()) * cos;
    let short = short * f64::from(view.size.y) / (2.0 * view.half_extent.y);
    for x in 2..view.size.x - 2 {
        let column = (0..view.size.y).map(|y| map.irradiance[texel(&map, x, y)]);
        let lit = column.clone().filter(|&e| close(e, expected, 1e-6)).count() as f64;
        assert!((lit - (f64::from(view.size.y) - short).floor()).abs() <= 1.0, "{lit} {short}");
        let sum: f64 = column.map(|e| e.y / expected.y).sum();
        assert!((sum - (f64::from(view.size.y) - short)).abs() < 1e-5, "{sum} {short}");
    }
}

/// Energy conservation under waves with folds: the light that interfaces and water transmit,
/// computed independently, all arrives.
#[test]
fn waves_conserve_light() {
    let text = "[liquid]\nior = 1.33\nabsorption = [0.8, 0.3, 0.0]\n";
    let scene = scene(&format!("{text}{}", FLOOR.replace("-1.0", "-4.0")));
    let liquid = water(waves(0.15));
    let (half, size) = (2.0, 40);
    let view = overhead(half, size);
    let map = beams(&liquid, &scene, &sun(DVec3::NEG_Y), &view, 1, 1);
    check_accounts(&map);
    let flux = map.flux;
    assert_eq!((flux.hidden, flux.missed, flux.reflected), (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO));
    assert!((flux.sent - POWER * 16.0).length() < 1e-9);
    assert!(flux.received.x > 0.8 * flux.transmitted.x, "most stays in the frame: {flux:?}");
    assert!(map.irradiance.iter().any(|e| e.z > 2.0), "it focuses");

    let mut expected = DVec3::ZERO;
    let ior = f64::from(scene.liquid.ior);
    let cell = 2.0 * half / f64::from(size);
    for j in 0..=size {
        for i in 0..=size {
            let at = DVec2::new(f64::from(i), f64::from(j)) * cell - half;
            let slope = liquid.waves.slope(at);
            let normal = DVec3::new(-slope.x, 1.0, -slope.y).normalize();
            let down = refract(DVec3::NEG_Y, normal, ior).unwrap();
            let length = (liquid.waves.height(at) + 4.0) / -down.y;
            // Each vertex has a third of its triangles.
            let (left, right) = (i > 0, i < size);
            let (above, below) = (j > 0, j < size);
            let triangles = u8::from(right && below)
                + u8::from(left && above)
                + 2 * u8::from(left && below)
                + 2 * u8::from(right && above);
            let t = 1.0 - fresnel(normal.y, ior);
            let share = f64::from(triangles) / 6.0 * cell * cell * t;
            expected += share * transmittance(scene.liquid.absorption.as_dvec3(), length) * POWER;
        }
    }
    assert!(close(flux.transmitted, expected, 1e-7), "{} {expected}", flux.transmitted);
}

/// A flat surface that refracts vertical light to a point `focus` below the origin.
struct Lens {
    focus: f64,
    ior: f64,
}

impl Liquid for Lens {
    fn crossing(&self, ray: &Ray, inside: bool) -> Option<Crossing> {
        let t = -ray.origin.y / ray.direction.y;
        if inside || t <= 0.0 {
            return None;
        }
        let x = ray.at(t);
        let towards = (DVec3::new(0.0, -self.focus, 0.0) - x).normalize();
        // Snell's law for the normal: the change of the ray's vector by refraction is along it.
        let shading = (DVec3::NEG_Y - self.ior * towards).normalize();
        Some(Crossing { t, normal: DVec3::Y, shading })
    }

    fn contains(&self, point: DVec3) -> bool {
        point.y < 0.0
    }
}

/// Focusing: a surface that refracts linearly, x' = x (1 − d/F), gives 1/(1 − d/F)² before and
/// beyond its focus, where all triangles are flipped; and at the focus all of the light.
#[test]
fn a_linear_lens_focuses_by_its_square() {
    let focus = 8.0;
    let view = overhead(0.5, 24);
    for depth in [2.0, 4.0, 12.0, 16.0, 22.0] {
        let scene = clear(&FLOOR.replace("-1.0", &format!("-{depth:.1}")));
        let lens = Lens { focus, ior: scene.liquid.ior.into() };
        let map = beams(&lens, &scene, &sun(DVec3::NEG_Y), &view, 1, 3);
        check_accounts(&map);
        let scale = 1.0 - depth / focus;
        for (i, &found) in map.irradiance.iter().enumerate() {
            let u = DVec2::new((i % 24) as f64 + 0.5, (i / 24) as f64 + 0.5);
            let landed = u / 24.0 - 0.5;
            let source = landed / scale;
            // Whole texels only.
            if (landed.abs() + 0.5 / 24.0).max_element() > 0.5 * scale.abs() {
                continue;
            }
            let ray = Ray { origin: DVec3::new(source.x, 1.0, source.y), direction: DVec3::NEG_Y };
            let cos = lens.crossing(&ray, false).unwrap().shading.y;
            let expected = POWER * (1.0 - fresnel(cos, lens.ior)) / (scale * scale);
            assert!(close(found, expected, 3e-5), "{depth} {u}: {found} {expected}");
        }
    }
    let scene = clear(&FLOOR.replace("-1.0", "-8.0"));
    let lens = Lens { focus, ior: scene.liquid.ior.into() };
    let map = beams(&lens, &scene, &sun(DVec3::NEG_Y), &view, 1, 2);
    check_accounts(&map);
    let lit = map.irradiance.iter().filter(|e| e.x > 1e-9 * map.flux.received.x).count();
    assert!(lit <= 4 && close(map.flux.received, map.flux.transmitted, 1e-12), "{lit}");
}

/// Paths that leave the liquid: a ball's light is what both interfaces and the chords transmit;
/// near the axis it converges at the paraxial focus, n R / (2 (n − 1)) from the centre.
#[test]
fn a_ball_focuses_paraxially() {
    let text = "[liquid]\nior = 1.33\nabsorption = [1.0, 0.5, 0.0]\n";
    let at = |distance: f64| {
        scene(&format!("{text}{}", FLOOR.replace("-1.0", &format!("-{distance:.15}"))))
    };
    let ball = Ball { center: DVec3::ZERO, radius: 1.0 };
    let scene = at(1.5);
    let (ior, absorption) = (f64::from(scene.liquid.ior), scene.liquid.absorption.as_dvec3());
    let whole = beams(&ball, &scene, &sun(DVec3::NEG_Y), &overhead(2.0, 128), 2, 2);
    check_accounts(&whole);
    assert!(close(whole.flux.sent, PI * POWER, 2e-3), "{}", whole.flux.sent);
    let steps = 20_000;
    let expected: DVec3 = (0..steps)
        .map(|i| {
            let b = (f64::from(i) + 0.5) / f64::from(steps);
            let t = 1.0 - fresnel((1.0 - b * b).sqrt(), ior);
            let chord = 2.0 * (1.0 - (b / ior).powi(2)).sqrt();
            TAU * b / f64::from(steps) * t * t * transmittance(absorption, chord) * POWER
        })
        .sum();
    assert!(close(whole.flux.transmitted, expected, 2e-3), "{:?} {expected}", whole.flux);
    assert!(close(whole.flux.received, expected, 5e-3), "{:?}", whole.flux);

    let focal = ior / (2.0 * (ior - 1.0));
    let axis = overhead(0.02, 33);
    let t = (1.0 - fresnel(1.0, ior)).powi(2) * transmittance(absorption, 2.0);
    let map = beams(&ball, &at(focal), &sun(DVec3::NEG_Y), &axis, 2, 2);
    check_accounts(&map);
    let middle = texel(&map, 16, 16);
    let share = map.irradiance[middle] * map.receivers[middle].unwrap().area / map.flux.sent;
    assert!(close(share, t, 1e-3), "all of it: {share} {t}");
    for distance in [1.4 * focal, 2.5 * focal] {
        let map = beams(&ball, &at(distance), &sun(DVec3::NEG_Y), &axis, 2, 2);
        let expected = t * POWER / (1.0 - distance / focal).powi(2);
        assert!(close(map.irradiance[middle], expected, 2e-3), "{distance}");
    }
    // With receivers inside the liquid only: none.
    let inside = beams(&ball, &scene, &sun(DVec3::NEG_Y), &overhead(2.0, 32), 1, 1);
    assert_eq!(inside.flux.received, DVec3::ZERO);
    check_accounts(&inside);
}

fn busy() -> Scene {
    clear(&format!(
        "{}[[solid]]\nshape = \"box\"\nmin = [-0.3, -2.0, -0.2]\nmax = [0.2, -0.6, 0.4]\n\
         [[solid]]\nshape = \"sphere\"\ncenter = [0.6, -1.0, 0.5]\nradius = 0.3\n\
         [[solid]]\nshape = \"box\"\nmin = [-0.9, -2.0, 0.3]\nmax = [-0.6, 0.4, 0.6]",
        FLOOR.replace("-1.0", "-2.0")
    ))
}

/// Beams agree with photons, which do not depend on areas, folds and edges; and more beams converge
/// to the truth.
#[test]
fn beams_agree_with_photons() {
    let scene = busy();
    let liquid = water(waves(0.12));
    let light = sun(DVec3::new(0.4, -1.0, 0.2));
    let view =
        light_view(&light, DVec3::new(-1.2, -2.0, -1.2), DVec3::new(1.2, 0.2, 1.2), &scene, 40);
    let maps = [1, 2, 4].map(|density| beams(&liquid, &scene, &light, &view, 1, density));
    let (fine, own) = beams_with_error(&liquid, &scene, &light, &view, 1, 12);
    for map in maps.iter().chain([&fine]) {
        check_accounts(map);
    }
    let errors = maps.map(|map| map.relative_l1(&fine));
    let counts = [20_000, 600_000];
    let noise = counts.map(|count| {
        let map = photons(&liquid, &scene, &light, &view, 1, count, 1);
        check_accounts(&map);
        assert!(close(map.flux.sent, fine.flux.sent, 2e-3), "{:?} {:?}", map.flux, fine.flux);
        assert!(close(map.flux.received, fine.flux.received, 3e-3));
        assert!((map.flux.hidden - fine.flux.hidden).length() < 3e-3 * fine.flux.sent.length());
        map.relative_l1(&fine)
    });
    println!("beams 1, 2, 4 per texel off 12: {errors:?}; 6 off 12: {own}; photons {noise:?}");
    assert!(errors[1] < 0.6 * errors[0] && errors[2] < 0.6 * errors[1], "{errors:?}");
    assert!(own < errors[2] && own < 0.01, "{own} {errors:?}");
    assert!(noise[1] < 0.3 * noise[0] && noise[1] < 0.05, "{noise:?}");
    assert_eq!(fine.relative_l1(&fine), 0.0);
}

/// Point lights: known answers straight below and at an angle (methods after Walter 2009), and from
/// far away the sun's map.
#[test]
fn point_lights_match_closed_forms() {
    let scene = clear(&FLOOR.replace("-1.0", "-2.0"));
    let ior = f64::from(scene.liquid.ior);
    let liquid = water(Waves::default());
    let intensity = Vec3::new(30.0, 20.0, 10.0);
    let corners = (DVec3::new(-0.6, -2.0, -0.6), DVec3::new(0.6, 0.0, 0.6));
    let at_origin = |map: &CausticMap| {
        map.at(&Spot { solid: 0, part: 0, point: -2.0 * DVec3::Y, normal: DVec3::Y })
    };

    let light = Light::Point { position: 3.0 * DVec3::Y, intensity };
    let view = light_view(&light, corners.0, corners.1, &scene, 64);
    let map = beams(&liquid, &scene, &light, &view, 1, 2);
    check_accounts(&map);
    let t = 1.0 - fresnel(1.0, ior);
    let expected = intensity.as_dvec3() * (t * WATER * WATER / 35.8801);
    assert!(close(at_origin(&map), expected, 1e-3), "{} {expected}", at_origin(&map));

    // θ = 43.0614° in air, 30.8886° in water, η²/D = 0.0270312.
    let light = Light::Point { position: DVec3::new(4.0, 3.0, 0.0), intensity };
    let view = light_view(&light, corners.0 * 2.0, corners.1 * 2.0, &scene, 96);
    let map = beams(&liquid, &scene, &light, &view, 1, 2);
    check_accounts(&map);
    let t = 1.0 - fresnel(43.0614f64.to_radians().cos(), ior);
    let cos = 30.8886f64.to_radians().cos();
    let expected = intensity.as_dvec3() * (0.0270312 * t * cos);
    assert!(close(at_origin(&map), expected, 1e-3), "{} {expected}", at_origin(&map));

    // 10 km away, like the sun.
    let liquid = water(waves(0.1));
    let (far, direction) = (1e4, DVec3::new(0.3, -1.0, 0.1).normalize());
    let point =
        Light::Point { position: -far * direction, intensity: (far * far * POWER).as_vec3() };
    let maps = [sun(direction), point].map(|light| {
        let view = light_view(&light, corners.0, corners.1, &scene, 24);
        beams(&liquid, &scene, &light, &view, 1, 4)
    });
    let mut compared = 0;
    for x in -6..=6 {
        for z in -6..=6 {
            let at = DVec3::new(0.04 * f64::from(x), -2.0, 0.04 * f64::from(z));
            let spot = Spot { solid: 0, part: 0, point: at, normal: DVec3::Y };
            let [a, b] = maps.each_ref().map(|map| map.at(&spot));
            // The texels of the two maps are at different positions.
            compared += i32::from((a - b).length() < 0.15 * a.length());
        }
    }
    assert!(compared > 150, "{compared} of 169");
    let mean = |map: &CausticMap| map.flux.transmitted / map.flux.sent;
    assert!(close(mean(&maps[0]), mean(&maps[1]), 1e-3));
}

/// Point lights that no single view covers: in the liquid, and so close above it that the liquid
/// spans nearly all directions, each with its closed form below.
#[test]
fn lights_in_or_close_to_liquid_shine_all_round() {
    let scene = clear(&format!("{FLOOR}lit = true"));
    let ior = f64::from(scene.liquid.ior);
    let liquid = water(Waves::default());
    let bounds = (DVec3::new(-1.0, -1.0, -1.0), DVec3::new(1.0, 0.0, 1.0));
    let intensity = Vec3::new(3.0, 2.0, 1.0);
    for height in [-0.5, 0.1] {
        let light = Light::Point { position: height * DVec3::Y, intensity };
        let maps = on_solids(&liquid, bounds, &scene, &light, 1, 256, 3);
        assert_eq!(maps.len(), 1);
        let at = |x: f64| {
            maps[0].at(&Spot {
                solid: 0,
                part: 0,
                point: DVec3::new(x, -1.0, 0.0),
                normal: DVec3::Y,
            })
        };
        let (below, aside) = (at(0.0), at(0.3));
        if height < 0.0 {
            assert!(close(below, POWER / 0.25, 0.03), "{below}");
            let expected = POWER * 0.5 / (0.25 + 0.09f64).powf(1.5);
            assert!(close(aside, expected, 0.03), "{aside} {expected}");
        } else {
            // Seen from above water appears 1/n as deep (Walter 2009, straight down).
            let expected = POWER * (1.0 - fresnel(1.0, ior)) / (height + 1.0 / ior).powi(2);
            assert!(close(below, expected, 0.03), "{below} {expected}");
        }
    }
}
