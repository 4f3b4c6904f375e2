// Light direction and shadowing for the caustic kernels. The root declares `caustics`.

// Unit direction towards the light. A sun's view is orthographic.
fn caustics_to_light(x: vec3f) -> vec3f {
    return select(normalize(caustics.light - x), caustics.light, ORTHOGRAPHIC);
}

// Whether a solid shadows a point of the liquid from the light.
fn shadowed(x: vec3f) -> bool {
    let d = caustics_to_light(x);
    let far = select(distance(caustics.light, x), NOTHING, ORTHOGRAPHIC);
    return scene_blocks(camera_world_point(x), camera_world_direction(d), far);
}

// Share of the light that passes the foam on the liquid at x, and the bubbles on a way of this length below it, as if it went
// straight on.
fn passed_below(x: vec3f, way: f32) -> f32 {
    let below = camera_world_point(x - way * caustics_to_light(x));
    return passed_by_spheres(caustics.number, below, 0.0, vec3f(1.0)).x;
}
