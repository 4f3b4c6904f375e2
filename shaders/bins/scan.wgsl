// Where each tile's list starts: a prefix sum of the counts, which are set back to 0. Tiles that have splats are listed,
// and those that have none any more.

#import common/groups.wgsl

@group(0) @binding(0) var<storage, read_write> counts: array<u32>;
// One more than tiles: the last is the sum.
@group(0) @binding(1) var<storage, read_write> starts: array<u32>;
// Splats listed of each tile, and of those that only swollen ellipsoids make touch it.
@group(0) @binding(2) var<storage, read_write> cursors: array<vec2u>;
@group(0) @binding(3) var<storage, read_write> blocks: array<u32>;

struct Tiles {
    count: atomic<u32>,
    tiles: array<u32>,
}

// Tiles with splats, and tiles to be emptied.
@group(0) @binding(4) var<storage, read_write> busy: Tiles;
@group(0) @binding(5) var<storage, read_write> emptied: Tiles;
// Of each tile, whether it has been drawn in this frame or, before, in the last.
@group(0) @binding(6) var<storage, read_write> filled: array<u32>;
// Indirect dispatches over the busy and the emptied tiles.
@group(0) @binding(7) var<storage, read_write> dispatches: array<vec3u, 2>;

override FIRST: bool = true; // no chunk is before
override LAST: bool = true;  // no chunk follows

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

// With several chunks, each tile is drawn or emptied by the first, because it hands over what it has found.
fn list_tile(tile: u32, has_splats: bool) {
    if has_splats {
        busy.tiles[atomicAdd(&busy.count, 1u)] = tile;
    } else if FIRST && (filled[tile] != 0u || !LAST) {
        emptied.tiles[atomicAdd(&emptied.count, 1u)] = tile;
    }
    if has_splats || FIRST {
        filled[tile] = select(0u, 1u, has_splats);
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
        let count = counts[first + i];
        total += count;
        counts[first + i] = 0u;
        cursors[first + i] = vec2u(0u);
        list_tile(first + i, count > 0u);
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

@compute @workgroup_size(1)
fn arrange() {
    dispatches[0] = over(atomicLoad(&busy.count));
    dispatches[1] = over(atomicLoad(&emptied.count));
}

fn over(count: u32) -> vec3u {
    return vec3u(min(count, ROW), (count + ROW - 1u) / ROW, 1u);
}
