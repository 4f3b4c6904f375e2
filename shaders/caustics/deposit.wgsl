// Deposits the light of each grid triangle in the map, between the landing points of its corners.
//
// A triangle carries the light of its area in the view and distributes it to texels by exact overlap
// area: no light is lost between sample points, folds of either sign add up, and the map's total is
// the emitted light. Sums are integers and thus independent of order.
//
// `deposit` has a thread for each cell of the grid. It lists the cells and triangles that cover many texels; in
// `deposit_large` a workgroup shares the texels of each of these, so that no thread is long at work.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/scene.wgsl
#import caustics/landing.wgsl
#import caustics/light.wgsl
#import caustics/light_sums.wgsl
#import caustics/params.wgsl

@group(1) @binding(0) var<$branching> caustics: CausticParams;
@group(1) @binding(1) var<storage, read> grid: array<GridVertex>;
@group(1) @binding(2) var<storage, read> landings: array<Landing>;
@group(1) @binding(3) var receivers: texture_2d<f32>; // planes
// Red, green and blue of each texel, two words each, the lower first.
@group(1) @binding(4) var<storage, read_write> light_sums: array<atomic<u32>>;
@group(1) @binding(5) var<storage, read_write> large: Large;

// Cells and triangles for `deposit_large`.
struct Large {
    count: atomic<u32>,
    entries: array<u32>, // KINDS times the cell, plus its half, or PATCH
}

const KINDS: u32 = 4u;
const PATCH: u32 = 2u;

// Texels of a bounding box from which a workgroup shares them.
const LARGE_BOX: f32 = 64.0;

// Threads that share the texels of a triangle, and the place of this one among them.
override LANES: u32 = 1u;
var<private> lane: u32 = 0u;
// Workgroups of `deposit_large`, over all pieces of its dispatch.
override GROUPS: u32 = 1u;

// Shortest semi-axis of a deposited triangle, pixels: spreads focused light instead of missing it, and
// keeps areas accurate.
const LEAST_EXTENT: f32 = 0.02;

// Two corners are on one surface if each lies this close to the other's plane, as a share of their
// distance plus a texel; steeper is a step between surfaces.
const TORN: f32 = 0.5;

// Triangles with a larger bounding box, in texels, are deposited as SPECKS squared points instead.
const LARGEST_BOX: f32 = 4096.0;
const SPECKS: i32 = 6;

// Whether two landing points are on one surface.
fn on_one_surface(a: Landing, b: Landing, texel: f32) -> bool {
    let apart = distance(a.position, b.position) + texel;
    let off_a = abs(dot(unpack_unit(a.normal), b.position - a.position));
    let off_b = abs(dot(unpack_unit(b.normal), a.position - b.position));
    return a.state >= LANDED && b.state >= LANDED && max(off_a, off_b) <= TORN * apart;
}

// Landing points vary smoothly over the grid. If the light of a cell and its neighbours falls on one
// surface, they are interpolated by bicubics through 4 x 4 vertices, and the cell is subdivided.
const SIDE: i32 = 4; // vertices along the side of a patch

struct Patch {
    at: array<vec2f, 16>,     // pixel positions of the landing points
    passed: array<vec3f, 4>,  // light at the cell's corners; bilinear interpolation suffices
    smooth_there: bool,       // all on one surface
}

// One thread per cell.
@compute @workgroup_size(8, 8)
fn deposit(@builtin(global_invocation_id) thread: vec3u) {
    let id = thread.xy + caustics.first;
    if any(id >= caustics.cells) {
        return;
    }
    let row = caustics.cells.x + 1u;
    let first = id.y * row + id.x;
    let number = KINDS * (id.y * caustics.cells.x + id.x);
    let a = landings[first];
    let b = landings[first + 1u];
    let c = landings[first + row];
    let d = landings[first + row + 1u];
    let states = vec4u(a.state, b.state, c.state, d.state);
    if all(states != vec4u(LANDED)) {
        return;
    }
    let inner = all(id > vec2u(0u)) && all(id + 2u <= caustics.cells);
    if inner && caustics.subdivide > 1u && all(states == vec4u(LANDED)) {
        var patch_of = patch_at(first);
        if patch_of.smooth_there {
            if is_large(patch_of.at[5], patch_of.at[6], patch_of.at[9], patch_of.at[10]) {
                list(number + PATCH);
            } else {
                deposit_patch(&patch_of);
            }
            return;
        }
    }
    // A loop: drivers inline a function where it is called, and compile it as often.
    for (var half = 0u; half < 2u; half++) {
        deposit_half(first, half, number + half);
    }
}

@compute @workgroup_size(LANES)
fn deposit_large(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) index: u32) {
    lane = index;
    let count = atomicLoad(&large.count);
    for (var i = caustics.first.x / 8u + group.x; i < count; i += GROUPS) {
        let number = large.entries[i];
        let cell = number / KINDS;
        let first = cell / caustics.cells.x * (caustics.cells.x + 1u) + cell % caustics.cells.x;
        if number % KINDS == PATCH {
            var patch_of = patch_at(first);
            deposit_patch(&patch_of);
        } else {
            let corners = corners_of(first, number % KINDS);
            let light = corners_light(corners) / 3.0;
            add_triangle(camera_pixel(corners.a.position), camera_pixel(corners.b.position), camera_pixel(corners.c.position), light);
        }
    }
}

fn list(number: u32) {
    large.entries[atomicAdd(&large.count, 1u)] = number;
}

// Whether the bounding box of four points in the map has many texels. Only times depend on it.
fn is_large(a: vec2f, b: vec2f, c: vec2f, d: vec2f) -> bool {
    let low = max(min(min(a, b), min(c, d)), vec2f(0.0));
    let high = min(max(max(a, b), max(c, d)), camera.size);
    let box = max(high - low, vec2f(0.0));
    return box.x * box.y > LARGE_BOX;
}

// The patch of a cell that is not at the border, whose first vertex this is.
fn patch_at(first: u32) -> Patch {
    let row = caustics.cells.x + 1u;
    let a = landings[first];
    let texel = camera_pixel_side(a.position);
    var patch_of: Patch;
    patch_of.smooth_there = true;
    patch_of.passed = array(
        a.passed, landings[first + 1u].passed, landings[first + row].passed, landings[first + row + 1u].passed,
    );
    for (var k = 0; k < SIDE * SIDE; k++) {
        let offset = vec2i(k % SIDE, k / SIDE) - 1;
        let there = landings[i32(first) + offset.y * i32(row) + offset.x];
        patch_of.smooth_there = patch_of.smooth_there && on_one_surface(a, there, texel);
        patch_of.at[k] = camera_pixel(there.position);
    }
    return patch_of;
}

// Weights of the Lagrange cubic through -1, 0, 1 and 2.
fn cubic_weights(t: f32) -> vec4f {
    return vec4f(
        -t * (t - 1.0) * (t - 2.0) / 6.0,
        (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
        -t * (t + 1.0) * (t - 2.0) / 2.0,
        t * (t + 1.0) * (t - 1.0) / 6.0,
    );
}

fn patch_point(patch_of: ptr<function, Patch>, t: vec2f) -> vec2f {
    let across = cubic_weights(t.x);
    let down = cubic_weights(t.y);
    var sum = vec2f(0.0);
    for (var j = 0; j < SIDE; j++) {
        var line = vec2f(0.0);
        for (var i = 0; i < SIDE; i++) {
            line += across[i] * (*patch_of).at[SIDE * j + i];
        }
        sum += down[j] * line;
    }
    return sum;
}

fn deposit_patch(patch_of: ptr<function, Patch>) {
    let cell = camera.size / vec2f(caustics.cells);
    let parts = i32(caustics.subdivide);
    let step = 1.0 / f32(parts);
    let share = 0.5 * cell.x * cell.y * step * step;
    let passed = (*patch_of).passed;
    for (var j = 0; j < parts; j++) {
        var p = patch_point(patch_of, vec2f(0.0, f32(j)) * step);
        var q = patch_point(patch_of, vec2f(0.0, f32(j + 1)) * step);
        for (var i = 0; i < parts; i++) {
            let next_p = patch_point(patch_of, vec2f(vec2i(i + 1, j)) * step);
            let next_q = patch_point(patch_of, vec2f(vec2i(i + 1, j + 1)) * step);
            let middle = (vec2f(vec2i(i, j)) + 0.5) * step;
            let light = share * mix(mix(passed[0], passed[1], middle.x), mix(passed[2], passed[3], middle.x), middle.y);
            for (var half = 0; half < 2; half++) {
                let other = half == 1;
                add_triangle(select(p, next_q, other), select(next_p, q, other), select(q, next_p, other), light);
            }
            p = next_p;
            q = next_q;
        }
    }
}

// Landing points and vertex indices of a triangle.
struct Corners {
    a: Landing,
    b: Landing,
    c: Landing,
    vertex_a: u32,
    vertex_b: u32,
    vertex_c: u32,
}

fn corners_of(first: u32, half: u32) -> Corners {
    let row = caustics.cells.x + 1u;
    let vertices = select(
        vec3u(first, first + 1u, first + row),
        vec3u(first + row + 1u, first + row, first + 1u),
        half == 1u,
    );
    return Corners(
        landings[vertices.x], landings[vertices.y], landings[vertices.z], vertices.x, vertices.y, vertices.z,
    );
}

fn lit_corners(corners: Corners) -> vec3f {
    return vec3f(vec3u(corners.a.state, corners.b.state, corners.c.state) == vec3u(LANDED));
}

// Three times the light of a triangle: each corner contributes a third.
fn corners_light(corners: Corners) -> vec3f {
    let cell = camera.size / vec2f(caustics.cells);
    let lit = lit_corners(corners);
    let half_cell = 0.5 * cell.x * cell.y;
    return half_cell * (lit.x * corners.a.passed + lit.y * corners.b.passed + lit.z * corners.c.passed);
}

fn deposit_half(first: u32, half: u32, number: u32) {
    let size = camera.size / vec2f(caustics.cells);
    let cell = select(size, -size, half == 1u);
    let corners = corners_of(first, half);
    let a = corners.a;
    let b = corners.b;
    let c = corners.c;
    let lit = lit_corners(corners);
    if all(lit == vec3f(0.0)) {
        return;
    }
    let light = corners_light(corners) / 3.0;
    let texel = camera_pixel_side(a.position);
    let whole = on_one_surface(a, b, texel) && on_one_surface(b, c, texel) && on_one_surface(c, a, texel);
    if whole && all(lit == vec3f(1.0)) {
        let at = array(camera_pixel(a.position), camera_pixel(b.position), camera_pixel(c.position));
        if is_large(at[0], at[1], at[2], at[2]) {
            list(number);
        } else {
            add_triangle(at[0], at[1], at[2], light);
        }
    } else if all(vec3u(a.state, b.state, c.state) != vec3u(NO_PATH)) {
        let count = lit.x + lit.y + lit.z;
        deposit_in_parts(corners, cell, light / count * 3.0);
    } else {
        // At the liquid's border: the triangle keeps its size in the view, centred on the corners that
        // landed.
        let at = select(vec2f(0.0), camera_pixel(a.position), lit.x > 0.0)
            + select(vec2f(0.0), camera_pixel(b.position), lit.y > 0.0)
            + select(vec2f(0.0), camera_pixel(c.position), lit.z > 0.0);
        let first = at / (lit.x + lit.y + lit.z) - cell / 3.0;
        add_triangle(first, first + vec2f(cell.x, 0.0), first + vec2f(0.0, cell.y), light);
    }
}

// Parts along the side of a triangle that spans several surfaces or a shadow edge.
const PARTS: i32 = 4;

// Deposits each part of a triangle by its own ray against the solids, if the view shows the hit.
fn deposit_in_parts(corners: Corners, cell: vec2f, light: vec3f) {
    let a = corners.a;
    let b = corners.b;
    let c = corners.c;
    let vertices = mat3x3f(
        grid[corners.vertex_a].position, grid[corners.vertex_b].position, grid[corners.vertex_c].position,
    );
    let starts = mat3x3f(a.start, b.start, c.start);
    let directions =
        mat3x3f(unpack_unit(a.direction), unpack_unit(b.direction), unpack_unit(c.direction));
    let part = light / f32(PARTS * PARTS);
    let side = cell / f32(PARTS);
    for (var j = 0; j < PARTS; j++) {
        // Alternates upright and inverted parts.
        for (var i = 0; i < 2 * (PARTS - j) - 1; i++) {
            let turned = select(1.0, -1.0, (i & 1) == 1);
            let corner = vec2f(f32((i + 1) / 2), f32(j + (i & 1)));
            let middle = (corner + vec2f(turned / 3.0)) / f32(PARTS);
            let weights = vec3f(1.0 - middle.x - middle.y, middle);
            if shadowed(vertices * weights) {
                continue;
            }
            let start = starts * weights;
            let d = normalize(directions * weights);
            let hit = scene_trace(camera_world_point(start), camera_world_direction(d));
            let x = start + hit.t * d;
            if hit.t < NOTHING && is_shown(x) {
                let first = camera_pixel(x) - turned * side / 3.0;
                add_triangle(
                    first,
                    first + turned * vec2f(side.x, 0.0),
                    first + turned * vec2f(0.0, side.y),
                    part,
                );
            }
        }
    }
}

// Whether the view shows a point: its texel's plane passes within a texel side of it.
fn is_shown(x: vec3f) -> bool {
    let u = camera_pixel(x);
    if any(u < vec2f(0.0)) || any(u >= camera.size) {
        return false;
    }
    let plane = textureLoad(receivers, vec2i(u), 0).xyz;
    let off = camera_point(camera_omega(u), dot(plane, camera_omega(u))) - x;
    return !plane_is_empty(plane) && abs(dot(off, plane_normal(plane))) <= camera_pixel_side(x);
}

const HALF_ROOT_3: f32 = 0.8660254;

// Deposits light uniformly over a triangle.
fn add_triangle(pa: vec2f, pb: vec2f, pc: vec2f, light: vec3f) {
    let centre = (pa + pb + pc) / 3.0;
    // Map from an equilateral triangle of circumradius 1.
    let e1 = pb - pa;
    let e2 = pc - pa;
    let m = with_min_extent(mat2x2f((2.0 * e1 - e2) / 3.0, e2 / sqrt(3.0)));
    let a = centre + m * vec2f(-0.5, -HALF_ROOT_3);
    let b = centre + m * vec2f(1.0, 0.0);
    let c = centre + m * vec2f(-0.5, HALF_ROOT_3);
    let density = light / (1.5 * HALF_ROOT_3 * abs(determinant(m)));
    let low = max(floor(min(a, min(b, c))), vec2f(0.0));
    let high = min(ceil(max(a, max(b, c))), camera.size);
    let box = max(high - low, vec2f(0.0));
    if box.x * box.y > LARGEST_BOX {
        // Too dim for exact placement to matter, but its energy must not be lost.
        let speck = light / f32(SPECKS * SPECKS);
        for (var i = i32(lane); i < SPECKS * SPECKS; i += i32(LANES)) {
            // Area-preserving map from a square to the triangle (Shirley and Chiu 1997).
            let s = (f32(i % SPECKS) + 0.5) / f32(SPECKS);
            let t = sqrt((f32(i / SPECKS) + 0.5) / f32(SPECKS));
            let at = vec2i(floor(mix(a, mix(b, c, s), t)));
            if all(at >= vec2i(0)) && all(at < vec2i(camera.size)) {
                add_to_texel(at, speck);
            }
        }
        return;
    }
    let width = u32(box.x);
    let texels = width * u32(box.y);
    for (var i = lane; i < texels; i += LANES) {
        let corner = low + vec2f(vec2u(i % width, i / width));
        let overlap = abs(area_under(a - corner, b - corner)
            + area_under(b - corner, c - corner) + area_under(c - corner, a - corner));
        if overlap > 0.0 {
            add_to_texel(vec2i(corner), overlap * density);
        }
    }
}

// A matrix with its singular values raised to at least LEAST_EXTENT.
fn with_min_extent(m: mat2x2f) -> mat2x2f {
    // m = rotation(phi) diag(s) rotation(theta) (Blinn, Consider the Lowly 2x2 Matrix, 1996).
    let e = 0.5 * (m[0].x + m[1].y);
    let f = 0.5 * (m[0].x - m[1].y);
    let g = 0.5 * (m[0].y + m[1].x);
    let h = 0.5 * (m[0].y - m[1].x);
    let q = sqrt(e * e + h * h);
    let r = sqrt(f * f + g * g);
    if abs(q - r) >= LEAST_EXTENT {
        return m;
    }
    let a1 = select(atan2(g, f), 0.0, r == 0.0);
    let a2 = select(atan2(h, e), 0.0, q == 0.0);
    let s = max(vec2f(q + r, abs(q - r)), vec2f(LEAST_EXTENT)) * vec2f(1.0, select(-1.0, 1.0, q >= r));
    let left = rotation(0.5 * (a2 + a1));
    return mat2x2f(left[0] * s.x, left[1] * s.y) * rotation(0.5 * (a2 - a1));
}

fn rotation(angle: f32) -> mat2x2f {
    let c = cos(angle);
    let s = sin(angle);
    return mat2x2f(vec2f(c, s), vec2f(-s, c));
}

// Area between an edge and y = 0 within the unit square, signed by the edge's direction. Summed around
// a polygon it is the overlap with the square.
fn area_under(p: vec2f, q: vec2f) -> f32 {
    let x0 = clamp(p.x, 0.0, 1.0);
    let x1 = clamp(q.x, 0.0, 1.0);
    if x0 == x1 {
        return 0.0;
    }
    let slope = (q.y - p.y) / (q.x - p.x);
    let y0 = p.y + (x0 - p.x) * slope;
    let y1 = p.y + (x1 - p.x) * slope;
    if abs(y1 - y0) < 1e-3 {
        return (x1 - x0) * clamp(0.5 * (y0 + y1), 0.0, 1.0);
    }
    return (x1 - x0) * (clamped_integral(y1) - clamped_integral(y0)) / (y1 - y0);
}

// Integral of clamp(y, 0, 1) from 0.
fn clamped_integral(y: f32) -> f32 {
    let within = clamp(y, 0.0, 1.0);
    return 0.5 * within * within + max(y - 1.0, 0.0);
}

// Adds light to a texel atomically, in 64-bit fixed point.
fn add_to_texel(texel: vec2i, light: vec3f) {
    let word = 6u * u32(texel.y * i32(camera.size.x) + texel.x);
    let amount = vec3u(round(min(light * UNIT, vec3f(4e9))));
    for (var i = 0u; i < 3u; i++) {
        let before = atomicAdd(&light_sums[word + 2u * i], amount[i]);
        if before > 0xffffffffu - amount[i] {
            atomicAdd(&light_sums[word + 2u * i + 1u], 1u);
        }
    }
}
