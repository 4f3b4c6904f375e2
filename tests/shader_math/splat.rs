//! `splat.wgsl`: ellipsoids as maps to the unit sphere.

use glam::{DMat3, DVec3};

use super::support::{Kernel, Random, gpu};
use super::view::case;

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
