//! Mathematical functions of the shaders on the device, against closed forms in 64 bits.
//!
//! References are computed from the 32-bit inputs of the device, so that tolerances cover only the
//! shaders' own rounding: 2^-24 = 6e-8 per operation, and for division, square roots and the like the
//! few units in the last place that WGSL allows.

mod camera;
mod environment;
mod gaps;
mod layers;
mod mesh_rays;
mod meshes;
mod optics;
mod screen_ray;
mod solids;
mod splat;
