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
    let bounds = pixel_bounds(placed);
    if !bounds.seen {
        return false;
    }
    let first = bounds.first / CELL;
    let last = bounds.last / CELL;
    let cells = last - first + 1u;
    if cells.x * cells.y > MOST_CELLS {
        return true;
    }
    let to_sphere = splat_to_sphere(splat);
    // One loop for rows and columns: splats of different widths share its turns.
    var cell = first;
    for (var i = 0u; i < cells.x * cells.y; i++) {
        mark_cell(cell, placed.centre, to_sphere);
        let ends_row = cell.x == last.x;
        cell = vec2u(select(cell.x + 1u, first.x, ends_row), select(cell.y, cell.y + 1u, ends_row));
    }
    return false;
}
