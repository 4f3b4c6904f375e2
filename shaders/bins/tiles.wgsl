// The tiles that a splat touches.

#import bins/params.wgsl
#import common/groups.wgsl
#import common/tiles.wgsl

// First and last tile of a splat's rectangle, x + 65536 y, and of its swollen rectangle; of nothing, 1 and 0.
const NOTHING: vec2u = vec2u(1u, 0u);

// Splats with more tiles for each of their threads than this are walked by workgroups.
const MOST: u32 = 32u;
const THREADS: u32 = 64u;

struct Rect {
    first: vec2u,
    size: vec2u,
}

fn rect_of(packed: vec2u) -> Rect {
    let first = vec2u(packed.x & 0xffffu, packed.x >> 16u);
    let last = vec2u(packed.y & 0xffffu, packed.y >> 16u);
    if any(first > last) {
        return Rect(vec2u(0u), vec2u(0u));
    }
    return Rect(first, last - first + 1u);
}

fn rect_tile(rect: Rect, i: u32) -> vec2u {
    return rect.first + vec2u(i % rect.size.x, i / rect.size.x);
}

fn is_large(rect: Rect) -> bool {
    return rect.size.x * rect.size.y > MOST * params.lanes;
}

fn tile_index(tile: vec2u) -> u32 {
    return tile.y * params.tiles.x + tile.x;
}

// Index of a thread.
fn thread_index(group: vec3u, local: u32) -> u32 {
    return group_index(group) * THREADS + local;
}
