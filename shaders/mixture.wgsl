// Mixture of fluids at each pixel: sums over all splats of the chord length along the pixel's ray, and
// of absorption times length. Their quotient is the mean absorption along the ray.

#import splat.wgsl

const MAX_FLUIDS: u32 = 16u;

// Absorption of each fluid, relative to the largest component of all, and in w the inverse particle
// radius, 1/m.
@group(2) @binding(0) var<uniform> absorptions: array<vec4f, MAX_FLUIDS>;

@fragment
fn mixture(in: Varying) -> @location(0) vec4f {
    let chord = fragment_chord(in, fragment_omega(in));
    if !chord.hit {
        discard;
    }
    // Length in depth, which is proportional along a ray, and in particle radii, so that half floats
    // hold it at any scene scale.
    let fluid = absorptions[in.tag.y];
    let length = chord.half_length * fluid.w;
    return vec4f(fluid.rgb * length, length);
}
