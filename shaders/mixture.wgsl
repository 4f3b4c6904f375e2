// What the liquid at each pixel is mixed of: the lengths of all splats along the pixel's ray, and
// their absorption times length, added up. Their quotient is the mean absorption along the ray.

#import splat.wgsl

const MAX_FLUIDS: u32 = 16u;

// Of each fluid, as shares of the largest component of all; and 1 over the particle radius, 1/m.
@group(2) @binding(0) var<uniform> absorptions: array<vec4f, MAX_FLUIDS>;

@fragment
fn mixture(in: Varying) -> @location(0) vec4f {
    let chord = splat_chord(in.centre, varying_to_sphere(in), camera_omega(in.clip.xy));
    if !chord.hit {
        discard;
    }
    // In depth, which is as good as length along one ray, and in particle radii: numbers that half
    // floats hold whatever the scene's scale.
    let fluid = absorptions[in.fluid];
    let length = chord.half_length * fluid.w;
    return vec4f(fluid.rgb * length, length);
}
