// Counting sort, first part: the cell of each member, and the number of members in each cell.

#import classify/params.wgsl

@group(0) @binding(1) var<storage, read> members: array<vec4f>;      // position and radius, m; radius 0: none
@group(0) @binding(2) var<storage, read_write> cells: array<vec2u>;  // cell, and arrival rank in it
@group(0) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;

@compute @workgroup_size(256)
fn count(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = group_index(group) * 256u + local;
    if i >= params.members {
        return;
    }
    if members[i].w <= 0.0 {
        cells[i] = vec2u(NO_CELL, 0u);
        return;
    }
    let cell = cell_index(cell_around(members[i].xyz));
    // The rank depends on scheduling; `arrange` restores file order.
    cells[i] = vec2u(cell, atomicAdd(&counts[cell], 1u));
}
