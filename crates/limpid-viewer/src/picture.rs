//! The picture on the screen: the next one to draw, kept ones, and the camera's controls.

pub mod adaptive_resolution;
pub mod camera_controls;
pub(crate) mod captions;
mod color_legend;
pub mod flipbook;
mod legend;
mod particle;
mod playing;
mod points;
mod refine;
pub(crate) mod state;
pub(crate) mod texture;
mod triad;
mod viewport;
pub(crate) mod waiting;
