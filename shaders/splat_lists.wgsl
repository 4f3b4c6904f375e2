// Lists splats, in their order: at equal depths the first one drawn wins, so the order affects the picture.
//
// A root supplies `is_listed`, and what it reads as group 3.

#import splat.wgsl
#import common/groups.wgsl

const BLOCK: u32 = 256u;
const MASK_WORDS: u32 = BLOCK / 32u;

struct Draw {
    vertices: u32,
    instances: u32,
    first_vertex: u32,
    first_instance: u32,
}

// One bit per splat.
@group(2) @binding(0) var<storage, read_write> masks: array<u32>;
// Listed splats per block; after `arrange`, in all preceding blocks.
@group(2) @binding(1) var<storage, read_write> counts: array<u32>;
@group(2) @binding(2) var<storage, read_write> listed: array<u32>;
@group(2) @binding(3) var<storage, read_write> draws: Draw;

// The pixels that an ellipsoid's bounding rectangle meets, from the first to the last; `seen` if there are any.
struct PixelBounds {
    seen: bool,
    first: vec2u,
    last: vec2u,
}

fn pixel_bounds(placed: Placed) -> PixelBounds {
    let low = splat_corner(0u, placed.centre, placed.rows);
    let high = splat_corner(3u, placed.centre, placed.rows);
    let end = camera.size - 1.0;
    let left_top = (vec2f(low.x, -high.y) * 0.5 + 0.5) * camera.size;
    let right_bottom = (vec2f(high.x, -low.y) * 0.5 + 0.5) * camera.size;
    return PixelBounds(
        !(any(low > vec2f(1.0)) || any(high < vec2f(-1.0))),
        vec2u(clamp(left_top, vec2f(0.0), end)),
        vec2u(clamp(right_bottom, vec2f(0.0), end)),
    );
}

var<workgroup> mask: array<atomic<u32>, MASK_WORDS>;

// Marks the listed splats of a block per workgroup.
@compute @workgroup_size(BLOCK)
fn mark(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let block = group_index(group);
    if local < MASK_WORDS {
        atomicStore(&mask[local], 0u);
    }
    workgroupBarrier();
    if is_listed(block * BLOCK + local) {
        atomicOr(&mask[local / 32u], 1u << (local % 32u));
    }
    workgroupBarrier();
    if block >= arrayLength(&counts) {
        return;
    }
    if local < MASK_WORDS {
        masks[block * MASK_WORDS + local] = atomicLoad(&mask[local]);
    }
    if local == 0u {
        var count = 0u;
        for (var word = 0u; word < MASK_WORDS; word++) {
            count += countOneBits(atomicLoad(&mask[word]));
        }
        counts[block] = count;
    }
}

var<workgroup> sums: array<u32, BLOCK>;

// Prefix sums over the blocks by one workgroup, with a run of blocks per thread.
@compute @workgroup_size(BLOCK)
fn arrange(@builtin(local_invocation_index) local: u32) {
    let blocks = arrayLength(&counts);
    let run = (blocks + BLOCK - 1u) / BLOCK;
    let first = min(local * run, blocks);
    let last = min(first + run, blocks);
    var sum = 0u;
    for (var block = first; block < last; block++) {
        sum += counts[block];
    }
    sums[local] = sum;
    workgroupBarrier();
    var before = 0u;
    for (var thread = 0u; thread < local; thread++) {
        before += sums[thread];
    }
    for (var block = first; block < last; block++) {
        let count = counts[block];
        counts[block] = before;
        before += count;
    }
    if local == BLOCK - 1u {
        draws = Draw(VERTICES * before, 1u, 0u, 0u);
    }
}

// Writes the list, in splat order.
@compute @workgroup_size(BLOCK)
fn list(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let block = group_index(group);
    if block >= arrayLength(&counts) {
        return;
    }
    let word = local / 32u;
    let bits = masks[block * MASK_WORDS + word];
    let bit = 1u << (local % 32u);
    if (bits & bit) == 0u {
        return;
    }
    var rank = counts[block] + countOneBits(bits & (bit - 1u));
    for (var before = 0u; before < word; before++) {
        rank += countOneBits(masks[block * MASK_WORDS + before]);
    }
    listed[rank] = block * BLOCK + local;
}
