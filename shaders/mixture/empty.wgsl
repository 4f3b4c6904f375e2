// Empties the mixture in tiles that a class of splats has left.

#import common/camera.wgsl
#import common/groups.wgsl
#import common/tiles.wgsl

@group(1) @binding(0) var<storage, read> emptied: TileList;
@group(1) @binding(1) var mixture: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn empty(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let number = group_index(group);
    if number >= emptied.count {
        return;
    }
    let across = tiles_across(u32(camera.size.x));
    let tile = emptied.tiles[number];
    let p = vec2u(tile % across, tile / across) * TILE + local.xy;
    if all(p < vec2u(camera.size)) {
        textureStore(mixture, p, vec4f(0.0));
    }
}
