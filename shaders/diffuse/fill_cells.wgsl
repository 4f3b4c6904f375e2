// Adds the areas of the spheres' discs to the cells: diffuse/cells.wgsl.
//
// A small sphere is divided among the eight cells around it, a larger one among those that a cube of its volume overlaps.

#import diffuse/particles.wgsl

@group(1) @binding(1) var<storage, read> spheres: array<vec4f>; // centre, relative to the particles' origin, and radius; m
@group(1) @binding(2) var<storage, read> traits: array<u32>;    // kind and opacity
// Four words a cell, by kind.
@group(1) @binding(3) var<storage, read_write> cells: array<atomic<u32>>;

// As in diffuse/cells.wgsl.
const CELL_UNITS: f32 = 262144.0;
// The sum from which on nothing is added: nothing is seen through it.
const MOST_DEPTH: u32 = 0x40000000u;
// Cells that half a side of a sphere's cube covers at most.
const LARGEST: f32 = 4.0;
// Half the side of a cube of a sphere's volume, over its radius.
const CUBE_SIDE: f32 = 0.80599598;

@compute @workgroup_size(64)
fn fill_cells(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = thread_index(group, local);
    if index >= params.count || traits[index] <= 3u {
        return;
    }
    let sphere = spheres[index];
    let kind = kind_of(traits[index]);
    let radius = sphere.w / params.cells_side;
    let depth = opacity_of(traits[index]) * 3.14159265 * radius * radius;
    let across = params.cells_across;
    let centre = (params.origin + sphere.xyz - params.cells_first) / params.cells_side;
    let half = clamp(CUBE_SIDE * radius, 0.5, LARGEST);
    let last = vec3f(across) - 1.0;
    let low = vec3u(clamp(floor(centre - half), vec3f(0.0), last));
    let high = vec3u(clamp(floor(centre + half), vec3f(0.0), last));
    for (var z = low.z; z <= high.z; z++) {
        for (var y = low.y; y <= high.y; y++) {
            for (var x = low.x; x <= high.x; x++) {
                let corner = vec3f(vec3u(x, y, z));
                let sides = clamp(min(centre + half, corner + 1.0) - max(centre - half, corner), vec3f(0.0), vec3f(1.0));
                let share = sides.x * sides.y * sides.z / (8.0 * half * half * half);
                let amount = u32(share * depth * CELL_UNITS + 0.5);
                let word = 4u * ((z * across.y + y) * across.x + x) + kind;
                if amount > 0u && atomicLoad(&cells[word]) < MOST_DEPTH {
                    atomicAdd(&cells[word], amount);
                }
            }
        }
    }
}
