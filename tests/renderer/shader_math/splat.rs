//! `splat/ellipsoid.wgsl`: maps to the unit sphere, and bounding rectangles of ellipsoids.

use glam::{DMat3, DVec2, DVec3, UVec2, Vec3};
use limpid::camera::Camera;

use crate::support::view::case;
use crate::support::{Kernel, Random, gpu, uniform};

/// A random rotation.
fn turn(random: &mut Random) -> DMat3 {
    let x = random.direction();
    let y = x.cross(random.direction()).normalize();
    DMat3::from_cols(x, y, x.cross(y))
}

/// The six entries of a symmetric matrix, in a splat's order.
fn entries(m: DMat3) -> [f64; 6] {
    [m.x_axis.x, m.y_axis.y, m.z_axis.z, m.x_axis.y, m.x_axis.z, m.y_axis.z]
}

/// The map to the unit sphere is the inverse of the ellipsoid's axes matrix, from micrometre drops to
/// boulders, round to flat.
#[test]
fn splat_matrices_are_inverted() {
    let Some(gpu) = gpu() else { return };
    let kernel = Kernel {
        imports: &["splat/ellipsoid.wgsl"],
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
            let turn = turn(&mut random);
            // `max_ratio` is at most 100 for eigenvalues of the covariance: 10 for the axes.
            let flat = if i % 3 == 0 { 1.0 } else { random.magnitude(1.0, 10.0) };
            let axes = DVec3::new(1.0, random.range(1.0 / flat, 1.0), 1.0 / flat);
            let m =
                turn * DMat3::from_diagonal(axes * random.magnitude(1e-6, 1e3)) * turn.transpose();
            case(&[&entries(m)])
        })
        .collect();
    let results: Vec<[f32; 9]> = kernel.run(gpu, &cases);
    for (x, result) in cases.iter().zip(results) {
        let [xx, yy, zz, xy, xz, yz] = x.map(f64::from);
        let m = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let inverse = DMat3::from_cols_array(&result.map(f64::from));
        let off = (m * inverse - DMat3::IDENTITY).to_cols_array();
        let worst = off.iter().fold(0.0, |worst: f64, e| worst.max(e.abs()));
        // Cofactors are differences of products that are up to 100 times larger at a ratio of 10, which
        // amplifies rounding by as much; and again in the product above.
        assert!(worst < 2e-4, "{x:?}: inverse off by {worst:e}");
    }
}

/// The bounding rectangle of an ellipsoid that the near plane cuts contains every pixel whose ray hits the
/// remaining part, and exceeds it by at most a fraction of a pixel. Looser rectangles would fill the
/// picture when the eye is near or inside liquid.
#[test]
fn rectangles_of_cut_splats_are_tight() {
    let Some(gpu) = gpu() else { return };
    let camera = Camera {
        eye: DVec3::ZERO,
        target: DVec3::NEG_Z,
        up: Vec3::Y,
        fov_y: 60.0,
        near: Some(0.05),
        lens: None,
    };
    let size = UVec2::new(32, 24);
    let view = camera.uniform(size, DVec3::ZERO);
    let (near, tangent) = (f64::from(view.near), view.tangent.as_dvec2());
    let buffer = uniform(gpu, &view);
    let kernel = Kernel {
        imports: &["splat/ellipsoid.wgsl"],
        body: "fn test(x: array<f32, 9>) -> array<f32, 4> {
            let splat = Splat(vec3f(x[6], x[7], x[8]), 0.0, vec3f(x[0], x[1], x[2]), 0u,
                vec3f(x[3], x[4], x[5]), 0u);
            // With the margin of `tiles_within`.
            let margin = vec4f(-0.125, -0.125, 0.125, 0.125);
            let bounds = (splat_bounds(splat_in_view(splat)) + margin) / camera.size.xyxy * 2.0 - 1.0;
            return array(bounds.x, -bounds.w, bounds.z, -bounds.y);
        }",
        constants: &[],
        resources: &[(0, 0, buffer.as_entire_binding())],
    };
    let mut random = Random(29);
    let cases: Vec<[f32; 9]> = (0..3000)
        .map(|i| {
            let turn = turn(&mut random);
            let flat = [1.0, 0.3, 0.01][i % 3];
            let axes = DVec3::new(1.0, random.range(0.3, 1.0), flat) * random.magnitude(0.01, 5.0);
            let m = turn * DMat3::from_diagonal(axes) * turn.transpose();
            let beyond = random.range(-0.999, 0.999) * m.row(2).length();
            let beside = random.magnitude(0.01, 3.0) * axes.x * random.direction();
            let centre = DVec3::new(beside.x, beside.y, -near - beyond);
            case(&[&entries(m), &centre.to_array()])
        })
        .collect();
    let rectangles: Vec<[f32; 4]> = kernel.run(gpu, &cases);
    let (mut cut, mut wide, mut pixels) = (0, 0, 0);
    for (x, rectangle) in cases.iter().zip(rectangles) {
        let [xx, yy, zz, xy, xz, yz, centre @ ..] = x.map(f64::from);
        let m = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let centre = DVec3::from_array(centre);
        let half_depth = m.row(2).length();
        if (near + centre.z).abs() >= 0.9999 * half_depth {
            continue;
        }
        cut += 1;
        let of = |i: usize| f64::from(rectangle[i]).clamp(-1.0, 1.0);
        let (low, high) = (DVec2::new(of(0), of(1)), DVec2::new(of(2), of(3)));

        let exact = [0, 1].map(|i| cut_slopes(m, centre, i, near).map(|s| s / tangent[i]));
        for (i, [least, most]) in exact.into_iter().enumerate() {
            let (least, most) = (least.clamp(-1.0, 1.0), most.clamp(-1.0, 1.0));
            let slack = 0.3 / f64::from(size[i]) + 1e-3;
            assert!(low[i] <= least && least <= low[i] + slack, "{x:?}: {least} from {low}");
            assert!(high[i] >= most && most >= high[i] - slack, "{x:?}: {most} to {high}");
        }
        wide += usize::from(low == DVec2::NEG_ONE && high == DVec2::ONE);

        let to_sphere = m.inverse();
        for u in (0..size.y).flat_map(|y| (0..size.x).map(move |x| UVec2::new(x, y))) {
            let ndc = (2.0 * (u.as_dvec2() + 0.5) / size.as_dvec2() - 1.0) * DVec2::new(1.0, -1.0);
            let ray = to_sphere * (ndc * tangent).extend(-1.0);
            let start = to_sphere * -centre;
            let (a, b, c) = (ray.length_squared(), start.dot(ray), start.length_squared() - 1.0);
            let discriminant = b * b - a * c;
            if discriminant >= 0.0 && (discriminant.sqrt() - b) / a >= near {
                pixels += 1;
                let inside = ndc.cmpge(low).all() && ndc.cmple(high).all();
                assert!(inside, "{x:?}: {ndc} is not in {low} to {high}");
            }
        }
    }
    assert!(cut > 2900 && wide < cut / 2 && pixels > 100_000, "{cut}, {wide}, {pixels}");
}

/// Smallest and largest slope, along x or y, of the part of the ellipsoid beyond the near plane, by
/// bisection: a line through the eye bounds the part if the part's farthest point is on the line.
fn cut_slopes(m: DMat3, centre: DVec3, axis: usize, near: f64) -> [f64; 2] {
    let (a, g) = (m.row(axis), -m.row(2));
    let (x, depth) = (centre[axis], -centre.z);
    // Ends of the cut by the near plane.
    let along = (near - depth) / g.length_squared();
    let half = (1.0 - along * along * g.length_squared()).sqrt() * a.cross(g).length() / g.length();
    let reaches = |sign: f64, slope: f64| {
        let d = sign * (a - slope * g);
        let farthest = depth + g.dot(d) / d.length();
        let distance = match farthest >= near {
            true => sign * (x - slope * depth) + d.length(),
            false => sign * (x + along * a.dot(g) - slope * near) + half,
        };
        distance >= 0.0
    };
    [-1.0, 1.0].map(|sign| {
        let (mut within, mut beyond) = (-sign * 1e5, sign * 1e5);
        for _ in 0..100 {
            let middle = 0.5 * (within + beyond);
            match reaches(sign, middle) {
                true => within = middle,
                false => beyond = middle,
            }
        }
        within
    })
}
