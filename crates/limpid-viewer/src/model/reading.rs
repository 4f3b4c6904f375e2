//! How particle files are read, and how that is known.

use serde::{Deserialize, Serialize};

use limpid::liquid::{Particles, Up};
use limpid_io::input::{Loader, RadiusFrom, UpFrom};

/// How a value of the data is known.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Known {
    /// The user has given it.
    Given,
    /// The files tell it.
    #[default]
    File,
    /// The scene tells it.
    Scene,
    /// It was guessed from the particles.
    Guessed,
    /// Nothing tells it.
    Assumed,
}

impl Known {
    /// A word for it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Given => "given",
            Self::File => "from the files",
            Self::Scene => "from the scene",
            Self::Guessed => "guessed",
            Self::Assumed => "assumed",
        }
    }

    /// Whether it may be wrong.
    pub fn is_doubtful(self) -> bool {
        matches!(self, Self::Guessed | Self::Assumed)
    }
}

impl From<RadiusFrom> for Known {
    fn from(radius: RadiusFrom) -> Self {
        match radius {
            RadiusFrom::File => Self::File,
            RadiusFrom::Option => Self::Given,
            RadiusFrom::Scene => Self::Scene,
            RadiusFrom::Guess => Self::Guessed,
        }
    }
}

impl From<UpFrom> for Known {
    fn from(up: UpFrom) -> Self {
        match up {
            UpFrom::Option => Self::Given,
            UpFrom::Scene => Self::Scene,
            UpFrom::Format(_) => Self::File,
            UpFrom::Flat | UpFrom::Guess => Self::Guessed,
            UpFrom::Default => Self::Assumed,
        }
    }
}

/// How the files of a document are read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// The axis that points up in them.
    pub up: Up,
    /// How that is known.
    pub up_known: Known,
    /// Radius of particles without one of their own, m.
    pub radius: Option<f32>,
    /// How that is known.
    pub radius_known: Known,
    /// Length of their unit, m.
    pub scale: f64,
}

impl Reading {
    /// That of a loader whose input is resolved.
    pub fn of(loader: &Loader) -> Self {
        let (up, up_from) = loader.up();
        let source = loader.source();
        let files = source.files().first();
        Self {
            up,
            up_known: up_from.into(),
            radius: files.and_then(|files| files.radius),
            radius_known: loader.radius_from(&Particles::default()).into(),
            scale: files.and_then(|files| files.scale).unwrap_or(1.0),
        }
    }
}
