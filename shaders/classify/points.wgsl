// The points of the iso-surface, one thread per line: `Field` of `src/liquid/classify/iso_surface.rs` on the device.

#import classify/line.wgsl
#import classify/spline.wgsl

@group(0) @binding(1) var<storage, read> starts: array<u32>;
@group(0) @binding(2) var<storage, read> sorted: array<vec4f>;      // position and radius, m
@group(0) @binding(3) var<storage, read> fields: array<f32>;        // densities at the members
@group(0) @binding(4) var<storage, read> line_starts: array<u32>;
@group(0) @binding(5) var<storage, read> lines: array<Line>;
@group(0) @binding(6) var<storage, read_write> points: array<Point>;

// Normalised density at the surface.
const LEVEL: f32 = 0.6;
// Steps along a line, and of the search between two of them.
const STEPS: u32 = 6u;
const REFINEMENTS: u32 = 4u;

// The first and last cell of the members that count on a line.
struct Cells {
    first: vec3u,
    last: vec3u,
}

fn cells_along(own: vec4f, end: vec3f) -> Cells {
    let margin = 5e-7 * max(abs(own.xyz), abs(end));
    let reach = FIELD * own.w;
    return Cells(
        cell_around(min(own.xyz, end) - reach - margin),
        cell_around(max(own.xyz, end) + reach + margin),
    );
}

// A member from another one, in radii of that, and its weight.
fn weighted(other: vec4f, own: vec4f, field: f32) -> vec4f {
    return vec4f((other.xyz - own.xyz) / own.w, relative_volume(other.w, own.w) / field);
}

// Density above the level at the steps along the line.
fn march(own: vec4f, cells: Cells, out: vec3f, farthest: f32) -> array<f32, STEPS + 1u> {
    var above: array<f32, STEPS + 1u>;
    for (var i = 0u; i <= STEPS; i++) {
        above[i] = -LEVEL;
    }
    for (var z = cells.first.z; z <= cells.last.z; z++) {
        for (var y = cells.first.y; y <= cells.last.y; y++) {
            let end = starts[cell_index(vec3u(cells.last.x, y, z)) + 1u];
            for (var slot = starts[cell_index(vec3u(cells.first.x, y, z))]; slot < end; slot++) {
                let x = weighted(sorted[slot], own, fields[slot]);
                let along = clamp(dot(x.xyz, out), 0.0, farthest);
                if distance(x.xyz, along * out) < FIELD {
                    for (var i = 0u; i <= STEPS; i++) {
                        let t = farthest * f32(i) / f32(STEPS);
                        above[i] += x.w * spline(distance(x.xyz, t * out) / FIELD);
                    }
                }
            }
        }
    }
    return above;
}

// A vector along the gradient of the density at a place relative to the member, and the density above the level.
fn field_at(own: vec4f, cells: Cells, at: vec3f) -> vec4f {
    var sum = vec4f(0.0, 0.0, 0.0, -LEVEL);
    for (var z = cells.first.z; z <= cells.last.z; z++) {
        for (var y = cells.first.y; y <= cells.last.y; y++) {
            let end = starts[cell_index(vec3u(cells.last.x, y, z)) + 1u];
            for (var slot = starts[cell_index(vec3u(cells.first.x, y, z))]; slot < end; slot++) {
                let x = weighted(sorted[slot], own, fields[slot]);
                let distance = distance(x.xyz, at);
                if distance < FIELD {
                    // The slope at 0 is 0.
                    let steepness = x.w * slope(distance / FIELD) / max(distance, 1e-6);
                    sum += vec4f(steepness * (at - x.xyz), x.w * spline(distance / FIELD));
                }
            }
        }
    }
    return sum;
}

// Where the density falls to the level between two distances with their densities above it.
fn between(inner: vec2f, outer: vec2f) -> f32 {
    return inner.x + (outer.x - inner.x) * inner.y / (inner.y - outer.y);
}

// The first place on a line at which the density falls below the level.
fn point_on(line: Line, own: vec4f, farthest: f32) -> Point {
    let none = Point(vec3f(0.0), own.w, vec3f(0.0), 0u);
    let cells = cells_along(own, own.xyz + farthest * own.w * line.out);
    var above = march(own, cells, line.out, farthest);
    var inner = vec2f(0.0, above[0]);
    var outer = inner;
    for (var i = 1u; i <= STEPS && outer.y >= 0.0; i++) {
        inner = outer;
        outer = vec2f(farthest * f32(i) / f32(STEPS), above[i]);
    }
    if inner.y < 0.0 || outer.y >= 0.0 {
        return none;
    }
    // The Illinois variant of the false position: superlinear, and never outside the bracket.
    var last = 0;
    for (var i = 0u; i < REFINEMENTS; i++) {
        let t = between(inner, outer);
        let value = field_at(own, cells, t * line.out).w;
        if value >= 0.0 {
            inner = vec2f(t, value);
            outer.y *= select(1.0, 0.5, last == 1);
            last = 1;
        } else {
            outer = vec2f(t, value);
            inner.y *= select(1.0, 0.5, last == -1);
            last = -1;
        }
    }
    let offset = between(inner, outer) * line.out;
    let gradient = field_at(own, cells, offset).xyz;
    let place = own.xyz - params.shift + own.w * offset;
    let steepness = length(gradient);
    // Not a number fails both.
    if !(steepness > 0.0 && all(abs(place) < vec3f(3e38))) {
        return none;
    }
    return Point(place, own.w, -gradient / steepness, 1u);
}

@compute @workgroup_size(64)
fn find_points(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = group_index(group) * 64u + local;
    if crowded() || i >= listed(line_starts[params.cells]) {
        return;
    }
    let kind = lines[i].tag & 3u;
    let own = sorted[lines[i].tag >> 2u];
    if kind == OUT {
        points[i] = point_on(lines[i], own, FARTHEST);
    } else if kind == NO_LINE {
        points[i].found = 0u;
    } else if kind == SIDE {
        // A sheet has both sides or none.
        var a = point_on(lines[i], own, HALF_SHEET);
        var b = point_on(lines[i + 1u], own, HALF_SHEET);
        let found = a.found & b.found;
        a.found = found;
        b.found = found;
        points[i] = a;
        points[i + 1u] = b;
    }
}
