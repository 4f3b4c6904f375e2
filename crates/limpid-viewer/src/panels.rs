//! The panels around the picture.

mod camera;
pub(crate) mod dialogs;
#[cfg(not(target_arch = "wasm32"))]
pub(crate) mod error_plot;
mod first_screen;
mod icons;
mod scene;
mod settings;
pub(crate) mod style;
mod timeline;
pub(crate) mod times;
mod toolbar;
