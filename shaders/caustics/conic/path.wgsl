// The point of an arc at which Snell's law holds, and the light's path through it.

#import caustics/conic/form.wgsl

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
// Iterations of the interpolation between the ends of an arc, which degrades to bisection at worst.
const CONIC_ROUNDS: u32 = 20u;

// End of an arc, and the residual there.
struct End {
    x: vec2f,
    g: f32,
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
