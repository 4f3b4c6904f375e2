//! Everything that can go wrong with files and frames, as one type.
//!
//! An error names the file, the location in it and the cause, and carries them as data. How a program
//! lets its user remedy it, by a flag or a button, is the program's to say. Errors are not logged: the
//! caller reports each once.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use limpid::error::printable;

/// Shorthand for results of this library.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Where in a file a problem was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Location {
    /// Offset from the start of the (decompressed) contents, in bytes.
    Byte(u64),
    /// Line number, counted from 1.
    Line(u64),
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(offset) => write!(f, "byte {offset}"),
            Self::Line(line) => write!(f, "line {line}"),
        }
    }
}

/// What the library reports instead of panicking.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be opened, read or written.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried: `read`, `write`, `list`.
        action: &'static str,
        /// The operating system's reason.
        source: io::Error,
    },
    /// The contents of a file contradict its format: truncated, a wrong count, a NaN position.
    #[error("{}: {location}: {problem}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where in it.
        location: Location,
        /// What was found and what was expected.
        problem: String,
    },
    /// A compressed file that unpacks to more than [`ReadOptions::max_unpacked`] allows.
    ///
    /// [`ReadOptions::max_unpacked`]: crate::particles::ReadOptions::max_unpacked
    #[error("{}: {location}: the {what} unpacks to more than {limit} bytes", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Where in it.
        location: Location,
        /// `file` or `array`.
        what: &'static str,
        /// What it may unpack to, bytes.
        limit: u64,
    },
    /// A file of another kind than expected, or of a kind that limpid does not know.
    #[error("{}: {problem}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What it seems to be, what can be read, and the remedy.
        problem: String,
    },
    /// A scene file, a setting or a camera that cannot be used.
    #[error("{origin}: {problem}")]
    Scene {
        /// The scene file, or the option that set the value.
        origin: String,
        /// What is wrong with which key.
        problem: String,
    },
    /// A value that is to be replaced by name: [`crate::project::Project::set`].
    #[error("{text}: {problem}")]
    Override {
        /// The override.
        text: String,
        /// What is wrong with it.
        problem: String,
    },
    /// No file matches a pattern, or frames of a range are missing.
    #[error("{pattern}: {problem}")]
    Sequence {
        /// The pattern or folder as given.
        pattern: String,
        /// What was not found.
        problem: String,
    },
    /// A frame that a sequence lacks.
    #[error("{pattern}: frame {frame} is missing")]
    MissingFrame {
        /// The pattern or folder as given.
        pattern: String,
        /// The frame's number.
        frame: i64,
    },
    /// A scene with a simulation whose frames have not been made.
    #[error("{scene}: not simulated yet")]
    NotBaked {
        /// The scene file.
        scene: String,
    },
    /// Frames in a folder that another simulation made.
    #[error(
        "{}: the frames {name}_*.bgeo here were made from other parameters{difference}",
        folder.display()
    )]
    OtherBake {
        /// The folder.
        folder: PathBuf,
        /// What the frames' names begin with.
        name: String,
        /// The first parameter that differs, in parentheses.
        difference: String,
    },
    /// Frames in a folder that nothing is known of.
    #[error(
        "{}: the frames {name}_*.bgeo here have no {name}.bake.json, so they may be another program's",
        folder.display()
    )]
    UnknownBake {
        /// The folder.
        folder: PathBuf,
        /// What the frames' names begin with.
        name: String,
    },
    /// Particles without radii, and too few to estimate one from their spacing.
    #[error("{origin}: no radii, and no spacing to estimate one from")]
    UnknownRadius {
        /// Their file.
        origin: String,
    },
    /// Two pictures that cannot be compared.
    #[error("{0}")]
    Mismatch(String),
    /// A request outside what can be done (a size of 0, a range that is empty).
    #[error("{0}")]
    Usage(String),
    /// A frame that could not be drawn or written.
    #[error("frame {frame}: {source}")]
    Frame {
        /// Its number, as its picture is numbered.
        frame: i64,
        /// Why.
        source: Box<Self>,
    },
    /// An error that several see: of a frame that a [`crate::frame_cache::FrameCache`] could not load.
    #[error(transparent)]
    Shared(#[from] Arc<Self>),
    /// No window can be shown.
    #[error("no window: {0}")]
    Window(String),
    /// The system starts no more threads, or no thread with the stack it needs.
    #[error("the system gives no more threads ({0})")]
    Threads(io::Error),
    /// What drawing reports.
    #[error(transparent)]
    Render(#[from] limpid::Error),
}

/// Kinds of errors, numbered as programs tell them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Category {
    /// limpid itself is wrong.
    Defect = 1,
    /// The request cannot be met: an argument, a scene, a setting.
    Request,
    /// A file of another kind, or two that do not belong together.
    Format,
    /// A file that cannot be read or written, or that is damaged.
    Data,
    /// No graphics device, or one that cannot do it.
    Device,
    /// It may succeed if it is tried again.
    Temporary,
}

impl From<&limpid::Error> for Category {
    fn from(error: &limpid::Error) -> Self {
        use limpid::Error::{
            DeviceLost, Empty, Invalid, Limit, Memory, NoAdapter, NoMatchingAdapter, Refused,
        };
        match error {
            Invalid { .. } | Empty { .. } => Self::Request,
            NoAdapter | NoMatchingAdapter { .. } | Refused { .. } | Limit { .. } => Self::Device,
            DeviceLost(_) | Memory { .. } => Self::Temporary,
            _ => Self::Defect,
        }
    }
}

impl Error {
    /// What kind of error it is: whose fault, and whether to try again.
    pub fn category(&self) -> Category {
        match self {
            Self::Usage(_)
            | Self::Scene { .. }
            | Self::Override { .. }
            | Self::OtherBake { .. }
            | Self::UnknownBake { .. }
            | Self::UnknownRadius { .. } => Category::Request,
            Self::Mismatch(_) | Self::Format { .. } => Category::Format,
            // The system's own word for no memory.
            Self::Io { source, .. } if source.kind() == io::ErrorKind::OutOfMemory => {
                Category::Temporary
            }
            Self::Io { .. }
            | Self::Malformed { .. }
            | Self::TooLarge { .. }
            | Self::Sequence { .. }
            | Self::MissingFrame { .. }
            | Self::NotBaked { .. } => Category::Data,
            Self::Window(_) => Category::Device,
            Self::Threads(_) => Category::Temporary,
            Self::Frame { source, .. } => source.category(),
            Self::Shared(error) => error.category(),
            Self::Render(error) => error.into(),
        }
    }

    /// The same error, of a frame.
    #[must_use]
    pub fn of_frame(self, frame: i64) -> Self {
        Self::Frame { frame, source: self.into() }
    }

    /// A file or folder that cannot be used: `action` is `read`, `write`, `list`.
    pub fn io(path: &Path, action: &'static str, source: io::Error) -> Self {
        Self::Io { path: path.to_owned(), action, source }
    }

    /// A file that contradicts its format at `place`.
    pub fn malformed(path: &Path, location: Location, problem: impl Into<String>) -> Self {
        Self::Malformed { path: path.to_owned(), location, problem: printable(problem.into()) }
    }

    /// A file of another kind than expected.
    pub fn format(path: &Path, problem: impl Into<String>) -> Self {
        Self::Format { path: path.to_owned(), problem: printable(problem.into()) }
    }
}

/// One message for a TOML error: the line, the problem and, for an unknown key, the nearest.
pub fn toml_error(text: &str, origin: &str, error: &toml::de::Error) -> Error {
    let mut problem = error.message().trim().to_owned();
    if let Some(nearest) = nearest_key(&problem) {
        problem = format!("{problem}; did you mean `{nearest}`?");
    }
    let line = error.span().map(|span| {
        let before = text.as_bytes().get(..span.start).unwrap_or(text.as_bytes());
        1 + before.iter().filter(|&&byte| byte == b'\n').count()
    });
    let origin = match line {
        Some(line) => format!("{origin}: line {line}"),
        None => origin.to_owned(),
    };
    Error::Scene { origin, problem: printable(problem) }
}

/// The key most like the unknown one, from serde's message (the first name in backquotes is the
/// unknown key, the rest are those that exist) or from toml's own about tables in arrays.
fn nearest_key(message: &str) -> Option<&str> {
    let names: Vec<&str> = match message.strip_prefix("unexpected keys in table: ") {
        Some(rest) => {
            let (unknown, known) = rest.split_once(", available keys: ")?;
            unknown.split(", ").take(1).chain(known.split(", ")).collect()
        }
        None if message.starts_with("unknown") => message.split('`').skip(1).step_by(2).collect(),
        None => return None,
    };
    let (unknown, known) = names.split_first()?;
    known.iter().copied().max_by(|a, b| {
        strsim::jaro_winkler(a, unknown).total_cmp(&strsim::jaro_winkler(b, unknown))
    })
}
