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
#import caustics/conic/path.wgsl

// Distance at which a point counts as on an edge, so that an arc that starts there may leave at once.
const CONIC_EDGE: f32 = 1e-3;

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
