//! `screen_ray.wgsl`: screen-space rays, the basis of all intersectors.

use glam::{DVec2, DVec3};
use limpid::gpu::Gpu;

use crate::support::view::{NOTHING, View, assert_near, case, distance_to_line, round3, vec3};
use crate::support::{Kernel, Random, gpu, uniform};

/// A screen ray as computed on the device, with derived quantities.
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

/// Computes screen rays on the device. Cases hold origin, direction, reach, plane and tau.
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

/// A random direction, or one towards or away from the eye, exactly or within a pixel, or perpendicular
/// to the view ray.
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

/// For any direction and distance, every tau is a point of the ray, in front of the eye and in the
/// picture, and the residual against a plane is linear in tau.
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
            // Near the eye, precision is limited by the rounding of the ray's origin.
            let tolerance = 1e-4 * point.length() + 2e-7 * o.length();
            assert_near(distance_to_line(point, o, d), 0.0, tolerance, "distance to the ray");
        }
        // The same rounding error at the end's depth, in pixels.
        let blur = 4e-7 * o.length() / -ray.end_point.z * view.size.y / (2.0 * view.tangent.y);
        for (u, blur) in [(ray.start, 0.0), (ray.end, blur)] {
            let outside = (-u).max(u - view.size).max_element();
            assert!(outside <= 0.02 + blur, "{x:?} goes to {u}, {outside} px out of the picture");
        }
        assert!(ray.tau_per_pixel.is_finite() && ray.tau_per_pixel > 0.0, "{x:?}");
        // Each residual is a difference of numbers of this magnitude.
        let size =
            pi.length() * view.omega(ray.start).length() + 1.0 / -ray.end_point.z - 1.0 / o.z;
        let line = ray.residuals[0] + tau * (ray.residuals[2] - ray.residuals[0]);
        assert_near(ray.residuals[1], line, 1e-6 * size, "the residual is linear");
        assert_near(ray.slope, ray.residuals[2] - ray.residuals[0], 1e-6 * size, "by its slope");
    }
}

/// Rays towards the eye from so far away that the near plane's depth is less than the rounding of theirs, which adapters
/// round differently.
#[test]
fn far_screen_rays_end_in_front_of_the_eye() {
    let Some(gpu) = gpu() else { return };
    let view = View::of_size(640, 480, 1e-3);
    let mut random = Random(11);
    let cases: Vec<_> = (0..5000)
        .map(|_| {
            let o = random.magnitude(1e3, 1e9) * view.omega(random.pixel(view.pixels()));
            let past = random.direction() * random.unit() * view.near;
            ray_case(o, (past - o).normalize(), NOTHING, DVec3::X, random.unit())
        })
        .collect();
    for (x, ray) in cases.iter().zip(screen_rays(gpu, &view, &cases)) {
        for point in [ray.at, ray.end_point] {
            assert!(point.is_finite() && point.z < 0.0, "{x:?} passes {point}");
        }
        assert!(ray.end.is_finite() && ray.slope.is_finite(), "{x:?} ends at {}", ray.end);
    }
}

/// The root of the residual is the intersection of ray and plane, for planes at any distance within the
/// reach of the ray.
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
        // The intersection with a plane edge-on to the ray or the eye is ill-conditioned.
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

/// A ray that ends one pixel inside a border is not clipped, one that ends a pixel outside is clipped to
/// the border, and one towards the eye to the near plane.
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
                // On the screen the ray is a straight line, clipped where it crosses the edge.
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
        // A rounded direction is off by 1e-7 of the ray's length, which is up to 100 times the depth at
        // its end; a pixel is 1/600 of that depth.
        assert_near(ray.end.distance(*end), 0.0, 0.02, &format!("end of {x:?} in px"));
        let inside = ray.texel.clamp(DVec2::ZERO, view.size - 1.0);
        assert_eq!(ray.texel, inside, "the texel is in the picture");
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
        // Relative to the ray's length, of which the near plane is a small fraction.
        let tolerance = 3e-7 * f64::from(-x[2]) + 1e-6 * view.near;
        assert!(depth >= view.near - tolerance, "{x:?} ends at depth {depth}");
        let on_screen = ray.end.clamp(DVec2::ZERO, view.size).distance(ray.end);
        if view.pixel(vec3(&x[..3])).distance(ray.end) < 200.0 {
            assert_near(depth, view.near, tolerance, "depth of the clipped end");
        }
        assert!(on_screen < 1.0, "{x:?} ends at {}", ray.end);
    }
}
