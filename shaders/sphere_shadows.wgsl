// Optical depth of the spheres from each light on, in the columns of its grid (T. Lokovic and E. Veach, Deep Shadow Maps, 2000;
// C. Yuksel and J. Keyser, Deep Opacity Maps, 2008).
//
// A sphere covers columns as a square of its area would. `shade_columns` adds integers, whose sums do not depend on the order;
// `sum_columns` turns them into the depths at the ends of the slices.

#import common/light_grid.wgsl
#import common/tiles.wgsl
#import diffuse/pixels.wgsl

struct ShadowParams {
    origin: vec3f, // of the particles, relative to that of the grids, m
    count: u32,    // of spheres
    lights: u32,
    grids: array<LightGrid, 16>,
}

@group(0) @binding(0) var<$branching> params: ShadowParams;
@group(0) @binding(1) var<storage, read> spheres: array<vec4f>; // centre and radius, m
@group(0) @binding(2) var<storage, read> traits: array<u32>;    // kind and opacity
@group(0) @binding(3) var<storage, read_write> depths: array<atomic<u32>>;

// Units of optical depth while it is added, and the sum from which on nothing is added: nothing passes it.
const SHADOW_UNITS: f32 = 262144.0;
const MOST_DEPTH: u32 = 0x40000000u;

// Columns that half a side of a sphere's square covers at most.
const LARGEST: f32 = 16.0;

// Half the sides of a square of the sphere's area, columns.
fn half_sides(grid: LightGrid, x: vec3f, radius: f32) -> vec2f {
    let half = 0.88622693 * radius * f32(grid.columns);
    if grid.scale == 0.0 {
        return half * vec2f(length(grid.right), length(grid.up));
    }
    if grid.scale > 0.0 {
        let depth = max(dot(x - grid.origin, grid.away), 1e-30);
        return 0.5 * half / depth * vec2f(length(grid.right), length(grid.up));
    }
    // An octahedron's columns differ in solid angle.
    let to = x - grid.origin;
    let distance2 = max(dot(to, to), 1e-30);
    let sum = abs(dot(to, grid.right)) + abs(dot(to, grid.up)) + abs(dot(to, grid.away));
    return vec2f(0.5 * half * inverseSqrt(distance2) * pow(sqrt(distance2) / sum, 1.5));
}

fn shade(grid: LightGrid, x: vec3f, radius: f32, opacity: f32) {
    let at = in_light_grid(grid, grid_shape(grid), x);
    let half = half_sides(grid, x, radius);
    let widened = clamp(half, vec2f(0.5), vec2f(LARGEST));
    let thinned = min(half / widened, vec2f(1.0));
    let centre = at.xy * f32(grid.columns);
    let last = f32(grid.columns) - 1.0;
    let low = vec2u(clamp(floor(centre - widened), vec2f(0.0), vec2f(last)));
    let high = vec2u(clamp(floor(centre + widened), vec2f(0.0), vec2f(last)));
    let slice = min(u32(max(at.z, 0.0) * f32(LIGHT_SLICES)), LIGHT_SLICES - 1u);
    for (var v = low.y; v <= high.y; v++) {
        for (var u = low.x; u <= high.x; u++) {
            let corner = vec2f(vec2u(u, v));
            let sides = clamp(min(centre + widened, corner + 1.0) - max(centre - widened, corner), vec2f(0.0), vec2f(1.0));
            let covered = opacity * sides.x * sides.y * thinned.x * thinned.y;
            let depth = -log(max(1.0 - covered, OPAQUE_TRANSMITTANCE));
            let word = grid.first + (v * grid.columns + u) * LIGHT_SLICES + slice;
            if atomicLoad(&depths[word]) < MOST_DEPTH {
                atomicAdd(&depths[word], u32(depth * SHADOW_UNITS + 0.5));
            }
        }
    }
}

@compute @workgroup_size(64)
fn shade_columns(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    // A workgroup has one light, whose grid software adapters load once for all threads, as none has left before.
    let number = group_index(group);
    let grid = params.grids[number % params.lights];
    let index = number / params.lights * 64u + local;
    if index >= params.count || traits[index] <= 3u {
        return;
    }
    let opacity = f32((traits[index] >> 2u) & 0xffffu) / 65535.0;
    shade(grid, params.origin + spheres[index].xyz, spheres[index].w, opacity);
}

@compute @workgroup_size(64)
fn sum_columns(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let first = (group_index(group) * 64u + local) * LIGHT_SLICES;
    if first >= arrayLength(&depths) {
        return;
    }
    var sum = 0.0;
    for (var i = 0u; i < LIGHT_SLICES; i++) {
        sum += f32(atomicLoad(&depths[first + i])) / SHADOW_UNITS;
        atomicStore(&depths[first + i], bitcast<u32>(sum));
    }
}
