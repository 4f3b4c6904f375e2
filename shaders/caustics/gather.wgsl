// Caustics by gathering: for each texel's receiver, finds the path through the liquid's front to the
// light.
//
// After Granizo-Hidalgo and Holzschuch (2024). In a view along the light, the straight line from
// receiver to light passes through the grid at the texel itself; in a view along refracted light, a
// few tangent-plane steps lead there. Either way the walk needs no ray tracing to start. Only one path
// per receiver is found: between the folds of a caustic, where several paths meet, the map is too
// dark.
//
// The layers are those of the light's view.

#import $intersector
#import caustics/conic.wgsl
#import caustics/light.wgsl
#import caustics/params.wgsl

@group(3) @binding(0) var<$branching> caustics: CausticParams;
// The vertex (i, j) is at pixel position (i, j) * camera.size / cells.
@group(3) @binding(1) var<storage, read> grid: array<GridVertex>;
@group(3) @binding(2) var caustic_map: texture_storage_2d<rgba32float, write>; // irradiance, state

// States of a texel.
const NOT_INSIDE: f32 = 0.0; // no liquid, or the receiver is not in the liquid that light enters first
const SOLVED: f32 = 1.0;     // a path was found; it may be shadowed
const UNSOLVED: f32 = 2.0;   // no path was found

// Cells around the grid by which level liquid is extended.
fn border() -> vec2i {
    return select(vec2i(0), vec2i(caustics.cells) / 4, any(caustics.level.xyz != vec3f(0.0)));
}

// Vertex of the grid extended by its border.
fn grid_vertex(at: vec2i) -> GridVertex {
    let cells = vec2i(caustics.cells);
    let inner = at - border();
    var vertex = GridVertex(vec3f(0.0), NONE, vec3f(0.0));
    if all(inner >= vec2i(0)) && all(inner <= cells) {
        vertex = grid[inner.y * (cells.x + 1) + inner.x];
    }
    if vertex.valid == NONE && any(caustics.level.xyz != vec3f(0.0)) {
        let omega = camera_omega(vec2f(inner) * camera.size / vec2f(cells));
        let o = camera_ray_origin(omega);
        let d = camera_ray_direction(omega);
        let n = caustics.level.xyz;
        let x = o + (caustics.level.w - dot(n, o)) / dot(n, d) * d;
        vertex = GridVertex(x, BEYOND, n);
    }
    return vertex;
}

// Lit share at a point of the grid, interpolated between shadowed and lit vertices; 0 beyond the
// liquid.
fn lit_share(at: vec2f) -> f32 {
    let cell = vec2i(floor(at));
    let f = at - floor(at);
    let upper = f.x + f.y > 1.0;
    let p = grid_vertex(cell + select(vec2i(0), vec2i(1), upper)).valid;
    let q = grid_vertex(cell + select(vec2i(1, 0), vec2i(0, 1), upper)).valid;
    let r = grid_vertex(cell + select(vec2i(0, 1), vec2i(1, 0), upper)).valid;
    let g = select(f, 1.0 - f, upper);
    let weights = vec3f(1.0 - g.x - g.y, g);
    let valid = vec3u(p, q, r);
    if any(valid == vec3u(BEYOND)) {
        return 0.0;
    }
    return dot(weights, select(vec3f(0.0), vec3f(1.0), valid == vec3u(LIT)));
}

// Pixel position at which the line from a receiver towards the light passes through the front.
fn line_pixel(receiver: vec3f, towards: vec3f, u0: vec2f) -> vec2f {
    var u = u0;
    for (var k = 0; k < 5; k++) {
        let texel = clamp(vec2i(floor(u)), vec2i(0), vec2i(camera.size) - 1);
        var plane = textureLoad(aggregate_layers, texel, FRONT$level).xyz;
        if SPLASH && plane_is_empty(plane) {
            plane = textureLoad(splash_layers, texel, FRONT$level).xyz;
        }
        var t = 0.0;
        if !plane_is_empty(plane) {
            t = plane_along(plane, receiver, towards);
        } else if any(caustics.level.xyz != vec3f(0.0)) {
            let n = caustics.level.xyz;
            t = (caustics.level.w - dot(n, receiver)) / dot(n, towards);
        }
        u = camera_pixel(receiver + t * towards);
    }
    return u;
}

// Parameter t at which the ray o + t d meets a texel's plane.
fn plane_along(pi: vec3f, o: vec3f, d: vec3f) -> f32 {
    if ORTHOGRAPHIC {
        return (camera_disparity(o) - dot(pi, vec3f(o.xy, -1.0))) / (dot(pi.xy, d.xy) - d.z);
    }
    return (1.0 - dot(pi, o)) / dot(pi, d);
}

// Disparity interval of one class at a texel, and whether a receiver lies in it.
struct Interval {
    front: f32,
    back: f32,
    inside: bool,
}

// Interval for the receiver at `disparity` with unit normal `normal`. Liquid wets a solid within
// `contact` of its back, as in `refract`.
fn interval(front: vec3f, back: vec3f, omega: vec3f, disparity: f32, normal: vec3f) -> Interval {
    if caustics.interfaces == 1u {
        // Solids bound the liquid: everything behind its front is inside.
        let at = dot(front, omega);
        return Interval(at, 0.0, at > disparity);
    }
    if plane_is_empty(front) || plane_is_empty(back) {
        return Interval(0.0, 0.0, false);
    }
    let ends = vec2f(dot(front, omega), dot(back, omega));
    let gap = camera_point(omega, ends.y) - camera_point(omega, disparity);
    let wet = CONTACT && abs(dot(gap, normal)) <= params.contact;
    return Interval(ends.x, ends.y, ends.x > disparity && (ends.y <= disparity || wet));
}

// Whether the receiver is in the liquid that light enters first, not behind a gap between splashes and
// aggregates.
fn in_first_liquid(texel: vec2i, omega: vec3f, disparity: f32, normal: vec3f) -> bool {
    var slabs = whole_slabs(texel);
    // The light enters the first interval of each class first.
    if slabs.aggregate_has_gap && is_open(aggregate_gap(texel, 0)) {
        slabs.aggregate.back = aggregate_gap(texel, 0).back;
    }
    if slabs.splash_has_gap && is_open(splash_gap(texel, 0)) {
        slabs.splash.back = splash_gap(texel, 0).back;
    }
    let aggregate = interval(slabs.aggregate.front, slabs.aggregate.back, omega, disparity, normal);
    if !SPLASH {
        return aggregate.inside;
    }
    let splash = interval(slabs.splash.front, slabs.splash.back, omega, disparity, normal);
    let aggregate_first = aggregate.inside && (splash.front <= aggregate.front || splash.back <= aggregate.front);
    let splash_first = splash.inside && (aggregate.front <= splash.front || aggregate.back <= splash.front);
    return aggregate_first || splash_first;
}

// Whether a solid lies between a point of the front and the receiver. `cosine` is that between the
// receiver's normal and the view: receivers seen at a slant are less accurate.
fn receiver_is_shadowed(x: vec3f, receiver: vec3f, cosine: f32) -> bool {
    let to = receiver - x;
    let length = length(to);
    let hit = opaque_entry(screen_ray(x, to / length, NOTHING));
    let slack = 1.5 * camera_pixel_side(receiver) / max(cosine, 0.1);
    return hit.found && distance(x, hit.position) < length - slack;
}

// On a caustic the irradiance of a point is infinite, but its mean over a texel is finite. At a fold
// the mean magnification is sqrt(2 b / a), with the texel side a and the distance b over which the
// focus of the waves changes by as much as itself. No visible wave is longer than the image, so b / a
// is at most about the image size over 2 pi, and the bound grows with resolution as the mean does.
fn largest_magnification() -> f32 {
    return sqrt(max(camera.size.x, camera.size.y));
}

@compute @workgroup_size(8, 8)
fn gather(@builtin(global_invocation_id) id: vec3u) {
    let texel = vec2i(id.xy + caustics.first);
    if any(texel >= vec2i(camera.size)) {
        return;
    }
    textureStore(caustic_map, texel, gathered(texel));
}

// Irradiance and state of one texel.
fn gathered(texel: vec2i) -> vec4f {
    let u = vec2f(texel) + 0.5;
    let omega = camera_omega(u);
    let plane = textureLoad(gbuffer_planes, texel, 0).xyz;
    let disparity = dot(plane, omega);
    if plane_is_empty(plane) || disparity <= 0.0 {
        return vec4f(0.0, 0.0, 0.0, NOT_INSIDE);
    }
    let receiver = camera_point(omega, disparity);
    let normal = plane_normal(plane);
    if !in_first_liquid(texel, omega, disparity, normal) {
        return vec4f(0.0, 0.0, 0.0, NOT_INSIDE);
    }

    var sight = Sight(receiver, caustics.light, 0.0, params.ior);
    if !ORTHOGRAPHIC {
        sight.distance = distance(caustics.light, receiver);
        sight.towards = (caustics.light - receiver) / sight.distance;
    }
    let per_pixel = vec2f(caustics.cells) / camera.size;
    let from_border = vec2f(border());
    let cells = vec2i(caustics.cells) + 2 * border();
    var path = no_path(0u);
    if any(caustics.level.xyz != vec3f(0.0)) {
        path = conic_walk_near(sight, u * per_pixel + from_border, cells, caustics.steps);
    }
    if !path.found {
        let start = line_pixel(receiver, sight.towards, u) * per_pixel + from_border;
        path = conic_walk(sight, start, cells, caustics.steps);
    }
    if !path.found {
        return vec4f(0.0, 0.0, 0.0, UNSOLVED);
    }
    let x = receiver + path.position;
    let lit = lit_share(camera_pixel(x) * per_pixel + from_border);
    if lit == 0.0 || receiver_is_shadowed(x, receiver, abs(dot(normal, camera_ray_direction(omega)))) {
        return vec4f(0.0, 0.0, 0.0, SOLVED);
    }
    let cos_air = dot(path.to_light, path.normal);
    let cos_liquid = optics_cos_transmitted(cos_air, params.ior);
    let transmitted = 1.0 - optics_fresnel(cos_air, cos_liquid, params.ior);
    let straight = select(sight.distance * sight.distance, 1.0, ORTHOGRAPHIC);
    let widening = max(path.spread, params.ior * params.ior * straight / largest_magnification());
    let focus = params.ior * params.ior / widening;
    let cosine = abs(dot(path.to_receiver, normal));
    let left = transmittance_between(x, receiver) * passed_below(x, distance(x, receiver));
    return vec4f(caustics.power * left * (lit * transmitted * focus * cosine), SOLVED);
}
