//! The axis that points up in files, and the turn to a world of y up.

use std::fmt;

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// The up axis of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    /// y, as in limpid, Houdini and most simulators.
    #[default]
    Y,
    /// z, as in Blender and CAD.
    Z,
}

impl Up {
    /// A place or a direction of a world where this axis points up, in the world of y up: a quarter turn about x, which
    /// preserves handedness.
    pub fn to_y_up(self, x: DVec3) -> DVec3 {
        if self == Self::Z { DVec3::new(x.x, x.z, -x.y) } else { x }
    }

    /// The inverse of [`Up::to_y_up`].
    pub fn from_y_up(self, x: DVec3) -> DVec3 {
        if self == Self::Z { DVec3::new(x.x, -x.z, x.y) } else { x }
    }
}

impl fmt::Display for Up {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if *self == Self::Z { "z" } else { "y" })
    }
}
