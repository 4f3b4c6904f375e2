//! The mathematics of the shaders, run on the device against closed forms in 64 bits.
//!
//! References are computed from the 32-bit values that the device was given, so that tolerances
//! speak of the shaders' own rounding alone: 2^-24 = 6e-8 per operation, and for division, square
//! roots and the like the few units in the last place that WGSL allows.

mod support;
#[path = "support/view.rs"]
mod view;

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec2, DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::gpu::Gpu;
use limpid::wgpu;
use support::{Kernel, Random, gpu, texture, uniform};
use view::{NOTHING, View, assert_near, case, distance_to_line, number, round3, vec3};

// ---------------------------------------------------------------------------------------------
// optics.wgsl

/// Cosine of the transmitted angle, reflectance, Schlick's reflectance.
fn interface(gpu: &Gpu, cases: &[[f32; 2]]) -> Vec<[f32; 3]> {
    let kernel = Kernel {
        imports: &["common/optics.wgsl"],
        body: "fn test(x: array<f32, 2>) -> array<f32, 3> {
            let c = optics_cos_transmitted(x[0], x[1]);
            return array(c, optics_fresnel(x[0], c, x[1]), optics_schlick(x[0], c, x[1]));
        }",
        constants: &[],
        resources: &[],
    };
    kernel.run(gpu, cases)
}

/// Unpolarised reflectance from the angles (Fresnel's sine and tangent laws); 1 beyond the
/// critical angle.
fn fresnel(sin2_i: f64, sin2_t: f64, eta: f64) -> f64 {
    if sin2_t >= 1.0 {
        return 1.0;
    }
    if sin2_i < 1e-12 {
        return ((eta - 1.0) / (eta + 1.0)).powi(2);
    }
    let (i, t) = (sin2_i.sqrt().asin(), sin2_t.max(0.0).sqrt().asin());
    let s = (i - t).sin() / (i + t).sin();
    let p = (i - t).tan() / (i + t).tan();
    0.5 * (s * s + p * p)
}

/// Protects the textbook's numbers: Snell's angles, the critical angle between water and air to a
/// ten-thousandth of a degree, Fresnel's and Schlick's reflectances.
#[test]
fn optics_known_angles() {
    let Some(gpu) = gpu() else { return };
    let into = 1.33;
    let out = 1.0 / 1.33;
    let at = |degrees: f64, eta: f64| [degrees.to_radians().cos() as f32, eta as f32];
    let cases = [
        at(30.0, into),
        at(0.0, into),
        at(0.0, out),
        at(45.0, out),
        at(48.7534, out),
        at(48.7536, out),
        at(89.0, out),
        at(90.0, into),
    ];
    let results = interface(gpu, &cases);
    let [cos_t, reflectance, schlick] = [0, 1, 2].map(|i| move |r: [f32; 3]| number(r, i));
    assert_near(cos_t(results[0]).acos().to_degrees(), 22.0824, 5e-5, "refracted angle");
    for normal in &results[1..3] {
        assert_near(cos_t(*normal), 1.0, 1e-7, "straight through");
        // 0.33^2 / 2.33^2, from either side.
        assert_near(reflectance(*normal), 0.020_059, 5e-7, "reflectance at normal incidence");
        assert_near(schlick(*normal), 0.020_059, 5e-7, "Schlick at normal incidence");
    }
    assert_near(reflectance(results[3]), 0.13419, 5e-6, "water to air at 45 degrees");
    assert_near(schlick(results[3]), 0.14285, 5e-6, "Schlick with the transmitted cosine");
    // The critical angle is 48.75347 degrees; a ten-thousandth of a degree is 3e-6 in the squared
    // sine, ten times what rounding does to it.
    assert!(cos_t(results[4]) >= 0.0 && reflectance(results[4]) < 1.0, "transmits: {results:?}");
    // Light along the surface: all of it is reflected, what is left goes in at the critical angle.
    assert_near(cos_t(results[7]).acos().to_degrees(), 48.7535, 1e-4, "grazing");
    assert_near(reflectance(results[7]), 1.0, 1e-6, "grazing reflectance");
    for total in &results[5..7] {
        assert!(cos_t(*total) < 0.0, "totally reflected: {total:?}");
        assert_eq!(total[1..], [1.0, 1.0]);
    }
}

/// Protects Snell's and Fresnel's laws at every angle and index, the critical angle included.
#[test]
fn optics_match_closed_forms() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(1);
    let cases: Vec<_> = (0..20_000)
        .map(|i| {
            // A third of the cosines is small: grazing.
            let cosine = if i % 3 == 0 { random.magnitude(1e-9, 1.0) } else { random.unit() };
            let eta = random.range(1.02, 3.0);
            [cosine as f32, if i % 2 == 0 { eta } else { 1.0 / eta } as f32]
        })
        .collect();
    // Rounding of the squared transmitted sine: four operations on numbers of about 1, and the
    // division. Near the critical angle its root amplifies it, so results are held against what
    // this uncertainty allows.
    const ROUNDING: f64 = 5e-7;
    for (x, result) in cases.iter().zip(interface(gpu, &cases)) {
        let (cos_i, eta) = (f64::from(x[0]), f64::from(x[1]));
        let sin2_i = 1.0 - cos_i * cos_i;
        let sin2_t = sin2_i / (eta * eta);
        let [cos_t, reflectance, schlick] = result.map(f64::from);
        if cos_t < 0.0 {
            assert!(sin2_t > 1.0 - ROUNDING, "{x:?} must transmit");
        } else {
            let low = (1.0 - sin2_t - ROUNDING).max(0.0).sqrt();
            let high = (1.0 - sin2_t + ROUNDING).max(0.0).sqrt();
            assert!((low - 1e-6..=high + 1e-6).contains(&cos_t), "{x:?} gives cosine {cos_t}");
        }
        let near = fresnel(sin2_i, sin2_t - ROUNDING, eta);
        let far = fresnel(sin2_i, sin2_t + ROUNDING, eta);
        let (low, high) = (near.min(far) - 2e-6, near.max(far) + 2e-6);
        assert!((low..=high).contains(&reflectance), "{x:?} reflects {reflectance}, not {near}");
        for share in [reflectance, schlick] {
            assert!((0.0..=1.0).contains(&share), "{x:?}: a share of {share}");
        }
    }
}

/// Protects Helmholtz's reciprocity: an interface reflects as much from either side of a path.
#[test]
fn optics_are_reciprocal() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(2);
    let cases: Vec<_> = (0..5000)
        .map(|_| [random.range(1e-3, 1.0) as f32, random.range(1.02, 3.0) as f32])
        .collect();
    let there = interface(gpu, &cases);
    let back: Vec<_> = cases.iter().zip(&there).map(|(x, r)| [r[0], 1.0 / x[1]]).collect();
    for ((x, there), back) in cases.iter().zip(&there).zip(interface(gpu, &back)) {
        let cos_i = number(*x, 0);
        // The way back has the first angle, as far as the rounding of its square lets it.
        assert_near(number(back, 0), cos_i, 1e-6 / cos_i + 1e-6, "the way back");
        // A reflectance falls from 1 at grazing by at most about 4 eta per cosine.
        let tolerance = 4.0 * number(*x, 1) * 1e-6 / cos_i + 2e-6;
        assert_near(number(back, 1), number(*there, 1), tolerance, "the reflectance back");
    }
}

/// Protects against NaN where ratios have no limit: grazing rays, and a liquid without contrast.
#[test]
fn optics_are_finite_at_grazing() {
    let Some(gpu) = gpu() else { return };
    let cosines = [0.0, 1e-38, 1e-20, 1e-8, 1e-4, 1e-2];
    let cases = |eta: f64| cosines.map(|cosine: f64| [cosine as f32, eta as f32]).to_vec();
    for eta in [1.33, 1.0 / 1.33, 1.001, 3.0] {
        for (x, [cos_t, reflectance, schlick]) in
            cases(eta).into_iter().zip(interface(gpu, &cases(eta)))
        {
            assert!(cos_t.is_finite(), "{x:?} gives cosine {cos_t}");
            let shares = [reflectance, schlick];
            assert!(shares.iter().all(|s| (0.0..=1.0).contains(s)), "{x:?} gives {shares:?}");
        }
        let [_, reflectance, schlick] = interface(gpu, &cases(eta))[0];
        assert_eq!([reflectance, schlick], [1.0, 1.0], "all is reflected at 90 degrees");
    }
}

/// Protects the same for an index of exactly 1, which scenes may have: nothing is there to reflect.
#[test]
fn optics_without_contrast_are_finite() {
    let Some(gpu) = gpu() else { return };
    for cosine in [1.0, 0.5, 1e-2, 0.0] {
        let [cos_t, reflectance, _] = interface(gpu, &[[cosine, 1.0]])[0];
        assert!(cos_t.is_finite() && reflectance.is_finite(), "{cosine}: {cos_t} {reflectance}");
        if cosine > 0.0 {
            assert_near(reflectance.into(), 0.0, 1e-6, "no contrast, no reflection");
        }
    }
}

/// Protects refracted directions: unit, in the plane of incidence, on the far side, at Snell's
/// angle, from normal to grazing incidence and up to the critical angle.
#[test]
fn optics_refract_directions() {
    let Some(gpu) = gpu() else { return };
    let kernel = Kernel {
        imports: &["common/optics.wgsl"],
        body: "fn test(x: array<f32, 7>) -> array<f32, 4> {
            let d = vec3f(x[0], x[1], x[2]);
            let n = vec3f(x[3], x[4], x[5]);
            let cos_i = -dot(d, n);
            let cos_t = optics_cos_transmitted(cos_i, x[6]);
            let out = optics_refract(d, n, cos_i, max(cos_t, 0.0), x[6]);
            return array(out.x, out.y, out.z, cos_t);
        }",
        constants: &[],
        resources: &[],
    };
    let mut random = Random(3);
    let mut cases: Vec<[f32; 7]> = (0..10_000)
        .map(|i| {
            let n = random.direction();
            let d = random.direction();
            let d = if d.dot(n) > 0.0 { -d } else { d };
            let eta = random.range(1.02, 3.0);
            case(&[&d.to_array(), &n.to_array(), &[if i % 2 == 0 { eta } else { 1.0 / eta }]])
        })
        .collect();
    let grazing = cases.len();
    cases.push(case(&[&[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0], &[1.33]]));
    let results: Vec<[f32; 4]> = kernel.run(gpu, &cases);
    for (x, result) in cases.iter().zip(&results) {
        let (d, n, eta) = (vec3(&x[..3]), vec3(&x[3..6]), f64::from(x[6]));
        let (out, cos_t) = (vec3(&result[..3]), f64::from(result[3]));
        let cos_i = -d.dot(n);
        let along = d + cos_i * n;
        let sin_t = along.length() / eta;
        if sin_t >= 1.0 - 1e-6 {
            continue; // total reflection: tested above
        }
        assert!(cos_t > 0.0, "{x:?} must transmit");
        let expected =
            (sin_t * along.normalize_or_zero() - (1.0 - sin_t * sin_t).sqrt() * n).normalize();
        // The transmitted cosine is the root of a number known to 5e-7; the inputs are unit
        // vectors to 1e-7.
        let tolerance = 2e-6 + 1e-6 / (1.0 - sin_t * sin_t).sqrt();
        assert_near(out.distance(expected), 0.0, tolerance, "refracted direction");
        assert_near(out.length(), 1.0, 3e-7, "unit vector");
    }
    let down = vec3(&results[grazing][..3]);
    assert_near((-down.y).acos().to_degrees(), 48.7535, 5e-5, "90 degrees, below the normal");
}

/// Protects absorption: Beer and Lambert's law per channel, from a drop to an ocean.
#[test]
fn optics_transmittance_is_exponential() {
    let Some(gpu) = gpu() else { return };
    let kernel = Kernel {
        imports: &["common/optics.wgsl"],
        body: "fn test(x: array<f32, 4>) -> array<f32, 3> {
            let t = optics_transmittance(vec3f(x[0], x[1], x[2]), x[3]);
            return array(t.x, t.y, t.z);
        }",
        constants: &[],
        resources: &[],
    };
    let mut random = Random(4);
    let mut cases: Vec<[f32; 4]> = (0..2000)
        .map(|_| {
            let sigma = DVec3::new(0.0, random.magnitude(1e-3, 1e3), random.unit());
            case(&[&sigma.to_array(), &[random.magnitude(1e-4, 1e4)]])
        })
        .collect();
    // The middle ray of a ball in water, as long as the literature's check has it.
    cases.push([1.0, 0.0, 1e30, 1.85329]);
    let results: Vec<[f32; 3]> = kernel.run(gpu, &cases);
    for (x, result) in cases.iter().zip(&results) {
        for channel in 0..3 {
            let depth = f64::from(x[channel]) * f64::from(x[3]);
            // The exponent is rounded: an absolute error in it is a relative one of the result.
            let tolerance = 1e-6 + 2e-6 * depth * (-depth).exp();
            assert_near(number(*result, channel), (-depth).exp(), tolerance, "transmittance");
        }
    }
    assert_near(results[2000][0].into(), 0.156_721, 1e-6, "through the ball");
    assert_eq!(results[2000][1..], [1.0, 0.0]);
}

// ---------------------------------------------------------------------------------------------
// camera.wgsl and layers.wgsl

/// Protects the conventions of view space: pixel positions and view rays are inverse to each other,
/// pixels count from the top left, and `Camera::uniform` agrees with a view built by hand.
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
                // A world point in front of the eye, on and around the picture.
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
            // The kernel's points are counted from the world's origin, so errors are of the eye's
            // distance to it.
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

/// Protects the meaning of a texel: the plane through a point with a normal has the point's
/// disparity at its pixel, faces away from the eye, and keeps the normal, edge-on to 1e-3.
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
            // Edge-on ones in every second case: off the edge by 1e-9 to 0.1, to either side.
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
        // Of a plane seen at a slant, the disparity is a small difference of large numbers.
        let slant = cosine.abs().max(1e-3);
        assert_near(z * pi.dot(omega), 1.0, 6e-7 / slant, "disparity at the pixel");
        // Within rounding of the edge, either side is as good.
        let angle = pi.normalize().distance(n).min(pi.normalize().distance(-n));
        let turned = (1e-3 - cosine.abs()).max(0.0);
        assert_near(angle, 0.0, turned + 1e-6, "direction");
    }
}

/// Protects smoothing's last step: a plane is rebuilt from its disparities at neighbouring pixels.
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

// ---------------------------------------------------------------------------------------------
// screen_ray.wgsl

/// What the device makes of a ray.
struct Ray {
    start: DVec2,
    end: DVec2,
    at: DVec3,
    end_point: DVec3,
    residuals: [f64; 3], // at tau 0, tau, 1
    slope: f64,
    root: f64,
    at_root: DVec3,
    texel: DVec2,
    tau_per_pixel: f64,
}

/// Cases are origin, direction, reach, plane, tau.
fn screen_rays(gpu: &Gpu, view: &View, cases: &[[f32; 11]]) -> Vec<Ray> {
    let buffer = uniform(gpu, &view.uniform);
    let kernel = Kernel {
        imports: &["common/screen_ray.wgsl", "common/camera.wgsl"],
        body: "fn test(x: array<f32, 11>) -> array<f32, 21> {
            let ray = screen_ray(vec3f(x[0], x[1], x[2]), vec3f(x[3], x[4], x[5]), x[6]);
            let pi = vec3f(x[7], x[8], x[9]);
            let end = ray.u + ray.du;
            let at = screen_ray_point(ray, x[10]);
            let end_point = screen_ray_point(ray, 1.0);
            let start = screen_ray_residual(ray, pi, 0.0);
            let slope = screen_ray_residual_slope(ray, pi);
            let root = -start / slope;
            let at_root = screen_ray_point(ray, root);
            let texel = vec2f(screen_ray_texel(ray, 1.0));
            return array(ray.u.x, ray.u.y, end.x, end.y, at.x, at.y, at.z,
                end_point.x, end_point.y, end_point.z,
                start, screen_ray_residual(ray, pi, x[10]), screen_ray_residual(ray, pi, 1.0),
                slope, root, at_root.x, at_root.y, at_root.z, texel.x, texel.y, ray.tau_per_pixel);
        }",
        constants: &[],
        resources: &[(0, 0, buffer.as_entire_binding())],
    };
    let results: Vec<[f32; 21]> = kernel.run(gpu, cases);
    let pair = |x: &[f32]| DVec2::new(x[0].into(), x[1].into());
    let ray = |r: &[f32; 21]| Ray {
        start: pair(&r[0..]),
        end: pair(&r[2..]),
        at: vec3(&r[4..]),
        end_point: vec3(&r[7..]),
        residuals: [10, 11, 12].map(|i| f64::from(r[i])),
        slope: r[13].into(),
        root: r[14].into(),
        at_root: vec3(&r[15..]),
        texel: pair(&r[18..]),
        tau_per_pixel: r[20].into(),
    };
    results.iter().map(ray).collect()
}

fn ray_case(o: DVec3, d: DVec3, reach: f64, pi: DVec3, tau: f64) -> [f32; 11] {
    case(&[&o.to_array(), &d.to_array(), &[reach], &pi.to_array(), &[tau]])
}

/// A direction of one of the kinds that rays have: any; towards or away from the eye, exactly or
/// by less than a pixel; across the view.
fn awkward_direction(random: &mut Random, o: DVec3, kind: usize) -> DVec3 {
    let away = o.normalize();
    match kind % 6 {
        0 => -away,
        1 => away,
        2 => (away + random.magnitude(1e-8, 1e-3) * random.direction()).normalize(),
        3 => away.cross(random.direction()).normalize(),
        _ => random.direction(),
    }
}

/// Protects the parametrisation on which all intersectors rest: every tau is a point of the ray,
/// in front of the eye and in the picture, whatever the direction and at any distance; and the
/// residual against a plane is linear.
#[test]
fn screen_ray_points_lie_on_the_ray() {
    let Some(gpu) = gpu() else { return };
    let view = View::of_size(640, 480, 1e-3);
    let mut random = Random(8);
    let cases: Vec<_> = (0..30_000)
        .map(|i| {
            let o = random.magnitude(1e-3, 1e4) * view.omega(random.pixel(view.pixels()));
            let d = awkward_direction(&mut random, o, i);
            let reach = if i % 7 == 0 { random.magnitude(1e-3, 1e4) } else { NOTHING };
            let pi = random.direction() * random.magnitude(1e-4, 1e3);
            ray_case(o, d, reach, pi, random.unit())
        })
        .collect();
    for (x, ray) in cases.iter().zip(screen_rays(gpu, &view, &cases)) {
        let (o, d, pi) = (vec3(&x[..3]), vec3(&x[3..6]), vec3(&x[7..10]));
        let tau = f64::from(x[10]);
        for point in [ray.at, ray.end_point] {
            assert!(point.is_finite() && point.z < 0.0, "{x:?} passes {point}");
            // Of a ray that comes near the eye, the last digits are those of where it started.
            let tolerance = 1e-4 * point.length() + 2e-7 * o.length();
            assert_near(distance_to_line(point, o, d), 0.0, tolerance, "distance to the ray");
        }
        // The same digits, at the end's depth, in pixels.
        let blur = 4e-7 * o.length() / -ray.end_point.z * view.size.y / (2.0 * view.tangent.y);
        for (u, blur) in [(ray.start, 0.0), (ray.end, blur)] {
            let outside = (-u).max(u - view.size).max_element();
            assert!(outside <= 0.02 + blur, "{x:?} goes to {u}, {outside} px out of the picture");
        }
        assert!(ray.tau_per_pixel.is_finite() && ray.tau_per_pixel > 0.0, "{x:?}");
        // Each residual is a difference of numbers of this size.
        let size =
            pi.length() * view.omega(ray.start).length() + 1.0 / -ray.end_point.z - 1.0 / o.z;
        let line = ray.residuals[0] + tau * (ray.residuals[2] - ray.residuals[0]);
        assert_near(ray.residuals[1], line, 1e-6 * size, "the residual is linear");
        assert_near(ray.slope, ray.residuals[2] - ray.residuals[0], 1e-6 * size, "by its slope");
    }
}

/// Protects Newton's one step: the residual's root is where the ray meets the plane, within the
/// reach of the ray, for planes at any distance along it.
#[test]
fn screen_ray_roots_are_intersections() {
    let Some(gpu) = gpu() else { return };
    let view = View::of_size(640, 480, 1e-3);
    let mut random = Random(9);
    let mut cases = Vec::new();
    while cases.len() < 20_000 {
        let o = round3(random.magnitude(1e-2, 1e3) * view.omega(random.pixel(view.pixels())));
        let d = round3(random.direction());
        let t = random.magnitude(1e-3, 10.0) * -o.z;
        let hit = o + t * d;
        let u = view.pixel(hit);
        if hit.z > -view.near || (u - u.clamp(DVec2::ZERO, view.size)) != DVec2::ZERO {
            continue;
        }
        let n = random.direction();
        // A plane that the ray or the eye sees edge-on has no well-defined intersection.
        if n.dot(d).abs() < 0.05 || n.dot(hit.normalize()).abs() < 0.05 {
            continue;
        }
        cases.push(ray_case(o, d, NOTHING, n / n.dot(hit), 0.5));
    }
    for (x, ray) in cases.iter().zip(screen_rays(gpu, &view, &cases)) {
        let (o, d, pi) = (vec3(&x[..3]), vec3(&x[3..6]), vec3(&x[7..10]));
        let exact = o + (1.0 - pi.dot(o)) / pi.dot(d) * d;
        assert!((-1e-3..=1.001).contains(&ray.root), "{x:?}: root at {}", ray.root);
        let error = ray.at_root.distance(exact) / exact.length().max(o.length());
        assert_near(error, 0.0, 1e-4, "relative error of the intersection");
    }
}

/// Protects the clipping: a ray that ends one pixel inside a border is whole, one that ends a
/// pixel outside ends on the border, and one towards the eye ends at the near plane.
#[test]
fn screen_ray_is_clipped_at_every_border() {
    let Some(gpu) = gpu() else { return };
    let view = View::of_size(640, 480, 1e-2);
    let mut random = Random(10);
    let mut cases = Vec::new();
    let mut expected = Vec::new();
    for border in 0..4 {
        for outside in [-1.0, 1.0] {
            for _ in 0..500 {
                let start = DVec2::new(random.range(5.0, 635.0), random.range(5.0, 475.0));
                let along = DVec2::new(random.range(5.0, 635.0), random.range(5.0, 475.0));
                let (end, edge) = match border {
                    0 => (DVec2::new(-outside, along.y), DVec2::new(0.0, f64::NAN)),
                    1 => (DVec2::new(640.0 + outside, along.y), DVec2::new(640.0, f64::NAN)),
                    2 => (DVec2::new(along.x, -outside), DVec2::new(f64::NAN, 0.0)),
                    _ => (DVec2::new(along.x, 480.0 + outside), DVec2::new(f64::NAN, 480.0)),
                };
                // On the screen the ray is a straight line: it is cut where that meets the edge.
                let share = if outside < 0.0 {
                    1.0
                } else if edge.x.is_nan() {
                    (edge.y - start.y) / (end.y - start.y)
                } else {
                    (edge.x - start.x) / (end.x - start.x)
                };
                let o = random.magnitude(1.0, 100.0) * view.omega(start);
                let to = random.magnitude(1.0, 100.0) * view.omega(end) - o;
                cases.push(ray_case(o, to.normalize(), to.length(), DVec3::X, 0.5));
                expected.push(start + share * (end - start));
            }
        }
    }
    for ((x, ray), end) in cases.iter().zip(screen_rays(gpu, &view, &cases)).zip(&expected) {
        // A rounded direction misses by 1e-7 of the ray's length: up to 100 times the depth at its
        // end, of which a pixel is 1/600.
        assert_near(ray.end.distance(*end), 0.0, 0.02, &format!("end of {x:?} in px"));
        let inside = ray.texel.clamp(DVec2::ZERO, view.size - 1.0);
        assert_eq!(ray.texel, inside, "texels are in the picture");
    }

    // Towards the eye, and past it on either side.
    let cases: Vec<_> = (0..2000)
        .map(|_| {
            let o = random.magnitude(0.02, 100.0) * view.omega(0.5 * view.size);
            let past = random.direction() * random.unit() * 0.5 * view.near;
            ray_case(o, (past - o).normalize(), NOTHING, DVec3::X, 0.5)
        })
        .collect();
    for (x, ray) in cases.iter().zip(screen_rays(gpu, &view, &cases)) {
        let depth = -ray.end_point.z;
        // Relative to the ray's length, of which the near plane is a small part.
        let tolerance = 3e-7 * f64::from(-x[2]) + 1e-6 * view.near;
        assert!(depth >= view.near - tolerance, "{x:?} ends at depth {depth}");
        let on_screen = ray.end.clamp(DVec2::ZERO, view.size).distance(ray.end);
        if view.pixel(vec3(&x[..3])).distance(ray.end) < 200.0 {
            assert_near(depth, view.near, tolerance, "the near plane ends it");
        }
        assert!(on_screen < 1.0, "{x:?} ends at {}", ray.end);
    }
}

// ---------------------------------------------------------------------------------------------
// scene.wgsl and splat.wgsl

/// A solid's form, in 64 bits; numbered as in `common/scene.wgsl`.
#[derive(Debug, Clone, Copy)]
enum Form {
    Plane { normal: DVec3, half_extent: f64 },
    Box { half: DVec3 },
    Sphere { radius: f64 },
}

impl Form {
    /// Shape, extent, half extent.
    fn numbers(self) -> [f64; 5] {
        match self {
            Self::Plane { normal: n, half_extent } => [0.0, n.x, n.y, n.z, half_extent],
            Self::Box { half } => [1.0, half.x, half.y, half.z, 0.0],
            Self::Sphere { radius } => [2.0, radius, radius, radius, 0.0],
        }
    }

    fn grown(self, by: f64) -> Self {
        match self {
            Self::Plane { normal, half_extent } => {
                Self::Plane { normal, half_extent: half_extent + by }
            }
            Self::Box { half } => Self::Box { half: half + by },
            Self::Sphere { radius } => Self::Sphere { radius: radius + by },
        }
    }

    /// The nearest hit along o + t d, t > 0, seen from the solid's origin, and the normal there.
    fn trace(self, o: DVec3, d: DVec3) -> Option<(f64, DVec3)> {
        let mut hits = Vec::new();
        match self {
            Self::Plane { normal, half_extent } => {
                let t = -o.dot(normal) / d.dot(normal);
                let within = in_plane(normal, o + t * d).abs().max_element() <= half_extent;
                hits.extend(within.then_some((t, normal)));
            }
            Self::Box { half } => {
                // Each of the six faces as a rectangle.
                for axis in 0..3 {
                    for side in [-1.0, 1.0] {
                        let t = (side * half[axis] - o[axis]) / d[axis];
                        let mut x = o + t * d;
                        x[axis] = 0.0;
                        let mut normal = DVec3::ZERO;
                        normal[axis] = side;
                        hits.extend(x.abs().cmple(half).all().then_some((t, normal)));
                    }
                }
            }
            Self::Sphere { radius } => {
                let (a, b, c) = (d.dot(d), o.dot(d), o.dot(o) - radius * radius);
                let root = (b * b - a * c).sqrt();
                for t in [(-b - root) / a, (-b + root) / a] {
                    hits.push((t, (o + t * d) / radius));
                }
            }
        }
        hits.retain(|(t, _)| *t > 0.0 && t.is_finite());
        hits.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn distance(self, x: DVec3) -> f64 {
        match self {
            Self::Plane { normal, half_extent } => {
                let beside = in_plane(normal, x).abs().max_element() > half_extent;
                if beside { NOTHING } else { x.dot(normal).abs() }
            }
            Self::Box { half } => {
                let beyond = x.abs() - half;
                if beyond.max_element() <= 0.0 {
                    beyond.max_element()
                } else {
                    x.distance(x.clamp(-half, half))
                }
            }
            Self::Sphere { radius } => x.length() - radius,
        }
    }
}

/// A plane's own coordinates: the two axes other than the one its normal is closest to.
fn in_plane(normal: DVec3, x: DVec3) -> DVec2 {
    let a = normal.abs();
    if a.y >= a.x && a.y >= a.z {
        DVec2::new(x.x, x.z)
    } else if a.x >= a.z {
        DVec2::new(x.z, x.y)
    } else {
        DVec2::new(x.x, x.y)
    }
}

/// A random solid of about unit size, kinds in turn.
fn random_form(random: &mut Random, kind: usize) -> Form {
    match kind % 4 {
        0 => Form::Plane { normal: random.direction(), half_extent: random.magnitude(0.1, 10.0) },
        1 => Form::Plane { normal: DVec3::Y, half_extent: 1e30 },
        2 => Form::Box { half: DVec3::from_array([(); 3].map(|()| random.magnitude(0.1, 10.0))) },
        _ => Form::Sphere { radius: random.magnitude(0.1, 10.0) },
    }
}

const SOLID_KERNEL: &str = "
    fn the_solid(x: array<f32, 14>, phase: vec3f) -> Solid {
        return Solid(vec3f(x[0], x[1], x[2]), u32(x[3]), vec3f(x[4], x[5], x[6]), x[7],
            vec3f(1.0), x[11], vec3f(0.0), 0u, phase);
    }";

/// Distance along the ray, distance of the origin from the surface, normal at the hit. Cases are
/// the solid's origin and numbers, then the ray.
fn trace_solids(gpu: &Gpu, cases: &[[f32; 14]]) -> Vec<[f32; 5]> {
    let body = format!(
        "{SOLID_KERNEL}
        fn test(x: array<f32, 14>) -> array<f32, 5> {{
            let solid = the_solid(x, vec3f(0.0));
            let o = vec3f(x[8], x[9], x[10]);
            let d = vec3f(x[11], x[12], x[13]);
            let t = solid_trace(solid, o, d);
            let n = solid_normal(solid, o + t * d);
            return array(t, solid_distance(solid, o), n.x, n.y, n.z);
        }}"
    );
    let kernel =
        Kernel { imports: &["common/scene.wgsl"], body: &body, constants: &[], resources: &[] };
    kernel.run(gpu, cases)
}

/// The form and ray of a case as the device has them, seen from the solid's origin.
fn solid_and_ray(x: &[f32; 14]) -> (Form, DVec3, DVec3) {
    let extent = vec3(&x[4..7]);
    let form = match x[3] {
        0.0 => Form::Plane { normal: extent, half_extent: x[7].into() },
        1.0 => Form::Box { half: extent },
        _ => Form::Sphere { radius: extent.x },
    };
    (form, vec3(&x[8..11]) - vec3(&x[..3]), vec3(&x[11..14]))
}

/// Holds the device's answers against those for solids that are larger and smaller by what rounding
/// may do at this distance: between the two, and a miss only where one of them is missed. Returns
/// how many cases were sharp: both hit or both missed.
fn check_traces(gpu: &Gpu, cases: &[[f32; 14]]) -> usize {
    let results = trace_solids(gpu, cases);
    let checked = || cases.iter().zip(&results).map(|(x, result)| check_trace(x, *result));
    let wrong: Vec<_> = checked().filter_map(Result::err).collect();
    assert!(wrong.is_empty(), "{} of {} wrong, as {}", wrong.len(), cases.len(), wrong[0]);
    checked().filter(|sharp| *sharp == Ok(true)).count()
}

fn check_trace(x: &[f32; 14], result: [f32; 5]) -> Result<bool, String> {
    let (form, o, d) = solid_and_ray(x);
    // An origin and a direction are known to 6e-8, and so is where the ray passes.
    let rounding = 4e-7 * o.length() + 1e-6;
    let hits = [rounding, -rounding].map(|by| form.grown(by).trace(o, d));
    let t = f64::from(result[0]);
    let found = t > 0.0 && t < NOTHING;
    let (a, b) = match hits {
        [Some(a), Some(b)] => (a, b),
        [None, None] if found => {
            return Err(format!("{form:?} from {o} along {d} must be missed, and is hit at {t}"));
        }
        hits => return Ok(hits == [None, None]),
    };
    let slack = 1e-6 * (a.0 + o.length());
    let (slack, radius) = match form {
        // A plane met at a slant: its distance is rounded, and divided by the cosine.
        Form::Plane { .. } => (slack / a.1.dot(d).abs(), NOTHING),
        Form::Box { .. } => (slack, NOTHING),
        Form::Sphere { radius } => (slack, radius),
    };
    let (low, high) = (a.0.min(b.0) - slack, a.0.max(b.0) + slack);
    if !found || !(low..=high).contains(&t) {
        return Err(format!("{form:?} from {o} along {d} must be hit at {low} to {high}, not {t}"));
    }
    // Which face an edge belongs to, rounding decides.
    let off = vec3(&result[2..]).distance(a.1);
    if a.1.distance(b.1) < 1e-2 && off > 1e-2 + 2.0 * rounding / radius {
        return Err(format!(
            "{form:?} from {o} along {d} has normal {}, not {}",
            vec3(&result[2..]),
            a.1
        ));
    }
    Ok(true)
}

/// Protects what rays see: hits of planes, boxes and spheres from anywhere, inside them too.
#[test]
fn solids_are_traced() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(11);
    let cases: Vec<[f32; 14]> = (0..40_000)
        .map(|i| {
            let form = random_form(&mut random, i);
            let origin = random.direction() * random.unit() * 10.0;
            let o = origin + random.direction() * random.magnitude(1e-2, 30.0);
            // Two thirds aim at the solid, or nearly.
            let aim = origin + random.direction() * random.magnitude(1e-3, 10.0) - o;
            let d = if i % 3 == 0 { random.direction() } else { aim.normalize() };
            case(&[&origin.to_array(), &form.numbers(), &o.to_array(), &d.to_array()])
        })
        .collect();
    let sharp = check_traces(gpu, &cases);
    assert!(sharp > 39_000, "only {sharp} cases say anything");
}

/// Protects axis-parallel rays, which straight cameras and level water have whole lines of, with
/// origins in the planes of faces too.
#[test]
fn solids_are_traced_along_axes() {
    let Some(gpu) = gpu() else { return };
    let mut cases = Vec::new();
    let forms = [
        Form::Box { half: DVec3::new(1.0, 2.0, 3.0) },
        Form::Sphere { radius: 1.5 },
        Form::Plane { normal: DVec3::Y, half_extent: 1e30 },
        Form::Plane { normal: DVec3::X, half_extent: 2.0 },
    ];
    let places = [-5.0, -0.5, 0.0, 0.25, 5.0];
    for form in forms {
        for o in 0..places.len().pow(3) {
            let o = DVec3::new(places[o % 5], places[o / 5 % 5], places[o / 25]);
            for d in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.6, 0.0, 0.8)] {
                for d in [d, -d] {
                    let numbers = form.numbers();
                    cases.push(case(&[&[0.0; 3], &numbers, &o.to_array(), &d.to_array()]));
                }
            }
        }
    }
    check_traces(gpu, &cases);
}

/// Protects far spheres: a ten-thousandth of the distance wide, hit and missed as they should be.
/// The textbook's discriminant has no digits left there.
#[test]
fn solids_are_traced_far_away() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(12);
    let cases: Vec<[f32; 14]> = (0..10_000)
        .map(|_| {
            let radius = random.magnitude(1e-2, 1e2);
            let o = random.direction() * random.unit();
            let origin = o + random.direction() * 1e4 * radius;
            let aim = origin + random.direction() * 2.0 * radius * random.unit() - o;
            let form = Form::Sphere { radius };
            let d = aim.normalize();
            case(&[&origin.to_array(), &form.numbers(), &o.to_array(), &d.to_array()])
        })
        .collect();
    let sharp = check_traces(gpu, &cases);
    assert!(sharp > 9500, "only {sharp} cases say anything");
}

/// Protects contact: the distance of a point from a solid, negative inside, none beside a square.
#[test]
fn solids_have_distances() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(13);
    let cases: Vec<[f32; 14]> = (0..20_000)
        .map(|i| {
            let form = random_form(&mut random, i);
            let x = random.direction() * random.magnitude(1e-3, 30.0);
            case(&[&[0.0; 3], &form.numbers(), &x.to_array(), &[0.0, 0.0, 1.0]])
        })
        .collect();
    for (x, result) in cases.iter().zip(trace_solids(gpu, &cases)) {
        let (form, o, _) = solid_and_ray(x);
        let expected = form.distance(o);
        // A point in line with a square's border may count to either side.
        if expected.max(form.grown(1e-5).distance(o)) < NOTHING || result[1] < 1e30 {
            if form.grown(-1e-5).distance(o) >= NOTHING && expected < NOTHING {
                continue;
            }
            assert_near(number(result, 1), expected, 1e-6 * (1.0 + o.length()), "distance");
        } else {
            assert_eq!(expected, NOTHING, "{x:?}");
        }
    }
}

/// Protects checkers: tiles are counted from the world's origin without a double or missing one at
/// zero, on floors, walls and balls alike, wherever the eye is; the tile at the origin is even.
#[test]
fn checkers_alternate_through_zero() {
    let Some(gpu) = gpu() else { return };
    let body = format!(
        "{SOLID_KERNEL}
        fn test(x: array<f32, 14>) -> array<f32, 1> {{
            let solid = the_solid(x, vec3f(x[0], x[1], x[2]));
            let color = solid_color(solid, vec3f(x[8], x[9], x[10]), vec3f(x[4], x[5], x[6]));
            return array(color.x);
        }}"
    );
    let kernel =
        Kernel { imports: &["common/scene.wgsl"], body: &body, constants: &[], resources: &[] };
    let mut random = Random(14);
    let mut cases: Vec<[f32; 14]> = Vec::new();
    let mut even = Vec::new();
    let tile = 0.5;
    while cases.len() < 10_000 {
        let (form, normal) = match cases.len() % 4 {
            0 => (0.0, DVec3::Y),
            1 => (0.0, DVec3::X),
            2 => (1.0, DVec3::NEG_Z),
            _ => (2.0, DVec3::ONE),
        };
        let x = random.direction() * random.magnitude(0.05, 50.0);
        let eye = random.direction() * random.magnitude(0.05, 1e5);
        let phase = (eye / tile).rem_euclid(DVec3::splat(2.0));
        let x = round3(x);
        let tiles = (eye + x) / tile;
        if (tiles - tiles.round()).abs().min_element() < 1e-4 {
            continue; // on a seam
        }
        let [i, j, k] = tiles.floor().to_array().map(|n| n as i64);
        let sum = match form {
            2.0 => i + j + k,
            _ if normal == DVec3::Y => i + k,
            _ if normal == DVec3::X => j + k,
            _ => i + j,
        };
        even.push(sum.rem_euclid(2) == 0);
        let half = &[1.0];
        cases.push(case(&[
            &phase.to_array(),
            &[form],
            &normal.to_array(),
            half,
            &x.to_array(),
            &[tile, 0.0, 0.0],
        ]));
    }
    let results: Vec<[f32; 1]> = kernel.run(gpu, &cases);
    for ((x, result), even) in cases.iter().zip(results).zip(even) {
        assert_eq!(result[0] == 1.0, even, "{x:?}");
    }
}

/// Protects the map's orientation: its middle is -z, right of it +x, its top +y, and it closes
/// behind without a seam; texel centres come out exactly, places between them in proportion.
#[test]
fn environment_map_directions() {
    let Some(gpu) = gpu() else { return };
    let size = UVec2::new(16, 8);
    let mut random = Random(15);
    let texels: Vec<[f32; 4]> =
        (0..size.element_product()).map(|_| [(); 4].map(|()| random.unit() as f32)).collect();
    let map = texture(gpu, size, &[&texels]);
    let kernel = Kernel {
        imports: &["common/scene.wgsl"],
        body: "fn test(x: array<f32, 3>) -> array<f32, 3> {
            let c = environment_lookup(vec3f(x[0], x[1], x[2]));
            return array(c.x, c.y, c.z);
        }",
        constants: &[],
        resources: &[(2, 3, wgpu::BindingResource::TextureView(&map))],
    };
    let texel = |x: i64, y: i64| {
        let (w, h) = (i64::from(size.x), i64::from(size.y));
        vec3(&texels[(y.clamp(0, h - 1) * w + x.rem_euclid(w)) as usize][..3])
    };
    // A place of the map, in texels, and the direction that it shows.
    let shown = |u: f64, v: f64| {
        let (turn, tilt) = ((u / 16.0 - 0.5) * TAU, (0.5 - v / 8.0) * PI);
        DVec3::new(tilt.cos() * turn.sin(), tilt.sin(), -tilt.cos() * turn.cos())
    };
    let mut cases = vec![DVec3::NEG_Z, DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y];
    let mean = |list: &[(i64, i64)]| {
        list.iter().map(|&(x, y)| texel(x, y)).sum::<DVec3>() / list.len() as f64
    };
    let mut expected = vec![
        mean(&[(7, 3), (8, 3), (7, 4), (8, 4)]),
        mean(&[(11, 3), (12, 3), (11, 4), (12, 4)]),
        mean(&[(3, 3), (4, 3), (3, 4), (4, 4)]),
    ];
    let poles = expected.len();
    // What a pole's longitude is, nobody can say; its row is.
    expected.extend([DVec3::ZERO; 2]);
    for _ in 0..5000 {
        // The seam at the back is within; rows beyond the first and last centres repeat them.
        let (u, v) = (random.range(-1.0, 17.0), random.range(0.01, 7.99));
        let (x, y) = ((u - 0.5).floor(), (v - 0.5).floor());
        let (fx, fy) = (u - 0.5 - x, v - 0.5 - y);
        let (i, j) = (x as i64, y as i64);
        let row = |j: i64| texel(i, j) * (1.0 - fx) + texel(i + 1, j) * fx;
        cases.push(shown(u, v));
        expected.push(row(j) * (1.0 - fy) + row(j + 1) * fy);
    }
    let cases: Vec<[f32; 3]> = cases.iter().map(|d| case(&[&d.to_array()])).collect();
    let results: Vec<[f32; 3]> = kernel.run(gpu, &cases);
    for (k, (result, expected)) in results.iter().zip(&expected).enumerate() {
        let got = vec3(result);
        if (poles..poles + 2).contains(&k) {
            let row = if k == poles { 0 } else { 7 };
            let dark = (0..16).map(|x| texel(x, row)).reduce(DVec3::min).expect("texels");
            let bright = (0..16).map(|x| texel(x, row)).reduce(DVec3::max).expect("texels");
            assert!(
                got.cmpge(dark - 1e-6).all() && got.cmple(bright + 1e-6).all(),
                "a pole: {got}"
            );
            continue;
        }
        // WGSL allows angles an error of 4096 units in the last place, 1e-3 of a radian: 2e-3 of a
        // texel here. Towards the poles, the longitude of a rounded direction is no better.
        let direction = vec3(&cases[k]);
        let tolerance = 6e-3 + 1e-5 / direction.x.hypot(direction.z);
        assert_near(got.distance(*expected), 0.0, tolerance, &format!("towards {direction}"));
    }
}

/// Protects the other two environments, and that the constant chooses among the three.
#[test]
fn environment_constant_and_gradient() {
    let Some(gpu) = gpu() else { return };
    use limpid::passes::gbuffer::SceneUniform;
    let (zenith, horizon, nadir) = ([1.0, 2.0, 3.0], [0.5, 0.25, 0.125], [8.0, 4.0, 2.0]);
    let scene = SceneUniform { zenith, horizon, nadir, ..bytemuck::Zeroable::zeroed() };
    let buffer = uniform(gpu, &scene);
    let map = texture(gpu, UVec2::ONE, &[&[[7.0; 4]]]);
    let mut random = Random(16);
    let cases: Vec<[f32; 3]> = (0..500).map(|_| case(&[&random.direction().to_array()])).collect();
    for kind in 0..3 {
        let kernel = Kernel {
            imports: &["common/scene.wgsl"],
            body: "fn test(x: array<f32, 3>) -> array<f32, 3> {
                let c = environment_radiance(vec3f(x[0], x[1], x[2]));
                return array(c.x, c.y, c.z);
            }",
            constants: &[("ENVIRONMENT", f64::from(kind))],
            resources: &[
                (2, 0, buffer.as_entire_binding()),
                (2, 3, wgpu::BindingResource::TextureView(&map)),
            ],
        };
        let results: Vec<[f32; 3]> = kernel.run(gpu, &cases);
        for (d, result) in cases.iter().zip(results) {
            let y = f64::from(d[1]);
            let end = if y > 0.0 { zenith } else { nadir };
            let expected = match kind {
                0 => vec3(&zenith),
                1 => vec3(&horizon) * (1.0 - y.abs()) + vec3(&end) * y.abs(),
                _ => DVec3::splat(7.0),
            };
            assert_near(vec3(&result).distance(expected), 0.0, 4e-6, "radiance");
        }
    }
}

/// Protects splats: the map to the unit sphere is the inverse of the ellipsoid's axes, from drops
/// of micrometres to boulders, round to flat.
#[test]
fn splat_matrices_are_inverted() {
    let Some(gpu) = gpu() else { return };
    let kernel = Kernel {
        imports: &["splat.wgsl"],
        body: "fn test(x: array<f32, 6>) -> array<f32, 9> {
            let m = symmetric_inverse(vec3f(x[0], x[1], x[2]), vec3f(x[3], x[4], x[5]));
            return array(m[0].x, m[0].y, m[0].z, m[1].x, m[1].y, m[1].z, m[2].x, m[2].y, m[2].z);
        }",
        constants: &[],
        resources: &[],
    };
    let mut random = Random(17);
    let cases: Vec<[f32; 6]> = (0..20_000)
        .map(|i| {
            let x = random.direction();
            let y = x.cross(random.direction()).normalize();
            let turn = DMat3::from_cols(x, y, x.cross(y));
            // `max_ratio` goes to 100 for eigenvalues of the covariance: 10 for the axes.
            let flat = if i % 3 == 0 { 1.0 } else { random.magnitude(1.0, 10.0) };
            let axes = DVec3::new(1.0, random.range(1.0 / flat, 1.0), 1.0 / flat);
            let m =
                turn * DMat3::from_diagonal(axes * random.magnitude(1e-6, 1e3)) * turn.transpose();
            case(&[&[m.x_axis.x, m.y_axis.y, m.z_axis.z, m.x_axis.y, m.x_axis.z, m.y_axis.z]])
        })
        .collect();
    let results: Vec<[f32; 9]> = kernel.run(gpu, &cases);
    for (x, result) in cases.iter().zip(results) {
        let [xx, yy, zz, xy, xz, yz] = x.map(f64::from);
        let m = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let inverse = DMat3::from_cols_array(&result.map(f64::from));
        let off = (m * inverse - DMat3::IDENTITY).to_cols_array();
        let worst = off.iter().fold(0.0, |worst: f64, e| worst.max(e.abs()));
        // Cofactors are differences of products: up to 100 times smaller than these at a ratio of
        // 10, so their rounding is that much larger; and again in the product above.
        assert!(worst < 2e-4, "{x:?}: inverse off by {worst:e}");
    }
}
