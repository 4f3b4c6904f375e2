//! `camera.wgsl`: view space, rays and pixel positions.

use glam::{DVec2, DVec3, UVec2, Vec3};
use limpid::camera::Camera;

use crate::support::view::{View, assert_near, case, number, vec3};
use crate::support::{Kernel, Random, gpu, uniform};

/// Pixel positions and view rays are inverse to each other, pixels start at the top left, and
/// `Camera::uniform` agrees with a hand-built view.
#[test]
fn camera_rays_and_pixels_are_inverse() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(5);
    for (size, fov_y) in [(UVec2::new(1920, 1080), 45.0), (UVec2::new(7, 301), 100.0)] {
        let camera = Camera {
            eye: DVec3::new(3.0, -2.0, 5.0),
            target: DVec3::new(-1.0, 0.5, 0.25),
            up: Vec3::new(0.2, 1.0, 0.1),
            fov_y,
            near: None,
            lens: None,
        };
        let view = View::new(&camera, size);
        let buffer = uniform(gpu, &view.uniform);
        let kernel = Kernel {
            imports: &["common/camera.wgsl"],
            body: "fn test(x: array<f32, 6>) -> array<f32, 14> {
                let omega = camera_omega(vec2f(x[0], x[1]));
                let u = camera_pixel(x[2] * omega);
                let world = vec3f(x[3], x[4], x[5]);
                let in_view = camera_view_direction(camera.origin + world);
                let p = camera_pixel(in_view);
                let w = camera_world_point(in_view);
                let d = camera_world_direction(camera_view_direction(world));
                return array(omega.x, omega.y, omega.z, u.x, u.y, p.x, p.y, -in_view.z,
                    w.x, w.y, w.z, d.x, d.y, d.z);
            }",
            constants: &[],
            resources: &[(0, 0, buffer.as_entire_binding())],
        };
        let (eye, target, up) = (camera.eye, camera.target, camera.up.as_dvec3());
        let forward = (target - eye).normalize();
        let right = forward.cross(up).normalize();
        let upward = right.cross(forward);
        let tangent_y = (f64::from(fov_y).to_radians() / 2.0).tan();
        let tangent = DVec2::new(tangent_y * view.size.x / view.size.y, tangent_y);

        let cases: Vec<[f32; 6]> = (0..5000)
            .map(|_| {
                let u = random.pixel(size);
                // A world point in front of the eye, inside and around the picture.
                let slope = (DVec2::new(random.unit(), random.unit()) - 0.5) * 4.0 * tangent;
                let world = eye
                    + random.magnitude(0.1, 100.0) * (forward + slope.x * right + slope.y * upward);
                case(&[&u.to_array(), &[random.magnitude(1e-3, 1e4)], &world.to_array()])
            })
            .collect();
        let results: Vec<[f32; 14]> = kernel.run(gpu, &cases);
        for (x, result) in cases.iter().zip(results) {
            let u = DVec2::new(number(*x, 0), number(*x, 1));
            let omega = vec3(&result[..3]);
            let scale = tangent.max_element().max(1.0);
            assert_near(omega.distance(view.omega(u)), 0.0, 5e-7 * scale, "omega");
            assert_eq!(result[2], -1.0, "unit depth");
            // A unit in the last place of a pixel position is 1e-7 of the picture.
            let there = DVec2::new(number(result, 3), number(result, 4));
            assert_near(there.distance(u), 0.0, 1e-6 * view.size.max_element(), "pixel of omega");

            let world = vec3(&x[3..6]);
            let (a, b, z) = {
                let offset = world - eye;
                (offset.dot(right), offset.dot(upward), offset.dot(forward))
            };
            // The kernel's points are relative to the world origin, so errors scale with the eye's
            // distance from it.
            let rounding = 1e-6 * (world.length() + eye.length());
            assert_near(number(result, 7), z, rounding, "depth");
            let expected =
                DVec2::new(0.5 + 0.5 * a / (z * tangent.x), 0.5 - 0.5 * b / (z * tangent.y));
            let got = DVec2::new(number(result, 5), number(result, 6)) / view.size;
            let tolerance = (1.0 + 3.0 / tangent.min_element()) * rounding / z + 2e-6;
            assert_near(got.distance(expected), 0.0, tolerance, "pixel of a world point");
            assert_near(
                vec3(&result[8..11]).distance(world - eye),
                0.0,
                4.0 * rounding,
                "and back",
            );
            assert_near(vec3(&result[11..14]).distance(world), 0.0, 4.0 * rounding, "direction");
        }
    }
}
