// Selects the splats that may be the side of a gap.

#import splat_lists.wgsl
#import gaps/cells.wgsl
#import gaps/swollen.wgsl

// Of each tile the least and the greatest depth of a split: of aggregates, then of splashes; 0 without any.
@group(3) @binding(0) var gap_tiles: texture_2d<f32>;

override CLASS: u32 = 0u;   // aggregates, splashes

// Splats that touch more tiles are drawn without a test.
const MOST_TILES: u32 = 64u;

// Whether any tile that a splat touches has a gap of which it may be the side.
fn is_listed(index: u32) -> bool {
    if index >= arrayLength(&splats) {
        return false;
    }
    let placed = splat_in_view(swollen(splats[index]));
    let bounds = pixel_bounds(placed);
    if !bounds.seen {
        return false;
    }
    let first = bounds.first / TILE;
    let last = bounds.last / TILE;
    let tiles = last - first + 1u;
    if tiles.x * tiles.y > MOST_TILES {
        return true;
    }
    let half_depth = length(placed.rows[2]);
    let nearest = -placed.centre.z - half_depth;
    let farthest = -placed.centre.z + half_depth;
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let splits = textureLoad(gap_tiles, vec2u(x, y), 0);
            let of_class = select(splits.xy, splits.zw, CLASS == 1u);
            let is_side = select(farthest >= of_class.x, nearest <= of_class.y, SIDE == BACK);
            if of_class.y > 0.0 && is_side {
                return true;
            }
        }
    }
    return false;
}
