//! The axes in which cameras are given: those of the particle files, unless something else is said.

use std::str::FromStr;

use glam::Vec3;

use crate::error::{Error, Result};
use limpid::camera::Camera;
use limpid::liquid::Up;

/// The axes in which the numbers of a camera count. The default are those of the world, where y is up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CameraAxes {
    /// The axis that points up there; `None` if it is that of the files.
    pub up: Option<Up>,
    /// Whether the camera has no direction of up of its own: it is that axis then.
    pub is_level: bool,
}

impl Default for CameraAxes {
    fn default() -> Self {
        Self { up: Some(Up::Y), is_level: false }
    }
}

impl CameraAxes {
    /// The axes of a camera in a file, where `up_axis` may say them. Otherwise they are those of the particle files, but
    /// the world's of a camera whose own `up` is along y, as limpid writes them.
    pub(crate) fn in_file(up_axis: Option<Up>, up: Option<Vec3>) -> Self {
        let world = up.filter(|&up| is_along_y(up)).map(|_| Up::Y);
        Self { up: up_axis.or(world), is_level: up.is_none() }
    }

    /// The `up_axis` that a file needs for [`CameraAxes::in_file`] to find these of a camera with this `up`.
    pub(crate) fn up_axis(self, up: Vec3) -> Option<Up> {
        let up = (!self.is_level).then_some(up);
        self.up.filter(|_| Self::in_file(None, up) != self)
    }

    /// The camera in the world, where y is up, of files where this axis points up.
    pub fn to_world(self, camera: Camera, files: Up) -> Camera {
        let world = camera.to_y_up(self.up.unwrap_or(files));
        if self.is_level { Camera { up: Vec3::Y, ..world } } else { world }
    }

    /// Checks a camera that counts in these axes, in those of files of one kind at least if they are not known.
    pub(crate) fn check(self, camera: &Camera) -> limpid::error::Result<()> {
        let [y, z] = [Up::Y, Up::Z].map(|files| self.to_world(*camera, files).check());
        if z.is_ok() { Ok(()) } else { y }
    }
}

/// Whether a direction is along y rather than any other axis.
fn is_along_y(up: Vec3) -> bool {
    const ALONG: f32 = 0.9;
    up.normalize_or_zero().y > ALONG
}

/// A camera with its axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GivenCamera {
    /// The camera; its `up` is 0, 1, 0 if it has none.
    pub camera: Camera,
    /// The axes in which it counts.
    pub axes: CameraAxes,
}

impl From<Camera> for GivenCamera {
    /// A camera in the world.
    fn from(camera: Camera) -> Self {
        Self { camera, axes: CameraAxes::default() }
    }
}

impl FromStr for GivenCamera {
    type Err = Error;

    /// Parses a camera in the axes of the files.
    ///
    /// # Errors
    /// As [`Camera::from_str`].
    fn from_str(text: &str) -> Result<Self> {
        let camera = Camera::parse(text)?;
        let is_level = !text.split_whitespace().any(|part| part.starts_with("up="));
        let axes = CameraAxes { up: None, is_level };
        axes.check(&camera)?;
        Ok(Self { camera, axes })
    }
}
