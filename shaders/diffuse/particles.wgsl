// Diffuse particles: spheres of foam, spray, bubbles and dust.

#import common/camera.wgsl
#import common/groups.wgsl

struct Params {
    origin: vec3f,            // of the particles, relative to the eye, world axes, m
    radius: f32,              // of the liquid's particles, m
    albedos: array<vec4f, 4>, // by kind
    absorption: vec3f,        // of the liquid, 1/m
    ior: f32,                 // of the liquid
    count: u32,
    mean_transmittance: f32,  // of the liquid's surface, for light from everywhere outside
    white: f32,               // radiance of which `sums` counts shares
    cells_first: vec3f,       // corner of the grid, relative to the eye, world axes, m: diffuse/cells.wgsl
    cells_side: f32,          // of a cell, m
    cells_across: vec3u,      // cells along each axis
}

@group(1) @binding(0) var<uniform> params: Params;

// A sphere in the picture.
struct Placed {
    position: vec3f,  // of its centre, view space, m
    radius: f32,      // m
    pixel: vec2f,     // where it is seen: refracted, if it is in the liquid
    way: f32,         // of the light through the liquid towards the eye, m
    traits: u32,      // and, above their 18 bits, the share of it above the liquid
}

// Side of the squares of pixels whose spheres share a probe of the light around them (diffuse/around.wgsl).
const PROBE_SIDE: u32 = 16u;
// Texels of a probe in a row of their texture: the mean, the changes with x, y and z, and the light on a sphere's disc that
// faces the eye. In w is 1, or 0 without spheres.
const PROBE_TEXELS: u32 = 5u;
const MEAN: i32 = 0;
const TO_EYE: i32 = 4;

// Kind, in two bits, and opacity, in 16.
fn kind_of(traits: u32) -> u32 {
    return traits & 3u;
}

fn opacity_of(traits: u32) -> f32 {
    return f32((traits >> 2u) & 0xffffu) / 65535.0;
}

// Share of a sphere above the liquid.
fn in_air(sphere: Placed) -> f32 {
    return f32(sphere.traits >> 18u) / 16383.0;
}

fn with_share_in_air(traits: u32, share: f32) -> u32 {
    return (traits & 0x3ffffu) | (u32(share * 16383.0 + 0.5) << 18u);
}

// Index of a thread in workgroups of 64.
fn thread_index(group: vec3u, local: u32) -> u32 {
    return group_index(group) * 64u + local;
}

// Probes in a row of the picture.
fn probes_across() -> u32 {
    return (u32(camera.size.x) + PROBE_SIDE - 1u) / PROBE_SIDE;
}

fn probe_of(pixel: vec2f) -> u32 {
    let square = vec2u(clamp(pixel, vec2f(0.0), camera.size - 1.0)) / PROBE_SIDE;
    return square.y * probes_across() + square.x;
}

// Radius in pixels.
fn radius_in_pixels(sphere: Placed) -> f32 {
    return sphere.radius / camera_pixel_side(sphere.position);
}

// Spheres with larger radii are drawn by workgroups, pixels.
const LARGE: f32 = 2.0;
