//! What threads and the worker of a page share.

pub mod drawing;
pub(crate) mod messages;
pub(crate) mod opening;
#[cfg(not(target_arch = "wasm32"))]
pub(crate) mod truth;
