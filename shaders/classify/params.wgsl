// What all of a classification's kernels are told, and how their threads are counted.

#import common/groups.wgsl

struct Params {
    least: vec3f,          // the grid's corners, m
    per_cell: f32,         // 1/m
    greatest: vec3f,
    members: u32,
    counts: vec3u,         // cells along each axis
    cells: u32,
    support: f32,          // h, in r
    least_weight: f32,     // below this summed weight it is splash
    density_at_rest: f32,  // the summed weight inside a body at rest
    smoothing: f32,        // lambda
    max_ratio: f32,        // k_r
    volume_kernel: u32,    // 0: the short axis is held; 1: the volume is
    short_axis: f32,       // of the former, in r
    long_axis: f32,
    splash_radius: f32,    // in r
    most_squares: f32,     // of the cells' counts, summed: more is a crowd
}

// Storage, not a uniform: its values decide branches.
@group(0) @binding(0) var<storage, read> params: Params;

fn cell_index(cell: vec3u) -> u32 {
    return (cell.z * params.counts.y + cell.y) * params.counts.x + cell.x;
}
