//! The mathematics of the shaders, run on the device against closed forms in 64 bits.
//!
//! References are computed from the 32-bit values that the device was given, so that tolerances
//! speak of the shaders' own rounding alone: 2^-24 = 6e-8 per operation, and for division, square
//! roots and the like the few units in the last place that WGSL allows.

mod camera;
mod environment;
mod layers;
mod optics;
mod screen_ray;
mod solids;
mod splat;
#[path = "../support/mod.rs"]
mod support;
#[path = "../support/view.rs"]
mod view;
