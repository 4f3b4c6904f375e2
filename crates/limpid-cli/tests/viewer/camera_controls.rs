//! Camera controls, checked against closed forms.

use glam::{DVec2, DVec3, Vec3};
use limpid::camera::{Camera, Lens};
use limpid_viewer::picture::camera_controls;

/// Cameras at several scales, some near the poles.
fn cameras() -> Vec<Camera> {
    let views =
        [DVec3::new(0.3, 0.5, 1.0), DVec3::new(1e-4, 1.0, 0.0), DVec3::new(-1.0, -3.0, 0.2)];
    let scales = [1e-3, 1.0, 1e4];
    let camera = |scale: f64, view: DVec3| Camera {
        eye: scale * (view + DVec3::new(0.1, 0.2, 0.3)),
        target: scale * DVec3::new(0.1, 0.2, 0.3),
        up: Vec3::Y,
        fov_y: 40.0,
        near: None,
        lens: None,
    };
    scales.into_iter().flat_map(|scale| views.map(|view| camera(scale, view))).collect()
}

fn close(a: DVec3, b: DVec3, scale: f64) -> bool {
    (a - b).length() <= 1e-9 * scale
}

/// An orbit keeps distance and target, a full turn is the identity, small turns add up, and the view
/// does not flip at the poles.
#[test]
fn orbit_keeps_distance_and_horizon() {
    for camera in cameras() {
        let distance = camera.eye.distance(camera.target);
        let turned = camera_controls::orbit(&camera, DVec2::new(0.7, 0.0));
        assert_eq!(turned.target, camera.target);
        assert!((turned.eye.distance(turned.target) / distance - 1.0).abs() < 1e-12);
        let around = camera_controls::orbit(&camera, DVec2::new(std::f64::consts::TAU, 0.0));
        assert!(close(around.eye, camera_controls::orbit(&camera, DVec2::ZERO).eye, distance));
        let thrice = (0..3).fold(camera, |c, _| camera_controls::orbit(&c, DVec2::new(0.1, 0.01)));
        assert!(close(
            thrice.eye,
            camera_controls::orbit(&camera, DVec2::new(0.3, 0.03)).eye,
            1e3 * distance
        ));
        // Beyond the pole the eye stays on its side, and the picture upright.
        for up in [9.0, -9.0] {
            let top = camera_controls::orbit(&camera, DVec2::new(0.0, up));
            top.check().expect("a valid camera");
            let [right, above, _] = camera_controls::axes(&top);
            let [before, ..] = camera_controls::axes(&camera_controls::orbit(&camera, DVec2::ZERO));
            assert!(above.y > 0.0 && right.dot(before) > 0.999, "{camera:?}");
        }
    }
}

/// Views along axes keep target and distance; y is up in the picture, and from above and below x is to the right.
#[test]
fn views_along_axes_are_upright() {
    for camera in cameras() {
        let distance = camera.eye.distance(camera.target);
        for direction in DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]) {
            let seen = camera_controls::from_direction(&camera, direction);
            seen.check().expect("a valid camera");
            assert_eq!(seen.target, camera.target);
            let offset = seen.eye - seen.target;
            assert!((offset.length() / distance - 1.0).abs() < 1e-4);
            assert!(offset.normalize().dot(direction) > 0.9999);
            let [right, above, _] = camera_controls::axes(&seen);
            match direction.y == 0.0 {
                true => assert!(above.y > 0.9999),
                false => assert!(right.x > 0.9999),
            }
        }
    }
}

/// Pans move eye and target by the same share of the picture, zooms are exponential and keep the point
/// under the pointer, and flights move along the axes.
#[test]
fn pan_zoom_and_fly_have_their_closed_forms() {
    for camera in cameras() {
        let distance = camera.eye.distance(camera.target);
        let [right, up, back] = camera_controls::axes(&camera);
        let height = 2.0 * distance * 20f64.to_radians().tan();
        let panned = camera_controls::pan(&camera, DVec2::new(0.25, -0.5));
        let moved = height * (0.25 * right - 0.5 * up);
        assert!(close(panned.eye - camera.eye, moved, distance));
        assert!(close(panned.target - camera.target, moved, distance));

        let near = camera_controls::zoom(&camera, 0.5, DVec2::ZERO);
        assert!(close(near.target, camera.target, distance));
        assert!((near.eye.distance(near.target) / distance - (-0.5f64).exp()).abs() < 1e-9);
        let back_again = camera_controls::zoom(&near, -0.5, DVec2::ZERO);
        assert!(close(back_again.eye, camera.eye, distance));
        let cursor = DVec2::new(0.6, -0.3);
        let at_cursor = |c: &Camera| {
            let [right, up, _] = camera_controls::axes(c);
            let half = c.eye.distance(c.target) * 20f64.to_radians().tan();
            c.target + half * (cursor.x * right + cursor.y * up)
        };
        let zoomed = camera_controls::zoom(&camera, 0.8, cursor);
        assert!(close(at_cursor(&zoomed), at_cursor(&camera), 10.0 * distance));

        let flown = camera_controls::fly(&camera, distance * DVec3::new(0.0, 0.0, 0.5));
        assert!(close(flown.eye, camera.eye - 0.5 * distance * back, distance));
        assert!((flown.eye.distance(flown.target) / distance - 1.0).abs() < 1e-9);
        let looked = camera_controls::look(&camera, DVec2::new(0.2, 0.0));
        assert_eq!(looked.eye, camera.eye);
        assert!((looked.target - camera.target).dot(right) > 0.0, "to the right");
    }
}

/// A fitted view contains all of the box and is filled by it, at any scale and aspect ratio.
#[test]
fn fit_shows_all_of_the_box() {
    for scale in [1e-3, 1.0, 1e4] {
        for (half, aspect) in [(DVec3::new(1.0, 0.1, 0.4), 1.6), (DVec3::new(0.2, 2.0, 0.2), 0.7)] {
            let centre = scale * DVec3::new(5.0, -2.0, 1.0);
            let (min, max) = (centre - scale * half, centre + scale * half);
            for camera in cameras() {
                let fitted = camera_controls::fit(&camera, (min, max), aspect);
                fitted.check().expect("a valid camera");
                let [right, up, back] = camera_controls::axes(&fitted);
                let tangent = 20f64.to_radians().tan();
                let reach = (0..8).map(|i| {
                    let pick = |bit: u32, axis: usize| {
                        if i >> bit & 1 == 0 { min[axis] } else { max[axis] }
                    };
                    let corner = DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2)) - fitted.eye;
                    let depth = -corner.dot(back);
                    assert!(depth > 0.0);
                    let x = corner.dot(right).abs() / (depth * tangent * aspect);
                    x.max(corner.dot(up).abs() / (depth * tangent))
                });
                let reach = reach.fold(0.0, f64::max);
                assert!(reach <= 1.0 && reach > 0.8, "{reach}");
            }
        }
    }
}

/// With parallel rays a zoom changes the height of the picture, not the distance, and keeps the point under the pointer;
/// a pan moves by shares of that height, and the whole of a box fits into it.
#[test]
fn parallel_cameras_change_their_height() {
    for camera in cameras() {
        let distance = camera.eye.distance(camera.target);
        let height = 0.7 * distance;
        let camera = Camera { lens: Some(Lens::Orthographic { height }), ..camera };
        let height_of = |camera: &Camera| match camera.lens {
            Some(Lens::Orthographic { height }) => height,
            other => panic!("{other:?}"),
        };
        let cursor = DVec2::new(0.4, -0.3);
        let zoomed = camera_controls::zoom(&camera, 0.5, cursor);
        assert!((height_of(&zoomed) / height - (-0.5f64).exp()).abs() < 1e-12);
        assert!(close(zoomed.eye - zoomed.target, camera.eye - camera.target, distance));
        let [right, up, _] = camera_controls::axes(&camera);
        let under = |camera: &Camera| {
            camera.target + 0.5 * height_of(camera) * (cursor.x * right + cursor.y * up)
        };
        assert!(close(under(&zoomed), under(&camera), distance));
        let panned = camera_controls::pan(&camera, DVec2::new(0.25, 0.0));
        assert!(close(panned.target, camera.target + 0.25 * height * right, distance));
        let half = distance * DVec3::new(0.2, 0.3, 0.1);
        let fitted = camera_controls::fit(&camera, (-half, half), 1.5);
        let corner = |i: u32| {
            let sign = |bit: u32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            half * DVec3::new(sign(0), sign(1), sign(2))
        };
        let shares = (0..8).map(|i| {
            let corner = corner(i);
            corner.dot(up).abs().max(corner.dot(right).abs() / 1.5) / (0.5 * height_of(&fitted))
        });
        let most = shares.fold(0.0, f64::max);
        assert!((most - 1.0 / 1.05).abs() < 1e-9, "{most}");
        assert!(fitted.eye.distance(fitted.target) > half.length());
    }
}
