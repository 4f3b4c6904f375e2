//! The work behind the interface: opening, loading, simulating, drawing, writing.
//!
//! [`core`] has the tasks and their messages. `native` runs them on threads; `web` in the worker of a page, to
//! which requests and answers travel as messages. Both have the same functions, which `here` names.

pub mod core;
pub(crate) mod frames;
#[cfg(not(target_arch = "wasm32"))]
pub mod native;
#[cfg(target_arch = "wasm32")]
pub mod web;

#[cfg(not(target_arch = "wasm32"))]
pub(crate) use native as here;
#[cfg(target_arch = "wasm32")]
pub(crate) use web as here;
