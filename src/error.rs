//! Everything that can go wrong in drawing, as one type.
//!
//! An error names what is wrong and its values. It does not know where a value came from or how a
//! program lets its user change it: that is the program's to add.

use std::fmt;

/// Shorthand for results of this library.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What the library reports instead of panicking.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A value of a scene, of its settings, of a camera or of a simulation that cannot be used.
    #[error("{part}: {problem}")]
    Invalid {
        /// The part that has it: `settings`, `[light]`, `camera`.
        part: String,
        /// The value, and what was expected.
        problem: String,
    },
    /// A picture without pixels.
    #[error("a picture of {width}x{height} has no pixels")]
    Empty {
        /// Its width, pixels.
        width: u32,
        /// Its height, pixels.
        height: u32,
    },
    /// No Vulkan, Metal, DirectX or OpenGL adapter.
    #[error("no graphics adapter found")]
    NoAdapter,
    /// There are adapters, but none that the environment selects.
    #[error("no graphics adapter fits {selected}; there are: {found}")]
    NoMatchingAdapter {
        /// The variables and their values.
        selected: String,
        /// The adapters with their backends.
        found: String,
    },
    /// An adapter that gives no device.
    #[error("adapter {adapter}: {problem}")]
    Refused {
        /// The adapter's name.
        adapter: String,
        /// The driver's reason.
        problem: String,
    },
    /// The adapter cannot hold or do what is asked.
    #[error("adapter {adapter}: {problem}; {of}")]
    Limit {
        /// The adapter's name.
        adapter: String,
        /// The limit, and what was asked for.
        problem: String,
        /// What is too large.
        of: Limited,
    },
    /// The device was lost or ran out of memory; the same frame may succeed later.
    #[error("the graphics device failed ({0}); the frame may succeed if tried again")]
    DeviceLost(String),
    /// The system has no memory for it now; with less beside it the same may succeed later.
    #[error("{what}: no memory: {mib} MiB more cannot be had; it may succeed if tried again")]
    Memory {
        /// What it was to hold: a file, a picture, a frame's shapes.
        what: String,
        /// How much was asked for, MiB.
        mib: u64,
    },
    /// limpid itself is wrong; standard error says where.
    #[error("{0}: a defect of limpid, which its authors would like to know of")]
    Defect(String),
}

/// What an adapter cannot hold or do; as text, the remedy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Limited {
    /// The picture.
    Picture,
    /// An environment map.
    Environment,
    /// The map of a light: [`crate::settings::Caustics::resolution`].
    CausticMap,
    /// The grid of a light's view: [`crate::settings::Caustics::grid`].
    CausticGrid,
    /// Classification on the device.
    Classify,
}

impl fmt::Display for Limited {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Picture => "choose a smaller picture",
            Self::Environment => "choose a smaller environment map",
            Self::CausticMap => "choose a smaller caustics.resolution",
            Self::CausticGrid => "choose a smaller caustics.grid",
            Self::Classify => "classify on the CPU",
        })
    }
}

impl Error {
    /// A value that cannot be used.
    pub fn invalid(part: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Invalid { part: part.into(), problem: problem.into() }
    }
}

/// A problem on one line that ends: what it quotes from a file may be of any length and anything,
/// even commands to the terminal.
#[doc(hidden)]
pub fn printable(problem: String) -> String {
    const MOST: usize = 500;
    if problem.len() <= MOST && !problem.contains(char::is_control) {
        return problem;
    }
    let cut = problem.chars().count() > MOST;
    let shown = problem.chars().take(MOST).map(|c| if c.is_control() { '?' } else { c });
    shown.chain(if cut { "..." } else { "" }.chars()).collect()
}
