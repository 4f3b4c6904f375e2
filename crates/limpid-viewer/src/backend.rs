//! The work behind the interface: opening, loading, simulating, drawing, writing.

pub(crate) mod background;
pub mod core;
pub(crate) mod frames;
#[cfg(not(target_arch = "wasm32"))]
pub mod native;
#[cfg(target_arch = "wasm32")]
pub mod web;
