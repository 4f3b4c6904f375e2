// Empties the texels that smoothing does not write: beyond the liquid's tiles, where taps read, and of backs where only
// fronts are smoothed.

#import common/groups.wgsl
#import common/tiles.wgsl

@group(0) @binding(0) var<storage, read> liquid: TileList;
@group(0) @binding(1) var<storage, read> background: TileList;
@group(0) @binding(2) var first_state: texture_storage_2d_array<rgba32float, write>;
@group(0) @binding(3) var second_state: texture_storage_2d_array<rgba32float, write>;
@group(0) @binding(4) var planes: texture_storage_2d_array<rgba32float, write>;
// Of each tile, whether the frame before has written it, and whether this one does.
@group(0) @binding(5) var<storage, read> filled_before: array<u32>;
@group(0) @binding(6) var<storage, read_write> filled: array<u32>;

override BACKS: bool = true; // backs are smoothed

// A workgroup has eight tiles, a thread a row of one of them.
@compute @workgroup_size(8, 8)
fn blank(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = group_index(group) * 8u + local.y;
    let covered = index < liquid.count;
    if index >= liquid.count + background.count {
        return;
    }
    var tile: u32;
    if covered {
        tile = liquid.tiles[index];
    } else {
        tile = background.tiles[index - liquid.count];
    }
    let size = textureDimensions(planes);
    let at = (tile >> 16u) * tiles_across(size.x) + (tile & 0xffffu);
    if local.x == 0u {
        filled[at] = select(0u, 1u, covered);
    }
    // A loop, because software adapters execute both sides of a branch.
    let emptied = select(filled_before[at] != 0u, !BACKS, covered);
    for (var x = select(0u, TILE, !emptied); x < TILE; x++) {
        let p = tile_pixel(tile, vec2u(x, local.x));
        let inside = all(vec2u(p) < size);
        for (var layer = select(0, 1, covered); layer < select(0, 2, inside); layer++) {
            textureStore(first_state, p, layer, vec4f(0.0));
            textureStore(second_state, p, layer, vec4f(0.0));
            textureStore(planes, p, layer, vec4f(0.0));
        }
    }
}
