//! The unbounded level ground of a scene.

use std::fmt;
use std::str::FromStr;

use glam::DVec3;
use limpid::camera::is_position;
use limpid::scene::{Scene, Shape, Solid};
use serde::{Deserialize, Serialize};

/// The height of the ground.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Floor {
    /// Without any.
    None,
    /// At this height, m.
    At(f64),
}

impl Floor {
    /// Its height, m.
    pub(crate) fn height(self) -> Option<f64> {
        if let Self::At(height) = self { Some(height) } else { None }
    }

    /// The height of a scene's ground.
    pub fn of(scene: &Scene) -> Self {
        let shape = scene.solids.iter().find(|solid| is_ground(solid)).map(|solid| &solid.shape);
        match shape {
            Some(Shape::Plane { origin, .. }) => Self::At(origin.y),
            _ => Self::None,
        }
    }
}

/// Whether a solid is an unbounded level plane.
pub(crate) fn is_ground(solid: &Solid) -> bool {
    matches!(solid.shape, Shape::Plane { normal, half_extent, .. }
        if half_extent.is_infinite() && normal.y.abs() > 0.999)
}

impl fmt::Display for Floor {
    /// Writes the form that [`Floor::from_str`] parses.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::At(height) => write!(f, "{height}"),
        }
    }
}

impl FromStr for Floor {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "none" {
            return Ok(Self::None);
        }
        let height = text.parse::<f64>().ok().filter(|y| is_position(DVec3::splat(*y)));
        height.map(Self::At).ok_or_else(|| "expected a height in metres, or none".into())
    }
}
