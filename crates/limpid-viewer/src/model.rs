//! What is open and how it is shown.

pub mod command_line;
pub mod demos;
pub mod document;
pub mod level;
pub mod playback;
pub mod shortcuts;
pub mod views;
