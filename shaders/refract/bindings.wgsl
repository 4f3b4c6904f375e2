// Group 1 of refraction: `BINDINGS` of `src/passes/refract.rs` has the names in this order. Lights' passes bind the first
// six, which intersectors read.

#import common/tiles.wgsl

struct Params {
    absorption: vec3f,     // 1/m; for several fluids the largest component, in all three channels
    ior: f32,              // of the liquid, relative to the surrounding medium
    contact: f32,          // largest distance of a wetted solid, m
    interfaces: u32,       // largest number of interfaces per ray
    internal_bounces: u32, // largest number of internal reflections per ray
    reach: f32,            // longest unchecked step of `guarded`, as a share of the height
    ambient_shares: vec2f, // shares of ambient light that enter level liquid by two paths
    ambient_paths: vec2f,  // lengths of these paths per metre of depth
    eye_depth: f32,        // depth of the eye below the liquid's surface, m; 0 outside
    scattering: vec3f,     // 1/m; likewise
    anisotropy: f32,       // mean cosine of scattering
    mean_transmittance: f32, // of the surface, for light from everywhere outside
    radius: f32,           // of particles, m
    diffuse_white: f32,    // of refract/diffuse.wgsl
    cells_first: vec3f,    // corner of the grid of diffuse/cells.wgsl, relative to the eye, world axes, m
    cells_side: f32,       // of a cell, m
    cells_across: vec3u,   // cells along each axis; 0 without spheres
}

@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var aggregate_layers: $layers;
@group(1) @binding(2) var splash_layers: $layers;
@group(1) @binding(3) var gbuffer_planes: texture_2d<f32>;
@group(1) @binding(4) var bounds: texture_2d<f32>; // as in bounds.wgsl
@group(1) @binding(5) var mixture: texture_2d<f32>; // absorption times length, length: mixture/sums.wgsl
@group(1) @binding(6) var gbuffer_surfaces: texture_2d<f32>; // world normal, solid index
@group(1) @binding(7) var radiance: texture_storage_2d<rgba32float, write>;
// Interfaces, length inside (m), solver iterations and solver failures: means over the samples.
@group(1) @binding(8) var diagnostics: texture_storage_2d<rgba32float, write>;
// Tiles of the entry point: those with liquid, or the others.
@group(1) @binding(9) var<storage, read> tiles: TileList;
@group(1) @binding(10) var host_color: texture_2d<f32>; // or the background
// Of `structured_pixels`: the picture with one ray per pixel.
@group(1) @binding(11) var first_radiance: texture_2d<f32>;
// Of opaque bodies and fluids: shade/body.wgsl.
@group(1) @binding(12) var body_radiance: texture_2d<f32>;
// Of turbid liquids: scattering times length, length; turbid/means.wgsl; turbid/slab.wgsl.
@group(1) @binding(13) var scattering_mixture: texture_2d<f32>;
@group(1) @binding(14) var turbid_light: texture_2d<u32>;
@group(1) @binding(15) var slab_table: texture_2d<f32>;
// Of foam, spray, bubbles and dust, by pixel: diffuse/pixels.wgsl.
@group(1) @binding(16) var<storage, read> diffuse_above: array<vec4u>;  // in the air
@group(1) @binding(17) var<storage, read> diffuse_inside: array<vec4u>; // in the liquid
@group(1) @binding(18) var<storage, read> cells: array<vec4u>;          // diffuse/cells.wgsl
