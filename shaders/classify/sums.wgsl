// What a block of cells holds, and whether the members crowd a few cells.

#import classify/params.wgsl

// Threads that sum a block, and cells of each.
const THREADS: u32 = 256u;
const EACH: u32 = 8u;

struct Sum {
    count: u32,   // of the block's cells; then of all blocks before
    squares: f32, // of the cells' counts; behind the last block, of all cells
}

// One count more than there are cells, 0, gets the number of all members.
fn blocks() -> u32 {
    return params.cells / (THREADS * EACH) + 1u;
}

// Whether so many are in the same places that looking at all neighbours would take hours.
fn crowded(all: Sum) -> bool {
    return all.squares > params.most_squares;
}
