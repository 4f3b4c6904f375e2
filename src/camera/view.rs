//! The general view that the renderer draws.

use glam::{DMat3, DMat4, DVec2, DVec3, UVec2};

use super::{Camera, CameraUniform, Lens, is_position};
use crate::error::{Error, Result};

/// The renderer's camera. View space is x right, y up, looking down −z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Position in world space, m: origin of view space.
    pub eye: DVec3,
    /// World to view space, a rotation.
    pub view_from_world: DMat3,
    /// The part of view space in the picture.
    pub projection: Projection,
    /// Distance of the target, m.
    pub focus: f64,
    /// As [`Camera::near`]; for an orthographic view 0 by default.
    pub near: Option<f32>,
}

/// The part of view space in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// A pinhole's view that is centred on the view direction.
    Perspective {
        /// Vertical field of view, degrees (above 0, below 180).
        fov_y: f32,
    },
    /// A camera's, which depends on the picture's shape.
    Lens(Lens),
    /// A pinhole's view between borders at depth 1.
    Frustum {
        /// Left and lower border, as x and y over depth.
        low: DVec2,
        /// Right and upper border.
        high: DVec2,
    },
    /// Parallel rays along the view direction.
    Orthographic {
        /// Left and lower border, m from the eye.
        low: DVec2,
        /// Right and upper border.
        high: DVec2,
    },
}

impl Projection {
    /// Half the extent and the middle of a picture of `size` pixels, as borders are given.
    fn half_and_middle(self, size: DVec2) -> (DVec2, DVec2) {
        match self {
            Self::Perspective { fov_y } => {
                let tangent_y = (0.5 * f64::from(fov_y)).to_radians().tan();
                (DVec2::new(tangent_y * size.x / size.y, tangent_y), DVec2::ZERO)
            }
            Self::Lens(lens) => lens.projection(size).half_and_middle(size),
            Self::Frustum { low, high } | Self::Orthographic { low, high } => {
                (0.5 * (high - low), 0.5 * (high + low))
            }
        }
    }
}

impl From<&Camera> for View {
    fn from(camera: &Camera) -> Self {
        let back = (camera.eye - camera.target).normalize();
        let right = camera.up.as_dvec3().cross(back).normalize();
        Self {
            eye: camera.eye,
            view_from_world: DMat3::from_cols(right, back.cross(right), back).transpose(),
            projection: match camera.lens {
                None => Projection::Perspective { fov_y: camera.fov_y },
                Some(lens) => Projection::Lens(lens),
            },
            focus: camera.eye.distance(camera.target),
            near: camera.near,
        }
    }
}

impl View {
    /// The view of a program that has matrices: the world in view space, which must be a rotation and a
    /// translation, and the projection to clip space as in WebGPU (x and y from −1 to 1, y up, depth from
    /// 0 to 1). The projection may be perspective or orthographic, off-centre, jittered, of reversed depth,
    /// and with a far plane or without.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a matrix is of another kind.
    pub fn from_matrices(view_from_world: DMat4, clip_from_view: DMat4) -> Result<Self> {
        let fail = |problem: &str| Err(Error::invalid("camera", problem));
        let rotation = DMat3::from_mat4(view_from_world);
        let skew = rotation * rotation.transpose() - DMat3::IDENTITY;
        let skewed = skew.to_cols_array().iter().any(|x| x.abs() > 1e-4);
        if skewed || rotation.determinant() < 0.0 || view_from_world.row(3) != glam::DVec4::W {
            return fail("the view matrix must be a rotation and a translation");
        }
        let c = clip_from_view.to_cols_array_2d();
        let plain = c[0][1..] == [0.0; 3] && [c[1][0], c[1][2], c[1][3]] == [0.0; 3];
        let bottom = clip_from_view.row(3);
        let orthographic = bottom == glam::DVec4::W;
        let perspective = bottom == glam::DVec4::NEG_Z && c[3][..2] == [0.0; 2];
        let parallel = orthographic && c[2][..2] == [0.0; 2];
        if !plain || !(perspective || parallel) || !(c[0][0] > 0.0 && c[1][1] > 0.0) {
            return fail(
                "the projection matrix must be that of a perspective or orthographic view",
            );
        }
        let half = DVec2::new(1.0 / c[0][0], 1.0 / c[1][1]);
        let column = if perspective { [c[2][0], c[2][1]] } else { [-c[3][0], -c[3][1]] };
        let middle = half * DVec2::from(column);
        let (low, high) = (middle - half, middle + half);
        // Depth in clip space falls with distance if it is reversed.
        let (slope, offset) = (c[2][2], c[3][2]);
        let near = match perspective {
            true if offset > 0.0 => offset / (1.0 + slope),
            true => offset / slope,
            false => parallel_near(slope, offset),
        };
        let projection = match perspective {
            true => Projection::Frustum { low, high },
            false => Projection::Orthographic { low, high },
        };
        let eye = -(rotation.transpose() * view_from_world.w_axis.truncate());
        // Parallel rays may begin behind the eye: then it moves back.
        let behind = if parallel { (-near).max(0.0) } else { 0.0 };
        let eye = eye + behind * rotation.transpose().z_axis;
        let near = Some((near + behind) as f32);
        let view = Self { eye, view_from_world: rotation, projection, focus: 1.0, near };
        view.check()?;
        Ok(view)
    }

    /// Half the extent and the middle of a picture of `size` pixels: tangents, or m if rays are parallel.
    pub(crate) fn borders(&self, size: UVec2) -> (DVec2, DVec2) {
        self.projection.half_and_middle(size.as_dvec2())
    }

    /// Side of a pixel of a picture of `size` at a depth, m; of parallel rays at any.
    pub fn pixel_side(&self, size: UVec2, depth: f64) -> f64 {
        let per_metre = if self.is_orthographic() { 1.0 } else { depth };
        2.0 * self.borders(size).0.y / f64::from(size.y) * per_metre
    }

    /// Whether rays are parallel.
    pub fn is_orthographic(&self) -> bool {
        matches!(self.projection, Projection::Orthographic { .. })
            || matches!(self.projection, Projection::Lens(Lens::Orthographic { .. }))
    }

    /// The direction of the view in world space.
    pub fn ahead(&self) -> DVec3 {
        -self.view_from_world.row(2)
    }

    /// Near plane, m, without the adjustment for nearby liquid.
    pub fn near(&self) -> f32 {
        let default = if self.is_orthographic() { 0.0 } else { (1e-3 * self.focus) as f32 };
        self.near.unwrap_or(default)
    }

    /// Checks that the view can be drawn.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the problem.
    pub fn check(&self) -> Result<()> {
        let fail = |problem: &str| Err(Error::invalid("camera", problem));
        if !is_position(self.eye) || !self.view_from_world.is_finite() {
            return fail("eye and directions must be finite");
        }
        match self.projection {
            Projection::Perspective { fov_y } if !(fov_y > 0.0 && fov_y < 180.0) => {
                return fail("fov_y must be above 0 and below 180 degrees");
            }
            Projection::Frustum { low, high } | Projection::Orthographic { low, high }
                if !(low.cmplt(high).all() && low.is_finite() && high.is_finite()) =>
            {
                return fail("the picture's borders must be finite, the left below the right");
            }
            Projection::Lens(lens) => lens.check()?,
            _ => {}
        }
        let near = self.near();
        let least = near > 0.0 || self.is_orthographic() && near == 0.0;
        if least && near.is_finite() { Ok(()) } else { fail("near must be above 0") }
    }

    /// Builds the uniform for a picture of `size` pixels, with splat positions relative to the
    /// world-space point `origin`, m. Positions are made relative to the eye before conversion to
    /// 32-bit floats. `far` is the depth of the farthest liquid, m, which only an orthographic view needs.
    pub fn uniform(&self, size: UVec2, origin: DVec3, far: f64) -> CameraUniform {
        let (half, middle) = self.borders(size);
        let size = size.as_dvec2();
        // Fronts at the near plane mark rays that start in liquid, and a depth of 0 means no liquid.
        let least = if self.is_orthographic() { 1e-6 * self.focus as f32 } else { 0.0 };
        CameraUniform {
            view_from_world: self
                .view_from_world
                .to_cols_array_2d()
                .map(|[x, y, z]| [x as f32, y as f32, z as f32, 0.0]),
            origin: (origin - self.eye).as_vec3(),
            near: self.near().max(least),
            size: size.as_vec2(),
            tangent: half.as_vec2(),
            far: if self.is_orthographic() { far as f32 } else { 0.0 },
            pad: 0.0,
            shift: middle.as_vec2(),
        }
    }
}

/// Near plane, m, of an orthographic projection to the depth `slope` × z + `offset`.
pub(crate) fn parallel_near(slope: f64, offset: f64) -> f64 {
    // Depth is 1 there if it is reversed.
    let depth = if slope > 0.0 { 1.0 } else { 0.0 };
    (offset - depth) / slope
}
