// Iterated smoothing of the aggregate layers.
//
// `prepare` converts planes to the state (unsmoothed normal, depth), so that a tap is one fetch;
// `iterate` runs one iteration, from one state texture to the other; `planes` converts the smoothed
// depths back to planes. The root defines the filter, `smoothed`.
//
// With GAP, the layers are the sides of a gap. They have fewer texels, and surfaces that go on in other
// layers: a tap is whichever of the gap's side and the whole layer is nearer in depth.
//
// Packing the normal into 32 bits would halve the state, but planes would no longer be fixed points:
// at 60 degrees the error is 5e-5 of the depth.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/sizes.wgsl
#import common/tiles.wgsl

struct Params {
    stride: f32,      // distance between taps: pixels, or particle radii with IN_RADII
    radius: f32,      // particle radius, m
    inv_sigma2: f32,  // 1 / sigma^2, 1/m^2
    delta: f32,       // half the depth range of one surface, m
    mu: f32,          // assumed depth behind the centre of taps beyond that range, m
    least: f32,       // smallest distance between taps with which the iteration changes a texel, pixels
}

override TAPS: i32 = 2;           // taps to each side of the centre; constant, so that loops unroll
override IN_RADII: bool = true;   // whether `stride` is in particle radii

override SIZES: bool = false;     // whether planes bear the sizes of their particles: common/sizes.wgsl

override GAPS: i32 = 0;           // gaps that a pixel distinguishes
override GAP: i32 = -1;           // number of the gap whose sides are smoothed; -1 for fronts and backs

@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var source: $layers;
@group(1) @binding(2) var target_state: texture_storage_2d_array<rgba32float, write>;
@group(1) @binding(3) var target_planes: texture_storage_2d_array<rgba32float, write>;
// The splatted planes; with GAP the smoothed state of fronts and backs.
@group(1) @binding(4) var unsmoothed: $layers;
@group(1) @binding(5) var<storage, read> liquid: TileList;
@group(1) @binding(6) var gap_tiles: texture_2d<f32>; // as in gaps/split.wgsl
@group(1) @binding(7) var splashes: texture_2d_array<f32>;

// Texture layer of fronts or backs: of all, or of the gap's sides.
fn layer_index(layer: i32) -> i32 {
    return select(layer, 2 + 2 * GAP + select(1, 0, layer == BACK), GAP >= 0);
}

// Tap on a surface at depth `z`: normal and depth, which is 0 for empty texels and outside of the picture.
fn state_at(q: vec2i, layer: i32, z: f32) -> vec4f {
    // As unsigned numbers, negative coordinates are large.
    let inside = all(vec2u(q) < vec2u(camera.size));
    if GAP >= 0 {
        let whole = textureLoad(unsmoothed, q, layer$level);
        var nearest = vec4f(whole.xyz, select(0.0, whole.w, inside));
        if inside && textureLoad(gap_tiles, vec2u(q) / TILE, 0).y > 0.0 {
            let side = textureLoad(source, q, layer_index(layer)$level);
            if side.w > 0.0 && (nearest.w <= 0.0 || abs(side.w - z) <= abs(nearest.w - z)) {
                nearest = side;
            }
        }
        return nearest;
    }
    let texel = textureLoad(source, q, layer$level);
    return vec4f(texel.xyz, select(0.0, texel.w, inside));
}

@compute @workgroup_size(8, 8)
fn prepare(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = group_index(group);
    if index >= liquid.count {
        return;
    }
    let p = tile_pixel(liquid.tiles[index], local.xy);
    let layer = i32(group.z);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    var plane = vec4f(0.0);
    if GAP >= 0 {
        plane = textureLoad(source, p, layer_index(layer)$level);
    } else {
        plane = textureLoad(unsmoothed, p, layer$level);
    }
    var state = vec4f(0.0);
    if plane.w > 0.0 {
        let normal = plane_normal(plane.xyz);
        state = vec4f(select(normal, with_particle_size(normal, particle_size(plane.xyz)), SIZES), plane.w);
    }
    textureStore(target_state, p, layer_index(layer), state);
}

@compute @workgroup_size(8, 8)
fn iterate(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = group_index(group);
    if index >= liquid.count {
        return;
    }
    let p = tile_pixel(liquid.tiles[index], local.xy);
    let layer = i32(group.z);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    var state = textureLoad(source, p, layer_index(layer)$level);
    // Empty texels and marks of rays that start inside are kept, and excluded from taps.
    let size = state_size(state);
    if state.w > camera.near && tap_distance(state.w, size) >= params.least {
        state.w = smoothed(p, layer, state.w, size);
    }
    textureStore(target_state, p, layer_index(layer), state);
}

// Size of a texel's particle relative to that of most particles.
fn state_size(state: vec4f) -> f32 {
    return select(1.0, relative_size(particle_size(state.xyz), params.radius), SIZES);
}

// Distance between the taps of a pixel at depth `z` on a particle of relative `size`, in pixels.
fn tap_distance(z: f32, size: f32) -> f32 {
    if !IN_RADII {
        return params.stride;
    }
    let distance = select(z, 1.0, ORTHOGRAPHIC);
    return params.stride * params.radius * size * camera.size.y / (2.0 * camera.tangent.y * distance);
}

// The same in whole pixels.
fn tap_stride(z: f32, size: f32) -> i32 {
    let stride = i32(tap_distance(z, size) + select(0.0, 0.5, IN_RADII));
    return clamp(stride, 1, i32(max(camera.size.x, camera.size.y)));
}

// Gaussian weight of a tap by its distance from the centre, in taps. Its sigma is half the distance to
// the window's edge.
fn tap_weight(offset: vec2i) -> f32 {
    let reach = f32(TAPS);
    return exp(-2.0 * f32(dot(offset, offset)) / (reach * reach));
}

@compute @workgroup_size(8, 8)
fn planes(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = group_index(group);
    if index >= liquid.count {
        return;
    }
    let p = tile_pixel(liquid.tiles[index], local.xy);
    let layer = i32(group.z);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    let here = textureLoad(source, p, layer_index(layer)$level);
    var plane = vec4f(0.0);
    if here.w > 0.0 {
        plane = fitted_plane(p, layer, here);
    }
    store_plane(p, layer, plane);
}

// Plane through the smoothed depths around a texel with the state `here`.
fn fitted_plane(p: vec2i, layer: i32, here: vec4f) -> vec4f {
    let z = here.w;
    let disparity = camera_disparity(vec3f(0.0, 0.0, -z));
    let omega = camera_omega(vec2f(p) + 0.5);
    var pi = plane_from_normal(omega, z, here.xyz);
    // Slope of the unsmoothed normal, for the choice of a side.
    let expected = plane_slope(pi);
    let size = state_size(here);
    let x = difference(p, vec2i(1, 0), layer, z, expected.x, size);
    let y = difference(p, vec2i(0, 1), layer, z, expected.y, size);
    if GAP < 0 && z <= camera.near {
        pi = textureLoad(unsmoothed, p, layer$level).xyz;
    } else if x.known && y.known {
        pi = plane_from_gradient(omega, disparity, vec2f(x.slope, y.slope));
    }
    return vec4f(pi, z);
}

// Copies the splatted planes, in place of all other steps where nothing is smoothed.
@compute @workgroup_size(8, 8)
fn copy(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = group_index(group);
    if index >= liquid.count {
        return;
    }
    let p = tile_pixel(liquid.tiles[index], local.xy);
    let layer = i32(group.z);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    let plane = textureLoad(unsmoothed, p, layer$level);
    store_plane(p, layer, plane);
    for (var gap = 0; gap < GAPS; gap++) {
        let side = select(gap_front(gap), gap_back(gap), layer == BACK);
        textureStore(target_planes, p, side, textureLoad(unsmoothed, p, side$level));
    }
}

// Whether the class whose flag is in the fronts (aggregates) or in the backs (splashes) has gaps at a texel.
fn has_gap(p: vec2i, layer: i32) -> bool {
    let splits = textureLoad(gap_tiles, vec2u(p) / TILE, 0);
    var found = false;
    // Loops in place of branches: software adapters skip them where no pixel of a group has gaps.
    for (var gap = select(GAPS, 0, layer == FRONT && splits.y > 0.0); gap < GAPS; gap++) {
        let back = textureLoad(unsmoothed, p, gap_back(gap)$level).w;
        let front = textureLoad(unsmoothed, p, gap_front(gap)$level).w;
        found = found || (back > 0.0 && front > 0.0);
    }
    for (var gap = select(GAPS, 0, layer == BACK && splits.w > 0.0); gap < GAPS; gap++) {
        let back = textureLoad(splashes, p, gap_back(gap), 0).w;
        let front = textureLoad(splashes, p, gap_front(gap), 0).w;
        found = found || (back > 0.0 && front > 0.0);
    }
    return found;
}

fn store_plane(p: vec2i, layer: i32, plane: vec4f) {
    if GAP >= 0 {
        textureStore(target_state, p, layer_index(layer), plane);
    } else {
        let flag = GAPS > 0 && has_gap(p, layer);
        textureStore(target_planes, p, layer, vec4f(plane.xyz, flagged(plane.w, flag)));
    }
}

// Copies the state of a gap's sides, for even numbers of iterations.
@compute @workgroup_size(8, 8)
fn carry(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = group_index(group);
    if index >= liquid.count {
        return;
    }
    let p = tile_pixel(liquid.tiles[index], local.xy);
    if all(p < vec2i(camera.size)) {
        let layer = layer_index(i32(group.z));
        textureStore(target_state, p, layer, textureLoad(source, p, layer$level));
    }
}

struct Difference {
    slope: f32, // disparity per pixel
    known: bool,
}

// Slope of the disparity along `axis`: a central difference, or a one-sided one if the other side is
// empty or across a gap. At a gap the two sides disagree, and the one closer to the unsmoothed normal
// is used.
fn difference(p: vec2i, axis: vec2i, layer: i32, z: f32, expected: f32, size: f32) -> Difference {
    let last = vec2i(camera.size) - 1;
    let q0 = clamp(p - axis, vec2i(0), last);
    let q1 = clamp(p + axis, vec2i(0), last);
    let z0 = state_at(q0, layer, z).w;
    let z1 = state_at(q1, layer, z).w;
    // Differences of depth first: disparities of a far surface cancel.
    let s0 = (z0 - z) / select(z * max(z0, 1e-20), 1.0, ORTHOGRAPHIC);
    let s1 = (z - z1) / select(z * max(z1, 1e-20), 1.0, ORTHOGRAPHIC);
    let has0 = z0 > 0.0 && any(q0 != p);
    let has1 = z1 > 0.0 && any(q1 != p);
    if has0 && has1 {
        let nearer = select(s1, s0, abs(s0 - expected) < abs(s1 - expected));
        let gap = abs(z0 + z1 - 2.0 * z) > BREAK * params.radius * size;
        return Difference(select(0.5 * (s0 + s1), nearer, gap), true);
    }
    return Difference(select(s1, s0, has0), has0 || has1);
}

// Second difference of depth, in particle radii, beyond which there is a gap.
const BREAK: f32 = 0.2;
