// Layers of tangent planes.
//
// A texel stores the plane { X : dot(pi, X) = 1 } in view space as pi.xyz; w is the depth at the
// pixel centre. Disparity at any pixel position is dot(pi, omega(u)): linear in u. Empty is 0.
// pi points away from the eye for both fronts and backs: the outward normal of a front is
// -pi / |pi|, that of a back pi / |pi|.
//
// In an orthographic view pi holds the slopes of the height that replaces disparity (camera.wgsl),
// so that D(u) = dot(pi, omega(u)) still holds, but pi is not a normal: use `plane_normal`.

const FRONT: i32 = 0;
const BACK: i32 = 1;

// Flags are sign bits of depths: of the aggregate front's, that aggregates have gaps at the texel, and of the
// aggregate back's, that splashes have. An empty texel with a flag has a depth of -0.
fn is_flagged(depth: f32) -> bool {
    return (bitcast<u32>(depth) & 0x80000000u) != 0u;
}

fn flagged(depth: f32, flag: bool) -> f32 {
    return bitcast<f32>(bitcast<u32>(depth) | select(0u, 0x80000000u, flag));
}

// Layers of the sides of a gap: the back in front of it, and the front behind it.
fn gap_back(gap: i32) -> i32 {
    return 2 + 2 * gap;
}

fn gap_front(gap: i32) -> i32 {
    return 3 + 2 * gap;
}

// Least cosine between a plane's normal and the ray.
const EDGE_ON: f32 = 1e-3;

// Plane through z * omega with normal `n` (of either sign). A plane seen edge-on has no finite
// disparity slope: its normal is tilted to a cosine of at least 1e-3 with the ray.
fn plane_from_normal(omega: vec3f, z: f32, n: vec3f) -> vec3f {
    let ray = camera_ray_direction(omega);
    var away = select(-n, n, dot(n, ray) > 0.0);
    let cos_theta = dot(away, ray);
    away += max(EDGE_ON - cos_theta, 0.0) * ray;
    if ORTHOGRAPHIC {
        let slope = away.xy / -away.z;
        return vec3f(slope, dot(slope, omega.xy) - (camera.far - z));
    }
    return away / (z * dot(away, omega));
}

// Unit normal that points away from the eye.
fn plane_normal(pi: vec3f) -> vec3f {
    return normalize(select(pi, vec3f(pi.xy, -1.0), ORTHOGRAPHIC));
}

// Plane whose disparity at `omega` is `disparity` and changes by `gradient` per pixel.
fn plane_from_gradient(omega: vec3f, disparity: f32, gradient: vec2f) -> vec3f {
    let per_omega = gradient * camera.size / (2.0 * camera.tangent) * vec2f(1.0, -1.0);
    return vec3f(per_omega, dot(per_omega, omega.xy) - disparity);
}

// Change of the plane's disparity per pixel along each axis.
fn plane_slope(pi: vec3f) -> vec2f {
    return pi.xy * vec2f(1.0, -1.0) * 2.0 * camera.tangent / camera.size;
}

fn plane_is_empty(pi: vec3f) -> bool {
    return all(pi == vec3f(0.0));
}

// Number of mip levels, for intersectors that read them. A texel is the mean of those planes among
// its four children that belong to the nearest surface.
const MIP_LEVELS: i32 = 8;

// Coarsest level of the picture.
fn mip_last() -> i32 {
    return min(MIP_LEVELS - 1, i32(log2(max(camera.size.x, camera.size.y))));
}

// Texel of `level` that covers `texel` of level 0.
fn mip_texel(texel: vec2i, level: i32) -> vec2i {
    let size = max(vec2i(camera.size) >> vec2u(u32(level)), vec2i(1));
    return min(texel >> vec2u(u32(level)), size - 1);
}
