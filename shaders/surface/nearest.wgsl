// Particle and fluid of the nearest front at each pixel.

#import splat.wgsl

struct Nearest {
    @location(0) tag: vec2u,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn nearest(in: Varying) -> Nearest {
    let chord = splat_chord(in.centre, varying_to_sphere(in), camera_omega(in.clip.xy));
    if !chord.hit {
        discard;
    }
    return Nearest(in.tag.xy, depth_at(max(chord.middle - chord.half_length, camera.near)));
}
