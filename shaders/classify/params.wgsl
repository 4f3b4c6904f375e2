// Parameters of the classification kernels, and the cells of the grid.

#import common/groups.wgsl

struct Params {
    least: vec3f,          // minimum corner of the grid, m
    per_cell: f32,         // inverse cell width, 1/m
    greatest: vec3f,       // maximum corner of the grid, m
    members: u32,          // number of members
    counts: vec3u,         // cells along each axis
    cells: u32,            // number of cells
    shift: vec3f,          // origin of the splats relative to that of the members, m
    squares: f32,          // sum of squared cell counts, copied here from the sums once it is known
    support: f32,          // h, in r
    least_weight: f32,     // summed weight below which a member is a splash
    density_at_rest: f32,  // summed weight inside a body at rest
    max_ratio: f32,        // k_r
    volume_kernel: u32,    // 0: fixed short axis; 1: fixed volume
    short_axis: f32,       // short semi-axis of the former, in r
    long_axis: f32,        // its longest semi-axis, in r
    splash_radius: f32,    // in r
    most_squares: f32,     // sum of squared cell counts above which the members are a crowd
    smoothing: f32,        // how far centres move towards the mean of the neighbours
    most_neighbours: u32,  // of a member whose splat may be moved to the iso-surface; 0: none is
    largest_radius: f32,   // of the members, m
    full: f32,             // members in 2x2x2 cells inside a body, at least; 0: no cell is merged
    full_cell: f32,        // members in each of them, at least
    most_lines: u32,       // lines on which the surface is looked for, at most
    tagged: u32,           // 1: each member has its tags; 0: one for all
    wetting: f32,          // distance from a solid within which bodies wet it, in r
    most_copies: u32,      // of splats on solids, at most
    pad: vec2u,
}

// Storage, not a uniform: its values decide branches.
@group(0) @binding(0) var<storage, read> params: Params;

// Cell of members that are not drawn.
const NO_CELL: u32 = 0xffffffffu;

// Bit of the cell of a sorted member, which marks the interior.
const INTERIOR_CELL: u32 = 0x80000000u;

fn cell_index(cell: vec3u) -> u32 {
    return (cell.z * params.counts.y + cell.y) * params.counts.x + cell.x;
}

// The cell of an index.
fn cell_at(index: u32) -> vec3u {
    let counts = params.counts;
    return vec3u(index % counts.x, index / counts.x % counts.y, index / (counts.x * counts.y));
}

// The cell of a place; places outside the grid belong to border cells.
fn cell_around(place: vec3f) -> vec3u {
    let inside = clamp(place, params.least, params.greatest);
    return min(vec3u((inside - params.least) * params.per_cell), params.counts - 1u);
}

// Whether particles are so crowded that visiting all neighbours would take hours.
fn crowded() -> bool {
    return params.squares > params.most_squares;
}
