// Empties the layers of gaps of one class in the tiles that have any.

#import common/groups.wgsl
#import common/tiles.wgsl

@group(0) @binding(0) var layers: texture_storage_2d_array<rgba32float, write>;
@group(0) @binding(1) var<storage, read> tiles: TileList;

override GAPS: u32 = 1u;

@compute @workgroup_size(8, 8)
fn clear(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = group_index(group);
    if index >= tiles.count {
        return;
    }
    let p = tile_pixel(tiles.tiles[index], local.xy);
    if any(p >= vec2i(textureDimensions(layers))) {
        return;
    }
    for (var layer = 2u; layer < 2u + 2u * GAPS; layer++) {
        textureStore(layers, p, layer, vec4f(0.0));
    }
}
