//! Sketches of many particles by some of them.

/// The reciprocal of the golden ratio: its multiples fill an interval evenly, whatever the order in it.
const STEP: f64 = 0.618_033_988_749_894_8;

/// At most `most` indices of `count` particles, spread evenly but not regularly: files often list lattices.
pub(crate) fn spread(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let all = count <= most;
    (0..count.min(most)).map(move |k| match all {
        true => k,
        false => ((k as f64 * STEP).fract() * count as f64) as usize,
    })
}

/// The factor of radii by which some of `count` particles cover as much as all.
pub(crate) fn enlarged(count: usize, most: usize) -> f32 {
    (count as f32 / most as f32).cbrt().max(1.0)
}
