// Parameters of the caustic kernels, and the grid over the light's view.

struct CausticParams {
    power: vec3f,      // irradiance of a sun, or radiant intensity of a point light
    steps: u32,        // largest number of triangles that `gather` walks
    light: vec3f,      // view space: direction towards a sun, or position of a point light
    interfaces: u32,   // 1: light is traced into the liquid, 2: also out of it
    cells: vec2u,      // of the grid
    gain: f32,         // light on a level surface, relative to light along the view's rays
    blur: f32,         // standard deviation, texels
    // Plane n . x = w in view space that extends level liquid beyond its border: n in xyz, 0 if the
    // liquid is not level.
    level: vec4f,
    subdivide: u32,    // parts along the side of a cell for deposition
    wet: u32,          // 1 if the light is in the liquid
    first: vec2u,      // first thread of a piece of the dispatch
    corner: vec2u,     // first texel of the view in the maps
    number: u32,       // of the light
}

struct GridVertex {
    position: vec3f,   // view space, on the liquid's front
    valid: u32,        // NONE, LIT, SHADOWED or BEYOND
    normal: vec3f,     // unit, out of the liquid
}

const NONE: u32 = 0u;     // no liquid
const LIT: u32 = 1u;
const SHADOWED: u32 = 2u; // by a solid
const BEYOND: u32 = 3u;   // on the extended level plane, for walks that start outside of the liquid
