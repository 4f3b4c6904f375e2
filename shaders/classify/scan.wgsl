// Counting sort, second part: the first sorted index of each cell, by an exclusive prefix sum over the
// cell counts in three steps, in blocks of 2048 cells.

#import classify/sums.wgsl

@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> sums: array<Sum>;
@group(0) @binding(3) var<storage, read_write> starts: array<u32>;

var<workgroup> shared_counts: array<u32, THREADS>;
var<workgroup> shared_squares: array<f32, THREADS>;

fn count_of(cell: u32) -> u32 {
    if cell < params.cells {
        return counts[cell];
    }
    return 0u;
}

// Exclusive prefix sum over the workgroup (Hillis and Steele, Data Parallel Algorithms,
// Communications of the ACM 29(12), 1986).
fn sum_before(local: u32, count: u32) -> u32 {
    shared_counts[local] = count;
    workgroupBarrier();
    for (var stride = 1u; stride < THREADS; stride *= 2u) {
        var sum = shared_counts[local];
        if local >= stride {
            sum += shared_counts[local - stride];
        }
        workgroupBarrier();
        shared_counts[local] = sum;
        workgroupBarrier();
    }
    return shared_counts[local] - count;
}

// Sum over the workgroup, in a deterministic order.
fn sum_squares(local: u32, squares: f32) -> f32 {
    shared_squares[local] = squares;
    workgroupBarrier();
    for (var stride = THREADS / 2u; stride > 0u; stride /= 2u) {
        if local < stride {
            shared_squares[local] += shared_squares[local + stride];
        }
        workgroupBarrier();
    }
    return shared_squares[0];
}

// Sums of each block.
@compute @workgroup_size(256)
fn add_blocks(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let block = group_index(group);
    var sum = 0u;
    var squares = 0.0;
    for (var k = 0u; k < EACH; k++) {
        let count = count_of((block * THREADS + local) * EACH + k);
        sum += count;
        squares += f32(count) * f32(count);
    }
    let before = sum_before(local, sum);
    let all_squares = sum_squares(local, squares);
    if local == THREADS - 1u && block < blocks() {
        sums[block] = Sum(before + sum, all_squares);
    }
}

// Prefix sums over the blocks, by one workgroup.
@compute @workgroup_size(256)
fn add_sums(@builtin(local_invocation_index) local: u32) {
    let each = (blocks() + THREADS - 1u) / THREADS;
    let first = min(local * each, blocks());
    let end = min(first + each, blocks());
    var sum = 0u;
    var squares = 0.0;
    for (var block = first; block < end; block++) {
        sum += sums[block].count;
        squares += sums[block].squares;
    }
    var before = sum_before(local, sum);
    let all_squares = sum_squares(local, squares);
    for (var block = first; block < end; block++) {
        let count = sums[block].count;
        sums[block].count = before;
        before += count;
    }
    if local == 0u {
        sums[blocks()] = Sum(params.members, all_squares);
    }
}

// First sorted index of each cell.
@compute @workgroup_size(256)
fn begin_cells(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let block = group_index(group);
    let first = (block * THREADS + local) * EACH;
    var sum = 0u;
    for (var k = 0u; k < EACH; k++) {
        sum += count_of(first + k);
    }
    var start = sum_before(local, sum);
    if block >= blocks() {
        return;
    }
    start += sums[block].count;
    for (var k = 0u; k < EACH && first + k <= params.cells; k++) {
        starts[first + k] = start;
        start += count_of(first + k);
    }
}
