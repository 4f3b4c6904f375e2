//! Splat shapes.

use glam::{DMat3, DVec3, Vec3};

use super::moments::Moments;
use super::{Member, Splat};
use crate::liquid::ellipsoid::Ellipsoid;
use crate::settings::{Classify, Kernel};

impl Member {
    pub(super) fn splash(&self, settings: &Classify, shift: DVec3) -> Splat {
        let radius = f64::from(settings.splash_radius * self.radius);
        self.splat(self.position().as_dvec3() - shift, DMat3::from_diagonal(DVec3::splat(radius)))
    }

    pub(super) fn aggregate(&self, near: &Moments, settings: &Classify, shift: DVec3) -> Splat {
        let r = f64::from(self.radius);
        let h = f64::from(settings.support) * r;
        let centre = self.position().as_dvec3() + f64::from(settings.smoothing) * h * near.mean();

        let ellipsoid = r * kernel(near.covariance(), near.count - 1, settings);
        self.splat(centre - shift, ellipsoid)
    }

    pub(super) fn given(&self, ellipsoid: &Ellipsoid, shift: DVec3) -> Splat {
        let ellipsoid = f64::from(self.radius) * ellipsoid.matrix();
        self.splat(self.position().as_dvec3() - shift, ellipsoid)
    }

    pub(super) fn splat(&self, centre: DVec3, ellipsoid: DMat3) -> Splat {
        let mut splat = Splat {
            centre: centre.as_vec3().to_array(),
            radius: self.radius,
            diagonal: [0.0; 3],
            particle: self.particle,
            off_diagonal: [0.0; 3],
            tags: self.fluid,
        };
        splat.set_axes(ellipsoid);
        splat
    }
}

impl Splat {
    fn set_axes(&mut self, ellipsoid: DMat3) {
        let [x, y, z] = [ellipsoid.x_axis, ellipsoid.y_axis, ellipsoid.z_axis];
        self.diagonal = DVec3::new(x.x, y.y, z.z).as_vec3().to_array();
        self.off_diagonal = DVec3::new(y.x, z.x, z.y).as_vec3().to_array();
    }

    /// Moves the centre and adds to the axes matrix, m. Results that are not finite are dropped.
    pub(super) fn change(&mut self, step: DVec3, longer: DMat3) {
        let centre = (Vec3::from_array(self.centre).as_dvec3() + step).as_vec3();
        let ellipsoid = self.axes() + longer;
        if centre.is_finite() && ellipsoid.is_finite() {
            self.centre = centre.to_array();
            self.set_axes(ellipsoid);
        }
    }
}

/// Eigenvalues of the covariance below this, in h², are rounding errors of coincident neighbours.
const COINCIDENT_SQUARED: f64 = 1e-8;

/// With fewer neighbours the papers draw a sphere.
const FEW_NEIGHBOURS: u32 = 25;

/// Longest semi-axis of a volume-preserving kernel, in r (Imai et al. 2016).
const VOLUME_CAP: f64 = 1.2;

/// Kernel of a neighbourhood, in r: the matrix with the eigenvectors of the covariance and the
/// [`semi_axes`] as eigenvalues.
fn kernel(covariance: DMat3, neighbours: u32, settings: &Classify) -> DMat3 {
    // Inside a body no axis is clamped: all axes are the same multiple of the eigenvalues, so the kernel
    // is that multiple of the covariance, and no eigenvectors are needed.
    let spread = eigenvalues(covariance);
    if spread.min_element() > COINCIDENT_SQUARED {
        let scale = semi_axes(spread, neighbours, settings) / spread;
        if scale.max_element() - scale.min_element() <= 1e-9 * scale.max_element() {
            return scale.x * covariance;
        }
    }
    let (spread, directions) = eigen(covariance);
    let axes = semi_axes(spread, neighbours, settings);
    directions * DMat3::from_diagonal(axes) * directions.transpose()
}

/// Semi-axes in r, from the eigenvalues of the covariance in h².
///
/// The eigenvalues themselves, not their square roots, are the relative axes, as in Yu and Turk 2013. The
/// lower clamp keeps sheets, lines and points finite.
fn semi_axes(spread: DVec3, neighbours: u32, settings: &Classify) -> DVec3 {
    let longest = spread.max_element();
    let relative = if longest > COINCIDENT_SQUARED {
        spread.max(DVec3::splat(longest / f64::from(settings.max_ratio).max(1.0))) / longest
    } else {
        DVec3::ONE
    };
    match settings.kernel {
        Kernel::Fitted => {
            let short = f64::from(settings.short_axis) / relative.min_element();
            (short * relative).min(DVec3::splat(settings.long_axis.into()))
        }
        Kernel::Volume if neighbours < FEW_NEIGHBOURS => DVec3::ONE,
        Kernel::Volume => {
            (relative / relative.element_product().cbrt()).min(DVec3::splat(VOLUME_CAP))
        }
    }
}

/// Eigenvalues of a symmetric matrix, unsorted, to 10⁻⁸ of the largest: O. K. Smith, "Eigenvalues of a
/// symmetric 3 × 3 matrix", Communications of the ACM 4(4), 1961.
fn eigenvalues(matrix: DMat3) -> DVec3 {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    let mean = (x.x + y.y + z.z) / 3.0;
    let off = matrix - DMat3::from_diagonal(DVec3::splat(mean));
    let squares =
        off.x_axis.length_squared() + off.y_axis.length_squared() + off.z_axis.length_squared();
    let half = (squares / 6.0).sqrt();
    if half <= f64::EPSILON * mean.abs() {
        return DVec3::splat(mean);
    }
    let cosine = off.determinant() / (2.0 * half * half * half);
    let angle = cosine.clamp(-1.0, 1.0).acos() / 3.0;
    let (first, last) = (angle.cos(), (angle + std::f64::consts::TAU / 3.0).cos());
    mean + 2.0 * half * DVec3::new(first, -first - last, last)
}

/// Eigenvalues of a symmetric matrix, unsorted, and the orthonormal eigenvectors as columns.
///
/// Uses cyclic Jacobi rotations: unlike the closed form with arc cosines they stay exact for coincident
/// eigenvalues, which are the common case in liquid.
fn eigen(matrix: DMat3) -> (DVec3, DMat3) {
    /// Convergence is quadratic: six sweeps suffice for any input, the rest is margin.
    const SWEEPS: usize = 12;

    let mut a = matrix.to_cols_array_2d();
    let mut vectors = DMat3::IDENTITY.to_cols_array_2d();
    for _ in 0..SWEEPS {
        let scale = a[0][0].abs() + a[1][1].abs() + a[2][2].abs();
        if a[0][1].abs() + a[0][2].abs() + a[1][2].abs() <= f64::EPSILON * scale {
            break;
        }
        for (p, q, other) in [(0, 1, 2), (0, 2, 1), (1, 2, 0)] {
            if a[p][q] == 0.0 {
                continue;
            }
            // Tangent of the smaller of the two angles that annihilate a[p][q].
            let cotangent = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = cotangent.signum() / (cotangent.abs() + (cotangent * cotangent + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let rotate = |x: f64, y: f64| (c * (x - t * y), c * (t * x + y));

            a[p][p] -= t * a[p][q];
            a[q][q] += t * a[p][q];
            (a[p][q], a[q][p]) = (0.0, 0.0);
            (a[other][p], a[other][q]) = rotate(a[other][p], a[other][q]);
            (a[p][other], a[q][other]) = (a[other][p], a[other][q]);
            let (left, right) = (vectors[p], vectors[q]);
            for i in 0..3 {
                (vectors[p][i], vectors[q][i]) = rotate(left[i], right[i]);
            }
        }
    }
    (DVec3::new(a[0][0], a[1][1], a[2][2]), DMat3::from_cols_array_2d(&vectors))
}

/// The direction of an ellipsoid's shortest axis, and its length relative to the next one.
pub(super) fn short_axis(ellipsoid: DMat3) -> (Vec3, f32) {
    let (lengths, directions) = eigen(ellipsoid);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| lengths[a].total_cmp(&lengths[b]));
    (directions.col(order[0]).as_vec3(), (lengths[order[0]] / lengths[order[1]]) as f32)
}

#[cfg(test)]
mod tests {
    use super::super::moments::symmetric;
    use super::*;
    use crate::liquid::classify::tests::noise;

    /// The shape constants are the same in Rust and WGSL.
    #[test]
    fn constants_match_the_shader() {
        let shader = |name| crate::gpu::shader::constant("classify/shape.wgsl", name);
        assert_eq!(shader("COINCIDENT_SQUARED"), COINCIDENT_SQUARED);
        assert_eq!(shader("FEW_NEIGHBOURS"), f64::from(FEW_NEIGHBOURS));
        assert_eq!(shader("VOLUME_CAP"), VOLUME_CAP);
    }

    fn difference(a: DMat3, b: DMat3) -> f64 {
        (a - b).to_cols_array().into_iter().fold(0.0, |most, x| x.abs().max(most))
    }

    /// Any symmetric matrix is recomposed from its eigenvalues and eigenvectors.
    #[test]
    fn eigen_recomposes_symmetric_matrices() {
        let mut seed = 1;
        let mut random = || DVec3::from_array([(); 3].map(|()| noise(&mut seed)));
        let mut matrices: Vec<_> = (0..1000).map(|_| symmetric(random(), random())).collect();
        // Cases where closed forms lose precision: equal, vanishing and nearly equal eigenvalues.
        for values in [[1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [1.0, 1.0 + 1e-9, 1e-17]]
        {
            let (_, rotation) = eigen(symmetric(random(), random()));
            matrices.push(rotation * DMat3::from_diagonal(values.into()) * rotation.transpose());
            matrices.push(DMat3::from_diagonal(values.into()));
        }
        for matrix in matrices {
            let (values, vectors) = eigen(matrix);
            let recomposed = vectors * DMat3::from_diagonal(values) * vectors.transpose();
            assert!(difference(recomposed, matrix) < 1e-12, "{matrix}");
            assert!(
                difference(vectors.transpose() * vectors, DMat3::IDENTITY) < 1e-12,
                "{vectors}"
            );
        }
    }

    /// The kernel equals its eigendecomposition, both with and without the shortcut that skips the
    /// eigenvectors.
    #[test]
    fn kernel_shortcut_equals_eigendecomposition() {
        let mut seed = 3;
        let (mut shortcuts, mut decompositions) = (0, 0);
        for round in 0..3000 {
            let mut random = || DVec3::from_array([(); 3].map(|()| noise(&mut seed)));
            // From spheres to flat and long shapes, some with pairs of equal eigenvalues.
            let (_, turn) = eigen(symmetric(random(), random()));
            let mut values = 0.15 * (DVec3::ONE + f64::from(round % 5) * 0.2 * random());
            if round % 3 == 0 {
                values.y = values.x;
            }
            let covariance = turn * DMat3::from_diagonal(values) * turn.transpose();
            let covariance = 0.5 * (covariance + covariance.transpose());
            let (spread, directions) = eigen(covariance);
            for kernel_of in [Kernel::Fitted, Kernel::Volume] {
                let settings = Classify { kernel: kernel_of, ..Default::default() };
                let axes = semi_axes(spread, 40, &settings);
                let expected = directions * DMat3::from_diagonal(axes) * directions.transpose();
                let found = kernel(covariance, 40, &settings);
                assert!(difference(found, expected) < 1e-7, "{found}, not {expected}");
                let scale = axes / spread;
                let clamped = scale.max_element() > 1.0001 * scale.min_element();
                *if clamped { &mut decompositions } else { &mut shortcuts } += 1;
            }
        }
        assert!(
            shortcuts > 500 && decompositions > 500,
            "{shortcuts} shortcuts, {decompositions} decompositions"
        );
    }

    /// A sheet has two equal eigenvalues and one zero to the last digits.
    #[test]
    fn eigenvalues_of_a_sheet_are_exact() {
        let (_, turn) = eigen(symmetric(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.3, 0.2, 0.1)));
        let sheet = turn * DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0)) * turn.transpose();
        let mut values = eigen(sheet).0.to_array();
        values.sort_by(f64::total_cmp);
        for (value, exact) in values.into_iter().zip([0.0, 1.0, 1.0]) {
            assert!((value - exact).abs() < 1e-14, "{values:?}");
        }
    }
}
