// Camera uniform and view rays.
//
// View space: x right, y up, looking down -z. Depth is z = -view.z > 0 in metres; disparity is
// D = 1/z. Pixel (i, j) has its centre at (i + 1/2, j + 1/2), y down.
//
// A sun's view is orthographic. There, "disparity" is the height above the far plane, D = far - z.
// Like 1/z in perspective it is linear in screen space along straight lines, larger is nearer, and
// 0 is the farthest.
//
// Shader world space has the scene's axes and its origin at the eye: the host makes positions
// relative to the eye in 64 bits, so that they keep their precision anywhere.

struct Camera {
    view_from_world: mat3x3f, // a rotation
    origin: vec3f,            // of the splat positions, m
    near: f32,                // m
    size: vec2f,              // pixels
    tangent: vec2f,           // tan(fov_x / 2), tan(fov_y / 2); orthographic: half the extent, m
    far: f32,                 // m, orthographic only
    shift: vec2f,             // the picture's middle: tangents or m right of and above the view direction
}

override ORTHOGRAPHIC: bool = false;

@group(0) @binding(0) var<uniform> camera: Camera;

// View ray through pixel position `u` with unit depth: the point at depth z is z * omega. In an
// orthographic view: the x and y of the ray, and -1.
fn camera_omega(u: vec2f) -> vec3f {
    let ndc = 2.0 * u / camera.size - 1.0;
    return vec3f(vec2f(ndc.x * camera.tangent.x, -ndc.y * camera.tangent.y) + camera.shift, -1.0);
}

// Origin of the ray through `omega`.
fn camera_ray_origin(omega: vec3f) -> vec3f {
    return select(vec3f(0.0), vec3f(omega.xy, 0.0), ORTHOGRAPHIC);
}

// Unit direction of the ray through `omega`. In an orthographic view it is made to appear dependent on the
// pixel: otherwise what follows from it would be branches on uniform memory (see `shape_of`).
fn camera_ray_direction(omega: vec3f) -> vec3f {
    let ahead = select(vec3f(0.0, 0.0, -1.0), omega, omega.x > 3e38);
    return select(normalize(omega), ahead, ORTHOGRAPHIC);
}

// View-space point on the ray through `omega` at a disparity.
fn camera_point(omega: vec3f, disparity: f32) -> vec3f {
    if ORTHOGRAPHIC {
        return vec3f(omega.xy, disparity - camera.far);
    }
    return omega / disparity;
}

// Length of the ray through `omega` to a disparity, m.
fn camera_distance(omega: vec3f, disparity: f32) -> f32 {
    return select(length(omega) / disparity, camera.far - disparity, ORTHOGRAPHIC);
}

// Disparity at a length of the ray through `omega`.
fn camera_disparity_at(omega: vec3f, t: f32) -> f32 {
    return select(length(omega) / t, camera.far - t, ORTHOGRAPHIC);
}

// Disparity of the near plane: nothing in the picture has more.
fn camera_near_disparity() -> f32 {
    return select(1.0 / camera.near, camera.far - camera.near, ORTHOGRAPHIC);
}

// Disparity of a view-space point in front of the eye.
fn camera_disparity(x: vec3f) -> f32 {
    if ORTHOGRAPHIC {
        return camera.far + x.z;
    }
    return 1.0 / -x.z;
}

// `camera_omega` of a view-space point in front of the eye.
fn camera_omega_of(x: vec3f) -> vec3f {
    return select(vec3f(x.xy / -x.z, -1.0), vec3f(x.xy, -1.0), ORTHOGRAPHIC);
}

// Pixel position of a view-space point in front of the eye.
fn camera_pixel(x: vec3f) -> vec2f {
    let ndc = (camera_omega_of(x).xy - camera.shift) / camera.tangent;
    return (vec2f(ndc.x, -ndc.y) * 0.5 + 0.5) * camera.size;
}

// Side of a pixel at a view-space point, m.
fn camera_pixel_side(x: vec3f) -> f32 {
    return 2.0 * camera.tangent.x / camera.size.x * select(-x.z, 1.0, ORTHOGRAPHIC);
}

// Both spaces have their origin at the eye, so points transform like directions.
fn camera_world_point(x: vec3f) -> vec3f {
    return camera_world_direction(x);
}

fn camera_world_direction(d: vec3f) -> vec3f {
    return d * camera.view_from_world;
}

fn camera_view_direction(d: vec3f) -> vec3f {
    return camera.view_from_world * d;
}
