// Finds the path from a point in the liquid through its front to the light, by walking along the curve
// of points that refract in the plane of the point, the light and their own normal.
//
// After Granizo-Hidalgo and Holzschuch (2024), as `crates/limpid-lab/src/reference/conic.rs`, which
// explains and justifies the differences. Positions are relative to the receiver: relative to a
// distant origin, 32-bit floats cannot resolve the relevant angles.
//
// A file that imports this one defines
//     fn grid_vertex(at: vec2i) -> GridVertex      with valid = NONE outside of the grid

#import caustics/params.wgsl

// A receiver and a light.
struct Sight {
    receiver: vec3f,
    towards: vec3f,  // unit, from the receiver to the light
    distance: f32,   // to the light, m; 0 for a sun
    ior: f32,
}

struct ConicPath {
    found: bool,
    position: vec3f,    // relative to the receiver
    normal: vec3f,      // interpolated, unit, out of the liquid
    to_receiver: vec3f, // unit
    to_light: vec3f,    // unit
    spread: f32,        // D: m2/sr at a point light, 1 at a sun
    steps: u32,         // triangles walked
}

// Bounds on the residual g, the sine of the angular error of the refracted light.
const CONIC_CLOSE: f32 = 1e-6;
const CONIC_ACCEPTED: f32 = 1e-4;
// Tolerance for points outside of their triangle, in barycentric coordinates.
const CONIC_OUTSIDE: f32 = 1e-2;
// Distance at which a point counts as on an edge, so that an arc that starts there may leave at once.
const CONIC_EDGE: f32 = 1e-3;
// Iterations of the interpolation between the ends of an arc, which degrades to bisection at worst.
const CONIC_ROUNDS: u32 = 20u;

struct Corner {
    at: vec2i,
    position: vec3f,
    normal: vec3f,
}

// A triangle, with the quadratic form in barycentric coordinates whose zeros are the coplanar points.
// A point is (x, y), the coordinates of q and r.
struct Triangle {
    p: Corner,
    q: Corner,
    r: Corner,
    own: vec3f,   // diagonal coefficients: p, q, r
    mixed: vec3f, // off-diagonal coefficients: pq, pr, qr
}

// Point at which the curve leaves a triangle.
struct Exit {
    found: bool,
    edge: u32,    // 0 to 2: pq, pr, qr
    s: f32,       // from the edge's first end to its second
    rising: bool, // whether the form rises along the edge
}

// End of an arc, and the residual there.
struct End {
    x: vec2f,
    g: f32,
}

const NO_CROSSING: f32 = -1.0;

// Root s at which a (1-s)^2 + 2 h s (1-s) + b s^2 rises, or falls, through 0; 0 counts as positive.
// Computes s / (1 - s) by the formula without cancellation.
fn edge_crossing(a: f32, h: f32, b: f32, rising: bool) -> f32 {
    let discriminant = h * h - a * b;
    if discriminant <= 0.0 && (a < 0.0) == (b < 0.0) {
        return NO_CROSSING;
    }
    let root = sqrt(max(discriminant, 0.0));
    var uv: vec2f;
    var exists: bool;
    if rising {
        exists = select((a < 0.0), (b >= 0.0), h < 0.0);
        uv = select(vec2f(root + h, -a), vec2f(b, root - h), h < 0.0);
    } else {
        exists = select((b < 0.0), (a >= 0.0), h < 0.0);
        uv = select(vec2f(-b, root + h), vec2f(root - h, a), h < 0.0);
    }
    let sum = uv.x + uv.y;
    return select(NO_CROSSING, select(0.0, uv.y / sum, sum > 0.0), exists);
}

fn conic_mixed(sight: Sight, a: Corner, b: Corner) -> f32 {
    let by_b = dot(a.normal, cross(sight.towards, b.position));
    let by_a = dot(b.normal, cross(sight.towards, a.position));
    return 0.5 * (by_a + by_b);
}

fn conic_own(sight: Sight, a: Corner) -> f32 {
    return dot(a.normal, cross(sight.towards, a.position));
}

fn conic_times(triangle: Triangle, b: vec3f) -> vec3f {
    let own = triangle.own;
    let mixed = triangle.mixed;
    return vec3f(
        own.x * b.x + mixed.x * b.y + mixed.y * b.z,
        mixed.x * b.x + own.y * b.y + mixed.z * b.z,
        mixed.y * b.x + mixed.z * b.y + own.z * b.z,
    );
}

fn conic_barycentric(x: vec2f) -> vec3f {
    return vec3f(1.0 - x.x - x.y, x);
}

fn conic_gradient(triangle: Triangle, x: vec2f) -> vec2f {
    let k = conic_times(triangle, conic_barycentric(x));
    return 2.0 * (k.yz - k.x);
}

fn conic_quadratic(triangle: Triangle, d: vec2f) -> f32 {
    let b = vec3f(-d.x - d.y, d);
    return dot(b, conic_times(triangle, b));
}

fn left_of(v: vec2f) -> vec2f {
    return vec2f(-v.y, v.x);
}

fn unit_or_zero(v: vec2f) -> vec2f {
    let length = length(v);
    return select(vec2f(0.0), v / length, length > 0.0);
}

fn exit_point(exit: Exit) -> vec2f {
    let s = exit.s;
    return select(select(vec2f(1.0 - s, s), vec2f(0.0, s), exit.edge == 1u), vec2f(s, 0.0), exit.edge == 0u);
}

// Exit of the arc from x, followed with the positive side of the form on its right or, for
// `along` = -1, on its left. Not found if the curve is closed inside the triangle.
fn conic_exit(triangle: Triangle, x: vec2f, along: f32) -> Exit {
    let own = triangle.own;
    let mixed = triangle.mixed;
    let up = along > 0.0;
    let s = vec3f(
        edge_crossing(own.x, mixed.x, own.y, !up),
        edge_crossing(own.x, mixed.y, own.z, up),
        edge_crossing(own.y, mixed.z, own.z, !up),
    );
    let there = s >= vec3f(0.0);
    var edge = select(select(2u, 1u, there.y), 0u, there.x);
    if u32(there.x) + u32(there.y) + u32(there.z) > 1u {
        edge = conic_first_exit(triangle, x, along, s);
    }
    return Exit(any(there), edge, s[edge], select(!up, up, edge == 1u));
}

// First of several exits along the arc: a line through x that turns from the tangent in the direction
// in which the arc bends meets them in the same order.
fn conic_first_exit(triangle: Triangle, x: vec2f, along: f32, s: vec3f) -> u32 {
    let gradient = unit_or_zero(conic_gradient(triangle, x));
    let tangent = along * left_of(gradient);
    let bend = -sign(conic_quadratic(triangle, tangent)) * gradient;
    var best = -9.0;
    var first = 0u;
    for (var edge = 0u; edge < 3u; edge++) {
        if s[edge] < 0.0 {
            continue;
        }
        let to = exit_point(Exit(true, edge, s[edge], false)) - x;
        let length = length(to);
        // An exit at x: on the entry edge it comes last, on another edge first.
        var turn = select(2.0, -2.0, edge == 0u && x.y == 0.0);
        if length > 1e-5 {
            turn = dot(to, tangent) / length * select(1.0, -1.0, dot(to, bend) < -1e-4 * length);
        }
        first = select(first, edge, turn > best);
        best = max(best, turn);
    }
    return first;
}

// Point of the arc from a to b at about the fraction w.
fn conic_arc_point(triangle: Triangle, a: vec2f, b: vec2f, along: f32, w: f32) -> vec2f {
    let at_a = conic_gradient(triangle, a);
    let across_a = unit_or_zero(at_a);
    let across_b = unit_or_zero(conic_gradient(triangle, b));
    let tangent = along * left_of(across_a);
    let chord = b - a;
    let on = a + w * chord;
    if dot(across_a, across_b) > 0.5 && dot(tangent, chord) > 0.0 {
        // Slightly bent: intersects perpendicular to the chord, at whose ends the form vanishes.
        let across = normalize(across_a + across_b);
        let polar = dot(conic_barycentric(a), conic_times(triangle, conic_barycentric(b)));
        let form = 2.0 * w * (1.0 - w) * polar;
        let half = 0.5 * dot(conic_gradient(triangle, on), across);
        let root = sqrt(max(half * half - form * conic_quadratic(triangle, across), 0.0));
        let divisor = half + select(root, -root, half < 0.0);
        return on - select(0.0, form / divisor, divisor != 0.0) * across;
    }
    // Strongly bent: on the line through a that bisects the tangent and the chord.
    let bend = -sign(conic_quadratic(triangle, tangent)) * across_a;
    let between = tangent + unit_or_zero(chord);
    let line = select(bend, between, any(chord != vec2f(0.0)) && dot(between, between) > 1e-6);
    let quadratic = conic_quadratic(triangle, line);
    let t = -dot(at_a, line) / quadratic;
    return select(on, a + t * line, quadratic != 0.0 && abs(t) < 4.0);
}

fn conic_position(triangle: Triangle, x: vec2f) -> vec3f {
    let p = triangle.p.position;
    return p + x.x * (triangle.q.position - p) + x.y * (triangle.r.position - p);
}

fn conic_normal(triangle: Triangle, x: vec2f) -> vec3f {
    let p = triangle.p.normal;
    return p + x.x * (triangle.q.normal - p) + x.y * (triangle.r.normal - p);
}

fn sight_to_light(sight: Sight, x: vec3f) -> vec3f {
    if sight.distance == 0.0 {
        return sight.towards;
    }
    return normalize(sight.distance * sight.towards - x);
}

// Residual of Snell's law along the surface at x, in the plane through the receiver and the light. The
// plane is oriented by `forward` at the start of the walk, which goes forward (way = 1) or back (-1).
fn conic_residual(triangle: Triangle, sight: Sight, x: vec2f, forward: vec3f, way: f32) -> f32 {
    let position = conic_position(triangle, x);
    let to_receiver = -normalize(position);
    let m = forward * 1e-4 - way * cross(sight.towards, to_receiver);
    let along = cross(m, conic_normal(triangle, x));
    let length = max(length(along), 1e-20);
    return dot(sight_to_light(sight, position) + sight.ior * to_receiver, along) / length;
}

// Point on the arc from a to b at which the residual is 0, given that its signs at the ends differ.
fn conic_solve(
    triangle: Triangle, sight: Sight, one: End, other: End, along: f32, forward: vec3f, way: f32,
) -> vec2f {
    var a = one;
    var b = other;
    var last = 0;
    for (var i = 0u; i < CONIC_ROUNDS; i++) {
        let w = clamp(a.g / (a.g - b.g), 0.01, 0.99);
        let x = conic_arc_point(triangle, a.x, b.x, along, w);
        let g = conic_residual(triangle, sight, x, forward, way);
        if abs(g) < CONIC_CLOSE {
            return x;
        }
        // Halves the residual of an end that is kept twice (Illinois method).
        if (g < 0.0) == (a.g < 0.0) {
            a = End(x, g);
            b.g *= select(1.0, 0.5, last == 1);
            last = 1;
        } else {
            b = End(x, g);
            a.g *= select(1.0, 0.5, last == -1);
            last = -1;
        }
    }
    return select(b.x, a.x, abs(a.g) < abs(b.g));
}

fn no_path(steps: u32) -> ConicPath {
    return ConicPath(false, vec3f(0.0), vec3f(0.0), vec3f(0.0), vec3f(0.0), 0.0, steps);
}

// The path through a point of a triangle, if it is valid.
fn conic_path(triangle: Triangle, sight: Sight, x: vec2f, steps: u32) -> ConicPath {
    if min(min(x.x, x.y), 1.0 - x.x - x.y) < -CONIC_OUTSIDE {
        return no_path(steps);
    }
    let position = conic_position(triangle, x);
    let raw = conic_normal(triangle, x);
    let normal = normalize(raw);
    let e1 = triangle.q.position - triangle.p.position;
    let e2 = triangle.r.position - triangle.p.position;
    var plane = normalize(cross(e1, e2));
    plane *= select(1.0, -1.0, dot(plane, normal) < 0.0);
    let depth = length(position);
    let to_receiver = -position / depth;
    let to_light = sight_to_light(sight, position);
    let bent = sight.ior * to_receiver + to_light;
    let bend = dot(bent, normal);
    let inside = dot(to_receiver, normal) < 0.0 && dot(to_receiver, plane) < 0.0;
    let outside = dot(to_light, normal) > 0.0 && dot(to_light, plane) > 0.0;
    if !(inside && outside && length(bent - bend * normal) < CONIC_ACCEPTED) {
        return no_path(steps);
    }
    // Ray differentials: two rotations of the ray about the receiver, propagated to the light.
    let u = normalize(cross(to_receiver, select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), abs(to_receiver.x) > 0.7)));
    let v = cross(to_receiver, u);
    let du = conic_spread(triangle, sight, position, raw, plane, to_receiver, to_light, u);
    let dv = conic_spread(triangle, sight, position, raw, plane, to_receiver, to_light, v);
    return ConicPath(true, position, normal, to_receiver, to_light, length(cross(du, dv)), steps);
}

// Ray differential at the light for a rotation of the ray about the receiver by `turn`.
fn conic_spread(
    triangle: Triangle, sight: Sight, position: vec3f, raw: vec3f, plane: vec3f,
    to_receiver: vec3f, to_light: vec3f, turn: vec3f,
) -> vec3f {
    let scale = length(raw);
    let normal = raw / scale;
    let depth = length(position);
    let moved = -depth * (turn - dot(turn, plane) / dot(to_receiver, plane) * to_receiver);
    // The displacement in barycentric coordinates, by the reciprocal vectors of the edges.
    let e1 = triangle.q.position - triangle.p.position;
    let e2 = triangle.r.position - triangle.p.position;
    let across = cross(e1, e2);
    let area2 = dot(across, across);
    let x = dot(cross(moved, e2), across) / area2;
    let y = dot(cross(e1, moved), across) / area2;
    var tilted = x * (triangle.q.normal - triangle.p.normal) + y * (triangle.r.normal - triangle.p.normal);
    tilted = (tilted - dot(tilted, normal) * normal) / scale;
    let eta = sight.ior;
    let bend = dot(to_light, normal) + eta * dot(to_receiver, normal);
    let ratio = dot(to_receiver, normal) / dot(to_light, normal);
    let bending = (eta * eta * ratio + eta) * (dot(turn, normal) + dot(to_receiver, tilted));
    let light = -eta * turn + bending * normal + bend * tilted;
    if sight.distance == 0.0 {
        return light;
    }
    let distance = length(sight.distance * sight.towards - position);
    return moved - dot(moved, to_light) * to_light + distance * light;
}

fn conic_corner(sight: Sight, at: vec2i, vertex: GridVertex) -> Corner {
    return Corner(at, vertex.position - sight.receiver, vertex.normal);
}

// Start of a walk: a triangle, and its intersection with the straight line to the light.
struct Beginning {
    found: bool,
    sure: bool, // whether the curve continues in this triangle
    triangle: Triangle,
    x: vec2f,
    ahead: Exit,
    behind: Exit,
}

fn conic_is_outside(x: vec2f) -> bool {
    return min(min(x.x, x.y), 1.0 - x.x - x.y) < -CONIC_EDGE;
}

fn conic_beginning(sight: Sight, at: vec2f, cells: vec2i) -> Beginning {
    var beginning: Beginning;
    if any(at < vec2f(0.0)) || any(at > vec2f(cells)) {
        return beginning;
    }
    let cell = min(vec2i(at), cells - 1);
    let within = at - vec2f(cell);
    let upper = within.x + within.y > 1.0;
    let p = cell + vec2i(select(0, 1, upper), 0);
    let q = cell + select(vec2i(1, 0), vec2i(0, 1), upper);
    let r = cell + select(vec2i(0, 1), vec2i(1, 1), upper);
    let vertex_p = grid_vertex(p);
    let vertex_q = grid_vertex(q);
    let vertex_r = grid_vertex(r);
    if vertex_p.valid == NONE || vertex_q.valid == NONE || vertex_r.valid == NONE {
        return beginning;
    }
    var start: Triangle;
    start.p = conic_corner(sight, p, vertex_p);
    start.q = conic_corner(sight, q, vertex_q);
    start.r = conic_corner(sight, r, vertex_r);
    start.own = vec3f(conic_own(sight, start.p), conic_own(sight, start.q), conic_own(sight, start.r));
    start.mixed = vec3f(
        conic_mixed(sight, start.p, start.q),
        conic_mixed(sight, start.p, start.r),
        conic_mixed(sight, start.q, start.r),
    );
    let side_p = cross(sight.towards, start.p.position);
    let side_q = cross(sight.towards, start.q.position);
    let side_r = cross(sight.towards, start.r.position);
    let areas = vec3f(
        dot(sight.towards, cross(side_q, side_r)),
        dot(sight.towards, cross(side_r, side_p)),
        dot(sight.towards, cross(side_p, side_q)),
    );
    let area = areas.x + areas.y + areas.z;
    if area == 0.0 {
        return beginning;
    }
    let x = areas.yz / area;
    beginning.found = true;
    beginning.triangle = start;
    beginning.x = x;
    // A point on an edge qualifies if the curve enters the triangle and does not just cut off a corner.
    let ahead = conic_exit(start, x, 1.0);
    let behind = conic_exit(start, x, -1.0);
    let near_ahead = ahead.found && distance(exit_point(ahead), x) < 10.0 * CONIC_EDGE;
    let near_behind = behind.found && distance(exit_point(behind), x) < 10.0 * CONIC_EDGE;
    let inside = min(min(x.x, x.y), 1.0 - x.x - x.y) > CONIC_EDGE;
    beginning.sure = inside || near_ahead != near_behind;
    beginning.ahead = ahead;
    beginning.behind = behind;
    return beginning;
}

// First path found by a walk of at most `steps` triangles in either direction. `at` is the intersection
// of the line to the light with the grid, in cells; `cells` is the size of the grid.
fn conic_walk(sight: Sight, at: vec2f, cells: vec2i, steps: u32) -> ConicPath {
    var beginning = conic_beginning(sight, at, cells);
    // The start is only approximate, unless the view is along the line.
    for (var k = 0; k < 4 && beginning.found && conic_is_outside(beginning.x); k++) {
        let triangle = beginning.triangle;
        let p = vec2f(triangle.p.at);
        let edges = mat2x2f(vec2f(triangle.q.at) - p, vec2f(triangle.r.at) - p);
        beginning = conic_beginning(sight, p + edges * beginning.x, cells);
    }
    // On an edge or vertex, the curve may pass through another triangle than that of `at`.
    for (var k = 0u; k < 6u && !beginning.sure; k++) {
        let first = select(vec2f(1.0), vec2f(2.0, -1.0), k % 3u == 1u);
        let nudge = select(first, vec2f(1.0, -2.0), k % 3u == 2u) * select(1.0, -1.0, k >= 3u);
        let other = conic_beginning(sight, at + CONIC_EDGE * nudge, cells);
        if other.sure || !beginning.found {
            beginning = other;
        }
    }
    if !beginning.found {
        return no_path(0u);
    }
    let start = beginning.triangle;
    let x = beginning.x;
    // Light along the normal is not refracted.
    let straight = conic_path(start, sight, x, 0u);
    if straight.found {
        return straight;
    }
    let slope = left_of(conic_gradient(start, x));
    let tangent = slope.x * (start.q.position - start.p.position) + slope.y * (start.r.position - start.p.position);
    let forward = cross(sight.towards, tangent / max(length(tangent), 1e-20));
    // On the line itself, `forward` determines the plane for both directions.
    let begin = End(x, conic_residual(start, sight, x, 1e8 * forward, 0.0));

    let ahead = beginning.ahead;
    let behind = beginning.behind;
    if !ahead.found && !behind.found {
        // The curve is closed inside this triangle; after a full turn the plane is flipped.
        let opposite = conic_arc_point(start, x, x, 1.0, 0.5);
        let half = End(opposite, conic_residual(start, sight, opposite, forward, 1.0));
        let first = (half.g < 0.0) != (begin.g < 0.0);
        var a = begin;
        var b = half;
        if !first {
            a = half;
            b = End(x, -begin.g);
        }
        return conic_path(start, sight, conic_solve(start, sight, a, b, 1.0, forward, 1.0), 0u);
    }
    // Starts in the direction in which the residual falls faster or changes sign.
    let sign = select(1.0, -1.0, begin.g < 0.0);
    let ahead_g = conic_residual(start, sight, exit_point(ahead), forward, 1.0);
    let behind_g = conic_residual(start, sight, exit_point(behind), forward, -1.0);
    let first = select(-1.0, 1.0, ahead.found && (!behind.found || sign * ahead_g <= sign * behind_g));
    var walked = 0u;
    for (var turn = 0; turn < 2; turn++) {
        let way = select(-first, first, turn == 0);
        var exit = behind;
        if way > 0.0 {
            exit = ahead;
        }
        let path = conic_follow(sight, start, begin, exit, way, forward, way, steps, &walked);
        if path.found {
            return path;
        }
    }
    return no_path(walked);
}

// Largest number of triangles searched for the curve near its expected position.
const CONIC_SEARCHED: u32 = 32u;

// As `conic_walk`, but `at` is where still water would refract the light, near which the curve and
// usually the path lie.
fn conic_walk_near(sight: Sight, at: vec2f, cells: vec2i, steps: u32) -> ConicPath {
    if any(at < vec2f(0.0)) || any(at > vec2f(cells)) {
        return no_path(0u);
    }
    let cell = min(vec2i(at), cells - 1);
    let within = at - vec2f(cell);
    let upper = within.x + within.y > 1.0;
    var triangle: Triangle;
    let p = cell + vec2i(select(0, 1, upper), 0);
    let q = cell + select(vec2i(1, 0), vec2i(0, 1), upper);
    let r = cell + select(vec2i(0, 1), vec2i(1, 1), upper);
    triangle.p = conic_corner(sight, p, grid_vertex(p));
    triangle.q = conic_corner(sight, q, grid_vertex(q));
    triangle.r = conic_corner(sight, r, grid_vertex(r));
    triangle.own = vec3f(
        conic_own(sight, triangle.p), conic_own(sight, triangle.q), conic_own(sight, triangle.r),
    );
    // Crosses edges towards the curve until the form changes sign in the triangle.
    var crossed = false;
    for (var k = 0u; k < CONIC_SEARCHED; k++) {
        let negative = triangle.own < vec3f(0.0);
        crossed = any(negative) && !all(negative);
        if crossed {
            break;
        }
        let size = abs(triangle.own);
        let third = triangle.p.at + triangle.q.at + triangle.r.at;
        // Replaces the vertex farthest from the curve by its mirror image.
        if size.z >= max(size.x, size.y) {
            let to = third - 2 * triangle.r.at;
            triangle.r = conic_corner(sight, to, grid_vertex(to));
            triangle.own.z = conic_own(sight, triangle.r);
        } else if size.y >= size.x {
            let to = third - 2 * triangle.q.at;
            triangle.q = triangle.r;
            triangle.own.y = triangle.own.z;
            triangle.r = conic_corner(sight, to, grid_vertex(to));
            triangle.own.z = conic_own(sight, triangle.r);
        } else {
            let to = third - 2 * triangle.p.at;
            triangle.p = triangle.q;
            triangle.q = triangle.r;
            triangle.own = triangle.own.yzz;
            triangle.r = conic_corner(sight, to, grid_vertex(to));
            triangle.own.z = conic_own(sight, triangle.r);
        }
    }
    let valid = vec3u(
        grid_vertex(triangle.p.at).valid, grid_vertex(triangle.q.at).valid, grid_vertex(triangle.r.at).valid,
    );
    if !crossed || any(valid == vec3u(NONE)) {
        return no_path(0u);
    }
    triangle.mixed = vec3f(
        conic_mixed(sight, triangle.p, triangle.q),
        conic_mixed(sight, triangle.p, triangle.r),
        conic_mixed(sight, triangle.q, triangle.r),
    );
    // Walks from one end of the curve in this triangle through the other, then in reverse.
    let centre = vec2f(1.0 / 3.0);
    var walked = 0u;
    let none = vec3f(0.0);
    let ahead = conic_exit(triangle, centre, 1.0);
    let behind = conic_exit(triangle, centre, -1.0);
    if !ahead.found || !behind.found {
        return no_path(0u);
    }
    let a = End(exit_point(ahead), conic_residual(triangle, sight, exit_point(ahead), none, 1.0));
    let b = End(exit_point(behind), conic_residual(triangle, sight, exit_point(behind), none, 1.0));
    // Starts towards the smaller residual.
    let first = select(-1.0, 1.0, abs(a.g) < abs(b.g));
    for (var turn = 0; turn < 2; turn++) {
        let way = select(-first, first, turn == 0);
        var begin = a;
        var exit = behind;
        if way > 0.0 {
            begin = b;
            exit = ahead;
        }
        let path = conic_follow(sight, triangle, begin, exit, way, none, 1.0, steps, &walked);
        if path.found {
            return path;
        }
    }
    return no_path(walked);
}

// First path on the curve from `begin` in a triangle, through `first_exit` and on, for at most `steps`
// triangles; `first_along` and `way` as for `conic_exit` and `conic_residual`.
fn conic_follow(
    sight: Sight, start: Triangle, begin: End, first_exit: Exit, first_along: f32, forward: vec3f,
    way: f32, steps: u32, walked: ptr<function, u32>,
) -> ConicPath {
    var triangle = start;
    var a = begin;
    var along = first_along;
    var exit = first_exit;
    let out = exit_point(exit);
    var b = End(out, conic_residual(triangle, sight, out, forward, way));
    for (var step = 0u; exit.found && step <= steps; step++) {
        if (a.g < 0.0) != (b.g < 0.0) {
            let root = conic_solve(triangle, sight, a, b, along, forward, way);
            let path = conic_path(triangle, sight, root, *walked);
            if path.found {
                return path;
            }
        }
        if step >= steps {
            break;
        }
        *walked += 1u;
        // Enters the neighbour: the shared edge in the same direction, then the new vertex. The two
        // triangles of any grid edge form a parallelogram.
        var next: Triangle;
        var opposite = triangle.r.at;
        next.p = triangle.p;
        next.q = triangle.q;
        next.own = triangle.own;
        next.mixed.x = triangle.mixed.x;
        if exit.edge == 1u {
            opposite = triangle.q.at;
            next.q = triangle.r;
            next.own.y = triangle.own.z;
            next.mixed.x = triangle.mixed.y;
        } else if exit.edge == 2u {
            opposite = triangle.p.at;
            next.p = triangle.q;
            next.q = triangle.r;
            next.own = triangle.own.yzz;
            next.mixed.x = triangle.mixed.z;
        }
        let third = next.p.at + next.q.at - opposite;
        let vertex = grid_vertex(third);
        if vertex.valid == NONE {
            break;
        }
        next.r = conic_corner(sight, third, vertex);
        next.own.z = conic_own(sight, next.r);
        next.mixed.y = conic_mixed(sight, next.p, next.r);
        next.mixed.z = conic_mixed(sight, next.q, next.r);
        triangle = next;
        along = select(-1.0, 1.0, exit.rising);
        a = End(vec2f(exit.s, 0.0), b.g);
        exit = conic_exit(triangle, a.x, along);
        let there = exit_point(exit);
        b = End(there, conic_residual(triangle, sight, there, forward, way));
    }
    return no_path(*walked);
}
