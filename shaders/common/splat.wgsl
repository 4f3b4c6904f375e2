// A splat: `Splat` of `src/liquid/classify.rs`.

// The ellipsoid { centre + A s : |s| <= 1 } in world axes, A symmetric.
struct Splat {
    centre: vec3f,       // relative to the splats' origin, m
    radius: f32,         // of the particle, m
    diagonal: vec3f,     // A_xx, A_yy, A_zz, m
    particle: u32,
    off_diagonal: vec3f, // A_xy, A_xz, A_yz, m
    tags: u32,           // index of the fluid; further bits
}

// The bits of the tags that hold the fluid.
const FLUID: u32 = 0xffffu;
// Bits of the tags of a particle that is surrounded by liquid, and of a splat that stands for those of a cell.
const BURIED: u32 = 0x10000u;
const INTERIOR: u32 = 0x10000000u;
// Of splats that the device has classified: droplets, and those for which another one stands.
const SPLASH: u32 = 0x20000000u;
const HIDDEN: u32 = 0x40000000u;
