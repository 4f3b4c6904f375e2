// Marks the bins of depth that liquid touches along a cell's ray.

#import splat.wgsl
#import gaps/cells.wgsl
#import gaps/swollen.wgsl

@group(3) @binding(0) var layers: $layers;
@group(3) @binding(1) var<storage, read_write> marks: array<atomic<u32>>;

fn mark_cell(cell: vec2u, centre: vec3f, to_sphere: mat3x3f) {
    let texel = min(cell_texel(cell), vec2u(camera.size) - 1u);
    let chord = splat_chord(centre, to_sphere, camera_omega(vec2f(texel) + 0.5), camera.near);
    if !chord.hit {
        return;
    }
    let first = textureLoad(layers, texel, FRONT$level).w;
    let last = textureLoad(layers, texel, BACK$level).w;
    if first <= 0.0 || last <= first {
        return;
    }
    let per_metre = f32(BINS) / (last - first);
    let low = (chord.middle - chord.half_length - first) * per_metre;
    let high = (chord.middle + chord.half_length - first) * per_metre;
    if high < 0.0 || low >= f32(BINS) {
        return;
    }
    let low_bin = u32(max(low, 0.0));
    let high_bin = u32(min(high, f32(BINS) - 1.0));
    let at = (cell.y * cells_across(u32(camera.size.x)) + cell.x) * WORDS;
    for (var word = 0u; word < WORDS; word++) {
        let bits = bits_up_to(high_bin + 1u, word) & ~bits_up_to(low_bin, word);
        // A load is cheaper where many splats overlap, as particles with too large a radius do.
        if (atomicLoad(&marks[at + word]) & bits) != bits {
            atomicOr(&marks[at + word], bits);
        }
    }
}

// The bits of a word that stand for bins before `end`.
fn bits_up_to(end: u32, word: u32) -> u32 {
    let bits = clamp(i32(end) - i32(32u * word), 0, 32);
    return select((1u << u32(bits & 31)) - 1u, 0xffffffffu, bits == 32);
}
