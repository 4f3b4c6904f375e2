// What the caustic kernels share: their parameters, and the grid over the light's view.

struct CausticParams {
    power: vec3f,      // a sun's irradiance, or a point light's radiant intensity
    steps: u32,        // triangles that `gather` walks at most
    light: vec3f,      // view space: the direction towards a sun, or a point light's position
    interfaces: u32,   // 1: light is followed into the liquid, 2: and out of it
    cells: vec2u,      // of the grid
    gain: f32,         // light on a level surface over that on a surface across the view
    blur: f32,         // standard deviation, texels
    // A plane n . x = w in view space, on which the liquid would lie if it went on beyond its
    // border: n in xyz, 0 if it is not level.
    level: vec4f,
    subdivide: u32,    // parts along the side of a cell whose light is laid
    wet: u32,          // 1 if the light is in the liquid
    first: vec2u,      // thread of a piece of a dispatch
    corner: vec2u,     // where the view's texels begin in the maps
}

struct GridVertex {
    position: vec3f,   // view space, on the liquid's front
    valid: u32,        // one of these:
    normal: vec3f,     // unit, out of the liquid
}

const NONE: u32 = 0u;     // no liquid here
const LIT: u32 = 1u;
const SHADOWED: u32 = 2u; // by a solid
const BEYOND: u32 = 3u;   // not liquid, but on its level: for walks that start beyond its border
