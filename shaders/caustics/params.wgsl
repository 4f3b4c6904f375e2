// What the caustic kernels share: their parameters, and the grid over the light's view.

struct CausticParams {
    power: vec3f,      // a sun's irradiance, or a point light's radiant intensity
    steps: u32,        // triangles that `gather` walks at most
    light: vec3f,      // view space: the direction towards a sun, or a point light's position
    interfaces: u32,   // 1: light is followed into the liquid, 2: and out of it
    cells: vec2u,      // of the grid
    gain: f32,         // light on a level surface over that on a surface across the view
    blur: f32,         // standard deviation, texels
}

struct GridVertex {
    position: vec3f,   // view space, on the liquid's front
    valid: u32,        // 0: no liquid here, 1: lit, 2: in the shadow of a solid
    normal: vec3f,     // unit, out of the liquid
}

// The unit direction towards the light, whose view is orthographic if it is a sun.
fn caustics_to_light(x: vec3f) -> vec3f {
    return select(normalize(caustics.light - x), caustics.light, ORTHOGRAPHIC);
}
