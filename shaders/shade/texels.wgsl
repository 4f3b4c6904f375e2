// The texels of a body's tiles.

#import common/camera.wgsl
#import common/tiles.wgsl

@group(1) @binding(4) var<storage, read> tiles: TileList;

// The texel of a thread, or one beyond the picture.
fn texel_of(group: vec3u, local: vec3u) -> vec2i {
    let index = group_index(group);
    if index >= tiles.count {
        return vec2i(camera.size);
    }
    return tile_pixel(tiles.tiles[index], local.xy);
}
