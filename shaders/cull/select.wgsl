// Selects potentially visible splats, in order: at equal depths the first one drawn wins, so the order
// affects the picture.
//
// Splats off the screen are invisible. Splats surrounded by liquid are potentially visible if a tile
// that they touch has a front behind them or a back in front of them: N. Greene, M. Kass and G. Miller,
// Hierarchical Z-Buffer Visibility (1993), with a single level for splats of a few pixels.

#import splat.wgsl
#import common/tiles.wgsl

const BLOCK: u32 = 256u;
const WORDS: u32 = BLOCK / 32u;

struct Draw {
    vertices: u32,
    instances: u32,
    first_vertex: u32,
    first_instance: u32,
}

@group(2) @binding(0) var<storage, read> depths: array<vec2f>;
// One bit per splat.
@group(2) @binding(1) var<storage, read_write> masks: array<u32>;
// Visible splats per block; after `arrange`, in all preceding blocks.
@group(2) @binding(2) var<storage, read_write> counts: array<u32>;
@group(2) @binding(3) var<storage, read_write> visible: array<u32>;
@group(2) @binding(4) var<storage, read_write> draws: Draw;

// Whether the splats surrounded by liquid are tested, or all others.
override SURROUNDED: bool = false;

fn may_show(index: u32) -> bool {
    if index >= arrayLength(&splats) {
        return false;
    }
    let splat = splats[index];
    if ((splat.tags & BURIED) != 0u) != SURROUNDED {
        return false;
    }
    let placed = splat_in_view(splat);
    let low = splat_corner(0u, placed.centre, placed.rows);
    let high = splat_corner(3u, placed.centre, placed.rows);
    if any(low > vec2f(1.0)) || any(high < vec2f(-1.0)) {
        return false;
    }
    return !SURROUNDED || !is_hidden(placed, low, high);
}

// Splats that touch more tiles are drawn without a test.
const MOST_TILES: u32 = 64u;

fn is_hidden(placed: Placed, low: vec2f, high: vec2f) -> bool {
    let size = vec2u(camera.size);
    let left_top = vec2f(low.x, -high.y) * 0.5 + 0.5;
    let right_bottom = vec2f(high.x, -low.y) * 0.5 + 0.5;
    let end = camera.size - 1.0;
    let first = vec2u(clamp(left_top * camera.size, vec2f(0.0), end)) / TILE;
    let last = vec2u(clamp(right_bottom * camera.size, vec2f(0.0), end)) / TILE;
    let tiles = last - first + 1u;
    if tiles.x * tiles.y > MOST_TILES {
        return false;
    }
    let half_depth = length(placed.rows[2]);
    let middle = -placed.centre.z;
    // Covers rounding errors, in an orthographic view also those of the depth buffer.
    let margin = depth_margin(middle, half_depth) + select(0.0, 1e-6 * camera.far, ORTHOGRAPHIC);
    let nearest = middle - half_depth - margin;
    let farthest = middle + half_depth + margin;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let between = depths[y * tiles_across(size.x) + x];
            if nearest <= between.x || farthest >= between.y {
                return false;
            }
        }
    }
    return true;
}

var<workgroup> mask: array<atomic<u32>, WORDS>;

// Marks the visible splats of a block per workgroup.
@compute @workgroup_size(BLOCK)
fn mark(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let block = group_index(group);
    if local < WORDS {
        atomicStore(&mask[local], 0u);
    }
    workgroupBarrier();
    if may_show(block * BLOCK + local) {
        atomicOr(&mask[local / 32u], 1u << (local % 32u));
    }
    workgroupBarrier();
    if block >= arrayLength(&counts) {
        return;
    }
    if local < WORDS {
        masks[block * WORDS + local] = atomicLoad(&mask[local]);
    }
    if local == 0u {
        var count = 0u;
        for (var word = 0u; word < WORDS; word++) {
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
        draws = Draw(4u, before, 0u, 0u);
    }
}

// Writes the list of visible splats, in splat order.
@compute @workgroup_size(BLOCK)
fn list(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let block = group_index(group);
    if block >= arrayLength(&counts) {
        return;
    }
    let word = local / 32u;
    let bits = masks[block * WORDS + word];
    let bit = 1u << (local % 32u);
    if (bits & bit) == 0u {
        return;
    }
    var rank = counts[block] + countOneBits(bits & (bit - 1u));
    for (var before = 0u; before < word; before++) {
        rank += countOneBits(masks[block * WORDS + before]);
    }
    visible[rank] = block * BLOCK + local;
}
