// Counting sort, first part: the cell of each member, and how many are in each cell.

#import classify/params.wgsl

@group(0) @binding(1) var<storage, read> members: array<vec4f>;      // place and radius, m
@group(0) @binding(2) var<storage, read_write> cells: array<vec2u>;  // cell, and who came before there
@group(0) @binding(3) var<storage, read_write> counts: array<atomic<u32>>;

@compute @workgroup_size(256)
fn count(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = group_index(group) * 256u + local;
    if i >= params.members {
        return;
    }
    // What lies outside is in the cells at the border.
    let inside = clamp(members[i].xyz, params.least, params.greatest);
    let at = vec3u((inside - params.least) * params.per_cell);
    let cell = cell_index(min(at, params.counts - 1u));
    // Who came before is the scheduler's choice, which `arrange` takes back.
    cells[i] = vec2u(cell, atomicAdd(&counts[cell], 1u));
}
