//! The renderer's error type.
//!
//! An error states the problem and the values involved. The program adds where a value came from and
//! how its user can change it.

use std::fmt;

/// Result of a fallible function of this library.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Any failure that the library reports.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An invalid value in a scene, its settings, a camera or a simulation.
    #[error("{part}: {problem}")]
    Invalid {
        /// The part that holds the value: `settings`, `[light]`, `camera`.
        part: String,
        /// The value and the expected ones.
        problem: String,
    },
    /// A picture without pixels.
    #[error("a picture of {width}x{height} has no pixels")]
    Empty {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
    /// There is no Vulkan, Metal, DirectX or OpenGL adapter.
    #[error("no graphics adapter found")]
    NoAdapter,
    /// No adapter matches the environment variables that select one.
    #[error("no graphics adapter fits {selected}; there are: {found}")]
    NoMatchingAdapter {
        /// The variables and their values.
        selected: String,
        /// The available adapters with their backends.
        found: String,
    },
    /// The adapter refused to create a device.
    #[error("adapter {adapter}: {problem}")]
    Refused {
        /// The adapter's name.
        adapter: String,
        /// The driver's reason.
        problem: String,
    },
    /// A request exceeds a limit of the adapter.
    #[error("adapter {adapter}: {problem}; {of}")]
    Limit {
        /// The adapter's name.
        adapter: String,
        /// The limit and the requested value.
        problem: String,
        /// The resource that is too large.
        of: Limited,
    },
    /// The device was lost or ran out of memory; the same frame may succeed later.
    #[error("the graphics device failed ({0}); the frame may succeed if tried again")]
    DeviceLost(String),
    /// The frame was [ended early](crate::gpu::Gpu::with_interrupt).
    #[error("the frame was interrupted")]
    Interrupted,
    /// The system is out of memory; the same request may succeed once other memory is freed.
    #[error("{what}: out of memory: {mib} MiB cannot be allocated; it may succeed if tried again")]
    Memory {
        /// Purpose of the allocation: a file, a picture, a frame's shapes.
        what: String,
        /// Requested size, MiB.
        mib: u64,
    },
    /// A bug in limpid; standard error has the details.
    #[error("{0}: this is a bug in limpid; please report it")]
    Defect(String),
}

/// A resource or operation that exceeds an adapter's limits. Its `Display` text is the remedy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Limited {
    /// The picture.
    Picture,
    /// An environment map.
    Environment,
    /// A light's caustic map: [`crate::settings::Caustics::resolution`].
    CausticMap,
    /// The grid over a light's view: [`crate::settings::Caustics::grid`].
    CausticGrid,
    /// Classification on the device.
    Classify,
    /// Meshes and textures.
    Meshes,
    /// The particles' velocities, for motion vectors.
    Velocities,
    /// Foam, spray, bubbles and dust.
    Diffuse,
}

impl fmt::Display for Limited {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Picture => "choose a smaller picture",
            Self::Environment => "choose a smaller environment map",
            Self::CausticMap => "choose a smaller caustics.resolution",
            Self::CausticGrid => "choose a smaller caustics.grid",
            Self::Classify => "classify on the CPU",
            Self::Velocities => "draw without motion vectors",
            Self::Diffuse => "choose a smaller picture, or draw without foam",
            Self::Meshes => "choose meshes of fewer triangles, or smaller textures",
        })
    }
}

impl Error {
    /// Creates an [`Error::Invalid`].
    pub fn invalid(part: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Invalid { part: part.into(), problem: problem.into() }
    }
}

/// Shortens a message to one printable line: text quoted from a file may be arbitrarily long and may
/// contain terminal escape sequences.
#[doc(hidden)]
pub fn printable(problem: String) -> String {
    const MAX_CHARS: usize = 500;
    if problem.len() <= MAX_CHARS && !problem.contains(char::is_control) {
        return problem;
    }
    let cut = problem.chars().count() > MAX_CHARS;
    let shown = problem.chars().take(MAX_CHARS).map(|c| if c.is_control() { '?' } else { c });
    shown.chain(if cut { "..." } else { "" }.chars()).collect()
}
