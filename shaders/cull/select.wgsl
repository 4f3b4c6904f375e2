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
    let bounds = pixel_bounds(placed);
    return bounds.seen && (!SURROUNDED || !is_hidden(placed, bounds));
}

// Splats that touch more tiles are drawn without a test.
const MOST_TILES: u32 = 64u;

fn is_hidden(placed: Placed, bounds: PixelBounds) -> bool {
    let first = bounds.first / TILE;
    let last = bounds.last / TILE;
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
            let between = depths[y * tiles_across(u32(camera.size.x)) + x];
            if nearest <= between.x || farthest >= between.y {
                return false;
            }
        }
    }
    return true;
}
