// The grain of graphics cards: a thread draws one pixel, and a workgroup reads a tile's list together.

alias Real = f32;
alias Index = u32;
alias Truth = bool;

// Pixels of a thread, one below the other, and values in which they are held.
const ROWS: u32 = 1u;
const PARTS: u32 = 1u;
// Whether lists are read through workgroup memory.
const STAGED: bool = true;

// `camera_omega(u).y` of a part's pixels, from `u` downwards.
fn rows_below(u: vec2f) -> Real {
    return camera_omega(u).y;
}

fn real_at(value: Real, row: u32) -> f32 {
    return value;
}

fn index_at(value: Index, row: u32) -> u32 {
    return value;
}

fn truth_at(value: Truth, row: u32) -> bool {
    return value;
}

// One value for each row of a part.
fn each_real(a: f32, b: f32, c: f32, d: f32) -> Real {
    return a;
}
