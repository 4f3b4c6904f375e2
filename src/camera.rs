//! The camera: a pinhole with a vertical field of view.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, UVec2, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// A perspective camera. View space is x right, y up, looking down −z.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Position in world space, m.
    pub eye: Vec3,
    /// The point in the middle of the picture, m.
    pub target: Vec3,
    /// A direction that points up in the picture; any length, not along the view.
    #[serde(default = "up")]
    pub up: Vec3,
    /// Vertical field of view, degrees (above 0, below 180).
    pub fov_y: f32,
    /// Near plane, m; by default a thousandth of the distance to the target. Liquid nearer than
    /// this counts as around the eye.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near: Option<f32>,
}

fn up() -> Vec3 {
    Vec3::Y
}

/// The camera as the shaders have it (`common/camera.wgsl`).
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct CameraUniform {
    /// World to view space.
    pub view_from_world: Mat4,
    /// View to world space.
    pub world_from_view: Mat4,
    /// Picture size, pixels.
    pub size: Vec2,
    /// Tangents of half the horizontal and vertical field of view.
    pub tangent: Vec2,
    /// Near plane, m.
    pub near: f32,
    /// Fills the last row.
    pub pad: [f32; 3],
}

impl Camera {
    /// A camera that sees all of a box from the front and above, in a picture at least as wide as
    /// it is high.
    pub fn fit(min: Vec3, max: Vec3) -> Self {
        let target = 0.5 * (min + max);
        let half = 0.5 * (max - min);
        let fov_y = 40f32;
        let tangent = (0.5 * fov_y.to_radians()).tan();
        let back = Vec3::new(0.25, 0.5, 1.0).normalize();
        let right = Vec3::Y.cross(back).normalize();
        let up = back.cross(right);
        // From this far each corner is inside the picture's edges.
        let corners = (0..8).map(|i| {
            let sign = |bit: u32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            half * Vec3::new(sign(0), sign(1), sign(2))
        });
        let needed = corners.map(|corner| {
            let off_axis = corner.dot(right).abs().max(corner.dot(up).abs());
            corner.dot(back) + off_axis / tangent
        });
        // At least so far away that the eye and the target are different numbers.
        let least = (1e-3 * target.abs().max_element()).max(1e-5);
        let distance = needed.fold(least, f32::max) * 1.05;
        Self { eye: target + back * distance, target, up: Vec3::Y, fov_y, near: None }
    }

    /// The near plane, m.
    pub fn near(&self) -> f32 {
        self.near.unwrap_or_else(|| 1e-3 * self.eye.distance(self.target))
    }

    /// Checks that the camera defines a view.
    ///
    /// # Errors
    /// [`Error::Scene`] naming the key that does not.
    pub fn check(&self) -> Result<()> {
        let fail = |problem: &str| {
            Err(Error::Scene { origin: "camera".into(), problem: problem.to_owned() })
        };
        let view = self.target - self.eye;
        if !(self.eye.is_finite() && self.target.is_finite() && self.up.is_finite()) {
            fail("eye, target and up must be finite")
        } else if view.length_squared() == 0.0 {
            fail("eye and target are the same point")
        } else if view.cross(self.up).length() <= 1e-6 * view.length() * self.up.length() {
            fail("up is along the view direction, or zero")
        } else if !(self.fov_y > 0.0 && self.fov_y < 180.0) {
            fail("fov_y must be above 0 and below 180 degrees")
        } else if !(self.near() > 0.0 && self.near().is_finite()) {
            fail("near must be above 0")
        } else {
            Ok(())
        }
    }

    /// What the shaders need for a picture of `size` pixels.
    pub fn uniform(&self, size: UVec2) -> CameraUniform {
        let view_from_world = glam::camera::rh::view::look_at_mat4(self.eye, self.target, self.up);
        let size = size.as_vec2();
        let tangent_y = (0.5 * self.fov_y.to_radians()).tan();
        CameraUniform {
            view_from_world,
            world_from_view: view_from_world.inverse(),
            size,
            tangent: Vec2::new(tangent_y * size.x / size.y, tangent_y),
            near: self.near(),
            pad: [0.0; 3],
        }
    }
}
