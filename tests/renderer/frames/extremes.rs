//! Degenerate particles, extreme splats, and other units of length.

use glam::{DVec3, Quat, Vec3};
use limpid::camera::Camera;
use limpid::liquid::Particles;
use limpid::liquid::classify::{Splats, classify};
use limpid::settings::Classify;

use super::{SIZE, tank};
use crate::support::frames::{ellipsoid, harness, mean_difference, scene, sphere, splats};

/// Coplanar, collinear, coincident, single and widely scattered particles are drawn and finite.
#[test]
fn degenerate_particles_are_drawn() {
    let Some(mut harness) = harness() else { return };
    let (scene, camera, _) = tank();
    let cells = |n: i32| (0..n * n).map(move |i| Vec3::new((i % n) as f32, 0.0, (i / n) as f32));
    let clouds: [(&str, Vec<Vec3>); 6] = [
        ("coplanar", cells(14).map(|x| (x - 6.5 * Vec3::new(1.0, 0.0, 1.0)) * 0.1).collect()),
        ("collinear", (0..40).map(|i| Vec3::X * (0.05 * (i - 20) as f32)).collect()),
        ("coincident", vec![Vec3::splat(0.1); 50]),
        ("nearly coincident", (0..50).map(|i| Vec3::splat(0.1) + 1e-7 * i as f32).collect()),
        ("alone", vec![Vec3::ZERO]),
        (
            "far flung",
            vec![Vec3::ZERO, Vec3::splat(1e18), Vec3::NEG_X * 1e30, camera.eye.as_vec3()],
        ),
    ];
    for kernel in [limpid::settings::Kernel::Fitted, limpid::settings::Kernel::Volume] {
        let settings = Classify { kernel, splash_density: 0.1, ..Classify::default() };
        for (name, positions) in &clouds {
            let particles = Particles { positions: positions.clone(), ..Default::default() };
            let drawn = classify(&particles, 0.06, &settings);
            let shot = harness.render(&scene, &camera, &drawn, SIZE);
            shot.assert_finite();
            let covered = shot.channel("interfaces").iter().filter(|&&n| n > 0.0).count();
            println!("{name}: {covered} pixels");
            assert!(covered > 20, "{name} is not visible");
        }
    }
}

/// Extreme splats that classification does not produce (needles, sheets, specks, one around the world,
/// at the eye, coincident), each alone and all together, yield finite images.
#[test]
fn adversarial_splats_are_finite() {
    let Some(mut harness) = harness() else { return };
    let (scene, camera, _) = tank();
    let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.3, 0.9, 2.1);
    let eye = camera.eye.as_vec3();
    let ahead = eye - eye.normalize() * camera.near();
    let adversarial = [
        ellipsoid(Vec3::ZERO, Vec3::new(1e-4, 1e-4, 1.0), turn),
        ellipsoid(Vec3::ZERO, Vec3::new(1e-4, 1.0, 1.0), turn),
        ellipsoid(Vec3::ZERO, Vec3::new(1e-4, 1.0, 1.0), Quat::from_rotation_y(1.2870022)),
        ellipsoid(Vec3::ZERO, Vec3::new(100.0, 1e-3, 100.0), Quat::IDENTITY),
        sphere(Vec3::ZERO, 1e-6),
        sphere(Vec3::ZERO, 1e-3),
        sphere(Vec3::ZERO, 1e4),
        sphere(Vec3::new(0.0, -1e5, 0.0), 1e5),
        sphere(eye, 1e-3),
        sphere(eye, 0.5),
        sphere(ahead, 1e-4),
        sphere(ahead, camera.near()),
        sphere(Vec3::new(1e6, 1e6, -1e6), 10.0),
        sphere(Vec3::ZERO, 0.3),
        sphere(Vec3::ZERO, 0.3),
    ];
    let mut finite = |aggregates: &[_], splashes: &[_], smoothed: bool| {
        let mut scene = scene.clone();
        scene.settings.smooth.iterations = if smoothed { 5 } else { 0 };
        let shot = harness.render(&scene, &camera, &splats(aggregates, splashes, 0.06), SIZE);
        shot.assert_finite();
        assert!(shot.pixels().all(|p| shot.radiance(p).cmpge(DVec3::ZERO).all()));
    };
    for (i, splat) in adversarial.iter().enumerate() {
        println!("splat {i}");
        finite(&[*splat], &[], true);
        finite(&[*splat], &[adversarial[13]], false);
    }
    finite(&adversarial, &[], true);
    finite(&adversarial[..8], &adversarial[8..], true);
    finite(&adversarial[8..], &adversarial[..8], false);
}

/// The unit of length does not matter: a world in millimetres or kilometres gives the same picture, up to
/// rounding and the rays that it decides. Detects hidden constants in metres.
#[test]
fn scale_does_not_change_the_picture() {
    let Some(mut harness) = harness() else { return };
    let mut scene = scene();
    scene.settings.smooth.iterations = 5;
    scene.liquid.absorption = Vec3::new(3.0, 1.0, 0.3);
    let (_, camera, drawn) = tank();
    let metres = harness.render(&scene, &camera, &drawn, SIZE);
    for scale in [1e-4f32, 1e-2, 1e3] {
        let splat = |splat: &limpid::liquid::classify::Splat| {
            let scaled = |v: [f32; 3]| v.map(|x| x * scale);
            limpid::liquid::classify::Splat {
                centre: scaled(splat.centre),
                radius: splat.radius * scale,
                diagonal: scaled(splat.diagonal),
                off_diagonal: scaled(splat.off_diagonal),
                ..*splat
            }
        };
        let scaled = Splats {
            aggregates: drawn.aggregates.iter().map(splat).collect(),
            splashes: drawn.splashes.iter().map(splat).collect(),
            radius: drawn.radius * scale,
            origin: drawn.origin * f64::from(scale),
            is_hull: false,
            device: None,
            colors: None,
            opaque: None,
            bulk: None,
        };
        let mut scene = scene.clone();
        scene.liquid.absorption /= scale;
        let camera = Camera { eye: camera.eye * f64::from(scale), ..camera };
        let shot = harness.render(&scene, &camera, &scaled, SIZE);
        shot.assert_finite();
        let mean = mean_difference(&metres, &shot);
        println!("{scale}: {mean:.2e}");
        assert!(mean < 1e-3, "{scale}: {mean}");
    }
}
