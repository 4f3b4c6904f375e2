//! `layers.wgsl`: encoding of planes in texels.

use glam::DVec2;

use crate::support::view::{View, assert_near, case, vec3};
use crate::support::{Kernel, Random, gpu, uniform};

/// The plane through a point with a normal has the point's disparity at its pixel, faces away from the
/// eye, and keeps the normal, down to an edge-on cosine of 1e-3.
#[test]
fn layers_planes_from_normals() {
    let Some(gpu) = gpu() else { return };
    let view = View::of_size(640, 480, 1e-3);
    let buffer = uniform(gpu, &view.uniform);
    let kernel = Kernel {
        imports: &["common/layers.wgsl", "common/camera.wgsl"],
        body: "fn test(x: array<f32, 7>) -> array<f32, 3> {
            let pi = plane_from_normal(vec3f(x[0], x[1], x[2]), x[3], vec3f(x[4], x[5], x[6]));
            return array(pi.x, pi.y, pi.z);
        }",
        constants: &[],
        resources: &[(0, 0, buffer.as_entire_binding())],
    };
    let mut random = Random(6);
    let cases: Vec<[f32; 7]> = (0..20_000)
        .map(|i| {
            let omega = view.omega(random.pixel(view.pixels()));
            let mut n = random.direction();
            // Every second case is edge-on: off by 1e-9 to 0.1, to either side.
            if i % 2 == 0 {
                let ray = omega.normalize();
                let across = n.cross(ray).normalize();
                let off = random.magnitude(1e-9, 0.1) * if i % 4 == 0 { 1.0 } else { -1.0 };
                n = (across + off * ray).normalize();
            }
            case(&[&omega.to_array(), &[random.magnitude(1e-3, 1e4)], &n.to_array()])
        })
        .collect();
    let results: Vec<[f32; 3]> = kernel.run(gpu, &cases);
    for (x, result) in cases.iter().zip(results) {
        let (omega, z, n) = (vec3(&x[..3]), f64::from(x[3]), vec3(&x[4..7]));
        let pi = vec3(&result);
        let ray = omega.normalize();
        let cosine = n.dot(ray);
        assert!(pi.is_finite() && pi.dot(omega) > 0.0, "{x:?} gives {pi}");
        // For a plane seen at a slant, disparity is a small difference of large numbers.
        let slant = cosine.abs().max(1e-3);
        assert_near(z * pi.dot(omega), 1.0, 6e-7 / slant, "disparity at the pixel");
        // Within rounding of edge-on, either sign is correct.
        let angle = pi.normalize().distance(n).min(pi.normalize().distance(-n));
        let turned = (1e-3 - cosine.abs()).max(0.0);
        assert_near(angle, 0.0, turned + 1e-6, "direction");
    }
}

/// A plane is rebuilt from its disparities at neighbouring pixels, as in the last step of smoothing.
#[test]
fn layers_planes_from_gradients() {
    let Some(gpu) = gpu() else { return };
    let view = View::of_size(640, 480, 1e-3);
    let buffer = uniform(gpu, &view.uniform);
    let kernel = Kernel {
        imports: &["common/layers.wgsl", "common/camera.wgsl"],
        body: "fn test(x: array<f32, 5>) -> array<f32, 3> {
            let omega = camera_omega(vec2f(x[0], x[1]));
            let pi = plane_from_gradient(omega, x[2], vec2f(x[3], x[4]));
            return array(pi.x, pi.y, pi.z);
        }",
        constants: &[],
        resources: &[(0, 0, buffer.as_entire_binding())],
    };
    let mut random = Random(7);
    let (cases, planes): (Vec<[f32; 5]>, Vec<_>) = (0..10_000)
        .map(|_| {
            let u = (random.pixel(view.pixels()).floor() + 0.5).as_vec2().as_dvec2();
            let n = random.direction();
            let point = random.magnitude(1e-3, 1e4) * view.omega(u);
            let pi = n / n.dot(point);
            let disparity = |x: f64, y: f64| pi.dot(view.omega(u + DVec2::new(x, y)));
            let slope = [disparity(1.0, 0.0), disparity(0.0, 1.0)].map(|d| d - disparity(0.0, 0.0));
            (case(&[&u.to_array(), &[disparity(0.0, 0.0)], &slope]), pi)
        })
        .unzip();
    let results: Vec<[f32; 3]> = kernel.run(gpu, &cases);
    for (result, pi) in results.iter().zip(planes) {
        // Three products of rounded inputs, each as large as the plane itself.
        let error = vec3(result).distance(pi) / pi.length();
        assert_near(error, 0.0, 6e-7, "relative error of the plane");
    }
}
