// Empties the tiles of a class's layers that have no splats any more.

#import common/camera.wgsl
#import common/groups.wgsl
#import common/tiles.wgsl

@group(1) @binding(0) var<storage, read> emptied: TileList;
@group(1) @binding(1) var layers: texture_storage_2d_array<rgba32float, write>;
@group(1) @binding(2) var tags: texture_storage_2d<rgba32uint, write>;
// As in splat/layers.wgsl: nothing is found yet.
@group(1) @binding(3) var state: texture_storage_2d_array<r32uint, read_write>;

override TAGS: bool = false; // tags are written
override LAST: bool = true;  // no chunk follows

const NOWHERE: f32 = 3e38;

@compute @workgroup_size(8, 8)
fn empty(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let number = group_index(group);
    if number >= emptied.count {
        return;
    }
    let across = tiles_across(u32(camera.size.x));
    let tile = emptied.tiles[number];
    let p = vec2u(tile % across, tile / across) * TILE + local.xy;
    if any(p >= vec2u(camera.size)) {
        return;
    }
    textureStore(layers, p, 0, vec4f(0.0));
    textureStore(layers, p, 1, vec4f(0.0));
    if TAGS {
        textureStore(tags, p, vec4u(0u));
    }
    if !LAST {
        textureStore(state, p, 0, vec4u(bitcast<u32>(NOWHERE)));
        textureStore(state, p, 1, vec4u(0u));
    }
}
