// Quads of 2 x 2 pixels, in which splats are tested that a tile does not hide.

// Side of a quad, pixels, and quads along a tile.
const QUAD: u32 = 4u;
const QUADS: u32 = TILE / QUAD;

// Index of a quad's depths in a picture of this size: those of the tiles come first. Tiles at the border have all their
// quads.
fn quad_index(quad: vec2u, size: vec2u) -> u32 {
    let tiles = (size + TILE - 1u) / TILE;
    return tiles.x * tiles.y + quad.y * tiles.x * QUADS + quad.x;
}
