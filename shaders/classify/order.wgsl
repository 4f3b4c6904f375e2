// Counting sort, third part: members by cell, within a cell in file order, so that sums do not depend
// on scheduling.

#import classify/params.wgsl

@group(0) @binding(1) var<storage, read> members: array<vec4f>; // position and radius, m
@group(0) @binding(2) var<storage, read> cells: array<vec2u>;   // cell, and arrival rank in it
@group(0) @binding(3) var<storage, read> starts: array<u32>;
@group(0) @binding(4) var<storage, read> interior: array<u32>; // 1 for cells in the interior of a body
@group(0) @binding(5) var<storage, read_write> came: array<u32>;     // members by cell, in arrival order
@group(0) @binding(6) var<storage, read_write> order: array<vec2u>;  // member, and cell with its mark
@group(0) @binding(7) var<storage, read_write> sorted: array<vec4f>; // position and radius, m

@compute @workgroup_size(256)
fn scatter(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = group_index(group) * 256u + local;
    if i < params.members && cells[i].x != NO_CELL {
        came[starts[cells[i].x] + cells[i].y] = i;
    }
}

@compute @workgroup_size(256)
fn arrange(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = group_index(group) * 256u + local;
    if i >= params.members || crowded() || cells[i].x == NO_CELL {
        return;
    }
    let cell = cells[i].x;
    let begin = starts[cell];
    let end = starts[cell + 1u];
    var slot = begin;
    for (var other = begin; other < end; other++) {
        slot += u32(came[other] < i);
    }
    let is_interior = params.full > 0.0 && interior[cell] != 0u;
    order[slot] = vec2u(i, cell | select(0u, INTERIOR_CELL, is_interior));
    sorted[slot] = members[i];
}
