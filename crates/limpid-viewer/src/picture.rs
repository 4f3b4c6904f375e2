//! The picture on the screen: what is drawn next, what is kept, and how the pointer moves the camera.

pub mod adaptive_resolution;
pub mod camera_controls;
pub mod flipbook;
mod legend;
mod playing;
mod refine;
pub(crate) mod state;
pub(crate) mod texture;
mod viewport;
