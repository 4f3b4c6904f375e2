//! The list of hostile inputs and their expected outcomes. `docs/hostile.md` has the rules behind them.

mod contents;
mod outputs;
mod paths;
mod values;

use std::path::Path;

/// A run of the program and its expected outcome.
pub(crate) struct Case {
    /// The case in words.
    pub(crate) what: &'static str,
    /// The arguments; quotes keep blanks.
    pub(crate) arguments: &'static str,
    /// Writes the files.
    pub(crate) prepare: fn(&Path),
    /// The environment of the run.
    pub(crate) way: Way,
    pub(crate) code: i32,
    /// Standard error without `limpid: `; `…` matches any text.
    pub(crate) message: &'static str,
}

/// The environment of a run.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Way {
    /// At most 3 GiB of address space.
    Small,
    /// No limits, since drivers need more address space; needs an adapter.
    Drawing,
    /// An unprivileged user.
    Nobody,
    /// A limit of 4 KiB on the length of files.
    Short,
    /// A disk of 4 KiB.
    Full,
    /// A disk of 4 KiB; needs an adapter.
    FullDrawing,
}

const fn case(
    what: &'static str,
    arguments: &'static str,
    prepare: fn(&Path),
    way: Way,
    code: i32,
    message: &'static str,
) -> Case {
    Case { what, arguments, prepare, way, code, message }
}

/// All cases.
pub(crate) fn all() -> impl Iterator<Item = &'static Case> {
    [paths::CASES, contents::CASES, values::CASES, outputs::CASES].into_iter().flatten()
}
