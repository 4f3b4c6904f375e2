// Projects the splats, and counts those of each tile.

#import splat/ellipsoid.wgsl
#import bins/tiles.wgsl

struct Large {
    count: atomic<u32>,
    splats: array<u32>,
}

@group(1) @binding(0) var<storage, read> splats: array<Splat>;
@group(2) @binding(1) var<storage, read_write> placed: array<ViewSplat>;
@group(2) @binding(2) var<storage, read_write> rects: array<vec4u>;
@group(2) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;
@group(2) @binding(4) var<storage, read_write> large: Large;

// The tiles with pixel centres in a rectangle, with an eighth of a pixel against rounding.
fn tiles_within(bounds: vec4f) -> vec2u {
    let first = max(ceil(bounds.xy - 0.625), vec2f(0.0));
    let last = min(floor(bounds.zw - 0.375), camera.size - 1.0);
    if !all(first <= last) {
        return NOTHING;
    }
    let a = vec2u(first) / TILE;
    let b = vec2u(last) / TILE;
    return vec2u(a.x | (a.y << 16u), b.x | (b.y << 16u));
}

fn count_tile(rect: Rect, i: u32) {
    atomicAdd(&counts[tile_index(rect_tile(rect, i))], 1u);
}

// A sphere behind the eye, which no ray meets.
const NOWHERE: ViewSplat =
    ViewSplat(vec4f(1.0, 0.0, 0.0, 0.0), vec4f(0.0, 1.0, 0.0, 0.0), vec4f(0.0, 0.0, 1.0, 1e30));

// Whether a splat is of another kind, or another splat stands for its particle.
fn is_left_out(tags: u32) -> bool {
    let is_droplet = (tags & SPLASH) != 0u;
    return params.kinds != ALL && ((tags & HIDDEN) != 0u || is_droplet != (params.kinds == DROPLETS));
}

@compute @workgroup_size(THREADS)
fn project(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let thread = thread_index(group, local);
    let index = thread / params.lanes;
    let lane = thread % params.lanes;
    if index >= params.splats {
        return;
    }
    let splat = splats[index];
    if is_left_out(splat.tags) {
        if lane == 0u {
            placed[index] = NOWHERE;
            rects[index] = vec4u(NOTHING, NOTHING);
        }
        return;
    }
    let shape = splat_in_view(splat);
    let inner = tiles_within(splat_bounds(shape));
    var outer = inner;
    if params.swell > 1.0 {
        outer = tiles_within(splat_bounds(Placed(shape.centre, params.swell * shape.rows)));
    }
    let rect = rect_of(outer);
    if lane == 0u {
        placed[index] = view_splat(splat);
        rects[index] = vec4u(inner, outer);
        if is_large(rect) {
            large.splats[atomicAdd(&large.count, 1u)] = index;
        }
    }
    for (var i = lane; i < select(rect.size.x * rect.size.y, 0u, is_large(rect)); i += params.lanes) {
        count_tile(rect, i);
    }
}

// Counts the tiles of large splats, a workgroup for each.
@compute @workgroup_size(THREADS)
fn count_large(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    for (var k = group.x; k < atomicLoad(&large.count); k += groups.x) {
        let rect = rect_of(rects[large.splats[k]].zw);
        for (var i = local; i < rect.size.x * rect.size.y; i += THREADS) {
            count_tile(rect, i);
        }
    }
}
