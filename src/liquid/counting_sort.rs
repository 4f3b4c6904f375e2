//! What both neighbour searches by a uniform grid rest on.

/// Sorts things by the cell that each is in; the order within a cell is kept.
///
/// `starts` gets where the things of each of `count` cells begin in the new order, and one more,
/// where the last cell's end; `order` gets for each place in the new order the one in the old.
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
