// Places of the rays in a pixel.

// Offset of sample `index` of `count` in the pixel: for square counts a regular grid, sheared so that no
// two samples share a row or a column; otherwise the R2 sequence.
fn sample_offset(index: u32, count: u32) -> vec2f {
    let side = u32(sqrt(f32(count)) + 0.5);
    if side * side != count {
        return fract(0.5 + f32(index) * vec2f(0.75487767, 0.56984029));
    }
    let cell = vec2f(f32(index % side), f32(index / side));
    let within = (vec2f(f32(side) - 1.0 - cell.y, cell.x) + 0.5) / f32(side);
    return (cell + within) / f32(side);
}

// Offset of sample `index`, from 1, of `count` that surround the pixel's centre, where the first one is: a sunflower's
// spiral (H. Vogel, A Better Way to Construct the Sunflower Head, 1979) of the pixel's area.
fn further_offset(index: u32, count: u32) -> vec2f {
    let angle = 2.3999632 * f32(index);
    let radius = sqrt((f32(index) + 0.5) / (3.14159265 * f32(count)));
    return 0.5 + radius * vec2f(cos(angle), sin(angle));
}
