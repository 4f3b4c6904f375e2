//! `gaps/runs.wgsl`: the gaps in the bins of a ray.

use crate::support::{Kernel, Random, gpu};

/// The middles of the first two runs of empty bins that end before a marked one and are `least` m long, one bin after the
/// other.
fn splits(marked: u64, first: f32, last: f32, least: f32) -> [f32; 2] {
    let bin_length = (last - first) / 64.0;
    let is_marked = |bin: u32| marked >> bin & 1 == 1;
    let mut splits = Vec::new();
    let mut bin = 0;
    while bin < 64 && splits.len() < 2 {
        let start = bin;
        while bin < 64 && !is_marked(bin) {
            bin += 1;
        }
        if bin < 64 && bin > start && (bin - start) as f32 * bin_length >= least {
            splits.push(first + 0.5 * (start + bin) as f32 * bin_length);
        }
        while bin < 64 && is_marked(bin) {
            bin += 1;
        }
    }
    splits.resize(2, 0.0);
    [splits[0], splits[1]]
}

/// Operations on words find the runs that a walk over the bins finds, of any length and number, for bins that are shorter
/// and longer than a gap, and none without liquid.
#[test]
fn gaps_are_runs_of_empty_bins() {
    let Some(gpu) = gpu() else { return };
    let kernel = Kernel {
        imports: &["gaps/runs.wgsl"],
        body: "fn test(x: array<f32, 7>) -> array<f32, 2> {
            // Halves of words: floats are integers up to 2^24.
            let marked = vec2u(u32(x[0]) | u32(x[1]) << 16u, u32(x[2]) | u32(x[3]) << 16u);
            let splits = splits_of(marked, x[4], x[5], x[6]);
            return array(splits.x, splits.y);
        }",
        constants: &[("GAPS", 2.0)],
        resources: &[],
    };
    let mut random = Random(23);
    let mut cases = vec![(0, 0.0, 0.0, 1.0), (u64::MAX, 1.0, 2.0, 0.01), (1 << 63, 1.0, 2.0, 0.5)];
    for i in 0..20_000 {
        let mut word = || (random.unit() * 4_294_967_296.0) as u64;
        // Of half, an eighth, and 7 of 8 bits; and with long runs.
        let [a, b, c] = [(); 3].map(|()| word() | word() << 32);
        let marked = match i % 4 {
            0 => a,
            1 => a & b & c,
            2 => a | b | c,
            _ => (a & b & c) & !(u64::MAX >> (a % 64) << (b % 64)),
        };
        let first = random.magnitude(0.1, 10.0);
        let last = first + random.magnitude(1e-3, 100.0);
        // Exact multiples of a bin, too, where the quotient is an integer or next to one.
        let bins =
            if i % 2 == 0 { (random.unit() * 40.0).floor() } else { random.magnitude(0.1, 80.0) };
        let (first, last) = (first as f32, last as f32);
        let least = (bins as f32 * ((last - first) / 64.0)).max(1e-6);
        cases.push((marked, first, last, least));
    }
    let inputs: Vec<[f32; 7]> = cases
        .iter()
        .map(|&(marked, first, last, least)| {
            let [a, b, c, d] = [0, 16, 32, 48].map(|by| (marked >> by & 0xffff) as f32);
            [a, b, c, d, first, last, least]
        })
        .collect();
    let results: Vec<[f32; 2]> = kernel.run(gpu, &inputs);
    let mut found = [0; 3];
    for (&(marked, first, last, least), result) in cases.iter().zip(results) {
        let expected = splits(marked, first, last, least);
        let close = |i: usize| (result[i] - expected[i]).abs() <= 1e-6 * last;
        assert!(
            close(0) && close(1),
            "{marked:#066b}, {first} to {last}, {least}: {result:?}, not {expected:?}"
        );
        found[expected.iter().filter(|split| **split > 0.0).count()] += 1;
    }
    assert!(found.iter().all(|&count| count > 1000), "{found:?}");
}
