// Marks the cells of small splats, and lists the others.

#import splat_lists.wgsl
#import gaps/mark.wgsl

// Splats that touch more cells are drawn.
const MOST_CELLS: u32 = 64u;

// Whether a splat is to be drawn; others are marked.
fn is_listed(index: u32) -> bool {
    if index >= arrayLength(&splats) {
        return false;
    }
    let splat = swollen(splats[index]);
    let placed = splat_in_view(splat);
    let low = splat_corner(0u, placed.centre, placed.rows);
    let high = splat_corner(3u, placed.centre, placed.rows);
    if any(low > vec2f(1.0)) || any(high < vec2f(-1.0)) {
        return false;
    }
    let end = camera.size - 1.0;
    let left_top = (vec2f(low.x, -high.y) * 0.5 + 0.5) * camera.size;
    let right_bottom = (vec2f(high.x, -low.y) * 0.5 + 0.5) * camera.size;
    let first = vec2u(clamp(left_top, vec2f(0.0), end)) / CELL;
    let last = vec2u(clamp(right_bottom, vec2f(0.0), end)) / CELL;
    let cells = last - first + 1u;
    if cells.x * cells.y > MOST_CELLS {
        return true;
    }
    let to_sphere = splat_to_sphere(splat);
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            mark_cell(vec2u(x, y), placed.centre, to_sphere);
        }
    }
    return false;
}
