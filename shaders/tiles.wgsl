// Sorts the picture's tiles into those that liquid covers and the rest.

#import common/tiles.wgsl

// Division of the tiles into sections with separate lists, to split long work.
struct Sections {
    tiles: u32, // tiles per section
    words: u32, // size of a section's `TileList`
    count: u32, // number of sections
}

@group(0) @binding(0) var aggregate_layers: $layers;
@group(0) @binding(1) var splash_layers: $layers;
@group(0) @binding(2) var<storage, read_write> liquid: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> background: array<atomic<u32>>;
// Indirect dispatch arguments of each section: liquid, liquid for both layers, background.
@group(0) @binding(4) var<storage, read_write> dispatches: array<array<vec3u, 3>>;
@group(0) @binding(5) var<storage, read> sections: Sections;

override SPLASH: bool = false;

@compute @workgroup_size(8, 8)
fn sort(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(aggregate_layers);
    if any(id.xy * TILE >= size) {
        return;
    }
    var covered = false;
    for (var i = 0u; i < TILE * TILE && !covered; i++) {
        let p = min(id.xy * TILE + vec2u(i % TILE, i / TILE), size - 1u);
        covered = textureLoad(aggregate_layers, p, 0$level).w > 0.0;
        if SPLASH {
            covered |= textureLoad(splash_layers, p, 0$level).w > 0.0;
        }
    }
    let tile = id.x | (id.y << 16u);
    let section = (id.y * tiles_across(size.x) + id.x) / sections.tiles;
    let count = section * sections.words;
    if covered {
        atomicStore(&liquid[count + 1u + atomicAdd(&liquid[count], 1u)], tile);
    } else {
        atomicStore(&background[count + 1u + atomicAdd(&background[count], 1u)], tile);
    }
}

@compute @workgroup_size(1)
fn arrange(@builtin(workgroup_id) group: vec3u) {
    let section = group_index(group);
    if section >= sections.count {
        return;
    }
    let count = section * sections.words;
    let covered = dispatch(atomicLoad(&liquid[count]));
    dispatches[section][0] = covered;
    dispatches[section][1] = vec3u(covered.xy, covered.z * 2u);
    dispatches[section][2] = dispatch(atomicLoad(&background[count]));
}

fn dispatch(count: u32) -> vec3u {
    return vec3u(min(count, ROW), (count + ROW - 1u) / ROW, 1u);
}
