//! Cameras: degenerate ones are refused, fitted ones see the whole box.

use glam::{DVec2, DVec3, Mat3, UVec2, Vec3};
use limpid::Error;
use limpid::camera::{Camera, Lens};
use limpid::scene::Scene;

use super::{assert_contains, parse, project, random};

/// The error of a camera that defines no view names the key.
#[test]
fn degenerate_cameras_are_errors() {
    let good = Camera::fit(-DVec3::ONE, DVec3::ONE);
    good.check().unwrap();
    let bad = [
        (Camera { target: good.eye, ..good }, "eye"),
        (Camera { eye: DVec3::NAN, ..good }, "eye"),
        (Camera { target: DVec3::INFINITY, ..good }, "target"),
        (Camera { up: Vec3::ZERO, ..good }, "up"),
        (Camera { up: Vec3::NAN, ..good }, "up"),
        (Camera { up: (good.eye - good.target).as_vec3(), ..good }, "up"),
        (Camera { up: 1e-3 * (good.target - good.eye).as_vec3(), ..good }, "up"),
        (Camera { fov_y: 0.0, ..good }, "fov_y"),
        (Camera { fov_y: 180.0, ..good }, "fov_y"),
        (Camera { fov_y: f32::NAN, ..good }, "fov_y"),
        (Camera { near: Some(0.0), ..good }, "near"),
        (Camera { near: Some(f32::INFINITY), ..good }, "near"),
    ];
    for (camera, key) in bad {
        let error = camera.check().expect_err(key);
        assert!(matches!(error, Error::Invalid { .. }));
        assert_contains(&error.to_string(), &["camera", key]);
    }
    // A view straight down is valid with another up.
    let down = Camera { eye: DVec3::new(0.0, 3.0, 0.0), target: DVec3::ZERO, ..good };
    assert!(down.check().is_err());
    Camera { up: -Vec3::Z, ..down }.check().unwrap();
}

/// A fitted camera sees the whole box, at any size and position, and the box fills a good part of the
/// picture.
#[test]
fn a_fitted_camera_sees_the_whole_box() {
    let mut seed = 2;
    for i in 0..1000 {
        let scale = 10f64.powi(i % 9 - 4);
        let mut random = || random(&mut seed).as_dvec3();
        let centre = 3.0 * scale * random();
        let half = scale * random().abs();
        let (min, max) = (centre - half, centre + half);
        let camera = Camera::fit(min, max);
        camera.check().unwrap();
        let uniform = camera.uniform(UVec2::new(64, 48), DVec3::ZERO);
        let view_from_world =
            Mat3::from_cols_array_2d(&uniform.view_from_world.map(|[x, y, z, _]| [x, y, z]));
        let mut reach = 0f32;
        for corner in 0..8 {
            let bit = |axis: u32| f64::from(corner >> axis & 1);
            let corner = min + (max - min) * DVec3::new(bit(0), bit(1), bit(2));
            let seen = view_from_world * (corner - camera.eye).as_vec3();
            assert!(-seen.z > uniform.near, "{min} {max}: a corner is nearer than the near plane");
            let place = glam::Vec2::new(seen.x, seen.y).abs() / (-seen.z * uniform.tangent);
            assert!(place.max_element() <= 1.0, "{min} {max}: a corner is at {place}");
            reach = reach.max(place.max_element());
        }
        assert!(reach > 0.3, "{min} {max}: the box fills {reach} of the picture");
    }
}

/// Cameras and scenes fit boxes without volume, as of a single particle or a flat sheet, anywhere.
#[test]
fn a_camera_fits_flat_boxes() {
    for place in [DVec3::ZERO, DVec3::ONE, DVec3::new(-30.0, 100.0, 7.0), DVec3::splat(1000.0)] {
        Camera::fit(place, place).check().unwrap_or_else(|error| panic!("{place}: {error}"));
        Camera::fit(place, place + DVec3::X).check().unwrap();
        let scene = Scene::around(place, place, 0.1);
        scene.check().unwrap_or_else(|error| panic!("{place}: {error}"));
        let camera = Camera::fit(place - 0.1, place + 0.1);
        assert!(camera.eye.distance(place) > 0.2, "{place}: the eye is in the particle");
        // An unknown radius, 0, must not give a floor with invalid tiles.
        Scene::around(place, place, 0.0).check().unwrap_or_else(|error| panic!("{error}"));
    }
}

/// Calibrated cameras and poses have four numbers in a row, and no more.
#[test]
fn calibrated_cameras_are_read_from_files() {
    let file = |intrinsics: &str, row: &str| {
        format!(
            "[camera]\npose = [[1, 0, 0, 0.5], {row}, [0, 0, -1, 3], [0, 0, 0, 1]]\n\
             intrinsics = {intrinsics}\nsize = [640, 480]\n"
        )
    };
    let (intrinsics, row) = ("[700.0, 710.0, 300.0, 250.0]", "[0, -1, 0, 0.25]");
    let camera = project(&file(intrinsics, row)).camera.unwrap();
    assert_eq!(camera.eye, DVec3::new(0.5, 0.25, 3.0));
    assert_eq!(camera.up, Vec3::Y);
    let expected = Lens::Pinhole {
        focal: DVec2::new(700.0, 710.0),
        principal: DVec2::new(300.0, 250.0),
        size: DVec2::new(640.0, 480.0),
    };
    assert_eq!(camera.lens, Some(expected));
    for text in [file("[700, 0, 710, 300, 250]", row), file(intrinsics, "[0, -1, 0, 0, 25]")] {
        let error = parse(&text).unwrap_err().to_string();
        assert_contains(&error, &["expected 4", "points, not commas"]);
    }
    let error = parse(&file(intrinsics, row).replace("480", "480, 0")).unwrap_err().to_string();
    assert_contains(&error, &["camera.size has 3 numbers, expected 2"]);
}
