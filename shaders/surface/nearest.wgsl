// Particle and fluid of the nearest front at each pixel.

#import splat.wgsl

struct Nearest {
    @location(0) tag: vec2u,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn nearest(in: Varying) -> Nearest {
    let chord = fragment_chord(in, fragment_omega(in));
    if !chord.hit {
        discard;
    }
    return Nearest(in.tag.xy, fragment_depth(in, max(chord.middle - chord.half_length, in.range.x)));
}
