//! The sources themselves: their modules, their shaders, what Rust and WGSL share, the pipelines that both make, and the pages. No
//! adapter is needed.

mod layout;
mod modules;
mod pages;
mod pipelines;
mod shaders;
#[path = "../support/mod.rs"]
mod support;
