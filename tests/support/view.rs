//! View space in 64 bits, and test cases for the device.

use glam::{DVec2, DVec3, UVec2, Vec3};
use limpid::camera::{Camera, CameraUniform};

/// Ray parameter of a miss, as in `common/scene.wgsl`.
pub(crate) const NOTHING: f64 = 1e30;

/// Rounds a vector to 32-bit floats.
pub(crate) fn round3(x: DVec3) -> DVec3 {
    x.as_vec3().as_dvec3()
}

pub(crate) fn vec3(x: &[f32]) -> DVec3 {
    DVec3::new(x[0].into(), x[1].into(), x[2].into())
}

/// Concatenates numbers and vectors into a case.
pub(crate) fn case<const N: usize>(parts: &[&[f64]]) -> [f32; N] {
    let numbers: Vec<f32> = parts.concat().into_iter().map(|x| x as f32).collect();
    numbers.try_into().expect("as many numbers as the kernel takes")
}

pub(crate) fn number<const N: usize>(x: [f32; N], i: usize) -> f64 {
    x[i].into()
}

pub(crate) fn assert_near(got: f64, expected: f64, tolerance: f64, what: &str) {
    let error = (got - expected).abs();
    assert!(error <= tolerance, "{what}: {got}, expected {expected}, off by {error:e}");
}

/// A camera and the conventions of view space, in 64 bits.
pub(crate) struct View {
    pub(crate) uniform: CameraUniform,
    pub(crate) size: DVec2,
    pub(crate) tangent: DVec2,
    pub(crate) near: f64,
}

impl View {
    pub(crate) fn new(camera: &Camera, size: UVec2) -> Self {
        let uniform = camera.uniform(size, DVec3::ZERO);
        Self {
            uniform,
            size: uniform.size.as_dvec2(),
            tangent: uniform.tangent.as_dvec2(),
            near: uniform.near.into(),
        }
    }

    /// A view with a field of view of 45 degrees at an arbitrary position.
    pub(crate) fn of_size(width: u32, height: u32, near: f32) -> Self {
        let camera = Camera {
            eye: DVec3::new(1.0, 2.0, 3.0),
            target: DVec3::ZERO,
            up: Vec3::Y,
            fov_y: 45.0,
            near: Some(near),
            lens: None,
        };
        Self::new(&camera, UVec2::new(width, height))
    }

    pub(crate) fn pixels(&self) -> UVec2 {
        self.size.as_uvec2()
    }

    /// Ray of unit depth through a pixel position.
    pub(crate) fn omega(&self, u: DVec2) -> DVec3 {
        let x = (u.x / self.size.x - 0.5) * 2.0 * self.tangent.x;
        let y = (0.5 - u.y / self.size.y) * 2.0 * self.tangent.y;
        DVec3::new(x, y, -1.0)
    }

    pub(crate) fn pixel(&self, x: DVec3) -> DVec2 {
        let slope = DVec2::new(x.x, x.y) / -x.z;
        DVec2::new(
            self.size.x * (0.5 + 0.5 * slope.x / self.tangent.x),
            self.size.y * (0.5 - 0.5 * slope.y / self.tangent.y),
        )
    }

    /// Plane with disparity `disparity` at `u` and the given slope per pixel.
    pub(crate) fn plane(&self, u: DVec2, disparity: f64, slope: DVec2) -> DVec3 {
        let omega = self.omega(u);
        let x = slope.x * self.size.x / (2.0 * self.tangent.x);
        let y = -slope.y * self.size.y / (2.0 * self.tangent.y);
        DVec3::new(x, y, x * omega.x + y * omega.y - disparity)
    }
}

pub(crate) fn distance_to_line(x: DVec3, o: DVec3, d: DVec3) -> f64 {
    (x - o).cross(d).length() / d.length()
}
