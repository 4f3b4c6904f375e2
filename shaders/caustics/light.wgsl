// The light, as the kernels that follow it see it: `caustics` is the root's.

// The unit direction towards the light, whose view is orthographic if it is a sun.
fn caustics_to_light(x: vec3f) -> vec3f {
    return select(normalize(caustics.light - x), caustics.light, ORTHOGRAPHIC);
}
