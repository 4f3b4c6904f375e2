//! The quality of a picture.

use serde::{Deserialize, Serialize};

/// Quality of a picture, from moving to long at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Level {
    /// A lower resolution, one ray per pixel.
    Draft,
    /// Full resolution, one ray per pixel.
    Full,
    /// Full resolution, several rays per pixel.
    Fine,
}

/// Rays per pixel of a picture at rest.
pub const FINE_SAMPLES: u32 = 4;
