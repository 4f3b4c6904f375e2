// Counting sort, third part: members by cell, within a cell in file order, so that sums do not depend
// on scheduling.

#import classify/sums.wgsl

@group(0) @binding(1) var<storage, read> members: array<vec4f>; // position and radius, m
@group(0) @binding(2) var<storage, read> cells: array<vec2u>;   // cell, and arrival rank in it
@group(0) @binding(3) var<storage, read> starts: array<u32>;
@group(0) @binding(4) var<storage, read> sums: array<Sum>;
@group(0) @binding(5) var<storage, read_write> came: array<u32>;     // members by cell, in arrival order
@group(0) @binding(6) var<storage, read_write> order: array<vec2u>;  // member and cell
@group(0) @binding(7) var<storage, read_write> sorted: array<vec4f>; // position and radius, m

@compute @workgroup_size(256)
fn scatter(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = group_index(group) * 256u + local;
    if i < params.members {
        came[starts[cells[i].x] + cells[i].y] = i;
    }
}

@compute @workgroup_size(256)
fn arrange(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = group_index(group) * 256u + local;
    if i >= params.members || crowded(sums[blocks()]) {
        return;
    }
    let cell = cells[i].x;
    let begin = starts[cell];
    let end = starts[cell + 1u];
    var slot = begin;
    for (var other = begin; other < end; other++) {
        slot += u32(came[other] < i);
    }
    order[slot] = vec2u(i, cell);
    sorted[slot] = members[i];
}
