//! The picture on the screen.

pub mod adaptive_resolution;
pub mod camera_controls;
pub mod flipbook;
pub(crate) mod refine;
mod viewport;
