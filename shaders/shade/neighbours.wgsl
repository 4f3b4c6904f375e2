// Pixels around one that show the same surface, for means over them. A root defines `params.radius`, that of particles.

#import shade/surface.wgsl

// How far pixels of one surface lie off its plane, in particle radii.
const OFF_PLANE: f32 = 1.0;

// Whether a texel shows the surface of `body`.
fn shows_surface_of(body: Body, texel: vec2i) -> bool {
    let omega = camera_omega(vec2f(texel) + 0.5);
    let front = front_at(texel);
    let most = OFF_PLANE * params.radius + camera_pixel_side(body.position);
    return !plane_is_empty(front) && abs(depth_below(body.front, omega, max(dot(front, omega), 1e-20))) <= most;
}

// Texels of 4 x 4 around p, by number.
fn neighbour(p: vec2i, i: i32) -> vec2i {
    return clamp(p + vec2i(i & 3, i >> 2u) - 2, vec2i(0), vec2i(camera.size) - 1);
}

// Texels whose means over 4 x 4 make one over 12 x 12, by number below 9, and their weights.
fn further_neighbour(p: vec2i, i: i32) -> vec2i {
    return clamp(p + 4 * vec2i(i % 3 - 1, i / 3 - 1), vec2i(0), vec2i(camera.size) - 1);
}

fn further_weight(i: i32) -> f32 {
    return f32((2 - abs(i % 3 - 1)) * (2 - abs(i / 3 - 1)));
}
