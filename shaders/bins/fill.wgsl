// Fills the lists of a band of tiles.
//
// A tile's list has, from its start, the splats that touch it and, from its end, those that touch it only where they
// are swollen. Their order differs from run to run: nothing that is drawn may depend on it.

#import bins/tiles.wgsl

struct Large {
    count: u32,
    splats: array<u32>,
}

@group(2) @binding(1) var<storage, read> rects: array<vec4u>;
@group(2) @binding(2) var<storage, read> starts: array<u32>;
@group(2) @binding(3) var<storage, read_write> cursors: array<array<atomic<u32>, 2>>;
@group(2) @binding(4) var<storage, read_write> list: array<u32>;
@group(2) @binding(5) var<storage, read> large: Large;

fn add(index: u32, inner: Rect, outer: Rect, i: u32) {
    let tile = rect_tile(outer, i);
    let at = tile_index(tile);
    let start = starts[at];
    if band_of(start) != params.band {
        return;
    }
    let base = params.band * params.entries;
    if all(tile - inner.first < inner.size) {
        list[start - base + atomicAdd(&cursors[at][0], 1u)] = index;
    } else {
        list[starts[at + 1u] - base - 1u - atomicAdd(&cursors[at][1], 1u)] = index;
    }
}

@compute @workgroup_size(THREADS)
fn fill(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let thread = thread_index(group, local);
    let index = thread / params.lanes;
    if index >= params.splats {
        return;
    }
    let packed = rects[index];
    let inner = rect_of(packed.xy);
    let outer = rect_of(packed.zw);
    for (var i = thread % params.lanes; i < select(outer.size.x * outer.size.y, 0u, is_large(outer)); i += params.lanes) {
        add(index, inner, outer, i);
    }
}

// Lists large splats, a workgroup for each.
@compute @workgroup_size(THREADS)
fn fill_large(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    for (var k = group.x; k < large.count; k += groups.x) {
        let index = large.splats[k];
        let packed = rects[index];
        let inner = rect_of(packed.xy);
        let outer = rect_of(packed.zw);
        for (var i = local; i < outer.size.x * outer.size.y; i += THREADS) {
            add(index, inner, outer, i);
        }
    }
}
