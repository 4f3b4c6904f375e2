// Lists of pixels that get further rays, apart from the pixels around them that do not: in one workgroup all would
// wait for those that have many.

struct PixelList {
    groups: atomic<u32>,    // size in x of the dispatch over the list, in groups of LIST_GROUP pixels
    count: atomic<u32>,
    looks: atomic<u32>,     // of the first ray of each pixel, with a host: terminated rays,
    fallbacks: atomic<u32>, // and those that the host's picture does not show
    pixels: array<u32>,     // x + 65536 y
}

@group(3) @binding(0) var<storage, read_write> listed: PixelList;

const LIST_GROUP: u32 = 64u;
// The largest dispatch that every adapter supports. Its threads take several pixels of a longer list.
const MOST_GROUPS: u32 = 65535u;

// Adds a pixel to the list, unless it is full.
fn is_deferred(p: vec2i) -> bool {
    let index = atomicAdd(&listed.count, 1u);
    if index >= arrayLength(&listed.pixels) {
        return false;
    }
    listed.pixels[index] = u32(p.x) | (u32(p.y) << 16u);
    if index % LIST_GROUP == 0u && index / LIST_GROUP < MOST_GROUPS {
        atomicAdd(&listed.groups, 1u);
    }
    return true;
}

// Pixels in the list.
fn listed_count() -> u32 {
    return min(atomicLoad(&listed.count), arrayLength(&listed.pixels));
}

// Threads of the dispatch over the list. `num_workgroups` is 0 in Direct3D 12 unless each indirect dispatch is checked.
fn listed_threads() -> u32 {
    return LIST_GROUP * min((listed_count() + LIST_GROUP - 1u) / LIST_GROUP, MOST_GROUPS);
}

fn listed_pixel(index: u32) -> vec2i {
    let packed = listed.pixels[index];
    return vec2i(vec2u(packed & 0xffffu, packed >> 16u));
}
