// The camera and its rays.
//
// View space: x right, y up, looking down -z. Depth is z = -view.z > 0 in metres; disparity is
// D = 1/z. Pixel (i, j) has its centre at (i + 1/2, j + 1/2), y down.
//
// A sun's view is orthographic. There disparity stands for the height above the far plane,
// D = far - z: like 1/z in perspective, it is linear on the screen along straight lines, larger is
// nearer, and 0 is as far as can be.
//
// The shaders' world has the axes of the scene's and its origin at the eye: positions are made
// relative to the eye in 64 bits before they come here, and keep their digits anywhere.

struct Camera {
    view_from_world: mat3x3f, // a rotation
    origin: vec3f,            // that splats are counted from, m
    near: f32,                // m
    size: vec2f,              // pixels
    tangent: vec2f,           // tan(fov_x / 2), tan(fov_y / 2); orthographic: half the extent, m
    far: f32,                 // m, orthographic only
}

override ORTHOGRAPHIC: bool = false;

@group(0) @binding(0) var<uniform> camera: Camera;

// The view ray through pixel position `u` with unit depth: a point at depth z is z * omega. In an
// orthographic view, the point there in x and y, and -1.
fn camera_omega(u: vec2f) -> vec3f {
    let ndc = 2.0 * u / camera.size - 1.0;
    return vec3f(ndc.x * camera.tangent.x, -ndc.y * camera.tangent.y, -1.0);
}

// Where the ray through `omega` starts, and its unit direction.
fn camera_ray_origin(omega: vec3f) -> vec3f {
    return select(vec3f(0.0), vec3f(omega.xy, 0.0), ORTHOGRAPHIC);
}

fn camera_ray_direction(omega: vec3f) -> vec3f {
    return select(normalize(omega), vec3f(0.0, 0.0, -1.0), ORTHOGRAPHIC);
}

// The view-space point on the ray through `omega` at a disparity.
fn camera_point(omega: vec3f, disparity: f32) -> vec3f {
    if ORTHOGRAPHIC {
        return vec3f(omega.xy, disparity - camera.far);
    }
    return omega / disparity;
}

// Disparity of a view-space point in front of the eye.
fn camera_disparity(x: vec3f) -> f32 {
    if ORTHOGRAPHIC {
        return camera.far + x.z;
    }
    return 1.0 / -x.z;
}

// The ray through a view-space point in front of the eye, as by `camera_omega`.
fn camera_omega_of(x: vec3f) -> vec3f {
    return select(vec3f(x.xy / -x.z, -1.0), vec3f(x.xy, -1.0), ORTHOGRAPHIC);
}

// The pixel position of a view-space point in front of the eye.
fn camera_pixel(x: vec3f) -> vec2f {
    let ndc = camera_omega_of(x).xy / camera.tangent;
    return (vec2f(ndc.x, -ndc.y) * 0.5 + 0.5) * camera.size;
}

// The side of a pixel at a view-space point, m.
fn camera_pixel_side(x: vec3f) -> f32 {
    return 2.0 * camera.tangent.x / camera.size.x * select(-x.z, 1.0, ORTHOGRAPHIC);
}

// Both spaces have their origin at the eye, so points turn as directions do.
fn camera_world_point(x: vec3f) -> vec3f {
    return camera_world_direction(x);
}

fn camera_world_direction(d: vec3f) -> vec3f {
    return d * camera.view_from_world;
}

fn camera_view_direction(d: vec3f) -> vec3f {
    return camera.view_from_world * d;
}
