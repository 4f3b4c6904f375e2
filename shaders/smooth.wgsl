// Smoothing of the aggregate layers by iterated plane fitting: Imai, Kanamori and Mitani,
// Real-Time Screen-Space Liquid Rendering with Complex Refractions (2016), eqs. 1 to 5.
//
// `prepare` turns planes into the state (unsmoothed normal, depth), so that a tap is one fetch;
// `fit` is one iteration; `planes` turns the smoothed depths back into planes.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/tiles.wgsl

struct Params {
    taps: i32,        // taps to each side of the centre
    stride: f32,      // distance between taps: pixels, or particle radii with in_radii
    in_radii: u32,
    radius: f32,      // particle radius, m
    inv_sigma2: f32,  // 1 / sigma^2, 1/m^2
}

@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var source: texture_2d_array<f32>;
@group(1) @binding(2) var target_layers: texture_storage_2d_array<rgba32float, write>;
// The unsmoothed planes, for `planes` where no difference can be taken.
@group(1) @binding(3) var unsmoothed: texture_2d_array<f32>;
@group(1) @binding(4) var<storage, read> liquid: TileList;

@compute @workgroup_size(8, 8)
fn prepare(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = tile_index(group);
    if index >= liquid.count {
        return;
    }
    let p = tile_pixel(liquid.tiles[index], local.xy);
    let layer = i32(group.z);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    let plane = textureLoad(source, p, layer, 0);
    var state = vec4f(0.0);
    if plane.w > 0.0 {
        state = vec4f(normalize(plane.xyz), plane.w);
    }
    textureStore(target_layers, p, layer, state);
}

@compute @workgroup_size(8, 8)
fn fit(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = tile_index(group);
    if index >= liquid.count {
        return;
    }
    let p = tile_pixel(liquid.tiles[index], local.xy);
    let layer = i32(group.z);
    let size = vec2i(camera.size);
    if any(p >= size) {
        return;
    }
    let here = textureLoad(source, p, layer, 0);
    // Empty, or a mark that the ray starts inside: kept, and no neighbour's tap.
    if here.w <= camera.near {
        textureStore(target_layers, p, layer, here);
        return;
    }
    let z_i = here.w;
    var stride = i32(params.stride);
    if params.in_radii != 0u {
        let pixels_per_radius = params.radius * camera.size.y / (2.0 * camera.tangent.y * z_i);
        stride = i32(params.stride * pixels_per_radius + 0.5);
    }
    stride = clamp(stride, 1, max(size.x, size.y));

    // Weighted sums of eqs. 2 to 4. The mean point is kept relative to the centre, in units of
    // the tap: sums of absolute positions would lose digits at a distance.
    let per_pixel = vec2f(2.0, -2.0) * camera.tangent / camera.size;
    let omega = camera_omega(vec2f(p) + 0.5);
    var sum_w = 0.0;
    var sum_n = vec3f(0.0);
    var sum_p = vec3f(0.0);
    for (var y = -params.taps; y <= params.taps; y++) {
        for (var x = -params.taps; x <= params.taps; x++) {
            let offset = vec2i(x, y) * stride;
            let q = p + offset;
            if any(q < vec2i(0)) || any(q >= size) {
                continue;
            }
            let tap = textureLoad(source, q, layer, 0);
            if tap.w <= camera.near {
                continue;
            }
            let dz = tap.w - z_i;
            let w = exp(-dz * dz * params.inv_sigma2);
            sum_w += w;
            sum_n += w * tap.xyz;
            sum_p += w * (dz * omega + vec3f(tap.w * vec2f(offset) * per_pixel, 0.0));
        }
    }
    // Eq. 5 as a step from the old depth: n.(mean - p_i) / n.omega.
    let n_length = length(sum_n);
    let n = sum_n / max(n_length, 1e-20);
    let slope = dot(n, omega) / length(omega);
    let dz = dot(n, sum_p) / (sum_w * dot(n, omega));
    // Keep the depth where the fit says nothing: opposing normals, a plane seen edge-on, a step
    // larger than the weights' own reach, or one past the near plane.
    let keep = n_length < 1e-3 * sum_w || abs(slope) < 0.02 || !(dz * dz * params.inv_sigma2 < 1.0)
        || z_i + dz <= camera.near;
    textureStore(target_layers, p, layer, vec4f(here.xyz, select(z_i + dz, z_i, keep)));
}

@compute @workgroup_size(8, 8)
fn planes(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = tile_index(group);
    if index >= liquid.count {
        return;
    }
    let p = tile_pixel(liquid.tiles[index], local.xy);
    let layer = i32(group.z);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    let here = textureLoad(source, p, layer, 0);
    if here.w <= 0.0 {
        textureStore(target_layers, p, layer, vec4f(0.0));
        return;
    }
    let z = here.w;
    let disparity = 1.0 / z;
    let omega = camera_omega(vec2f(p) + 0.5);
    var pi = plane_from_normal(omega, z, here.xyz);
    // The slope that the unsmoothed normal had, to judge sides by.
    let expected = plane_slope(pi);
    let x = difference(p, vec2i(1, 0), layer, z, expected.x);
    let y = difference(p, vec2i(0, 1), layer, z, expected.y);
    if z <= camera.near {
        pi = textureLoad(unsmoothed, p, layer, 0).xyz;
    } else if x.known && y.known {
        pi = plane_from_gradient(omega, disparity, vec2f(x.slope, y.slope));
    }
    textureStore(target_layers, p, layer, vec4f(pi, z));
}

struct Difference {
    slope: f32, // disparity per pixel
    known: bool,
}

// The disparity's slope along `axis`: central, or one-sided where the other side is empty or lies
// across a gap. There the two sides disagree, and the unsmoothed normal tells which one is ours.
fn difference(p: vec2i, axis: vec2i, layer: i32, z: f32, expected: f32) -> Difference {
    let size = vec2i(camera.size);
    let q0 = clamp(p - axis, vec2i(0), size - 1);
    let q1 = clamp(p + axis, vec2i(0), size - 1);
    let z0 = textureLoad(source, q0, layer, 0).w;
    let z1 = textureLoad(source, q1, layer, 0).w;
    // Differences of depth first: disparities of a far surface agree in most digits.
    let s0 = (z0 - z) / (z * max(z0, 1e-20));
    let s1 = (z - z1) / (z * max(z1, 1e-20));
    let has0 = z0 > 0.0 && any(q0 != p);
    let has1 = z1 > 0.0 && any(q1 != p);
    if has0 && has1 {
        let nearer = select(s1, s0, abs(s0 - expected) < abs(s1 - expected));
        let gap = abs(z0 + z1 - 2.0 * z) > GAP * params.radius;
        return Difference(select(0.5 * (s0 + s1), nearer, gap), true);
    }
    return Difference(select(s1, s0, has0), has0 || has1);
}

// Bend over two pixels, in particle radii, beyond which a surface is taken for two.
const GAP: f32 = 0.2;
