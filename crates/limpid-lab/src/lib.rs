//! Measures the speed and the error of [`limpid`]: [`mod@reference`] computes the ground truth,
//! [`compare`] the difference of two pictures, [`report`] measures time and error in one run, and
//! [`check`] runs picture tests.

#![forbid(unsafe_code)]

pub mod check;
pub mod compare;
mod html_shell;
pub mod reference;
pub mod report;
