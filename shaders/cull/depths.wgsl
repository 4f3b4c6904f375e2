// Depth range per 8 x 8 tile, and per quad of 2 x 2 pixels, in which splats are hidden: behind all fronts and in
// front of all backs drawn so far.

#import common/tiles.wgsl
#import cull/quads.wgsl

// Beyond all depths.
const NOWHERE: f32 = 3e38;

// Fronts, backs.
@group(0) @binding(0) var layers: $layers;
// Of tiles, then of quads.
@group(0) @binding(1) var<storage, read_write> depths: array<vec2f>;

// Whether backs are drawn; without them, fronts alone hide splats.
override BACKS: bool = true;

@compute @workgroup_size(8, 8)
fn reduce(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(layers);
    if any(id.xy * TILE >= size) {
        return;
    }
    var between = vec2f(0.0, NOWHERE);
    for (var i = 0u; i < QUADS * QUADS; i++) {
        let quad = id.xy * QUADS + vec2u(i % QUADS, i / QUADS);
        let of_quad = between_of(quad, size);
        depths[quad_index(quad, size)] = of_quad;
        between = vec2f(max(between.x, of_quad.x), min(between.y, of_quad.y));
    }
    depths[id.y * tiles_across(size.x) + id.x] = between;
}

fn between_of(quad: vec2u, size: vec2u) -> vec2f {
    var between = vec2f(0.0, NOWHERE);
    for (var i = 0u; i < QUAD * QUAD; i++) {
        // Clamping repeats border pixels, which does not affect the extrema.
        let p = min(quad * QUAD + vec2u(i % QUAD, i / QUAD), size - 1u);
        let front = textureLoad(layers, p, 0$level).w;
        // Empty pixels hide nothing.
        between.x = max(between.x, select(NOWHERE, front, front > 0.0));
        if BACKS {
            between.y = min(between.y, textureLoad(layers, p, 1$level).w);
        }
    }
    return between;
}
