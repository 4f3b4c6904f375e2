// A light's columns through foam, spray and bubbles, each divided into slices: sphere_shadows.wgsl.

// Along the three axes, points relative to `origin` are shares of a sun's grid. A lamp's columns lie in a frustum, whose sides
// the axes scale to 1, or around it as octahedral directions.
struct LightGrid {
    right: vec3f,
    columns: u32, // along a side
    up: vec3f,
    first: u32,   // word of the first column
    away: vec3f,  // from the light
    near: f32,    // binary logarithm of a lamp's least distance, m
    origin: vec3f,
    scale: f32,   // of that logarithm, to shares; 0 for a sun, negative for an octahedron
}

const NO_GRID: u32 = 0u;
const BOX_GRID: u32 = 1u;
const FRUSTUM_GRID: u32 = 2u;
const OCTAHEDRON_GRID: u32 = 3u;

fn grid_shape(grid: LightGrid) -> u32 {
    return select(select(BOX_GRID, OCTAHEDRON_GRID, grid.scale < 0.0), FRUSTUM_GRID, grid.scale > 0.0);
}

// Slices of a column.
const LIGHT_SLICES: u32 = 32u;

// Column and slice of a point in a grid of this shape, as shares.
fn in_light_grid(grid: LightGrid, shape: u32, x: vec3f) -> vec3f {
    let from_origin = x - grid.origin;
    let at = vec3f(dot(from_origin, grid.right), dot(from_origin, grid.up), dot(from_origin, grid.away));
    if shape == BOX_GRID {
        return at;
    }
    if shape == FRUSTUM_GRID {
        let depth = max(at.z, 1e-30);
        return vec3f(0.5 * at.xy / depth + 0.5, (log2(depth) - grid.near) * grid.scale);
    }
    // Cigolle et al., A Survey of Efficient Representations for Independent Unit Vectors, 2014.
    let p = at.xy / max(abs(at.x) + abs(at.y) + abs(at.z), 1e-30);
    let sign = select(vec2f(-1.0), vec2f(1.0), p >= vec2f(0.0));
    let folded = select(p, (1.0 - abs(p.yx)) * sign, at.z < 0.0);
    return vec3f(0.5 * folded + 0.5, (log2(max(length(at), 1e-30)) - grid.near) * -grid.scale);
}
