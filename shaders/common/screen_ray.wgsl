// A ray in screen space, clipped once to the picture and to the near plane.
//
// The parameter tau in [0, 1] is linear in screen space; the ray's disparity is then exactly linear
// in tau, and so is its residual against any plane. Points behind the eye cannot be represented.

struct ScreenRay {
    u: vec2f,           // pixel position at tau = 0
    du: vec2f,          // its change from tau = 0 to 1
    omega: vec3f,       // camera_omega(u)
    d_omega: vec3f,     // its change from tau = 0 to 1
    disparity: f32,     // at tau = 0, 1/m
    d_disparity: f32,   // its change from tau = 0 to 1
    tau_per_pixel: f32,
    direction: vec3f,   // unit, view space
}

// Beyond every tau: no intersection.
const NEVER: f32 = 1e30;

// Screen ray of the view-space ray o + t d, 0 <= t <= t_max, from a point inside the picture.
fn screen_ray(o: vec3f, d: vec3f, t_max: f32) -> ScreenRay {
    let z = -o.z;
    // Clips against half-spaces at + t * rate >= 0: left, right, bottom, top, near (orthographic: far).
    var t = select(min(t_max, 1e5 * z / max(-d.z, 1e-3)), t_max, ORTHOGRAPHIC);
    // Distances of the left and lower and of the right and upper border from the view direction.
    let low = camera.tangent - camera.shift;
    let high = camera.tangent + camera.shift;
    if ORTHOGRAPHIC {
        t = clip(t, low.x + o.x, d.x);
        t = clip(t, high.x - o.x, -d.x);
        t = clip(t, low.y + o.y, d.y);
        t = clip(t, high.y - o.y, -d.y);
        t = clip(t, camera.far - z, d.z);
    } else {
        t = clip(t, o.x + low.x * z, d.x - low.x * d.z);
        t = clip(t, high.x * z - o.x, -high.x * d.z - d.x);
        t = clip(t, o.y + low.y * z, d.y - low.y * d.z);
        t = clip(t, high.y * z - o.y, -high.y * d.z - d.y);
    }
    t = clip(t, z - camera.near, -d.z);
    var end = o + t * d;
    // From far away, t * d rounds by more than the near plane's depth. Nearer by, the end stays on the ray.
    end.z = select(min(end.z, -0.5 * camera.near), end.z, ORTHOGRAPHIC);

    var ray: ScreenRay;
    ray.u = camera_pixel(o);
    ray.du = camera_pixel(end) - ray.u;
    ray.omega = camera_omega_of(o);
    ray.d_omega = vec3f(camera_omega_of(end).xy - ray.omega.xy, 0.0);
    ray.disparity = camera_disparity(o);
    // From the difference of depths, t * d.z: disparities of far points cancel, and so do depths.
    ray.d_disparity = t * d.z * select(1.0 / (z * -end.z), 1.0, ORTHOGRAPHIC);
    ray.direction = d;
    ray.tau_per_pixel = 1.0 / max(length(ray.du), 1e-6);
    return ray;
}

fn clip(t: f32, at: f32, rate: f32) -> f32 {
    return select(t, min(t, max(at, 0.0) / -rate), rate < 0.0);
}

fn screen_ray_texel(ray: ScreenRay, tau: f32) -> vec2i {
    return clamp(vec2i(floor(ray.u + tau * ray.du)), vec2i(0), vec2i(camera.size) - 1);
}

// View-space point at tau.
fn screen_ray_point(ray: ScreenRay, tau: f32) -> vec3f {
    return camera_point(ray.omega + tau * ray.d_omega, ray.disparity + tau * ray.d_disparity);
}

// Disparity of the plane minus that of the ray: negative where the ray is in front of the plane.
fn screen_ray_residual(ray: ScreenRay, pi: vec3f, tau: f32) -> f32 {
    return dot(pi, ray.omega + tau * ray.d_omega) - (ray.disparity + tau * ray.d_disparity);
}

fn screen_ray_residual_slope(ray: ScreenRay, pi: vec3f) -> f32 {
    return dot(pi, ray.d_omega) - ray.d_disparity;
}
