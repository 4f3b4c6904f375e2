// The curve of points of a triangle that refract in the plane of a receiver, a light and their own normal: its quadratic
// form, where it leaves the triangle, and points of its arcs.

// A receiver and a light.
struct Sight {
    receiver: vec3f,
    towards: vec3f,  // unit, from the receiver to the light
    distance: f32,   // to the light, m; 0 for a sun
    ior: f32,
}

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
