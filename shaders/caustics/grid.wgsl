// Regular grid over the light's view: the first point of liquid on each of its rays. The layers are
// those of the light's view.

#import $intersector
#import caustics/light.wgsl
#import caustics/params.wgsl

@group(3) @binding(0) var<$branching> caustics: CausticParams;
@group(3) @binding(1) var<storage, read_write> grid_out: array<GridVertex>;

// Pixel position of a vertex.
fn grid_pixel(vertex: vec2u) -> vec2f {
    return vec2f(vertex) * camera.size / vec2f(caustics.cells);
}

// Nearest front at a texel among both classes.
fn nearest_front(texel: vec2i, omega: vec3f) -> vec3f {
    let aggregate = textureLoad(aggregate_layers, texel, FRONT$level).xyz;
    if SPLASH {
        let splash = textureLoad(splash_layers, texel, FRONT$level).xyz;
        return select(aggregate, splash, dot(splash, omega) > dot(aggregate, omega));
    }
    return aggregate;
}

// Largest difference, in texels, between the planes of neighbouring texels of one surface: allows for
// curvature and noise, but not for a step to another surface.
const SAME_SURFACE: f32 = 1.0;

// Change of disparity over a depth difference of one texel side.
fn disparity_per_texel(disparity: f32) -> f32 {
    return 2.0 * camera.tangent.x / camera.size.x * select(disparity, 1.0, ORTHOGRAPHIC);
}

@compute @workgroup_size(8, 8)
fn grid_vertices(@builtin(global_invocation_id) thread: vec3u) {
    let id = thread.xy + caustics.first;
    if any(id > caustics.cells) {
        return;
    }
    let index = id.y * (caustics.cells.x + 1u) + id.x;
    let u = grid_pixel(id);
    let omega = camera_omega(u);
    let last = vec2i(camera.size) - 1;
    let own = clamp(vec2i(floor(u)), vec2i(0), last);
    let plane = nearest_front(own, omega);
    let disparity = dot(plane, omega);
    // Blends the planes of the four surrounding texels, so that normals are continuous for any grid
    // spacing.
    let base = floor(u - 0.5);
    let f = u - 0.5 - base;
    let slope = plane_slope(plane);
    let tolerance = SAME_SURFACE * (disparity_per_texel(disparity) + abs(slope.x) + abs(slope.y));
    var sum = vec3f(0.0);
    var weight = 0.0;
    for (var i = 0; i < 4; i++) {
        let corner = vec2f(f32(i & 1), f32(i >> 1u));
        let texel = clamp(vec2i(base + corner), vec2i(0), last);
        let there = nearest_front(texel, omega);
        let share = mix(1.0 - f, f, corner);
        if !plane_is_empty(there) && abs(dot(there, omega) - disparity) <= tolerance {
            sum += share.x * share.y * there;
            weight += share.x * share.y;
        }
    }
    var vertex = GridVertex(vec3f(0.0), NONE, vec3f(0.0));
    // Excludes rays that start in the liquid.
    let before_near = !ORTHOGRAPHIC && disparity >= 1.0 / camera.near;
    if !plane_is_empty(plane) && weight > 0.0 && !before_near {
        let blended = sum / weight;
        let x = camera_point(omega, dot(blended, omega));
        vertex = GridVertex(x, select(LIT, SHADOWED, shadowed(x)), -plane_normal(blended));
    }
    grid_out[index] = vertex;
}
