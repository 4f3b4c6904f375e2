//! Direct light on solids without liquid: shadows, point lights and skipped passes, against closed forms.

use std::f64::consts::PI;

use glam::{DVec2, DVec3, Vec3};
use limpid::environment::{Environment, Glow};
use limpid::frame::FrameInput;
use limpid::offscreen::Picture;
use limpid::scene::{Light, Scene, Shape, Solid, Surface};
use limpid_lab::reference::Ray;
use limpid_lab::reference::surroundings::Surroundings;

use super::{SIZE, SKY, assert_close, camera, drop, dry, floor, lit, nothing, ray, sun};
use crate::support::frames::{FrameImages, Harness, View, diagnosed, harness, render};

/// A box 1 m high under a sun at 45° shadows 1 m of the floor next to it; in the shadow only the
/// sky lights the floor, around it also the sun by its cosine, at every pixel.
#[test]
fn box_shadows_have_their_closed_form() {
    let Some(mut harness) = harness() else { return };
    let stand =
        lit(Shape::Box { min: DVec3::new(-0.5, 0.0, -0.5), max: DVec3::new(0.5, 1.0, 0.5) });
    let scene = dry(&[floor(), stand], &[sun(Vec3::new(1.0, -1.0, 0.0))]);
    let camera = camera(DVec3::new(1.5, 5.0, 3.0), DVec3::new(0.7, 0.0, 0.0), 40.0);
    let shot = harness.render(&scene, &camera, &nothing(), SIZE);
    let view = View::new(&camera, SIZE);
    let surroundings = Surroundings::new(&scene);
    let mut seen = [0, 0];
    for p in shot.pixels() {
        let hit = surroundings.hit(&ray(&camera, &view, p.as_dvec2() + 0.5));
        let Some(x) = hit.filter(|hit| hit.solid == 0).map(|hit| hit.point) else { continue };
        // Signed distance to the border of the shadow's rectangle, positive inside.
        let inside = (0.5 - (x.x - 1.0).abs()).min(0.5 - x.z.abs());
        if inside.abs() < 1e-3 {
            continue;
        }
        let dark = inside > 0.0;
        let direct = if dark { 0.0 } else { 2.0 * 0.5f64.sqrt() / PI };
        assert_close(shot.radiance(p), DVec3::splat(0.5 * (SKY + direct)), 1e-5, &format!("{x}"));
        seen[usize::from(dark)] += 1;
    }
    assert!(seen[0] > 2000 && seen[1] > 300, "{seen:?}");
}

/// Neither shadow acne nor detached shadows: adjacent planes, boxes and spheres, as large as rooms
/// and as small as grains, 1000 km from the origin and seen from afar, against shadows in f64.
/// Pixels on an edge are skipped.
#[test]
fn solids_do_not_shadow_themselves() {
    let Some(mut harness) = harness() else { return };
    for (scale, moved, afar) in
        [(1.0, 0.0, 1.0), (1.0, 1e6, 1.0), (1e-3, 0.0, 1.0), (1.0, 0.0, 100.0), (1e3, 0.0, 1.0)]
    {
        let at = |x: f64, y: f64, z: f64| scale * DVec3::new(x, y, z) + moved;
        let radius = (0.4 * scale) as f32;
        let slope = Vec3::new(1.0, 2.0, 0.5).normalize();
        let half_extent = scale as f32;
        let plane =
            |normal, half_extent| Shape::Plane { origin: at(0.0, 0.0, 0.0), normal, half_extent };
        let ramp = Shape::Plane { origin: at(-1.5, 0.5, 0.0), normal: slope, half_extent };
        let solids = [
            plane(Vec3::Y, f32::INFINITY),
            ramp,
            Shape::Box { min: at(-0.4, 0.0, -0.4), max: at(0.4, 0.7, 0.4) },
            Shape::Sphere { center: at(0.9, 0.4, 0.3), radius },
            Shape::Sphere { center: at(0.0, 1.1, 0.0), radius },
        ];
        let lights = [sun(Vec3::new(0.6, -1.0, 0.3)), sun(Vec3::new(-0.9, -0.2, -0.5))];
        let scene = dry(&solids.map(lit), &lights);
        let eye = at(0.0, 0.3, 0.0) + afar * scale * DVec3::new(1.0, 2.5, 4.0);
        let camera = camera(eye, at(0.0, 0.3, 0.0), 45.0 / afar as f32);
        let shot = harness.render(&scene, &camera, &nothing(), SIZE);
        let view = View::new(&camera, SIZE);
        let surroundings = Surroundings::new(&scene);
        let (mut compared, mut off) = (0, Vec::new());
        for p in shot.pixels() {
            let truth = |dx, dy| {
                surroundings.radiance(&ray(&camera, &view, p.as_dvec2() + DVec2::new(dx, dy)))
            };
            let middle = truth(0.5, 0.5);
            let around = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(x, y)| truth(x, y));
            if around.iter().all(|a| (a - middle).abs().max_element() < 0.1 * middle.max_element())
            {
                compared += 1;
                let error = ((shot.radiance(p) - middle) / middle).abs().max_element();
                if error > 2e-3 {
                    off.push((p, error));
                }
            }
        }
        println!("{scale} {moved} {afar}: {compared}, off {:?}", &off[..off.len().min(5)]);
        assert!(compared > 9000, "{compared}");
        assert!(off.is_empty(), "{} of {compared} at {scale}, {moved}, {afar}: {off:?}", off.len());
    }
}

/// Point lights: inverse square and cosine at every pixel, the shadow of a solid in between, and
/// none of a solid behind the light.
#[test]
fn point_lights_follow_the_inverse_square() {
    let Some(mut harness) = harness() else { return };
    let position = DVec3::new(0.3, 1.2, -0.2);
    let lights = [Light::Point { position, intensity: Vec3::new(4.0, 2.0, 1.0) }];
    let ball = |y: f64, radius| lit(Shape::Sphere { center: position.with_y(y), radius });
    let camera = camera(DVec3::new(0.0, 1.5, 6.0), DVec3::ZERO, 40.0);
    let view = View::new(&camera, SIZE);
    // A large ball behind the light, and a small one between it and the floor.
    for (solids, radius) in [
        (vec![floor()], 0.0),
        (vec![floor(), ball(2.5, 1.0)], 0.0),
        (vec![floor(), ball(0.6, 0.1)], 0.1),
    ] {
        let scene = dry(&solids, &lights);
        let shot = harness.render(&scene, &camera, &nothing(), SIZE);
        let surroundings = Surroundings::new(&scene);
        // The shadow of a ball halfway to the floor is a disc.
        let shadow = 1.2 * f64::tan(f64::asin(radius / 0.6));
        let mut seen = [0, 0];
        for p in shot.pixels() {
            let hit = surroundings.hit(&ray(&camera, &view, p.as_dvec2() + 0.5));
            let Some(x) = hit.filter(|hit| hit.solid == 0).map(|hit| hit.point) else { continue };
            let beside = x.distance(position.with_y(0.0)) - shadow;
            if x.length() > 8.0 || radius > 0.0 && beside.abs() < 1e-3 {
                continue;
            }
            let dark = beside < 0.0;
            let distance = x.distance(position);
            let share = if dark { 0.0 } else { 1.2 / distance.powi(3) / PI };
            let expected = 0.5 * (SKY + DVec3::new(4.0, 2.0, 1.0) * share);
            assert_close(shot.radiance(p), expected, 1e-4, &format!("{x}"));
            seen[usize::from(dark)] += 1;
        }
        assert!(seen[0] > 2000 && (radius == 0.0 || seen[1] > 10), "{seen:?}");
    }
}

/// Unlit scenes cost nothing: without lights, or without lit solids, no pass of a light runs and
/// there is no map; and a light without lit solids changes no bit of the picture.
#[test]
fn unlit_scenes_skip_light_passes() {
    let Some(mut harness) = harness() else { return };
    let Harness { gpu, renderer } = &mut *harness;
    let (lit, drop) = drop(&[sun(Vec3::new(0.3, -1.0, 0.2))]);
    let dark = Scene { lights: Vec::new(), ..lit.clone() };
    let mut glowing = lit.clone();
    glowing.solids.iter_mut().for_each(|solid| solid.lit = false);
    let glowing_dark = Scene { lights: Vec::new(), ..glowing.clone() };
    let camera = camera(DVec3::new(0.0, 2.5, 5.0), DVec3::Y, 40.0);
    let mut draw = |scene: &Scene| {
        let frame = Picture::new(gpu, SIZE).expect("a frame");
        let input = FrameInput { timing: true, ..FrameInput::new(scene, &camera, &drop, SIZE) };
        let times = renderer.render(input, &frame).expect("the frame is drawn");
        let names: Vec<_> = times.iter().map(|time| time.name).collect();
        let of_light = names.iter().any(|n| n.starts_with("light ") || *n == "caustics");
        let maps = renderer.images().caustics;
        (
            of_light,
            names.is_empty(),
            maps,
            render(gpu, renderer, diagnosed(scene, &camera, &drop, SIZE)),
        )
    };
    let (of_light, untimed, maps, _) = draw(&lit);
    assert!(of_light || untimed);
    assert!(maps.len() == 1 && maps[0].is_some());
    let same = |a: &FrameImages, b: &FrameImages| {
        a.channels.keys().all(|name| {
            let bits = |shot: &FrameImages| {
                shot.channel(name).iter().map(|v| v.to_bits()).collect::<Vec<_>>()
            };
            bits(a) == bits(b)
        })
    };
    let shots = [&dark, &glowing, &glowing_dark].map(|scene| {
        let (of_light, _, maps, shot) = draw(scene);
        assert!(!of_light && maps.is_empty(), "{maps:?}");
        shot
    });
    assert!(same(&shots[1], &shots[2]), "a light without lit solids changes the picture");
}

/// An endless ground fades into a sky with glows: at every pixel the radiance is that of the closed form in
/// 64 bits, near the ground's middle, at the horizon and above it; and the horizon has no edge. Pixels on a
/// seam of the pattern are skipped.
#[test]
fn grounds_fade_into_the_sky() {
    let Some(mut harness) = harness() else { return };
    let glow = |direction: Vec3, radiance, sharpness| Glow {
        direction: direction.normalize(),
        radiance,
        sharpness,
    };
    let environment = Environment::Sky {
        zenith: Vec3::new(0.2, 0.4, 0.8),
        horizon: Vec3::new(0.7, 0.8, 0.9),
        nadir: Vec3::splat(0.3),
        glows: [
            glow(Vec3::new(0.2, 0.3, -1.0), Vec3::new(9.0, 8.0, 6.0), 300.0),
            glow(Vec3::new(-0.5, 0.6, -1.0), Vec3::splat(0.5), 8.0),
        ],
    };
    let ground = |lit| Solid {
        shape: Shape::Plane { origin: DVec3::ZERO, normal: Vec3::Y, half_extent: f32::INFINITY },
        surface: Surface::Ground {
            tile: 0.5,
            even: Vec3::new(0.5, 0.45, 0.4),
            odd: Vec3::splat(0.3),
            fade: 8.0,
        },
        lit,
    };
    let camera = camera(DVec3::new(1.0, 2.0, 9.0), DVec3::new(0.0, 1.5, 0.0), 45.0);
    for lit in [false, true] {
        let lights = [sun(Vec3::new(0.3, -1.0, 0.2))];
        let scene = Scene { environment: environment.clone(), ..dry(&[ground(lit)], &lights) };
        let images = harness.render(&scene, &camera, &nothing(), SIZE);
        let view = View::new(&camera, SIZE);
        let surroundings = Surroundings::new(&scene);
        let (mut on_ground, mut in_sky) = (0, 0);
        for p in images.pixels() {
            let at = |dx, dy| ray(&camera, &view, p.as_dvec2() + DVec2::new(dx, dy));
            let truth = surroundings.radiance(&at(0.5, 0.5));
            let corners = [(0.4, 0.4), (0.6, 0.4), (0.4, 0.6), (0.6, 0.6)]
                .map(|(x, y)| surroundings.radiance(&at(x, y)));
            if corners.iter().any(|c| (c - truth).abs().max_element() > 0.01 * truth.max_element())
            {
                continue;
            }
            assert_close(images.radiance(p), truth, 1e-3, &format!("{p}, lit {lit}"));
            let hits = surroundings.hit(&at(0.5, 0.5)).is_some();
            on_ground += usize::from(hits);
            in_sky += usize::from(!hits);
        }
        assert!(on_ground > 3000 && in_sky > 3000, "{on_ground} {in_sky}");
        // Straight below and above the horizon.
        let level = |y| Ray { origin: camera.eye, direction: DVec3::new(0.3, y, -1.0).normalize() };
        let [below, above] = [-1e-3, 1e-3].map(|y| surroundings.radiance(&level(y)));
        assert_close(below, above, 2e-3, "the horizon");
    }
}

/// A pattern that is filtered has no edges that need many rays: with 16 of them at edges a lit ground has the bits that it
/// has with one. Solids on it have: they change its picture.
#[test]
fn filtered_patterns_have_no_edges() {
    let Some(mut harness) = harness() else { return };
    let checker = Surface::Checker { tile: 0.5, even: Vec3::splat(0.6), odd: Vec3::splat(0.3) };
    let ground = Solid { surface: checker, ..floor() };
    let ball = lit(Shape::Sphere { center: DVec3::new(0.0, 1.0, 0.0), radius: 0.6 });
    let camera = camera(DVec3::new(1.0, 2.0, 6.0), DVec3::new(0.0, -0.6, 0.0), 30.0);
    for (solids, differs) in [(vec![ground.clone()], false), (vec![ground, ball], true)] {
        let mut scene = dry(&solids, &[sun(Vec3::new(0.3, -1.0, 0.2))]);
        scene.settings.refract.filter_patterns = true;
        let shots = [1, 16].map(|edge_samples| {
            scene.settings.refract.edge_samples = edge_samples;
            harness.render(&scene, &camera, &nothing(), SIZE)
        });
        let [one, many] = shots.each_ref().map(|shot| shot.channel("radiance.G"));
        assert!(one.iter().any(|&r| r > 0.5) && one.iter().any(|&r| r < 0.3), "both tiles");
        assert_eq!(one != many, differs, "{} solids", solids.len());
    }
}
