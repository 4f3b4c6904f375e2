//! Pinhole camera with a vertical field of view.

use std::fmt;
use std::str::FromStr;

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DQuat, DVec3, UVec2, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// A perspective camera. View space is x right, y up, looking down −z.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Position in world space, m.
    pub eye: DVec3,
    /// World-space point at the picture centre, m.
    pub target: DVec3,
    /// World-space direction that points up in the picture; any length, not parallel to the view.
    #[serde(default = "up")]
    pub up: Vec3,
    /// Vertical field of view, degrees (above 0, below 180).
    pub fov_y: f32,
    /// Near plane, m. The eye counts as inside liquid nearer than this. Default: a thousandth of the
    /// distance to the target, or half the distance to the nearest liquid where the former would clip
    /// liquid that the eye is outside of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near: Option<f32>,
}

/// Default up direction.
#[doc(hidden)]
pub fn up() -> Vec3 {
    Vec3::Y
}

impl fmt::Display for Camera {
    /// Writes what [`Camera::from_str`] parses, losslessly: `eye=1,2,3 target=0,0,0 up=0,1,0 fov_y=40`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (eye, target, up) = (self.eye, self.target, self.up);
        write!(f, "eye={},{},{} ", eye.x, eye.y, eye.z)?;
        write!(f, "target={},{},{} ", target.x, target.y, target.z)?;
        if up != Vec3::Y {
            write!(f, "up={},{},{} ", up.x, up.y, up.z)?;
        }
        write!(f, "fov_y={}", self.fov_y)?;
        self.near.map_or(Ok(()), |near| write!(f, " near={near}"))
    }
}

impl FromStr for Camera {
    type Err = Error;

    /// # Errors
    /// [`Error::Invalid`] naming the value that is missing or malformed, and as [`Camera::check`].
    fn from_str(text: &str) -> Result<Self> {
        let usage = |problem: &str| Error::invalid(format!("camera `{text}`"), problem);
        let (mut eye, mut target, mut fov_y) = (None, None, None);
        let (mut up, mut near) = (Vec3::Y, None);
        for part in text.split_whitespace() {
            let (key, value) = part.split_once('=').ok_or_else(|| usage("expected name=value"))?;
            let numbers: Vec<&str> = value.split(',').collect();
            let problem = || usage(&format!("`{part}` is not what {key} takes"));
            match (key, numbers.as_slice()) {
                ("eye", &[x, y, z]) => eye = Some(parsed([x, y, z]).ok_or_else(problem)?),
                ("target", &[x, y, z]) => target = Some(parsed([x, y, z]).ok_or_else(problem)?),
                ("up", &[x, y, z]) => up = parsed([x, y, z]).ok_or_else(problem)?.into(),
                ("fov_y", &[x]) => fov_y = Some(x.parse().map_err(|_| problem())?),
                ("near", &[x]) => near = Some(x.parse().map_err(|_| problem())?),
                ("eye" | "target" | "up" | "fov_y" | "near", _) => return Err(problem()),
                _ => {
                    let known =
                        "expected eye=X,Y,Z target=X,Y,Z fov_y=DEGREES up=X,Y,Z near=METRES";
                    return Err(usage(&format!("there is no {key}; {known}")));
                }
            }
        }
        let eye = DVec3::from_array(eye.ok_or_else(|| usage("eye=X,Y,Z is missing"))?);
        let target = DVec3::from_array(target.ok_or_else(|| usage("target=X,Y,Z is missing"))?);
        let fov_y = fov_y.ok_or_else(|| usage("fov_y=DEGREES is missing"))?;
        let camera = Self { eye, target, up, fov_y, near };
        camera.check()?;
        Ok(camera)
    }
}

fn parsed<T: FromStr>(numbers: [&str; 3]) -> Option<[T; 3]> {
    let [x, y, z] = numbers.map(|number| number.parse().ok());
    Some([x?, y?, z?])
}

/// Camera uniform of the shaders (`common/camera.wgsl`). The shaders' world space has the scene's axes
/// and its origin at the eye, so that 32-bit floats suffice wherever the scene is.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct CameraUniform {
    /// World to view space, a rotation: three columns, each padded with a 0.
    pub view_from_world: [[f32; 4]; 3],
    /// Origin of the splat positions, relative to the eye in world axes, m.
    pub origin: Vec3,
    /// Near plane, m.
    pub near: f32,
    /// Picture size, pixels.
    pub size: Vec2,
    /// Tangents of half the horizontal and vertical field of view; half the extent in m for an
    /// orthographic view.
    pub tangent: Vec2,
    /// Depth of the far plane of an orthographic view, m; otherwise 0.
    pub far: f32,
    /// Padding.
    pub pad: [f32; 3],
}

impl Camera {
    /// Returns a camera that sees a whole box from the front and above, in a picture at least as wide
    /// as it is high.
    pub fn fit(min: DVec3, max: DVec3) -> Self {
        let target = 0.5 * (min + max);
        let half = 0.5 * (max - min);
        let fov_y = 40f32;
        let tangent = f64::from(0.5 * fov_y).to_radians().tan();
        let back = DVec3::new(0.25, 0.5, 1.0).normalize();
        let right = DVec3::Y.cross(back).normalize();
        let up = back.cross(right);
        // Distance at which each corner is inside the frustum.
        let corners = (0..8).map(|i| {
            let sign = |bit: u32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            half * DVec3::new(sign(0), sign(1), sign(2))
        });
        let needed = corners.map(|corner| {
            let off_axis = corner.dot(right).abs().max(corner.dot(up).abs());
            corner.dot(back) + off_axis / tangent
        });
        // Far enough for the eye and the target to differ in 64-bit floats.
        let least = (1e-12 * target.abs().max_element()).max(1e-9);
        let distance = needed.fold(least, f64::max) * 1.05;
        Self { eye: target + back * distance, target, up: Vec3::Y, fov_y, near: None }
    }

    /// Orbits the camera by `angle`, radians, about the axis through the target along `up`,
    /// counter-clockwise when seen from the tip of `up`. Target and distance stay the same.
    #[must_use]
    pub fn turned(self, angle: f64) -> Self {
        let axis = self.up.as_dvec3().normalize_or(DVec3::Y);
        // Relative to the target, so that precision does not depend on where the scene is.
        let offset = DQuat::from_axis_angle(axis, angle) * (self.eye - self.target);
        Self { eye: self.target + offset, ..self }
    }

    /// Near plane, m, without the adjustment for nearby liquid.
    pub fn near(&self) -> f32 {
        self.near.unwrap_or_else(|| (1e-3 * self.eye.distance(self.target)) as f32)
    }

    /// Checks that the camera defines a view.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the offending key.
    pub fn check(&self) -> Result<()> {
        let fail = |problem: &str| Err(Error::invalid("camera", problem));
        let view = (self.target - self.eye).normalize_or_zero();
        let up = self.up.as_dvec3();
        if !(is_position(self.eye) && is_position(self.target) && up.is_finite()) {
            fail("eye, target and up must be finite")
        } else if view == DVec3::ZERO {
            fail("eye and target are the same point")
        } else if view.cross(up).length() <= 1e-6 * up.length() {
            fail("up is along the view direction, or zero; seen straight from above, say up=0,0,-1")
        } else if !(self.fov_y > 0.0 && self.fov_y < 180.0) {
            fail("fov_y must be above 0 and below 180 degrees")
        } else if !(self.near() > 0.0 && self.near().is_finite()) {
            fail("near must be above 0")
        } else {
            Ok(())
        }
    }

    /// Builds the uniform for a picture of `size` pixels, with splat positions relative to the
    /// world-space point `origin`, m. Positions are made relative to the eye before conversion to
    /// 32-bit floats.
    pub fn uniform(&self, size: UVec2, origin: DVec3) -> CameraUniform {
        let back = (self.eye - self.target).normalize();
        let right = self.up.as_dvec3().cross(back).normalize();
        let view_from_world = DMat3::from_cols(right, back.cross(right), back).transpose();
        let size = size.as_dvec2();
        let tangent_y = (0.5 * f64::from(self.fov_y)).to_radians().tan();
        CameraUniform {
            view_from_world: view_from_world
                .to_cols_array_2d()
                .map(|[x, y, z]| [x as f32, y as f32, z as f32, 0.0]),
            origin: (origin - self.eye).as_vec3(),
            near: self.near(),
            size: size.as_vec2(),
            tangent: Vec2::new((tangent_y * size.x / size.y) as f32, tangent_y as f32),
            far: 0.0,
            pad: [0.0; 3],
        }
    }
}

/// Whether a position is finite and small enough that squared distances fit in a 32-bit float.
#[doc(hidden)]
pub fn is_position(x: DVec3) -> bool {
    x.abs().cmplt(DVec3::splat(1e18)).all()
}
