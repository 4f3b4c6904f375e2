// Chooses the gaps of each cell, and the tiles that have any.

#import gaps/cells.wgsl
#import gaps/runs.wgsl
#import common/groups.wgsl

// Division of the tiles into sections, as in tiles.wgsl.
struct Sections {
    tiles: u32,
    words: u32,
    count: u32,
}

struct Params {
    least: f32, // shortest gap between swollen ellipsoids, m
}

override SPLASH: bool = false;

@group(0) @binding(0) var aggregate_layers: texture_2d_array<f32>;
@group(0) @binding(1) var splash_layers: texture_2d_array<f32>;
@group(0) @binding(2) var<storage, read> aggregate_marks: array<u32>;
@group(0) @binding(3) var<storage, read> splash_marks: array<u32>;
@group(0) @binding(4) var aggregate_splits: texture_storage_2d<rgba32float, write>;
@group(0) @binding(5) var splash_splits: texture_storage_2d<rgba32float, write>;
// Of each tile the least and the greatest depth of a split: of aggregates, then of splashes; 0 without any.
@group(0) @binding(6) var gap_tiles: texture_storage_2d<rgba32float, write>;
@group(0) @binding(7) var<storage, read_write> list: array<atomic<u32>>;
@group(0) @binding(8) var<storage, read> sections: Sections;
@group(0) @binding(9) var<uniform> params: Params;

// Cells to each side of a tile whose gaps extend into it.
const RING: u32 = 1u;
const WINDOW: u32 = CELLS_PER_TILE + 2u * RING;

// Splits of the cells of a tile and around it, by rows.
var<private> window: array<vec2f, WINDOW * WINDOW>;

fn window_cell(tile: vec2u, i: u32) -> vec2i {
    return vec2i(tile * CELLS_PER_TILE + vec2u(i % WINDOW, i / WINDOW)) - i32(RING);
}

// Depths of the first front and the last back of a cell's ray.
fn cell_range(splash: bool, cell: vec2i) -> vec2f {
    let size = textureDimensions(aggregate_layers);
    let texel = min(cell_texel(vec2u(cell)), size - 1u);
    if splash {
        return vec2f(textureLoad(splash_layers, texel, 0, 0).w, textureLoad(splash_layers, texel, 1, 0).w);
    }
    return vec2f(textureLoad(aggregate_layers, texel, 0, 0).w, textureLoad(aggregate_layers, texel, 1, 0).w);
}

fn fill_window(splash: bool, tile: vec2u) {
    let size = textureDimensions(aggregate_layers);
    let across = cells_across(size.x);
    for (var i = 0u; i < WINDOW * WINDOW; i++) {
        let cell = window_cell(tile, i);
        window[i] = vec2f(0.0);
        if any(cell < vec2i(0)) || any(cell * i32(CELL) >= vec2i(size)) {
            continue;
        }
        let at = (u32(cell.y) * across + u32(cell.x)) * WORDS;
        var marked: vec2u;
        if splash {
            marked = vec2u(splash_marks[at], splash_marks[at + 1u]);
        } else {
            marked = vec2u(aggregate_marks[at], aggregate_marks[at + 1u]);
        }
        let range = cell_range(splash, cell);
        window[i] = splits_of(marked, range.x, range.y, params.least);
    }
}

// Splits of a tile's cell: its own or, at the rim of a gap, those of a neighbour.
fn spread_splits(i: u32) -> vec2f {
    var splits = window[i];
    for (var k = 0u; k < 9u && splits.x <= 0.0; k++) {
        splits = window[i + (k / 3u) * WINDOW + k % 3u - WINDOW - 1u];
    }
    return splits;
}

@compute @workgroup_size(8, 8)
fn split(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(aggregate_layers);
    let tile = id.xy;
    if any(tile * TILE >= size) {
        return;
    }
    var found = vec4f(0.0);
    for (var of_class = 0u; of_class <= select(0u, 1u, SPLASH); of_class++) {
        fill_window(of_class == 1u, tile);
        var range = vec2f(0.0);
        for (var k = 0u; k < CELLS_PER_TILE * CELLS_PER_TILE; k++) {
            let i = (k / CELLS_PER_TILE + RING) * WINDOW + k % CELLS_PER_TILE + RING;
            let splits = spread_splits(i);
            let cell = window_cell(tile, i);
            if of_class == 0u {
                textureStore(aggregate_splits, cell, vec4f(splits, 0.0, 0.0));
            } else {
                textureStore(splash_splits, cell, vec4f(splits, 0.0, 0.0));
            }
            if splits.x > 0.0 {
                range.x = select(min(range.x, splits.x), splits.x, range.y == 0.0);
                range.y = max(range.y, max(splits.x, splits.y));
            }
        }
        found = select(vec4f(range, found.zw), vec4f(found.xy, range), of_class == 1u);
    }
    textureStore(gap_tiles, tile, found);
    if any(found > vec4f(0.0)) {
        let section = (tile.y * tiles_across(size.x) + tile.x) / sections.tiles;
        let count = section * sections.words;
        atomicStore(&list[count + 1u + atomicAdd(&list[count], 1u)], tile.x | (tile.y << 16u));
    }
}
