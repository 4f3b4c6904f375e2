//! Remarks of a reader: on parts of a file that it has left out, or understood in a way that its user should know.

use std::fmt;
use std::mem::{Discriminant, discriminant};

use crate::number::thousands;

/// A remark on the contents of a particle file. Its text is one line, without a remedy in terms of a program's
/// options.
#[derive(Debug, Clone, PartialEq)]
pub enum Remark {
    /// An array that has the name of an attribute, but cannot be used.
    Unusable {
        /// Its name in the file.
        array: String,
        /// Contents that were found, and those that were expected.
        problem: String,
    },
    /// Positions with a row for each coordinate instead of one for each particle.
    Transposed {
        /// Its name in the file.
        array: String,
        /// Its size along each axis.
        shape: Vec<usize>,
        /// Number of particles that it is read as.
        particles: usize,
    },
    /// Positions of two numbers.
    Planar {
        /// Its name in the file.
        array: String,
    },
    /// The file is one of several that hold the particles of a frame, and the others were not read.
    Partial {
        /// Number of those that were read.
        found: u64,
        /// Number of all.
        total: u64,
        /// Unit of the numbers.
        unit: Unit,
    },
    /// The frames of a file are numbered from 0, since their time steps do not ascend.
    Renumbered {
        /// The first step that does not follow the one before it.
        step: i64,
    },
    /// A frame that cannot be read, where such frames are replaced.
    Unread {
        /// The error of its file.
        problem: String,
        /// The number of the frame that is shown in its place, if one is.
        shown: Option<i64>,
    },
    /// Numbers of an attribute that cannot be used, for which others stand.
    Repaired {
        /// The array's name in the file.
        array: String,
        /// How many they are, and what is wrong with them.
        problem: String,
        /// Value in their place.
        substitute: &'static str,
    },
    /// Particles of walls and bodies that are left out.
    LeftOut {
        /// How many they are.
        count: usize,
        /// The reason: an array and its numbers.
        why: String,
    },
    /// No particle of the file satisfies the selection.
    NoneSelected {
        /// Its text.
        selection: String,
    },
    /// An array that the attribute map names for the radii is not read, since a radius was given.
    RadiusGiven {
        /// The array, with its factor.
        array: String,
    },
    /// The file has radii of its own, which win over the given one.
    OwnRadii,
    /// A file of foam, spray, bubbles or dust is not shown with this frame, but with the one that the scene selects.
    OfOtherFrame {
        /// The file's name.
        file: String,
        /// Number of the scene's frame.
        own: i64,
    },
    /// Particles that are left out, since their positions are not finite or too large to be drawn.
    Unplaced {
        /// How many they are.
        unplaced: usize,
        /// Number of all particles in the file.
        particles: usize,
        /// The number of the first of them, from 0.
        first: usize,
    },
}

/// Unit in which the parts of a frame are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Files.
    Files,
    /// Particles.
    Particles,
}

impl Remark {
    /// Adds the remarks on another part of the same frame: numbers of particles are added up.
    pub(crate) fn join(remarks: &mut Vec<Self>, more: Vec<Self>) {
        for remark in more {
            let same = remarks.iter_mut().find_map(|known| match (known, &remark) {
                (
                    Self::Unplaced { unplaced, particles, .. },
                    Self::Unplaced { unplaced: also, particles: of, .. },
                ) => {
                    *unplaced += also;
                    *particles += of;
                    Some(())
                }
                (Self::LeftOut { count, why }, Self::LeftOut { count: also, why: cause })
                    if *why == *cause =>
                {
                    *count += also;
                    Some(())
                }
                (known, remark) => (*known == *remark).then_some(()),
            });
            if same.is_none() {
                remarks.push(remark);
            }
        }
    }

    /// Subject of the remark: of two remarks of a sequence with the same subject, one need not be told.
    pub fn subject(&self) -> (Discriminant<Self>, &str) {
        let name = match self {
            Self::Unusable { array, .. }
            | Self::Transposed { array, .. }
            | Self::Planar { array }
            | Self::Repaired { array, .. }
            | Self::RadiusGiven { array } => array,
            Self::Partial { .. }
            | Self::Renumbered { .. }
            | Self::OwnRadii
            | Self::Unplaced { .. }
            | Self::LeftOut { .. }
            | Self::NoneSelected { .. } => "",
            Self::Unread { problem, .. } => problem,
            Self::OfOtherFrame { file, .. } => file,
        };
        (discriminant(self), name)
    }
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unusable { array, problem } => write!(f, "{array} is ignored: {problem}"),
            Self::Transposed { array, shape, particles } => {
                let shape: Vec<String> = shape.iter().map(usize::to_string).collect();
                let (shape, particles) = (shape.join(", "), thousands(*particles));
                write!(f, "{array} ({shape}) has a row for each coordinate: {particles} particles")
            }
            Self::Planar { array } => {
                write!(f, "{array} has two numbers a particle: x and y, with z = 0")
            }
            Self::Partial { found, total, unit } => {
                let unit = match unit {
                    Unit::Files => "files",
                    Unit::Particles => "particles",
                };
                write!(f, "a part of the frame: {found} of {total} {unit}")
            }
            Self::Renumbered { step } => write!(
                f,
                "time step {step} does not follow the one before it, so the frames are numbered from 0"
            ),
            Self::Unread { problem, shown: Some(number) } => {
                write!(f, "{problem}; frame {number} is shown in its place")
            }
            Self::Unread { problem, shown: None } => {
                write!(f, "{problem}; nothing is shown in its place")
            }
            Self::Repaired { array, problem, substitute } => {
                write!(f, "{array}: {problem}, and {substitute} stands for them")
            }
            Self::LeftOut { count, why } => write!(
                f,
                "{} particles of walls and bodies are left out ({why})",
                thousands(*count)
            ),
            Self::NoneSelected { selection } => {
                write!(f, "no particle of the file satisfies {selection}")
            }
            Self::RadiusGiven { array } => {
                write!(f, "{array} is not read as the radius, since a radius was given")
            }
            Self::OwnRadii => {
                f.write_str("the file has radii of its own, which win over the given one")
            }
            Self::OfOtherFrame { file, own } => {
                write!(f, "{file} is shown with frame {own} alone, which the scene selects")
            }
            Self::Unplaced { unplaced, particles, first } => write!(
                f,
                "{} of {} particles have no finite position below 1e18 and are left out (the first: particle {first})",
                thousands(*unplaced),
                thousands(*particles)
            ),
        }
    }
}
