//! What a reader has left out of a file, or understood in a way that its user should know.

use std::fmt;
use std::mem::{Discriminant, discriminant};

/// A remark on the contents of a particle file. Its text is one line, without a remedy in terms of a program's
/// options.
#[derive(Debug, Clone, PartialEq)]
pub enum Remark {
    /// An array that has the name of an attribute, but cannot be used.
    Unusable {
        /// Its name in the file.
        array: String,
        /// What was found and what was expected.
        problem: String,
    },
}

impl Remark {
    /// What the remark is about: two remarks of a sequence with the same subject need not both be told.
    pub fn subject(&self) -> (Discriminant<Self>, &str) {
        let name = match self {
            Self::Unusable { array, .. } => array,
        };
        (discriminant(self), name)
    }
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unusable { array, problem } => write!(f, "{array} is ignored: {problem}"),
        }
    }
}
