// The frame before, for motion vectors.

#import common/camera.wgsl

struct Before {
    view_from_world: mat3x3f, // rotation into its view
    offset: vec3f,            // of this frame's eye from its eye, m
    seconds: f32,             // since it
    tangent: vec2f,           // of its camera
    shift: vec2f,
    reach: f32,               // largest difference in depth of particles whose velocities are averaged, m
}

// Units of the spheres' sums, and half of a pixel.
const MOTION_UNITS: f32 = 16384.0;
const HALF_COVERED: i32 = 8192;

// Pixel position there of a point that moves with `velocity`, relative to this frame's eye, in world axes; `now` if it was
// behind the eye.
fn previous_pixel(before: Before, point: vec3f, velocity: vec3f, now: vec2f) -> vec2f {
    let x = point + before.offset - before.seconds * velocity;
    let view = before.view_from_world * x;
    if !ORTHOGRAPHIC && -view.z < 1e-6 * length(x) {
        return now;
    }
    let tangent = view.xy / select(-view.z, 1.0, ORTHOGRAPHIC);
    let ndc = (tangent - before.shift) / before.tangent;
    return (vec2f(ndc.x, -ndc.y) * 0.5 + 0.5) * camera.size;
}
