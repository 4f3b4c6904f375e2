//! How fast and how wrong [`limpid`] is: [`mod@reference`] is the ground truth, [`compare`] the difference
//! of two pictures, [`report`] measures speed beside error, and [`check`] tests pictures.

#![forbid(unsafe_code)]

pub mod check;
pub mod compare;
mod html_shell;
pub mod quality;
pub mod reference;
pub mod report;
