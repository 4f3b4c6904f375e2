// Foam, spray, bubbles and dust at a pixel: diffuse/sums.wgsl.

#import diffuse/pixels.wgsl
#import refract/bindings.wgsl

override DIFFUSE: bool = false; // the frame has any

// Radiance times coverage, and coverage.
fn diffuse_of(sums: vec4u) -> vec4f {
    let depth = f32(sums.x) / DEPTH_UNITS;
    let covered = select(1.0 - exp(-depth), 1.0, depth >= OPAQUE_DEPTH);
    let radiance = vec3f(sums.yzw) / (COLOR_UNITS * max(depth, 1.0 / DEPTH_UNITS));
    return vec4f(covered * params.diffuse_white * radiance, covered);
}

fn diffuse_index(p: vec2i) -> u32 {
    return u32(p.y) * u32(camera.size.x) + u32(p.x);
}

// The spheres in the air at a pixel, over the radiance and coverage behind them.
fn behind_spheres(p: vec2i, seen: vec4f) -> vec4f {
    if !DIFFUSE {
        return seen;
    }
    let spheres = diffuse_of(diffuse_above[diffuse_index(p)]);
    return spheres + (1.0 - spheres.w) * seen;
}

// Media of the cells of diffuse/cells.wgsl.
const NO_SPHERES: u32 = 0u;
const IN_AIR: u32 = 1u;
const IN_LIQUID: u32 = 2u;

// Most cells and bricks on a ray's way.
const MOST_CELLS: u32 = 400u;
// Transmittance below which the rest of a way is not seen.
const DARK_WAY: f32 = 0.005;

// Radiance and transmittance of the spheres on a way through a medium, in view space: one cell after the other (J. Amanatides
// and A. Woo, A Fast Voxel Traversal Algorithm for Ray Tracing, 1987), four at once where there are none.
fn spheres_along(start: vec3f, direction: vec3f, way: f32, medium: u32) -> vec4f {
    let across = params.cells_across;
    var light = vec3f(0.0);
    var passed = 1.0;
    // In cells.
    let o = (camera_world_point(start) - params.cells_first) / params.cells_side;
    let world_d = camera_world_direction(direction);
    let d = select(world_d, select(vec3f(-1e-9), vec3f(1e-9), world_d >= vec3f(0.0)), abs(world_d) < vec3f(1e-9));
    let to_low = -o / d;
    let to_high = (vec3f(across) - o) / d;
    let first = min(to_low, to_high);
    let last = max(to_low, to_high);
    var t = max(max(first.x, first.y), max(first.z, 0.0));
    let end = min(min(last.x, last.y), min(last.z, way / params.cells_side));
    let bricks = (across + 3u) / 4u;
    let behind = across.x * across.y * across.z;
    let is_none = !DIFFUSE || medium == NO_SPHERES || across.x == 0u;
    for (var i = 0u; i < select(MOST_CELLS, 0u, is_none) && t < end && passed > DARK_WAY; i++) {
        let cell = vec3u(clamp(o + (t + 1e-3) * d, vec3f(0.0), vec3f(across) - 1.0));
        let brick = cell / 4u;
        let number = (brick.z * bricks.y + brick.y) * bricks.x + brick.x;
        let is_empty = cells[behind + number / 4u][number % 4u] == 0u;
        let size = select(1u, 4u, is_empty);
        let corner = vec3f(cell / size * size);
        let exits = (select(corner, corner + f32(size), d > vec3f(0.0)) - o) / d;
        let next = min(max(min(exits.x, min(exits.y, exits.z)), t + 1e-3), end);
        if !is_empty {
            let all = cells[(cell.z * across.y + cell.y) * across.x + cell.x];
            let own = select(all.xy, all.zw, medium == IN_LIQUID);
            let depth = bitcast<f32>(own.x);
            let left = exp(-depth * (next - t));
            let absorbed = select(vec3f(1.0), exp(-params.absorption * t * params.cells_side), medium == IN_LIQUID);
            light += passed * (1.0 - left) * absorbed * unpack_color(own.y);
            passed *= left;
        }
        t = next;
    }
    return vec4f(params.diffuse_white * light, passed);
}
