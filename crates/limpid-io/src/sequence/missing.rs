//! Missing frames.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// The treatment of frames that are missing or cannot be read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Missing {
    /// An error.
    #[default]
    Error,
    /// A frame without particles, or without the solid.
    Empty,
    /// The nearest frame before that can be read; before the first, an empty one.
    Hold,
}

impl FromStr for Missing {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "error" => Ok(Self::Error),
            "empty" => Ok(Self::Empty),
            "hold" => Ok(Self::Hold),
            _ => Err(Error::Usage(format!(
                "missing frames: `{text}`; expected error, empty or hold"
            ))),
        }
    }
}
