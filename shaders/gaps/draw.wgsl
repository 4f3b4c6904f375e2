// Splats the two sides of a gap: the last back in front of the cell's split, and the first front behind
// it. A pixel whose liquid extends across the split has no gap.

#import splat.wgsl
#import gaps/cells.wgsl
#import gaps/swollen.wgsl

// The splats to draw.
@group(2) @binding(0) var<storage, read> listed: array<u32>;
@group(3) @binding(0) var splits: texture_2d<f32>;

override GAP: u32 = 0u; // which split

@vertex
fn vertex_gap(@builtin(vertex_index) vertex: u32) -> Varying {
    return splat_varying(vertex_corner(vertex), swollen(splats[listed[vertex / VERTICES]]));
}

@fragment
fn side(in: Varying) -> Fragment {
    let texel = vec2u(in.clip.xy);
    let split = textureLoad(splits, texel / CELL, 0)[GAP];
    let omega = fragment_omega(in);
    let chord = fragment_chord(in, omega);
    if !chord.hit || split <= 0.0 {
        discard;
    }
    if abs(chord.middle - split) <= chord.half_length {
        // Liquid across the split: wins the depth test against all sides, and is empty.
        return Fragment(vec4f(0.0), fragment_depth(in, split));
    }
    // The ellipsoid itself, in the space of the swollen one.
    let discriminant = 1.0 / (CLOSING * CLOSING) - dot(chord.f, chord.f);
    let half_length = sqrt(max(discriminant, 0.0)) / length(chord.d);
    let before = chord.middle < split;
    if discriminant < 0.0 || before != (SIDE == BACK) {
        discard;
    }
    let towards = select(-half_length, half_length, SIDE == BACK);
    let z = chord.middle + towards;
    if z < in.range.x {
        discard;
    }
    let pi = chord_plane(in, chord, omega, towards, z);
    return Fragment(vec4f(sized(pi, in), z), fragment_depth(in, z));
}
