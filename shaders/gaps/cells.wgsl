// Occupancy of the rays through a coarse grid of the picture: along each, bins of depth between the
// first front and the last back, and a bit for each bin that liquid touches.
//
// After Zirr and Dachsbacher, Memory-Efficient On-The-Fly Voxelization of Particle Data (2015):
// binary voxels in view space.

#import common/tiles.wgsl

// Side of a cell, pixels: its ray passes through the middle of one texel.
const CELL: u32 = 4u;
const CELLS_PER_TILE: u32 = TILE / CELL;

// Bins of a cell, 32 to a word.
const BINS: u32 = 64u;
const WORDS: u32 = BINS / 32u;

// Scale at which the ellipsoids leave no gaps inside the liquid.
const CLOSING: f32 = 1.3;

// Gaps, at most: splits of a cell.
const MOST_GAPS: u32 = 2u;

// The texel whose ray a cell stands for.
fn cell_texel(cell: vec2u) -> vec2u {
    return cell * CELL + CELL / 2u;
}

fn cells_across(width: u32) -> u32 {
    return (width + CELL - 1u) / CELL;
}
