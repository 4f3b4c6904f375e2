//! The application: its state, and what becomes of keys, buttons and messages.

mod actions;
#[cfg(not(target_arch = "wasm32"))]
pub(crate) mod filming;
#[cfg(target_arch = "wasm32")]
pub mod link;
pub(crate) mod log;
mod messages;
pub(crate) mod opening;
#[cfg(target_arch = "wasm32")]
pub mod page;
pub(crate) mod recent;
pub(crate) mod state;
#[cfg(not(target_arch = "wasm32"))]
pub(crate) mod window;
