//! The window of `limpid view`, and the page of a browser: inspect liquids, tune settings, save pictures.
//!
//! The interface's thread never blocks: it sends requests to the [`backend`] and shows its results. That works on
//! threads, or in a browser, which has none, in one worker. It sends messages to the interface, which wake it; nothing
//! else does except input and playback.
//!
//! | folder | contents |
//! |---|---|
//! | [`model`] | the open document and its view: plain data |
//! | [`backend`] | opening, loading, simulating, drawing, writing |
//! | [`panels`] | the panels around the picture |
//! | [`picture`] | the next picture to draw, kept pictures, the camera's controls |
//! | [`app`] | the viewer: its state, the effects of keys, buttons and messages; its window, its page |
//!
//! Each uses those above it. [`Viewer::ui`] is one frame of the interface.

pub mod app;
pub mod backend;
pub mod model;
pub mod panels;
pub mod picture;

#[cfg(not(target_arch = "wasm32"))]
pub use app::window::run;
pub use app::{Options, Viewer};
pub use model::level::FINE_SAMPLES;
