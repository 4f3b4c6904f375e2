// Sorts the picture's tiles into those that liquid covers and the rest.

#import common/tiles.wgsl

struct AtomicTileList {
    count: atomic<u32>,
    tiles: array<u32>,
}

@group(0) @binding(0) var aggregate_layers: texture_2d_array<f32>;
@group(0) @binding(1) var splash_layers: texture_2d_array<f32>;
@group(0) @binding(2) var<storage, read_write> liquid: AtomicTileList;
@group(0) @binding(3) var<storage, read_write> background: AtomicTileList;
// Indirect dispatches: liquid, liquid for both layers, background.
@group(0) @binding(4) var<storage, read_write> dispatches: array<vec3u, 3>;

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
        covered = textureLoad(aggregate_layers, p, 0, 0).w > 0.0;
        if SPLASH {
            covered |= textureLoad(splash_layers, p, 0, 0).w > 0.0;
        }
    }
    let tile = id.x | (id.y << 16u);
    if covered {
        liquid.tiles[atomicAdd(&liquid.count, 1u)] = tile;
    } else {
        background.tiles[atomicAdd(&background.count, 1u)] = tile;
    }
}

@compute @workgroup_size(1)
fn arrange() {
    let covered = dispatch(atomicLoad(&liquid.count));
    dispatches[0] = covered;
    dispatches[1] = vec3u(covered.xy, covered.z * 2u);
    dispatches[2] = dispatch(atomicLoad(&background.count));
}

fn dispatch(count: u32) -> vec3u {
    return vec3u(min(count, ROW), (count + ROW - 1u) / ROW, 1u);
}
