// G-buffer of an opaque scene that another program has drawn, from its depth buffer: disparity is linear
// on planes, so that two neighbours on one side tell whether a texel lies on their plane.

#import common/camera.wgsl
#import common/layers.wgsl

struct Params {
    offset: f32,  // disparity is (depth + offset) * slope
    slope: f32,
    cleared: f32, // depth where nothing was drawn
}

override NORMALS: bool = false; // the program has drawn normals

@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var depths: texture_2d<f32>;
@group(1) @binding(2) var normals: texture_2d<f32>; // world space
@group(1) @binding(3) var planes: texture_storage_2d<rgba32float, write>; // pi, depth
@group(1) @binding(4) var surfaces: texture_storage_2d<rgba32float, write>; // world normal, no solid

// A texel's disparity, if something was drawn there.
struct Sample {
    found: bool,
    disparity: f32,
}

fn sample_at(p: vec2i) -> Sample {
    let inside = all(p >= vec2i(0)) && all(p < vec2i(camera.size));
    let depth = textureLoad(depths, clamp(p, vec2i(0), vec2i(camera.size) - 1), 0).x;
    return Sample(inside && depth != params.cleared, (depth + params.offset) * params.slope);
}

// Difference of disparity to one neighbour along an axis, and how far the texel lies off the line through
// this neighbour and the next.
struct Side {
    difference: f32,
    error: f32,
}

// Larger than every error of a side.
const NO_SIDE: f32 = 1e30;

fn side_of(p: vec2i, step: vec2i, here: f32) -> Side {
    let near = sample_at(p + step);
    let far = sample_at(p + 2 * step);
    let difference = near.disparity - here;
    let bend = abs(2.0 * near.disparity - far.disparity - here);
    return Side(difference, select(NO_SIDE, select(abs(difference), bend, far.found), near.found));
}

// Change of disparity per pixel along an axis: over both sides of a smooth surface, over the better side at
// an edge.
fn slope_along(p: vec2i, step: vec2i, here: f32) -> f32 {
    let after = side_of(p, step, here);
    let before = side_of(p, -step, here);
    let best = min(after.error, before.error);
    if best >= NO_SIDE {
        return 0.0;
    }
    if max(after.error, before.error) <= 4.0 * best + 1e-6 * here {
        return 0.5 * (after.difference - before.difference);
    }
    return select(-before.difference, after.difference, after.error <= before.error);
}

@compute @workgroup_size(8, 8)
fn host(@builtin(global_invocation_id) id: vec3u) {
    let p = vec2i(id.xy);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    let omega = camera_omega(vec2f(p) + 0.5);
    let here = sample_at(p);
    var plane = vec4f(0.0);
    var surface = vec4f(0.0);
    if here.found {
        let z = camera_distance(vec3f(0.0, 0.0, -1.0), here.disparity);
        let gradient = vec2f(
            slope_along(p, vec2i(1, 0), here.disparity),
            slope_along(p, vec2i(0, 1), here.disparity),
        );
        var pi = plane_from_gradient(omega, here.disparity, gradient);
        if NORMALS {
            // 0 where the program draws none.
            let normal = textureLoad(normals, p, 0).xyz;
            if any(normal != vec3f(0.0)) {
                pi = plane_from_normal(omega, z, camera_view_direction(normalize(normal)));
            }
        }
        plane = vec4f(pi, z);
        surface = vec4f(-camera_world_direction(plane_normal(pi)), -1.0);
    }
    textureStore(planes, p, plane);
    textureStore(surfaces, p, surface);
}
