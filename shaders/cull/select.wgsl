// Selects potentially visible splats.
//
// Splats off the screen are invisible. Splats surrounded by liquid are potentially visible if a tile
// that they touch has a front behind them or a back in front of them: N. Greene, M. Kass and G. Miller,
// Hierarchical Z-Buffer Visibility (1993), with a single level for splats of a few pixels.

#import splat_lists.wgsl
#import common/tiles.wgsl

@group(3) @binding(0) var<storage, read> depths: array<vec2f>;

// Whether the splats surrounded by liquid are tested, or all others.
override SURROUNDED: bool = false;

fn is_listed(index: u32) -> bool {
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
