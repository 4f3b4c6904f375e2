// The camera and its rays.
//
// View space: x right, y up, looking down -z. Depth is z = -view.z > 0 in metres; disparity is
// D = 1/z. Pixel (i, j) has its centre at (i + 1/2, j + 1/2), y down.

struct Camera {
    view_from_world: mat4x4f,
    world_from_view: mat4x4f,
    size: vec2f,    // pixels
    tangent: vec2f, // tan(fov_x / 2), tan(fov_y / 2)
    near: f32,      // m
}

@group(0) @binding(0) var<uniform> camera: Camera;

// The view ray through pixel position `u` with unit depth: a point at depth z is z * omega.
fn camera_omega(u: vec2f) -> vec3f {
    let ndc = 2.0 * u / camera.size - 1.0;
    return vec3f(ndc.x * camera.tangent.x, -ndc.y * camera.tangent.y, -1.0);
}

// The pixel position of a view-space point in front of the eye.
fn camera_pixel(x: vec3f) -> vec2f {
    let ndc = x.xy / (-x.z * camera.tangent);
    return (vec2f(ndc.x, -ndc.y) * 0.5 + 0.5) * camera.size;
}

fn camera_world_point(x: vec3f) -> vec3f {
    return (camera.world_from_view * vec4f(x, 1.0)).xyz;
}

fn camera_world_direction(d: vec3f) -> vec3f {
    return (camera.world_from_view * vec4f(d, 0.0)).xyz;
}

fn camera_view_direction(d: vec3f) -> vec3f {
    return (camera.view_from_world * vec4f(d, 0.0)).xyz;
}
