//! Light through liquid: refracted, attenuated, absorbed and blurred, against closed forms.

use std::f64::consts::PI;

use glam::{DVec3, UVec2, Vec3, Vec3Swizzles as _};
use limpid::frame::FrameInput;
use limpid::light_view::LightView;
use limpid::liquid::classify::Splats;
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::scene::{Light, Scene, Shape, Surface};
use limpid::settings::Method;

use super::{
    DROP, IOR, SIZE, SKY, assert_close, camera, drop, entering, floor, lit, nothing, on_floor, ray,
    slab, sun, wet,
};
use crate::even_light::even_light;
use crate::support::frames::{Harness, View, gpu, harness, render, sphere};

/// Light under still liquid, from particles to the picture: the floor under a block receives E T
/// cos(theta) exp(-sigma l) by every method, to 3 % in its mean, so the methods agree; ambient
/// light is that of `even_light`; and the floor next to the block does not change.
#[test]
fn the_floor_under_a_slab_has_its_closed_form() {
    let Some(mut harness) = harness() else { return };
    let direction = Vec3::new(0.3, -1.0, 0.2);
    let (mut scene, slab) = slab(&[sun(direction)]);
    let camera = camera(DVec3::new(0.0, 6.0, 1.0), DVec3::ZERO, 36.0);
    let view = View::new(&camera, SIZE);
    let alone = harness.render(&scene, &camera, &Splats { radius: slab.radius, ..nothing() }, SIZE);
    let height = 0.4;
    let absorption = DVec3::X;
    let cos_theta_i = -direction.as_dvec3().normalize().y;
    let (transmitted, cos_theta_t) = entering(cos_theta_i);
    let arriving = 2.0 * transmitted * cos_theta_i * (-height / cos_theta_t * absorption).exp();
    let mut means = Vec::new();
    for method in Method::ALL {
        scene.settings.caustics.method = method;
        let shot = harness.render(&scene, &camera, &slab, SIZE);
        shot.assert_finite();
        let (mut sum, mut expected, mut spread, mut count) = (DVec3::ZERO, DVec3::ZERO, 0.0, 0);
        for p in shot.pixels() {
            let Some(x) = on_floor(&camera, &view, p) else { continue };
            let far = x.with_y(0.0).abs().max_element();
            if far > 1.6 {
                let (got, without) = (shot.radiance(p), alone.radiance(p));
                assert_close(got, without, 1e-3, &format!("{method:?}, beside the slab at {x}"));
            }
            if far > 0.6 {
                continue;
            }
            let ray = ray(&camera, &view, p.as_dvec2() + 0.5);
            let (seen, cos) = entering(-ray.direction.y);
            let lit = 0.5 * (SKY * even_light(IOR, absorption, height) + arriving / PI);
            let here = seen / (IOR * IOR) * (-height / cos * absorption).exp() * lit;
            let here = here + (1.0 - seen) * SKY;
            sum += shot.radiance(p);
            expected += here;
            spread += (shot.radiance(p) - here).abs().element_sum() / here.element_sum();
            count += 1;
        }
        let (mean, expected) = (sum / f64::from(count), expected / f64::from(count));
        let spread = spread / f64::from(count);
        println!("{method:?}: {mean}, expected {expected}, each off by {spread:.3}");
        assert!(count > 500, "{count}");
        assert_close(mean, expected, 0.03, &format!("{method:?}"));
        assert!(spread < 0.12, "{method:?}: {spread}");
        means.push(mean);
    }
    for mean in &means {
        assert_close(*mean, means[0], 0.03, "methods");
    }
}

/// `straight`, without caustics: under a plate in the air, the floor has the light that both faces
/// and absorption transmit, where a straight line to the sun passes through the plate, and nowhere
/// more light than without the plate.
#[test]
fn straight_light_is_attenuated_by_a_plate() {
    let Some(mut harness) = harness() else { return };
    let at = "kind = \"slab\"\nmin = [-1.0, 1.0, -1.0]\nmax = [1.0, 1.3, 1.0]\ncount = 15000";
    let (mut scene, plate) = wet(at, &[floor()], &[sun(Vec3::NEG_Y)]);
    scene.settings.caustics.method = Method::Straight;
    let camera = camera(DVec3::new(0.0, 0.7, 7.0), DVec3::new(0.0, 0.2, 0.0), 30.0);
    let view = View::new(&camera, SIZE);
    let shot = harness.render(&scene, &camera, &plate, SIZE);
    let (transmitted, _) = entering(1.0);
    let passed = transmitted * transmitted * (-0.3 * DVec3::X).exp();
    let (mut sum, mut count) = (DVec3::ZERO, 0);
    for p in shot.pixels() {
        // Pixels that see the floor under the plate, but not through it.
        let Some(x) =
            on_floor(&camera, &view, p).filter(|_| shot.at("depth.aggregate_front", p) == 0.0)
        else {
            continue;
        };
        assert!(shot.radiance(p).max_element() <= 0.5 * (SKY + 2.0 / PI) + 1e-5, "{x}");
        if x.x.abs() < 0.7 && x.z.abs() < 0.7 {
            sum += shot.radiance(p);
            count += 1;
        }
    }
    assert!(count > 100, "{count}");
    let expected = 0.5 * (SKY + 2.0 * passed / PI);
    assert_close(sum / f64::from(count), expected, 0.03, "under the plate");
}

/// Light of a drop, from particles to the picture: of the light that the drop intercepts, the share
/// missing on the floor is what its two faces reflect, its inside absorbs and it refracts out of
/// the light's view, within 4 %; and behind the drop there is a spot brighter than under the sun
/// alone, although it is far beyond the focus.
#[test]
fn a_drop_transmits_its_light() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, drop) = drop(&[sun(Vec3::NEG_Y)]);
    // Enough samples not to miss the spot.
    scene.settings.refract.samples = 16;
    let camera = camera(DVec3::new(0.0, 0.9, 4.0), DVec3::new(0.0, 0.1, 0.0), 46.0);
    let size = UVec2::new(200, 150);
    let view = View::new(&camera, size);
    let with = harness.render(&scene, &camera, &drop, size);
    let map = harness.renderer.images().caustics[0].clone().expect("a map");
    let without =
        harness.render(&scene, &camera, &Splats { radius: drop.radius, ..nothing() }, size);
    let (mut missing, mut brightest) = (DVec3::ZERO, 0.0f64);
    for p in with.pixels() {
        let Some(x) = on_floor(&camera, &view, p) else { continue };
        if x.x.abs().max(x.z.abs()) > 1.4 {
            continue;
        }
        assert_eq!(with.at("depth.aggregate_front", p), 0.0, "the drop hides the floor at {x}");
        let ray = x - camera.eye;
        // A pixel's area on the floor.
        let cosine = -ray.y / ray.length();
        let omega = view.through(p);
        let solid_angle = view.footprint().powi(2) / omega.length().powi(3);
        let area = solid_angle * ray.length_squared() / cosine;
        let radiosity = PI / 0.5 * (without.radiance(p) - with.radiance(p));
        missing += area * radiosity;
        brightest = brightest.max(with.radiance(p).y / without.radiance(p).y);
    }
    // Integrates over the distance from the axis at which light enters.
    let half = map.view.half_extent.x.min(1.4);
    let n = 4000;
    let passed: DVec3 = (0..n)
        .map(|i| {
            let b = (f64::from(i) + 0.5) / f64::from(n);
            let cos_i = (1.0 - b * b).sqrt();
            let (transmitted, cos_t) = entering(cos_i);
            // Deviation towards the axis by each face.
            let turned = b.asin() - cos_t.acos();
            let x = DROP.radius * (b - 2.0 * cos_t * turned.sin());
            let y = DROP.center.y + DROP.radius * (cos_i - 2.0 * cos_t * turned.cos());
            let lands = x - y * (2.0 * turned).tan();
            let kept = lands.abs() < half && 2.0 * turned < 0.5 * PI;
            let inside = (-2.0 * DROP.radius * cos_t * DVec3::X).exp();
            2.0 * b / f64::from(n) * transmitted * transmitted * inside * f64::from(u8::from(kept))
        })
        .sum();
    let in_the_way = 2.0 * PI * DROP.radius * DROP.radius;
    let got = 1.0 - missing / in_the_way;
    println!("passed {got}, expected {passed}; brightest {brightest}");
    assert!((got - passed).abs().max_element() < 0.04, "{got}, not {passed}");
    assert!(brightest > 1.6, "{brightest}");
}

/// With several lights the maps are layers of one texture, and the picture is the sum of the
/// contributions of the single lights.
#[test]
fn contributions_of_lights_add() {
    let Some(mut harness) = harness() else { return };
    let lights = [
        sun(Vec3::new(0.5, -1.0, 0.1)),
        Light::Point {
            position: DVec3::new(-0.8, 4.0, 0.5),
            intensity: Vec3::new(20.0, 10.0, 5.0),
        },
    ];
    let (mut scene, drop) = drop(&lights);
    // Adaptive sampling uses a threshold, which is not under test here.
    scene.settings.refract.edge_samples = 1;
    let camera = camera(DVec3::new(0.5, 2.5, 5.0), DVec3::new(0.0, 0.7, 0.0), 40.0);
    let mut draw = |lights: &[Light]| {
        let scene = Scene { lights: lights.to_vec(), ..scene.clone() };
        let shot = harness.render(&scene, &camera, &drop, SIZE);
        (shot, harness.renderer.images().caustics.iter().flatten().count())
    };
    let (both, maps) = draw(&lights);
    assert_eq!(maps, 2);
    let [first, second, none] = [&lights[..1], &lights[1..], &[]].map(|lights| draw(lights).0);
    let mut lit = 0.0f64;
    for p in both.pixels() {
        let dark = none.radiance(p);
        let sum = first.radiance(p) + second.radiance(p) - dark;
        let error = (both.radiance(p) - sum).abs().max_element();
        assert!(error < 1e-4 * sum.max_element().max(1.0), "{p}: {error}");
        lit = lit.max((second.radiance(p) - dark).max_element());
    }
    assert!(lit > 0.1, "{lit}");
}

/// Frames with caustics are bit-identical when rendered again, in another order, and by a new
/// renderer.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn lit_frames_are_independent() {
    let Some(gpu) = gpu() else { return };
    let point = Light::Point { position: DVec3::new(0.5, 4.0, 0.3), intensity: Vec3::splat(20.0) };
    let (one, drop) = drop(&[sun(Vec3::new(0.3, -1.0, 0.2))]);
    let (two, slab) = slab(&[point, sun(Vec3::new(-0.5, -1.0, 0.2))]);
    let mut gathered = two.clone();
    gathered.settings.caustics.method = Method::Gather;
    let mut larger = one.clone();
    larger.settings.caustics.resolution = 200;
    larger.settings.caustics.grid = 150;
    larger.settings.caustics.blur = 0.02;
    let dark = Scene { lights: Vec::new(), ..one.clone() };
    let nothing = nothing();
    let frames = [
        (&one, &drop),
        (&two, &slab),
        (&dark, &drop),
        (&gathered, &slab),
        (&larger, &drop),
        (&two, &nothing),
    ];
    let camera = camera(DVec3::new(0.5, 2.5, 5.0), DVec3::new(0.0, 0.7, 0.0), 40.0);
    let size = UVec2::new(80, 60);
    let draw = |renderer: &mut Renderer, (scene, drawn): (&Scene, &Splats)| {
        let shot = render(&gpu, renderer, FrameInput::new(scene, &camera, drawn, size));
        let maps = renderer.images().caustics;
        let maps: Vec<_> = maps.iter().flatten().map(|m| m.read(&gpu).expect("a map")).collect();
        let texels = maps.iter().flat_map(|(map, depth)| map.as_flattened().iter().chain(depth));
        let texels: Vec<_> = texels.map(|v| v.to_bits()).collect();
        let radiance = ["R", "G", "B"].map(|c| {
            let values = shot.channel(&format!("radiance.{c}")).iter();
            values.map(|v| v.to_bits()).collect::<Vec<_>>()
        });
        (radiance, texels)
    };
    let mut kept = Renderer::new(&gpu);
    let first: Vec<_> = frames.iter().map(|&frame| draw(&mut kept, frame)).collect();
    assert!(draw(&mut Renderer::new(&gpu), frames[4]) == first[4], "by a new renderer");
    for i in [4, 1, 1, 5, 0, 3, 2, 4, 0] {
        assert!(draw(&mut kept, frames[i]) == first[i], "frame {i}");
    }
}

/// Stray particles do not reduce the resolution of the maps: a splash at a thousand times the
/// slab's width changes no view, and a drop above a lamp leaves the lamp a map of the slab.
#[test]
fn stray_splashes_do_not_change_the_maps() {
    let Some(mut harness) = harness() else { return };
    let lamp = Light::Point { position: DVec3::new(0.0, 1.6, 0.0), intensity: Vec3::ONE };
    let (scene, whole) = slab(&[sun(Vec3::new(0.3, -1.0, 0.2)), lamp]);
    let camera = camera(DVec3::new(0.0, 2.0, 4.0), DVec3::ZERO, 40.0);
    let mut views = |splash: Option<Vec3>| -> Vec<LightView> {
        let mut splats = whole.clone();
        splats.splashes.extend(splash.map(|at| sphere(at, whole.radius)));
        harness.render(&scene, &camera, &splats, UVec2::new(16, 12));
        let maps = harness.renderer.images().caustics;
        maps.into_iter().map(|map| map.expect("a map").view).collect()
    };
    let alone = views(None);
    for lost in [Vec3::new(2000.0, 0.0, 0.0), Vec3::new(10.0, -2000.0, 500.0)] {
        assert_eq!(views(Some(lost)), alone, "a splash at {lost}");
    }
    let below = views(Some(Vec3::new(0.1, 2.0, 0.0)));
    let change = below[1].half_extent / alone[1].half_extent;
    assert!((change - 1.0).abs().max_element() < 0.1, "{change}");
}

/// `caustics.blur` is the standard deviation, in metres, of a blurred spot in either direction, and
/// the map keeps its light, to 2 %.
#[test]
fn blur_has_its_width_and_keeps_light() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, drop) = drop(&[sun(Vec3::NEG_Y)]);
    let camera = camera(DVec3::new(0.0, 2.5, 5.0), DVec3::Y, 40.0);
    let mut measure = |blur: f32| {
        scene.settings.caustics.blur = blur;
        harness.render(&scene, &camera, &drop, UVec2::new(32, 24));
        let map = harness.renderer.images().caustics[0].clone().expect("a map");
        let (irradiance, _) = map.read(&harness.gpu).expect("a map");
        let size = map.view.size;
        let (mut sum, mut moment, mut most) = (0.0, 0.0, 0.0f64);
        for (e, i) in irradiance.iter().zip(0..) {
            let u = UVec2::new(i % size.x, i / size.x).as_dvec2() + 0.5;
            let x = (2.0 * u / size.as_dvec2() - 1.0) * map.view.half_extent;
            sum += f64::from(e[1]);
            moment += f64::from(e[1]) * x.length_squared();
            most = most.max(e[1].into());
        }
        (sum, moment / sum, most)
    };
    let (sum, moment, most) = measure(0.0);
    for blur in [0.03, 0.1] {
        let (blurred, wider, less) = measure(blur);
        let width = (0.5 * (wider - moment)).max(0.0).sqrt();
        println!("{blur}: light {}, width {width}, peak {}", blurred / sum, less / most);
        assert!((blurred / sum - 1.0).abs() < 0.02, "{blur}: {blurred}, not {sum}");
        assert!((width / f64::from(blur) - 1.0).abs() < 0.1, "{width}, not {blur}");
        assert!(less < 0.8 * most, "{less} of {most}");
    }
}

/// Radiance is finite wherever the light is: in the liquid, on its surface, on a solid, straight
/// above, along the floor, below it; with a liquid of no particle, one and many.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn unusual_lights_give_finite_pictures() {
    let Some(mut harness) = harness() else { return };
    let point =
        |x, y, z| Light::Point { position: DVec3::new(x, y, z), intensity: Vec3::splat(5.0) };
    let lights = [
        point(0.0, 0.2, 0.0),
        point(0.0, 0.4, 0.0),
        point(0.0, 0.45, 0.0),
        point(2.0, 0.0, 0.0),
        point(0.0, 1e5, 0.0),
        point(0.0, -2.0, 0.0),
        sun(Vec3::NEG_Y),
        sun(Vec3::Y),
        sun(Vec3::X),
        sun(Vec3::new(1.0, -1e-3, 0.0)),
        sun(Vec3::new(1e-20, -1e-20, 0.0)),
        sun(Vec3::new(1e-5, -1e5, 0.0)),
    ];
    let (mut scene, slab) = slab(&[]);
    let one = Splats { aggregates: slab.aggregates[..1].to_vec(), ..slab.clone() };
    let spray = Splats {
        aggregates: Vec::new(),
        splashes: vec![sphere(Vec3::new(0.1, 0.5, 0.2), 0.05)],
        ..slab.clone()
    };
    scene.settings.caustics.resolution = 64;
    scene.settings.caustics.grid = 64;
    let camera = camera(DVec3::new(0.5, 2.0, 3.0), DVec3::new(0.0, 0.2, 0.0), 40.0);
    let size = UVec2::new(48, 36);
    for method in Method::ALL {
        scene.settings.caustics.method = method;
        for light in lights {
            scene.lights = vec![light];
            for drawn in [&slab, &one, &spray, &nothing()] {
                // The kinds of liquid select pipeline variants, which one method covers.
                if drawn.aggregates.len() < 2 && method != Method::Forward {
                    continue;
                }
                let shot = harness.render(&scene, &camera, drawn, size);
                shot.assert_finite();
                let name = format!("{method:?}, {light:?}");
                let least =
                    shot.pixels().map(|p| shot.radiance(p).min_element()).fold(1.0, f64::min);
                assert!(least >= 0.0, "{name}: {least}");
                for map in harness.renderer.images().caustics.iter().flatten() {
                    let (irradiance, depths) = map.read(&harness.gpu).expect("a map");
                    let good = |v: &f32| v.is_finite() && *v >= 0.0;
                    assert!(irradiance.as_flattened().iter().all(good), "{name}: map");
                    assert!(depths.iter().all(|d| d.is_finite()), "{name}: depths");
                }
            }
        }
    }
}

/// A camera in the liquid sees the floor lit by light through the surface, attenuated on the way to
/// the camera, and finite everywhere.
#[test]
fn the_floor_is_lit_for_a_submerged_camera() {
    let Some(mut harness) = harness() else { return };
    let (mut scene, slab) = slab(&[sun(Vec3::NEG_Y)]);
    let camera = camera(DVec3::new(0.0, 0.25, 0.3), DVec3::new(0.0, 0.0, 0.0), 40.0);
    let mut draw = |scene: &Scene| harness.render(scene, &camera, &slab, SIZE);
    let lit = draw(&scene);
    lit.assert_finite();
    scene.lights.clear();
    let dark = draw(&scene);
    let view = View::new(&camera, SIZE);
    let (mut sum, mut count) = (DVec3::ZERO, 0);
    for p in lit.pixels() {
        let Some(x) = on_floor(&camera, &view, p).filter(|x| x.abs().max_element() < 0.5) else {
            continue;
        };
        let left = (-(x - camera.eye).length() * DVec3::X).exp();
        sum += (lit.radiance(p) - dark.radiance(p)) / left;
        count += 1;
    }
    assert!(count > 1000, "{count}");
    let expected = 0.5 * 2.0 / PI * entering(1.0).0 * (-0.4 * DVec3::X).exp();
    assert_close(sum / f64::from(count), expected, 0.05, "light on the floor");
}

/// The floor of a pool receives the ambient light that is left at its depth, compared with an unlit
/// floor of the same radiance; seen from above, at a slant and from inside the liquid. The
/// particles' surface may be up to a radius below the block's.
#[test]
fn ambient_light_is_attenuated_with_depth() {
    let Some(mut harness) = harness() else { return };
    let absorption = DVec3::new(1.0, 0.3, 0.0);
    for depth in [0.2, 1.0, 4.0] {
        let (side, bottom) = (4.0 * depth, DVec3::new(0.0, -depth, 0.0));
        let at = format!(
            "kind = \"slab\"\nmin = [-{side:?}, -{depth:?}, -{side:?}]\n\
             max = [{side:?}, 0.0, {side:?}]\ncount = 20000"
        );
        let floor = Shape::Plane { origin: bottom, normal: Vec3::Y, half_extent: f32::INFINITY };
        let (mut scene, drawn) = wet(&at, &[lit(floor)], &[]);
        scene.liquid.absorption = absorption.as_vec3();
        let glowing = |radiance: f64| {
            let mut scene = scene.clone();
            scene.solids[0].surface = Surface::Color(Vec3::splat(radiance as f32));
            scene.solids[0].lit = false;
            scene
        };
        let scenes = [scene.clone(), glowing(0.5 * SKY), glowing(0.0)];
        for (eye, target) in
            [([0.0, 3.0, 0.5], 0.0), ([0.0, 1.5, 3.0], 0.0), ([0.0, -0.4, 0.2], -1.0)]
        {
            let eye = depth * DVec3::from_array(eye);
            let camera = camera(eye, DVec3::new(0.0, target * depth, 0.0), 36.0);
            let view = View::new(&camera, SIZE);
            let shots = scenes.each_ref().map(|s| harness.render(s, &camera, &drawn, SIZE));
            let (mut sums, mut count) = ([DVec3::ZERO; 3], 0);
            for p in shots[0].pixels() {
                let ray = ray(&camera, &view, p.as_dvec2() + 0.5);
                let at = ray.at(eye.y.abs() / ray.direction.y.abs());
                if ray.direction.y >= 0.0 || at.xz().abs().max_element() > 2.5 * depth {
                    continue;
                }
                for (sum, shot) in sums.iter_mut().zip(&shots) {
                    *sum += shot.radiance(p);
                }
                count += 1;
            }
            assert!(count > 2000, "{count}");
            let share = (sums[0] - sums[2]) / (sums[1] - sums[2]);
            let depths = [depth, depth - f64::from(drawn.radius)];
            let [least, most] = depths.map(|depth| even_light(IOR, absorption, depth));
            println!("{depth} m, from {eye}: {share}, {least} to {most}");
            assert!(share.cmpge(0.99 * least).all() && share.cmple(1.01 * most).all(), "{share}");
        }
    }
}

/// Finds the end of the shadow on the floor next to a block that extends to x = 0.6 m, under a sun
/// at 45 degrees from −x, by the share of dark pixels between 0.8 and 1.6 m.
fn shadow_end(harness: &mut Harness, scene: &Scene, drawn: &Splats) -> f64 {
    let camera = camera(DVec3::new(1.2, 5.0, 0.0), DVec3::new(1.2, 0.0, 0.01), 26.0);
    let view = View::new(&camera, SIZE);
    let shot = harness.render(scene, &camera, drawn, SIZE);
    let half_lit = 0.5 * (SKY + 0.5 * 2.0 * 0.5f64.sqrt() / PI);
    let (mut dark, mut seen) = (0.0, 0.0);
    for p in shot.pixels() {
        let Some(x) = on_floor(&camera, &view, p) else { continue };
        if x.z.abs() < 0.3 && (0.8..1.6).contains(&x.x) {
            dark += f64::from(u8::from(shot.radiance(p).y < half_lit));
            seen += 1.0;
        }
    }
    assert!(seen > 500.0, "{seen}");
    0.8 + 0.8 * dark / seen
}

/// Shadows of liquid without walls: the floor has no direct light where the straight line to the
/// sun meets the block, although the map looks along refracted light; and a bump on the top, far
/// from the edge that casts the shadow, does not move its end.
#[test]
fn a_block_of_liquid_casts_a_straight_shadow() {
    let Some(mut harness) = harness() else { return };
    let at = "kind = \"slab\"\nmin = [-0.6, 0.0, -0.6]\nmax = [0.6, 0.6, 0.6]\ncount = 15000";
    let (scene, block) = wet(at, &[floor()], &[sun(Vec3::new(1.0, -1.0, 0.0))]);
    let level = shadow_end(&mut harness, &scene, &block);
    assert!(harness.renderer.images().caustics[0].as_ref().is_some_and(|m| m.view.level.is_some()));
    let mut bumped = block.clone();
    for splat in &block.aggregates {
        let [x, y, z] = splat.centre.map(f64::from);
        if x < -0.25 && y > 0.3 {
            let centre = [x, y + 0.25, z].map(|v| v as f32);
            bumped.aggregates.push(limpid::liquid::classify::Splat { centre, ..*splat });
        }
    }
    let bump = shadow_end(&mut harness, &scene, &bumped);
    assert!(harness.renderer.images().caustics[0].as_ref().is_some_and(|m| m.view.level.is_none()));
    println!("the shadow ends at {level} m, {bump} m with a bump");
    // The block's edge is rounded by about a particle.
    assert!((level - 1.2).abs() < 0.04, "{level}, not 1.2 m");
    assert!((bump - level).abs() < 0.015, "{level} m, {bump} m with a bump");
}

/// A second view, which only tells where liquid blocks direct light, has no gaps: they are of the caustic map's view alone.
/// It is smoothed, for splats at the rim of liquid on a floor reach below it.
#[test]
fn views_of_direct_light_have_no_gaps() {
    let Some(mut harness) = harness() else { return };
    let at = "kind = \"slab\"\nmin = [-0.6, 0.0, -0.6]\nmax = [0.6, 0.6, 0.6]\ncount = 15000";
    let (scene, block) = wet(at, &[floor()], &[sun(Vec3::new(1.0, -1.0, 0.0))]);
    let Harness { gpu, renderer } = &mut *harness;
    let camera = camera(DVec3::new(0.0, 4.0, 2.0), DVec3::ZERO, 36.0);
    let frame = Picture::new(gpu, SIZE).expect("a frame");
    let input = FrameInput { timing: true, ..FrameInput::new(&scene, &camera, &block, SIZE) };
    let times = renderer.render(input, &frame).expect("the frame is drawn");
    let count = |name| times.iter().filter(|time| time.name == name).count();
    if !times.is_empty() {
        assert_eq!((count("light splat"), count("caustics")), (2, 2));
        assert_eq!((count("light smooth"), count("light gaps")), (2, 1));
    }
}
