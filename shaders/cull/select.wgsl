// Selects potentially visible splats.
//
// Splats off the screen are invisible. Splats surrounded by liquid are potentially visible if a tile
// that they touch has a front behind them or a back in front of them: N. Greene, M. Kass and G. Miller,
// Hierarchical Z-Buffer Visibility (1993), with two levels: on a surface seen at a slant, the depths of
// a tile are far apart.

#import splat_lists.wgsl
#import common/tiles.wgsl
#import cull/quads.wgsl

// Of tiles, then of quads.
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

// Splats that touch more tiles are drawn without a test, and with more quads than that by their tiles' alone.
const MOST: u32 = 64u;

fn is_hidden(placed: Placed, bounds: PixelBounds) -> bool {
    let half_depth = length(placed.rows[2]);
    let middle = -placed.centre.z;
    // Covers rounding errors, in an orthographic view also those of the depth buffer.
    let margin = depth_margin(middle, half_depth) + select(0.0, 1e-6 * camera.far, ORTHOGRAPHIC);
    let reach = half_depth + margin;
    let range = vec2f(middle - reach, middle + reach);
    let size = vec2u(camera.size);
    let across = tiles_across(size.x);

    var first = bounds.first / TILE;
    var count = bounds.last / TILE - first + 1u;
    if count.x * count.y > MOST {
        return false;
    }
    var hidden = true;
    for (var i = 0u; i < count.x * count.y && hidden; i++) {
        let tile = first + vec2u(i % count.x, i / count.x);
        hidden = is_between(range, depths[tile.y * across + tile.x]);
    }
    first = bounds.first / QUAD;
    count = bounds.last / QUAD - first + 1u;
    if hidden || count.x * count.y > MOST {
        return hidden;
    }
    hidden = true;
    for (var i = 0u; i < count.x * count.y && hidden; i++) {
        hidden = is_between(range, depths[quad_index(first + vec2u(i % count.x, i / count.x), size)]);
    }
    return hidden;
}

// Whether a splat between two depths is hidden where the layers are.
fn is_between(range: vec2f, layers: vec2f) -> bool {
    return range.x > layers.x && range.y < layers.y;
}
