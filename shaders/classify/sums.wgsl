// Sums over blocks of cells.

#import classify/params.wgsl

// Threads per block.
const THREADS: u32 = 256u;
// Cells per thread.
const EACH: u32 = 8u;

// Sums over a block; the entry after the last block holds the totals.
struct Sum {
    count: u32,   // members in the block; after `add_sums`, in all preceding blocks
    squares: f32, // sum of the squared cell counts
}

// Number of blocks. The scan has one entry more than there are cells, for the end of the last cell.
fn blocks() -> u32 {
    return params.cells / (THREADS * EACH) + 1u;
}
