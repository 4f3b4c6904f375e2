// The interior of large bodies, where one splat stands for all members of a cell: `src/liquid/classify/interior.rs` on
// the device. A cell is interior if all 2x2x2 cells with it are full.

#import classify/params.wgsl

@group(0) @binding(1) var<storage, read> starts: array<u32>;
@group(0) @binding(2) var<storage, read_write> interior: array<u32>;

fn count_of(cell: vec3u) -> f32 {
    let index = cell_index(cell);
    return f32(starts[index + 1u] - starts[index]);
}

fn corner(i: u32) -> vec3u {
    return vec3u(i & 1u, (i >> 1u) & 1u, i >> 2u);
}

// Whether a cell and the seven after it, along all axes, are full.
fn is_full(cell: vec3u) -> bool {
    var sum = 0.0;
    var least = params.full_cell;
    for (var i = 0u; i < 8u; i++) {
        let count = count_of(cell + corner(i));
        sum += count;
        least = min(least, count);
    }
    return sum >= params.full && least >= params.full_cell;
}

@compute @workgroup_size(64)
fn mark(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = group_index(group) * 64u + local;
    if index >= params.cells {
        return;
    }
    let cell = cell_at(index);
    var marked = all(cell > vec3u(0u)) && all(cell + 1u < params.counts);
    for (var i = 0u; i < select(0u, 8u, marked); i++) {
        marked = marked && is_full(cell - 1u + corner(i));
    }
    interior[index] = u32(marked);
}
