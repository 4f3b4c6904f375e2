// Counting sort, first part: the cell of each member, and the number of members in each cell.

#import classify/params.wgsl

@group(0) @binding(1) var<storage, read> members: array<vec4f>;      // position and radius, m
@group(0) @binding(2) var<storage, read_write> cells: array<vec2u>;  // cell, and arrival rank in it
@group(0) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;

@compute @workgroup_size(256)
fn count(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = group_index(group) * 256u + local;
    if i >= params.members {
        return;
    }
    // Members outside the grid belong to border cells.
    let inside = clamp(members[i].xyz, params.least, params.greatest);
    let at = vec3u((inside - params.least) * params.per_cell);
    let cell = cell_index(min(at, params.counts - 1u));
    // The rank depends on scheduling; `arrange` restores file order.
    cells[i] = vec2u(cell, atomicAdd(&counts[cell], 1u));
}
