//! The sources themselves: their modules, their shaders, what Rust and WGSL share, and the pipelines that both make. No
//! adapter is needed.

mod layout;
mod modules;
mod pipelines;
mod shaders;
#[path = "../support/mod.rs"]
mod support;
