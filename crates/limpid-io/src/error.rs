//! The error type of files and frames.
//!
//! An error contains the file, the location in it and the cause as data. Remedies depend on the program,
//! which has flags or buttons for them, and are worded by the program. Errors are not logged: the caller
//! reports each once.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use limpid::error::printable;

/// Shorthand for results of this library.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// The location of a problem in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Location {
    /// Offset from the start of the (decompressed) contents, bytes.
    Byte(u64),
    /// Line number, from 1.
    Line(u64),
    /// The part of a document, by its path in it: `nodes[3]`.
    Part(String),
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(offset) => write!(f, "byte {offset}"),
            Self::Line(line) => write!(f, "line {line}"),
            Self::Part(part) => f.write_str(part),
        }
    }
}

/// Input that takes too much memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unpacked {
    /// A single file of particles.
    File,
    /// A file with all files that it lists, or the files of all ranks.
    Files,
    /// The meshes of a document, with their pictures.
    Meshes,
    /// A mesh that its nodes repeat.
    Instances,
}

impl fmt::Display for Unpacked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::File => "the file unpacks to",
            Self::Files => "the files that belong together unpack to",
            Self::Meshes => "the meshes of the document and their pictures take",
            Self::Instances => "its nodes repeat meshes, which take",
        })
    }
}

/// An error of this library.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be opened, read or written.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The failed action: `read`, `write`, `list`.
        action: &'static str,
        /// The operating system's reason.
        source: io::Error,
    },
    /// A file that violates its format: truncated, or with a wrong count.
    #[error("{}: {location}: {problem}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The location in it.
        location: Location,
        /// Contents that were found, and those that were expected.
        problem: String,
    },
    /// A file of which so many particles have no position that it seems to be damaged.
    #[error(
        "{}: {location}: particle {row}: position {position:?}; {unplaced} of {particles} particles have no \
         finite position below 1e18",
        path.display()
    )]
    Unplaced {
        /// The file.
        path: PathBuf,
        /// The location of the first of these particles.
        location: Location,
        /// Its number, from 0.
        row: usize,
        /// Its position in the file.
        position: [f32; 3],
        /// How many they are.
        unplaced: usize,
        /// Number of all particles in the file.
        particles: usize,
    },
    /// A document of which more would be made than [`ReadOptions::max_unpacked`] or its length allows.
    ///
    /// [`ReadOptions::max_unpacked`]: crate::particles::ReadOptions::max_unpacked
    #[error("{}: {location}: {what} more than {limit} bytes", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The location in it.
        location: Location,
        /// Its kind.
        what: Unpacked,
        /// The limit of its unpacked size, bytes.
        limit: u64,
    },
    /// A file of another format than expected, or of an unknown one.
    #[error("{}: {problem}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// The format that it seems to have, the readable formats, and the remedy.
        problem: String,
    },
    /// A scene file, a setting or a camera that cannot be used.
    #[error("{origin}: {problem}")]
    Scene {
        /// The scene file, or the option that set the value.
        origin: String,
        /// The key and its problem.
        problem: String,
    },
    /// An invalid override of a value by name: [`crate::project::Project::set`].
    #[error("{text}: {problem}")]
    Override {
        /// The override.
        text: String,
        /// Its problem.
        problem: String,
    },
    /// No file matches a pattern.
    #[error("{pattern}: {problem}")]
    Sequence {
        /// The pattern or folder as given.
        pattern: String,
        /// Files that were not found.
        problem: String,
    },
    /// An error of one of several inputs.
    #[error("{input}: {source}")]
    Input {
        /// The input as given.
        input: String,
        /// The error.
        source: Box<Self>,
    },
    /// A missing frame of a sequence.
    #[error("{pattern}: frame {frame} is missing")]
    MissingFrame {
        /// The pattern or folder as given.
        pattern: String,
        /// The frame's number.
        frame: i64,
    },
    /// Frames of a range are missing.
    #[error("{pattern}: {problem}")]
    MissingFrames {
        /// The pattern or folder as given.
        pattern: String,
        /// How many, and which.
        problem: String,
    },
    /// A scene with a simulation that has not been baked.
    #[error("{scene}: not simulated yet")]
    NotBaked {
        /// The scene file.
        scene: String,
    },
    /// Frames in a folder that were baked with other parameters.
    #[error(
        "{}: the frames {name}_*.bgeo here were made from other parameters{difference}",
        folder.display()
    )]
    OtherBake {
        /// The folder.
        folder: PathBuf,
        /// Prefix of the frames' names.
        name: String,
        /// The first parameter that differs, in parentheses.
        difference: String,
    },
    /// Frames in a folder without a bake record.
    #[error(
        "{}: the frames {name}_*.bgeo here have no {name}.bake.json, so they may be another program's",
        folder.display()
    )]
    UnknownBake {
        /// The folder.
        folder: PathBuf,
        /// Prefix of the frames' names.
        name: String,
    },
    /// Particles without radii, and too few to estimate a radius from their spacing.
    #[error("{origin}: no radii, and no spacing to estimate one from")]
    UnknownRadius {
        /// Their file.
        origin: String,
    },
    /// Two pictures that cannot be compared.
    #[error("{0}")]
    Mismatch(String),
    /// An invalid request (a size of 0, an empty range).
    #[error("{0}")]
    Usage(String),
    /// A frame that could not be drawn or written.
    #[error("frame {frame}: {source}")]
    Frame {
        /// Its number, which is that of its picture.
        frame: i64,
        /// The cause.
        source: Box<Self>,
    },
    /// An error with several receivers: of a frame that a [`crate::frame_cache::FrameCache`] could not
    /// load.
    #[error(transparent)]
    Shared(#[from] Arc<Self>),
    /// A window that cannot be shown.
    #[error("no window: {0}")]
    Window(String),
    /// A thread that the system cannot start, or not with the required stack.
    #[error("the system cannot start another thread ({0})")]
    Threads(io::Error),
    /// An error of the renderer.
    #[error(transparent)]
    Render(#[from] limpid::Error),
}

/// Categories of errors, numbered by exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Category {
    /// A defect of limpid.
    Defect = 1,
    /// An invalid argument, scene or setting.
    Request,
    /// A file of another format, or two files that do not match.
    Format,
    /// A file that cannot be read or written, or is damaged.
    Data,
    /// No graphics device, or one without the required limits.
    Device,
    /// A failure that a retry may avoid.
    Temporary,
}

impl From<&limpid::Error> for Category {
    fn from(error: &limpid::Error) -> Self {
        use limpid::Error::{
            DeviceLost, Empty, Interrupted, Invalid, Limit, Memory, NoAdapter, NoMatchingAdapter,
            Refused,
        };
        match error {
            Invalid { .. } | Empty { .. } => Self::Request,
            NoAdapter | NoMatchingAdapter { .. } | Refused { .. } | Limit { .. } => Self::Device,
            DeviceLost(_) | Interrupted | Memory { .. } => Self::Temporary,
            _ => Self::Defect,
        }
    }
}

impl Error {
    /// The category of the error.
    pub fn category(&self) -> Category {
        match self {
            Self::Usage(_)
            | Self::Scene { .. }
            | Self::Override { .. }
            | Self::OtherBake { .. }
            | Self::UnknownBake { .. }
            | Self::UnknownRadius { .. } => Category::Request,
            Self::Mismatch(_) | Self::Format { .. } => Category::Format,
            // The system is out of memory.
            Self::Io { source, .. } if source.kind() == io::ErrorKind::OutOfMemory => {
                Category::Temporary
            }
            Self::Io { .. }
            | Self::Malformed { .. }
            | Self::Unplaced { .. }
            | Self::TooLarge { .. }
            | Self::Sequence { .. }
            | Self::MissingFrame { .. }
            | Self::MissingFrames { .. }
            | Self::NotBaked { .. } => Category::Data,
            Self::Window(_) => Category::Device,
            Self::Threads(_) => Category::Temporary,
            Self::Frame { source, .. } | Self::Input { source, .. } => source.category(),
            Self::Shared(error) => error.category(),
            Self::Render(error) => error.into(),
        }
    }

    /// Whether a file cannot be read: it is missing, damaged or of another format. Others may be read then.
    pub fn is_of_reading(&self) -> bool {
        match self {
            Self::Shared(error) => error.is_of_reading(),
            Self::Frame { source, .. } => source.is_of_reading(),
            Self::Io { action, .. } if !matches!(*action, "read" | "list") => false,
            _ => matches!(self.category(), Category::Data | Category::Format),
        }
    }

    /// Adds the frame's number to the error.
    #[must_use]
    pub fn of_frame(self, frame: i64) -> Self {
        Self::Frame { frame, source: self.into() }
    }

    /// The error of a file or folder; `action` is `read`, `write`, `list`.
    pub fn io(path: &Path, action: &'static str, source: io::Error) -> Self {
        Self::Io { path: path.to_owned(), action, source }
    }

    /// The error of a file that violates its format at `location`.
    pub fn malformed(path: &Path, location: Location, problem: impl Into<String>) -> Self {
        Self::Malformed { path: path.to_owned(), location, problem: printable(problem.into()) }
    }

    /// The error of a file of another format than expected.
    pub fn format(path: &Path, problem: impl Into<String>) -> Self {
        Self::Format { path: path.to_owned(), problem: printable(problem.into()) }
    }
}

/// Converts a TOML error to one with the line, the problem and, for an unknown key, the nearest known
/// one.
pub fn toml_error(text: &str, origin: &str, error: &toml::de::Error) -> Error {
    let mut problem = error.message().trim().to_owned();
    if let Some((nearest, similarity)) = nearest_key(&problem) {
        // All keys, unless it is clear which one is meant.
        let problem_alone =
            problem.split_once(", expected one of ").map_or(&*problem, |(first, _)| first);
        let stated = if similarity > CLEAR { problem_alone } else { &problem };
        problem = format!("{stated}; did you mean `{nearest}`?");
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

/// Similarity of a misspelt key to the one that is meant, from 0 to 1.
const CLEAR: f64 = 0.9;

/// The known key most similar to the unknown one, from the message of serde (the first name in
/// backquotes is the unknown key, the others are the known ones) or of toml for tables in arrays; and how
/// similar it is, from 0 to 1.
fn nearest_key(message: &str) -> Option<(&str, f64)> {
    let names: Vec<&str> = match message.strip_prefix("unexpected keys in table: ") {
        Some(rest) => {
            let (unknown, known) = rest.split_once(", available keys: ")?;
            unknown.split(", ").take(1).chain(known.split(", ")).collect()
        }
        None if message.starts_with("unknown") => message.split('`').skip(1).step_by(2).collect(),
        None => return None,
    };
    let (unknown, known) = names.split_first()?;
    let known = known.iter().map(|&key| (key, strsim::jaro_winkler(key, unknown)));
    known.max_by(|(_, a), (_, b)| a.total_cmp(b))
}
