// Where each tile's list starts: a prefix sum of the counts, which are set back to 0.

#import common/groups.wgsl

@group(0) @binding(0) var<storage, read_write> counts: array<u32>;
// One more than tiles: the last is the sum.
@group(0) @binding(1) var<storage, read_write> starts: array<u32>;
// Splats listed of each tile, and of those that only swollen ellipsoids make touch it.
@group(0) @binding(2) var<storage, read_write> cursors: array<vec2u>;
@group(0) @binding(3) var<storage, read_write> blocks: array<u32>;

const THREADS: u32 = 256u;
const EACH: u32 = 4u;
const BLOCK: u32 = THREADS * EACH;

var<workgroup> sums: array<u32, THREADS>;

// Sum of each block of counts.
@compute @workgroup_size(THREADS)
fn sum(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let block = group_index(group);
    let first = block * BLOCK + local * EACH;
    var own = 0u;
    for (var i = 0u; i < EACH && first + i < arrayLength(&counts); i++) {
        own += counts[first + i];
    }
    sums[local] = own;
    workgroupBarrier();
    for (var stride = THREADS / 2u; stride > 0u; stride /= 2u) {
        if local < stride {
            sums[local] += sums[local + stride];
        }
        workgroupBarrier();
    }
    if local == 0u && block < arrayLength(&blocks) {
        blocks[block] = sums[0];
    }
}

@compute @workgroup_size(THREADS)
fn scan(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let block = group_index(group);
    let tiles = arrayLength(&counts);
    let first = block * BLOCK + local * EACH;
    var own = array<u32, EACH>();
    var total = 0u;
    for (var i = 0u; i < EACH && first + i < tiles; i++) {
        own[i] = total;
        total += counts[first + i];
        counts[first + i] = 0u;
        cursors[first + i] = vec2u(0u);
    }
    // Of the blocks before, and of the threads before.
    var before = 0u;
    for (var other = local; other < min(block, arrayLength(&blocks)); other += THREADS) {
        before += blocks[other];
    }
    sums[local] = before;
    workgroupBarrier();
    for (var stride = THREADS / 2u; stride > 0u; stride /= 2u) {
        if local < stride {
            sums[local] += sums[local + stride];
        }
        workgroupBarrier();
    }
    before = sums[0];
    workgroupBarrier();
    sums[local] = total;
    workgroupBarrier();
    for (var stride = 1u; stride < THREADS; stride *= 2u) {
        var sum = sums[local];
        if local >= stride {
            sum += sums[local - stride];
        }
        workgroupBarrier();
        sums[local] = sum;
        workgroupBarrier();
    }
    before += sums[local] - total;
    for (var i = 0u; i < EACH && first + i < tiles; i++) {
        starts[first + i] = before + own[i];
        if first + i + 1u == tiles {
            starts[tiles] = before + total;
        }
    }
}
