//! The renderer: pictures, intermediate images and shader functions on the device, and what it computes on the CPU. One
//! program, since each takes seconds to link, and one renderer, since each compiles its shaders again.

mod bins;
mod cameras;
mod classify;
mod frames;
mod gaps;
mod hosts;
mod interior;
mod intersectors;
mod look;
mod mesh;
mod opaque;
mod refract;
mod shader_math;
mod smooth;
mod splat;
#[path = "../support/mod.rs"]
mod support;
mod surface;
