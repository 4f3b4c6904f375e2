// Diffuse particles: spheres of foam, spray, bubbles and dust.

#import common/camera.wgsl
#import common/tiles.wgsl

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

// Light around the spheres of a tile (diffuse/around.wgsl): texels in a row of its texture, of the mean, with 1 in w or 0
// without spheres, and of the changes with x, y and z.
const PROBE_TEXELS: u32 = 4u;

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

// Tiles in a row of the picture.
fn tile_of(pixel: vec2f) -> u32 {
    let tile = vec2u(clamp(pixel, vec2f(0.0), camera.size - 1.0)) / TILE;
    return tile.y * tiles_across(u32(camera.size.x)) + tile.x;
}

// Radius in pixels.
fn radius_in_pixels(sphere: Placed) -> f32 {
    return sphere.radius / camera_pixel_side(sphere.position);
}

// Spheres with larger radii are drawn by workgroups, pixels.
const LARGE: f32 = 2.0;
