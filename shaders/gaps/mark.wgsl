// Marks the bins of depth that liquid touches.

#import splat.wgsl
#import gaps/cells.wgsl
#import gaps/swollen.wgsl

@group(2) @binding(0) var layers: texture_2d_array<f32>;
@group(2) @binding(1) var<storage, read_write> marks: array<atomic<u32>>;

@vertex
fn vertex_cells(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> Varying {
    var out = splat_varying(corner, swollen(splats[instance]));
    // The middle of a cell's texel is half a texel from the middle of the cell.
    let sign = vec2f(f32(corner & 1u), f32(corner >> 1u)) * 2.0 - 1.0;
    out.clip = vec4f(out.clip.xy + sign / camera.size, 0.5, 1.0);
    return out;
}

@fragment
fn mark(in: Varying) {
    let cell = vec2u(in.clip.xy);
    let texel = min(cell_texel(cell), vec2u(camera.size) - 1u);
    let first = textureLoad(layers, texel, FRONT, 0).w;
    let last = textureLoad(layers, texel, BACK, 0).w;
    let chord = splat_chord(in.centre, varying_to_sphere(in), camera_omega(vec2f(texel) + 0.5));
    if !chord.hit || first <= 0.0 || last <= first {
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
        if bits != 0u {
            atomicOr(&marks[at + word], bits);
        }
    }
}

// The bits of a word that stand for bins before `end`.
fn bits_up_to(end: u32, word: u32) -> u32 {
    let bits = clamp(i32(end) - i32(32u * word), 0, 32);
    return select((1u << u32(bits & 31)) - 1u, 0xffffffffu, bits == 32);
}
