// Bounds of the liquid's disparity in each tile, by which rays in the air skip tiles: N. Greene, M. Kass and
// G. Miller, Hierarchical Z-Buffer Visibility (1993), with a single level.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/tiles.wgsl

override SPLASH: bool = false;

// Smoothed aggregates, splashes.
@group(1) @binding(0) var aggregate_layers: $layers;
@group(1) @binding(1) var splash_layers: $layers;
@group(1) @binding(2) var<storage, read> tiles: TileList;
@group(1) @binding(3) var<storage, read> background: TileList;
// Of each tile the largest disparity of the aggregates' fronts and the smallest of their backs, and the same of the
// splashes; 0 without any. Planes count over their whole pixels.
@group(1) @binding(4) var bounds: texture_storage_2d<rgba32float, write>;

// Beyond all disparities.
const NEAREST: f32 = 3e38;

// Rows of the tiles of a workgroup.
var<workgroup> rows: array<vec4f, 64>;

// A workgroup has eight tiles, a thread a row of one of them.
@compute @workgroup_size(8, 8)
fn bound(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = group_index(group) * 8u + local.y;
    let listed = index < tiles.count;
    var found = vec4f(0.0, NEAREST, 0.0, NEAREST);
    for (var x = select(TILE, 0u, listed); x < TILE; x++) {
        let p = tile_pixel(tiles.tiles[index], vec2u(x, local.x));
        if all(p < vec2i(camera.size)) {
            found = united(found, pixel_bounds(p));
        }
    }
    rows[local.y * 8u + local.x] = found;
    workgroupBarrier();
    if local.x > 0u {
        return;
    }
    if !listed {
        let number = index - tiles.count;
        if number < background.count {
            textureStore(bounds, tile_pixel(background.tiles[number], vec2u(0u)) / i32(TILE), vec4f(0.0));
        }
        return;
    }
    for (var row = 1u; row < 8u; row++) {
        found = united(found, rows[local.y * 8u + row]);
    }
    textureStore(bounds, tile_pixel(tiles.tiles[index], vec2u(0u)) / i32(TILE), found);
}

fn united(a: vec4f, b: vec4f) -> vec4f {
    return select(min(a, b), max(a, b), vec4<bool>(true, false, true, false));
}

fn pixel_bounds(p: vec2i) -> vec4f {
    var found = vec4f(class_bounds(aggregate_layers, p), 0.0, NEAREST);
    if SPLASH {
        found = vec4f(found.xy, class_bounds(splash_layers, p));
    }
    return found;
}

fn class_bounds(layers: $layers, p: vec2i) -> vec2f {
    let front = textureLoad(layers, p, FRONT$level).xyz;
    let back = textureLoad(layers, p, BACK$level).xyz;
    if plane_is_empty(front) {
        return vec2f(0.0, NEAREST);
    }
    let omega = camera_omega(vec2f(p) + 0.5);
    let side = 2.0 * camera.tangent / camera.size;
    let within = 0.5 * vec2f(dot(abs(front.xy), side), dot(abs(back.xy), side));
    return vec2f(dot(front, omega) + within.x, dot(back, omega) - within.y);
}
