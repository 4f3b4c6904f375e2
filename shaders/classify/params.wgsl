// Parameters of the classification kernels.

#import common/groups.wgsl

struct Params {
    least: vec3f,          // minimum corner of the grid, m
    per_cell: f32,         // inverse cell width, 1/m
    greatest: vec3f,       // maximum corner of the grid, m
    members: u32,          // number of members
    counts: vec3u,         // cells along each axis
    cells: u32,            // number of cells
    support: f32,          // h, in r
    least_weight: f32,     // summed weight below which a member is a splash
    density_at_rest: f32,  // summed weight inside a body at rest
    max_ratio: f32,        // k_r
    volume_kernel: u32,    // 0: fixed short axis; 1: fixed volume
    short_axis: f32,       // short semi-axis of the former, in r
    long_axis: f32,        // its longest semi-axis, in r
    splash_radius: f32,    // in r
    most_squares: f32,     // sum of squared cell counts above which the members are a crowd
}

// Storage, not a uniform: its values decide branches.
@group(0) @binding(0) var<storage, read> params: Params;

fn cell_index(cell: vec3u) -> u32 {
    return (cell.z * params.counts.y + cell.y) * params.counts.x + cell.x;
}
