// Depth range per 8 x 8 tile in which splats are hidden: behind all fronts and in front of all backs
// drawn so far.

#import common/tiles.wgsl

// Beyond all depths.
const NOWHERE: f32 = 3e38;

// Fronts, backs.
@group(0) @binding(0) var layers: $layers;
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
    for (var i = 0u; i < TILE * TILE; i++) {
        // Clamping repeats border pixels, which does not affect the extrema.
        let p = min(id.xy * TILE + vec2u(i % TILE, i / TILE), size - 1u);
        let front = textureLoad(layers, p, 0$level).w;
        // Empty pixels hide nothing.
        between.x = max(between.x, select(NOWHERE, front, front > 0.0));
        if BACKS {
            between.y = min(between.y, textureLoad(layers, p, 1$level).w);
        }
    }
    depths[id.y * tiles_across(size.x) + id.x] = between;
}
