//! Particle shapes from a file.

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3};

/// Shape of a particle of radius r at c: the ellipsoid { c + r A·s : |s| ≤ 1 } with A symmetric and
/// positive definite; other matrices are not drawable. The unit of A is the particle radius, so A = 1
/// is the particle's sphere.
///
/// The entries are in VTK's order for symmetric tensors.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Ellipsoid {
    /// `A_xx`.
    pub xx: f32,
    /// `A_yy`.
    pub yy: f32,
    /// `A_zz`.
    pub zz: f32,
    /// `A_xy`.
    pub xy: f32,
    /// `A_yz`.
    pub yz: f32,
    /// `A_xz`.
    pub xz: f32,
}

impl Ellipsoid {
    /// The particle's sphere.
    pub const SPHERE: Self = Self { xx: 1.0, yy: 1.0, zz: 1.0, xy: 0.0, yz: 0.0, xz: 0.0 };

    /// Builds the ellipsoid { c + r G·s : |s| ≤ 1 } of any matrix G by polar decomposition G = A·Q,
    /// which drops the rotation Q of the unit sphere. A symmetric, positive definite G is returned
    /// bit by bit; a singular G yields a shape that is not [drawable](Self::drawable).
    pub fn of_map(map: DMat3) -> Self {
        let given = Self::of_symmetric(map);
        if given.matrix() == map && given.drawable() {
            return given;
        }
        if map.determinant().abs() < f64::MIN_POSITIVE {
            return Self::default();
        }
        // Higham, "Computing the Polar Decomposition", 1986: Newton's iteration for the nearest
        // orthogonal matrix; unless G is nearly singular it converges long before this limit.
        const STEPS: usize = 100;
        let mut turn = map;
        for _ in 0..STEPS {
            let next = 0.5 * (turn + turn.inverse().transpose());
            if next == turn {
                break;
            }
            turn = next;
        }
        let found = Self::of_symmetric(map * turn.transpose());
        if found.matrix().is_finite() { found } else { Self::default() }
    }

    /// Builds A from the symmetric part of a matrix.
    fn of_symmetric(a: DMat3) -> Self {
        let [x, y, z] = [a.x_axis, a.y_axis, a.z_axis];
        let mean = |a: f64, b: f64| (0.5 * (a + b)) as f32;
        let [xx, yy, zz] = [x.x as f32, y.y as f32, z.z as f32];
        Self { xx, yy, zz, xy: mean(x.y, y.x), yz: mean(y.z, z.y), xz: mean(x.z, z.x) }
    }

    /// The matrix A.
    pub fn matrix(self) -> DMat3 {
        let Self { xx, yy, zz, xy, yz, xz } = self;
        let column = |x: f32, y: f32, z: f32| DVec3::new(x.into(), y.into(), z.into());
        DMat3::from_cols(column(xx, xy, xz), column(xy, yy, yz), column(xz, yz, zz))
    }

    /// Whether this is an ellipsoid whose axes differ by less than about a factor of 10⁴.
    pub fn drawable(self) -> bool {
        /// Smallest ratio of the determinant to the cube of the mean axis.
        const FLAT: f64 = 1e-8;
        let a = self.matrix();
        let mean = (a.x_axis.x + a.y_axis.y + a.z_axis.z) / 3.0;
        // Sylvester's criterion.
        let leading = a.x_axis.x * a.y_axis.y - a.x_axis.y * a.y_axis.x;
        a.is_finite() && a.x_axis.x > 0.0 && leading > 0.0 && a.determinant() > FLAT * mean.powi(3)
    }

    /// Rotates from z up to y up, as [`super::Particles::to_y_up`].
    pub(super) fn turned_y_up(self) -> Self {
        let Self { xx, yy, zz, xy, yz, xz } = self;
        Self { xx, yy: zz, zz: yy, xy: xz, yz: -yz, xz: -xy }
    }

    /// Scales every axis by `factor`.
    pub fn scaled(self, factor: f32) -> Self {
        bytemuck::cast(bytemuck::cast::<Self, [f32; 6]>(self).map(|entry| factor * entry))
    }
}
