// The light, as the kernels that follow it see it: `caustics` is the root's.

// The unit direction towards the light, whose view is orthographic if it is a sun.
fn caustics_to_light(x: vec3f) -> vec3f {
    return select(normalize(caustics.light - x), caustics.light, ORTHOGRAPHIC);
}

// Whether a solid is between the light and a point of the liquid.
fn shadowed(x: vec3f) -> bool {
    let d = caustics_to_light(x);
    let far = select(distance(caustics.light, x), NOTHING, ORTHOGRAPHIC);
    return scene_blocks(camera_world_point(x), camera_world_direction(d), far);
}
