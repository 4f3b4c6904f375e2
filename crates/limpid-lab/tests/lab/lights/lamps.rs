//! Lamps in and close to liquid: absorption along the whole path, against closed forms.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use limpid::frame::FrameInput;
use limpid::offscreen::Picture;
use limpid::scene::Light;

use super::{DROP, IOR, SIZE, SKY, assert_close, camera, drop, entering, on_floor, ray, slab};
use crate::support::frames::{Harness, View, harness};

/// Lights too close to the liquid for one view: under a lamp over a wide pool each point of the
/// floor receives what Fresnel reflection and absorption (Beer and Lambert) leave on the straight
/// line.
#[test]
fn a_lamp_close_to_a_pool_is_absorbed() {
    let Some(mut harness) = harness() else { return };
    let position = DVec3::new(0.1, 0.55, 0.05);
    let lamp = Light::Point { position, intensity: Vec3::splat(3.0) };
    let (mut scene, slab) = slab(&[lamp]);
    let camera = camera(DVec3::new(0.0, 3.0, 0.2), DVec3::ZERO, 30.0);
    let lit = harness.render(&scene, &camera, &slab, SIZE);
    lit.assert_finite();
    assert_eq!(harness.renderer.lights_without_caustics(), [0]);
    scene.lights.clear();
    let dark = harness.render(&scene, &camera, &slab, SIZE);
    let view = View::new(&camera, SIZE);
    let mut shares: [Vec<DVec3>; 3] = Default::default();
    for p in lit.pixels() {
        let ray = ray(&camera, &view, p.as_dvec2() + 0.5);
        let (seen, cos) = entering(-ray.direction.y);
        let t = (0.4 - ray.origin.y) / ray.direction.y;
        let across = ray.direction.with_y(0.0) / IOR * (0.4 / cos);
        let x = (ray.at(t) + across).with_y(0.0);
        let distance = x.distance(position);
        let cos_light = position.y / distance;
        if x.abs().max_element() > 0.8 {
            continue;
        }
        let left = (-0.4 / cos_light * DVec3::X).exp() * entering(cos_light).0;
        let arriving = 3.0 * cos_light / (distance * distance) * left;
        let expected = 0.5 / PI * arriving * seen / (IOR * IOR) * (-0.4 / cos * DVec3::X).exp();
        let ring = (x.distance(position.with_y(0.0)) / 0.3) as usize;
        if let Some(ring) = shares.get_mut(ring) {
            ring.push((lit.radiance(p) - dark.radiance(p)) / expected);
        }
    }
    for (i, ring) in shares.iter().enumerate() {
        let mean = ring.iter().sum::<DVec3>() / ring.len() as f64;
        println!("{i}: {mean} of {}", ring.len());
        assert!(ring.len() > 50, "{}", ring.len());
        assert_close(mean, DVec3::ONE, 0.05, &format!("ring {i}"));
    }
}

/// Each pass of each view of lamps in the liquid is timed.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn passes_of_many_lamps_are_timed() {
    let Some(mut harness) = harness() else { return };
    let lamp = |i: i32| Light::Point {
        position: DVec3::new(0.3 * f64::from(i % 3 - 1), 0.2, 0.3 * f64::from(i / 3 - 1)),
        intensity: Vec3::splat(1.0),
    };
    let lamps: Vec<_> = (0..6).map(lamp).collect();
    let (mut scene, slab) = slab(&lamps);
    scene.settings.caustics.resolution = 48;
    let Harness { gpu, renderer } = &mut *harness;
    let camera = camera(DVec3::new(0.0, 6.0, 1.0), DVec3::ZERO, 36.0);
    let frame = Picture::new(gpu, SIZE).expect("a frame");
    let input = FrameInput { timing: true, ..FrameInput::new(&scene, &camera, &slab, SIZE) };
    let times = renderer.render(input, &frame).expect("the frame is drawn");
    let count = times.iter().filter(|time| time.name == "caustics").count();
    assert!(times.is_empty() || count == 36, "{count} of six faces of six lamps");
}

/// Lamps in the liquid: a lamp in a drop lights the floor by exp(−σ r) times the transmittance of
/// one face; a lamp at the bottom of a block by exp(−σ d) alone.
#[test]
fn a_lamp_in_the_liquid_is_absorbed() {
    let Some(mut harness) = harness() else { return };
    let lamp = |position| Light::Point { position, intensity: Vec3::splat(3.0) };
    let (scene, drop) = drop(&[lamp(DROP.center)]);
    let outside = camera(DVec3::new(0.0, 0.9, 4.0), DVec3::new(0.0, 0.1, 0.0), 40.0);
    let view = View::new(&outside, SIZE);
    let images = harness.render(&scene, &outside, &drop, SIZE);
    let (mut sum, mut count) = (DVec3::ZERO, 0);
    for p in images.pixels() {
        let Some(x) = on_floor(&outside, &view, p).filter(|x| x.length() < 1.2) else { continue };
        let distance = x.distance(DROP.center);
        let left = entering(1.0).0 * (-DROP.radius * DVec3::X).exp();
        let arriving = 3.0 * DROP.center.y / distance.powi(3) * left;
        sum += images.radiance(p) / (0.5 * (SKY + arriving / PI));
        count += 1;
    }
    println!("drop: {}", sum / f64::from(count));
    assert!(count > 300, "{count}");
    assert_close(sum / f64::from(count), DVec3::ONE, 0.03, "under a lamp in a drop");

    let position = DVec3::new(0.1, 0.3, 0.1);
    let (mut scene, slab) = slab(&[lamp(position)]);
    let diver = camera(DVec3::new(0.0, 0.25, 0.3), DVec3::new(0.0, 0.0, 0.0), 40.0);
    let view = View::new(&diver, SIZE);
    let lit = harness.render(&scene, &diver, &slab, SIZE);
    scene.lights.clear();
    let dark = harness.render(&scene, &diver, &slab, SIZE);
    let (mut sum, mut count) = (DVec3::ZERO, 0);
    for p in lit.pixels() {
        let Some(x) = on_floor(&diver, &view, p).filter(|x| x.abs().max_element() < 0.5) else {
            continue;
        };
        let distance = x.distance(position);
        let arriving = 3.0 * position.y / distance.powi(3) * (-distance * DVec3::X).exp();
        let left = (-x.distance(diver.eye) * DVec3::X).exp();
        sum += (lit.radiance(p) - dark.radiance(p)) / (0.5 / PI * arriving * left);
        count += 1;
    }
    println!("block: {}", sum / f64::from(count));
    assert!(count > 1000, "{count}");
    assert_close(sum / f64::from(count), DVec3::ONE, 0.03, "a lamp in a block");
}
