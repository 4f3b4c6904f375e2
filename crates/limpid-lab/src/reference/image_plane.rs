//! A camera that generates rays in f64.

use glam::{DMat3, DVec2, DVec3, UVec2};
use limpid::camera::{self, Camera};

use super::{Ray, wide};

/// A camera and the size of its picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct ImagePlane {
    pub(super) eye: DVec3,
    /// Columns are the axes of view space: right, up, back.
    pub(super) world_from_view: DMat3,
    /// Tangents of half the field of view, horizontal and vertical; with parallel rays half the extent, m.
    tangent: DVec2,
    /// The picture's middle, right of and above the view direction.
    shift: DVec2,
    parallel: bool,
    pub(super) size: DVec2,
}

impl ImagePlane {
    pub(super) fn new(camera: &Camera, size: UVec2) -> Self {
        let (eye, target) = (wide(camera.eye), wide(camera.target));
        let back = (eye - target).normalize();
        let right = wide(camera.up).cross(back).normalize();
        let pixels = size.as_dvec2();
        let tangent_y = (0.5 * f64::from(camera.fov_y).to_radians()).tan();
        let view = Self {
            eye,
            world_from_view: DMat3::from_cols(right, back.cross(right), back),
            tangent: DVec2::new(tangent_y * pixels.x / pixels.y, tangent_y),
            shift: DVec2::ZERO,
            parallel: false,
            size: pixels,
        };
        if camera.lens.is_none() {
            return view;
        }
        let seen = camera::View::from(camera);
        let uniform = seen.uniform(size, camera.eye, 1.0);
        let (tangent, shift) = (uniform.tangent.as_dvec2(), uniform.shift.as_dvec2());
        Self { tangent, shift, parallel: seen.is_orthographic(), ..view }
    }

    /// The point of the picture, in pixels from the top left corner, that shows a direction.
    pub(super) fn pixel(&self, direction: DVec3) -> Option<DVec2> {
        let view = self.world_from_view.transpose() * direction;
        let ndc = (view.truncate() / -view.z - self.shift) / self.tangent;
        let u = (0.5 + 0.5 * ndc * DVec2::new(1.0, -1.0)) * self.size;
        let within = u.cmpge(DVec2::ZERO).all() && u.cmplt(self.size).all();
        (!self.parallel && view.z < 0.0 && within).then_some(u)
    }

    /// Returns the ray through a point of the picture, in pixels from the top left corner.
    pub(super) fn ray(&self, u: DVec2) -> Ray {
        let ndc = DVec2::new(2.0, -2.0) * u / self.size + DVec2::new(-1.0, 1.0);
        let beside = ndc * self.tangent + self.shift;
        if self.parallel {
            let origin = self.eye + self.world_from_view * beside.extend(0.0);
            return Ray { origin, direction: -self.world_from_view.z_axis };
        }
        let direction = self.world_from_view * beside.extend(-1.0);
        Ray { origin: self.eye, direction: direction.normalize() }
    }
}
