//! Counting sort by grid cell, shared by both grid-based neighbour searches.

/// Sorts items by their cell, stably.
///
/// `starts` receives the first sorted index of each of the `count` cells, and as a last entry the end of
/// the last cell; `order` receives the original index for each sorted index.
///
/// # Panics
/// If a cell is not below `count`.
pub fn by_cell(cells: &[u32], count: usize, starts: &mut Vec<u32>, order: &mut Vec<u32>) {
    starts.clear();
    starts.resize(count + 1, 0);
    for &cell in cells {
        starts[cell as usize] += 1;
    }
    let mut sum = 0;
    for start in starts.iter_mut() {
        sum += *start;
        *start = sum;
    }
    order.clear();
    order.resize(cells.len(), 0);
    for (i, &cell) in cells.iter().enumerate().rev() {
        let start = &mut starts[cell as usize];
        *start -= 1;
        order[*start as usize] = i as u32;
    }
}
