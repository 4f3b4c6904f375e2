// Lists of 8 x 8 pixel tiles: those that liquid covers, and the rest.
//
// Liquid passes are dispatched over covered tiles only. The order within a list is undefined, but
// every pixel is in exactly one tile of one list, so pictures do not depend on it.

#import common/groups.wgsl

const TILE: u32 = 8u;

struct TileList {
    count: u32,
    tiles: array<u32>, // x + 65536 y
}

// Tiles in a row of the picture.
fn tiles_across(width: u32) -> u32 {
    return (width + TILE - 1u) / TILE;
}

// Pixel of thread `local` in a packed tile.
fn tile_pixel(tile: u32, local: vec2u) -> vec2i {
    return vec2i(vec2u(tile & 0xffffu, tile >> 16u) * TILE + local);
}
