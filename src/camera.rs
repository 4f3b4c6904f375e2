//! Cameras: one that is aimed, and the general view that the renderer draws.

mod view;

use std::fmt;
use std::str::FromStr;

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DMat4, DQuat, DVec2, DVec3, UVec2, Vec2, Vec3};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::up_axis::Up;

pub(crate) use view::parallel_near;
pub use view::{Projection, View};

/// A camera that is aimed at a point. View space is x right, y up, looking down −z.
///
/// In files it is a table of its fields. Instead of `fov_y` it may have `height`, for parallel rays, or
/// `intrinsics` and `size`; instead of eye, target and up, it may have a `pose`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "CameraTable", into = "CameraTable")]
pub struct Camera {
    /// Position in world space, m.
    pub eye: DVec3,
    /// World-space point at the picture centre, m.
    pub target: DVec3,
    /// World-space direction that points up in the picture; any length, not parallel to the view.
    pub up: Vec3,
    /// Vertical field of view, degrees (above 0, below 180). An approximation for other lenses.
    pub fov_y: f32,
    /// Near plane, m. The eye counts as inside liquid nearer than this. Default: a thousandth of the
    /// distance to the target, or half the distance to the nearest liquid where the former would clip
    /// liquid that the eye is outside of.
    pub near: Option<f32>,
    /// Projection, if it is not a field of view centred on the target.
    pub lens: Option<Lens>,
}

/// Another projection than a centred field of view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lens {
    /// Parallel rays.
    Orthographic {
        /// Height of the part of the scene in the picture, m.
        height: f64,
    },
    /// A calibrated pinhole camera. A picture of another shape than `size` shows more or less at both sides.
    Pinhole {
        /// Focal lengths along x and y, pixels.
        focal: DVec2,
        /// The pixel position in the view direction, from the upper left corner, pixels.
        principal: DVec2,
        /// Size of the picture that these count in, pixels.
        size: DVec2,
    },
}

/// A camera in a file.
#[derive(Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct CameraTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    eye: Option<DVec3>,
    #[serde(skip_serializing_if = "Option::is_none")]
    target: Option<DVec3>,
    #[serde(skip_serializing_if = "Option::is_none")]
    up: Option<Vec3>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pose: Option<[[f64; 4]; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fov_y: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    height: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    intrinsics: Option<[f64; 4]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    size: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    near: Option<f32>,
}

impl From<Camera> for CameraTable {
    fn from(camera: Camera) -> Self {
        let Camera { eye, target, up, fov_y, near, lens } = camera;
        let mut table =
            Self { eye: Some(eye), target: Some(target), up: Some(up), near, ..Self::default() };
        match lens {
            None => table.fov_y = Some(fov_y),
            Some(Lens::Orthographic { height }) => table.height = Some(height),
            Some(Lens::Pinhole { focal: f, principal: c, size }) => {
                table.intrinsics = Some([f.x, f.y, c.x, c.y]);
                table.size = Some(size.to_array());
            }
        }
        table
    }
}

impl TryFrom<CameraTable> for Camera {
    type Error = String;

    fn try_from(table: CameraTable) -> Result<Self, String> {
        let CameraTable { eye, target, up, pose, fov_y, height, intrinsics, size, near } = table;
        let (eye, target, up) = match (pose, eye, target) {
            (None, Some(eye), Some(target)) => (eye, target, up.unwrap_or(Vec3::Y)),
            (None, None, _) => return Err("missing field `eye`".into()),
            (None, _, None) => return Err("missing field `target`".into()),
            (Some(pose), None, None) if up.is_none() => posed(pose)?,
            (Some(_), ..) => return Err("takes eye, target and up, or a pose".into()),
        };
        let lens = match (height, intrinsics, size) {
            (None, None, None) => None,
            (Some(height), None, None) => Some(Lens::Orthographic { height }),
            (None, Some([fx, fy, cx, cy]), Some(size)) => Some(Lens::Pinhole {
                focal: DVec2::new(fx, fy),
                principal: DVec2::new(cx, cy),
                size: DVec2::from_array(size),
            }),
            _ => return Err("takes fov_y, or height, or intrinsics with the size in pixels".into()),
        };
        let fov_y = match (fov_y, lens) {
            (Some(fov_y), None) => fov_y,
            (None, None) => return Err("missing field `fov_y`".into()),
            (None, Some(lens)) => lens.field_of_view(eye.distance(target)),
            (Some(_), Some(_)) => return Err("takes one of fov_y, height and intrinsics".into()),
        };
        Ok(Self { eye, target, up, fov_y, near, lens })
    }
}

/// Eye, target and up of a camera's pose: the rows of the matrix that takes points of the camera (x right,
/// y down, z ahead, as calibrations have it) to the world.
fn posed(rows: [[f64; 4]; 4]) -> Result<(DVec3, DVec3, Vec3), String> {
    let world_from_camera = DMat4::from_cols_array_2d(&rows).transpose();
    let rotation = DMat3::from_mat4(world_from_camera);
    let skew = (rotation * rotation.transpose() - DMat3::IDENTITY).to_cols_array();
    let skewed = !skew.iter().all(|x| x.abs() < 1e-3);
    if skewed || rotation.determinant() < 0.0 || rows[3] != [0.0, 0.0, 0.0, 1.0] {
        return Err(
            "a pose is four rows of a rotation and a translation, the last 0, 0, 0, 1".into()
        );
    }
    let eye = world_from_camera.w_axis.truncate();
    Ok((eye, eye + rotation.z_axis, -rotation.y_axis.as_vec3()))
}

impl Lens {
    /// Fails if no picture can be taken with it.
    fn check(self) -> Result<()> {
        let fail = |problem: &str| Err(Error::invalid("camera", problem));
        match self {
            Self::Orthographic { height } if !(height > 0.0 && height < 1e18) => {
                fail("height must be above 0 and below 1e18")
            }
            Self::Pinhole { focal, principal, size }
                if !(focal.min(size).min_element() > 0.0
                    && (focal + principal + size).is_finite()) =>
            {
                fail("intrinsics (fx, fy, cx, cy) and size are pixels, fx, fy and size above 0")
            }
            _ => Ok(()),
        }
    }

    /// Vertical field of view, degrees, that shows about as much at this distance.
    fn field_of_view(self, distance: f64) -> f32 {
        let tangent = match self {
            Self::Orthographic { height } => 0.5 * height / distance.max(1e-300),
            Self::Pinhole { focal, size, .. } => 0.5 * size.y / focal.y,
        };
        (2.0 * tangent.atan().to_degrees()) as f32
    }

    /// Returns the projection of a picture of `size` pixels. Pixels keep their shape: a wider picture shows more at both
    /// sides.
    fn projection(self, size: DVec2) -> Projection {
        match self {
            Self::Orthographic { height } => {
                let half = 0.5 * height * DVec2::new(size.x / size.y, 1.0);
                Projection::Orthographic { low: -half, high: half }
            }
            Self::Pinhole { focal, principal, size: own } => {
                let wider = 0.5 * (size.x * own.y / size.y - own.x);
                let low = DVec2::new(-principal.x - wider, principal.y - own.y) / focal;
                let high = DVec2::new(own.x - principal.x + wider, principal.y) / focal;
                Projection::Frustum { low, high }
            }
        }
    }
}

impl fmt::Display for Camera {
    /// Writes the form that [`Camera::from_str`] parses, losslessly: `eye=1,2,3 target=0,0,0 up=0,1,0 fov_y=40`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (eye, target, up) = (self.eye, self.target, self.up);
        write!(f, "eye={},{},{} ", eye.x, eye.y, eye.z)?;
        write!(f, "target={},{},{} ", target.x, target.y, target.z)?;
        if up != Vec3::Y {
            write!(f, "up={},{},{} ", up.x, up.y, up.z)?;
        }
        match self.lens {
            Some(Lens::Orthographic { height }) => write!(f, "height={height}")?,
            Some(Lens::Pinhole { focal: a, principal: c, size }) => {
                write!(f, "intrinsics={},{},{},{} size={},{}", a.x, a.y, c.x, c.y, size.x, size.y)?;
            }
            None => write!(f, "fov_y={}", self.fov_y)?,
        }
        self.near.map_or(Ok(()), |near| write!(f, " near={near}"))
    }
}

impl FromStr for Camera {
    type Err = Error;

    /// # Errors
    /// As [`Camera::parse`] and [`Camera::check`].
    fn from_str(text: &str) -> Result<Self> {
        let camera = Self::parse(text)?;
        camera.check()?;
        Ok(camera)
    }
}

impl Camera {
    /// Parses a camera without checking whether it defines a view: `up` is 0,1,0 unless it is given, which may be along
    /// the view where another axis points up.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the value that is missing or malformed.
    pub fn parse(text: &str) -> Result<Self> {
        let usage = |problem: &str| Error::invalid(format!("camera `{text}`"), problem);
        let mut table = CameraTable::default();
        for part in text.split_whitespace() {
            let (key, value) = part.split_once('=').ok_or_else(|| usage("expected name=value"))?;
            let numbers: Vec<&str> = value.split(',').collect();
            let problem = || usage(&format!("`{part}` is not what {key} takes"));
            match (key, numbers.as_slice()) {
                ("eye", &[x, y, z]) => {
                    table.eye = Some(parsed([x, y, z]).ok_or_else(problem)?.into());
                }
                ("target", &[x, y, z]) => {
                    table.target = Some(parsed([x, y, z]).ok_or_else(problem)?.into());
                }
                ("up", &[x, y, z]) => {
                    table.up = Some(parsed([x, y, z]).ok_or_else(problem)?.into());
                }
                ("fov_y", &[x]) => table.fov_y = Some(x.parse().map_err(|_| problem())?),
                ("height", &[x]) => table.height = Some(x.parse().map_err(|_| problem())?),
                ("intrinsics", &[a, b, c, d]) => {
                    table.intrinsics = Some(parsed([a, b, c, d]).ok_or_else(problem)?);
                }
                ("size", &[x, y]) => table.size = Some(parsed([x, y]).ok_or_else(problem)?),
                ("near", &[x]) => table.near = Some(x.parse().map_err(|_| problem())?),
                (
                    "eye" | "target" | "up" | "fov_y" | "height" | "intrinsics" | "size" | "near",
                    _,
                ) => {
                    return Err(problem());
                }
                _ => {
                    let known = "expected eye=X,Y,Z target=X,Y,Z fov_y=DEGREES up=X,Y,Z near=METRES; \
                                 or height=METRES, or intrinsics=FX,FY,CX,CY size=WIDTH,HEIGHT, in \
                                 place of fov_y";
                    return Err(usage(&format!("there is no {key}; {known}")));
                }
            }
        }
        let missing = |given: bool, what: &str| if given { Ok(()) } else { Err(usage(what)) };
        missing(table.eye.is_some(), "eye=X,Y,Z is missing")?;
        missing(table.target.is_some(), "target=X,Y,Z is missing")?;
        let lens = table.height.is_some() || table.intrinsics.is_some();
        missing(table.fov_y.is_some() || lens, "fov_y=DEGREES is missing")?;
        Self::try_from(table).map_err(|problem| usage(&problem))
    }
}

fn parsed<T: FromStr, const N: usize>(numbers: [&str; N]) -> Option<[T; N]> {
    let numbers: Vec<T> = numbers.into_iter().map_while(|number| number.parse().ok()).collect();
    numbers.try_into().ok()
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
    pub pad: f32,
    /// The picture's middle, right of and above the view direction: tangents, or m in an orthographic view.
    pub shift: Vec2,
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
        Self { eye: target + back * distance, target, up: Vec3::Y, fov_y, near: None, lens: None }
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

    /// The camera in a world of y up, if this axis points up in its own.
    #[must_use]
    pub fn to_y_up(self, up: Up) -> Self {
        if up == Up::Y {
            return self;
        }
        // Without zeros that have a sign.
        let turned = |x| up.to_y_up(x) + DVec3::ZERO;
        let direction = turned(self.up.as_dvec3()).as_vec3();
        Self { eye: turned(self.eye), target: turned(self.target), up: direction, ..self }
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
        // Before the field of view, which is computed from the lens.
        if let Some(lens) = self.lens {
            lens.check()?;
        }
        if !(is_position(self.eye) && is_position(self.target) && up.is_finite()) {
            fail("eye, target and up must be finite")
        } else if view == DVec3::ZERO {
            fail("eye and target are the same point")
        } else if view.cross(up).length() <= 1e-6 * up.length() {
            fail(
                "up is along the view direction, or zero; seen straight from above, say up=0,0,-1, or up=0,1,0 \
                 where z is up",
            )
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
        View::from(self).uniform(size, origin, 0.0)
    }
}

/// Whether a position is finite and small enough that squared distances fit in a 32-bit float.
#[doc(hidden)]
pub fn is_position(x: DVec3) -> bool {
    x.abs().cmplt(DVec3::splat(1e18)).all()
}
