// Layers of tangent planes.
//
// A texel stores the plane { X : dot(pi, X) = 1 } in view space as pi.xyz; w is the depth at the
// pixel's centre. Disparity at any pixel position is dot(pi, omega(u)): linear in u. Empty is 0.
// pi points away from the eye on fronts and backs alike: the outward normal of a front is
// -pi / |pi|, that of a back pi / |pi|.
//
// In an orthographic view pi holds the same slopes of what stands for disparity (camera.wgsl), so
// that D(u) = dot(pi, omega(u)) again, but is no normal: `plane_normal` serves both.

const FRONT: i32 = 0;
const BACK: i32 = 1;

// The plane through z * omega with normal `n` (either orientation). A plane seen edge-on has no
// finite disparity slope: its normal is turned to at least 1e-3 off the edge.
fn plane_from_normal(omega: vec3f, z: f32, n: vec3f) -> vec3f {
    let ray = camera_ray_direction(omega);
    var away = select(-n, n, dot(n, ray) > 0.0);
    let cos_theta = dot(away, ray);
    away += max(1e-3 - cos_theta, 0.0) * ray;
    if ORTHOGRAPHIC {
        let slope = away.xy / -away.z;
        return vec3f(slope, dot(slope, omega.xy) - (camera.far - z));
    }
    return away / (z * dot(away, omega));
}

// The unit normal that points away from the eye.
fn plane_normal(pi: vec3f) -> vec3f {
    return normalize(select(pi, vec3f(pi.xy, -1.0), ORTHOGRAPHIC));
}

// The plane whose disparity at `omega` is `disparity` and changes by `gradient` per pixel.
fn plane_from_gradient(omega: vec3f, disparity: f32, gradient: vec2f) -> vec3f {
    let per_omega = gradient * camera.size / (2.0 * camera.tangent) * vec2f(1.0, -1.0);
    return vec3f(per_omega, dot(per_omega, omega.xy) - disparity);
}

// Change of the plane's disparity per pixel.
fn plane_slope(pi: vec3f) -> vec2f {
    return pi.xy * vec2f(1.0, -1.0) * 2.0 * camera.tangent / camera.size;
}

fn plane_is_empty(pi: vec3f) -> bool {
    return all(pi == vec3f(0.0));
}

// Mip levels, where the intersector reads them: a texel is the mean plane of those of the four
// below that belong to the nearest surface among them.
const MIP_LEVELS: i32 = 8;

// The coarsest level that a picture has.
fn mip_last() -> i32 {
    return min(MIP_LEVELS - 1, i32(log2(max(camera.size.x, camera.size.y))));
}

// The texel of `level` that holds `texel` of level 0.
fn mip_texel(texel: vec2i, level: i32) -> vec2i {
    let size = max(vec2i(camera.size) >> vec2u(u32(level)), vec2i(1));
    return min(texel >> vec2u(u32(level)), size - 1);
}
