// Runs of empty bins between marked ones, by operations on the 64 bits of a cell.

#import gaps/cells.wgsl

override GAPS: u32 = 1u;

// Bits moved `by` < 64 places down.
fn moved_down(bits: vec2u, by: u32) -> vec2u {
    let rest = by % 32u;
    let within = vec2u(bits.x >> rest, bits.y >> rest);
    let low = within.x | select(0u, bits.y << (32u - max(rest, 1u)), rest > 0u);
    return select(vec2u(low, within.y), vec2u(within.y, 0u), by >= 32u);
}

// The bits from which `length` bits are set, up to BINS.
fn runs_of(bits: vec2u, length: u32) -> vec2u {
    var runs = bits;
    var found = 1u;
    for (var i = 0u; i < 6u; i++) {
        let more = min(found, length - found);
        runs &= moved_down(runs, more);
        found += more;
    }
    return runs;
}

// The bits of the bins from `first` on.
fn bits_from(bits: vec2u, first: u32) -> vec2u {
    let all = 0xffffffffu << (first % 32u);
    return bits & select(vec2u(all, 0xffffffffu), vec2u(0u, select(0u, all, first < BINS)), first >= 32u);
}

// The bin of the first bit; BINS if there is none.
fn first_bin(bits: vec2u) -> u32 {
    let high = select(BINS, 32u + firstTrailingBit(bits.y), bits.y != 0u);
    return select(high, firstTrailingBit(bits.x), bits.x != 0u);
}

// Depths of the middles of the first gaps, of a length of `least` or more, along a ray with liquid from `first` to `last`;
// 0 where there is none.
fn splits_of(marked: vec2u, first: f32, last: f32, least: f32) -> vec2f {
    let bin_length = max(last - first, 0.0) / f32(BINS);
    // The fewest bins that are as long as a gap: the quotient may round either way.
    var fewest = clamp(ceil(least / max(bin_length, 1e-30)), 1.0, f32(BINS) + 1.0);
    fewest -= select(0.0, 1.0, fewest > 1.0 && (fewest - 1.0) * bin_length >= least);
    fewest += select(0.0, 1.0, fewest * bin_length < least);
    var splits = vec2f(0.0);
    if fewest > f32(BINS) {
        return splits;
    }
    let gaps = runs_of(~marked, u32(fewest));
    var done = 0u;
    for (var i = 0u; i < GAPS; i++) {
        let start = first_bin(bits_from(gaps, done));
        let end = first_bin(bits_from(marked, start));
        if end >= BINS {
            break;
        }
        splits[i] = first + 0.5 * f32(start + end) * bin_length;
        done = end;
    }
    return splits;
}
