// The sums of spheres at pixels: in the air before everything else, and in the liquid behind its first surface.

// Each pixel has its spheres' optical depth, and optical depth times radiance.
// Units of the sums.
const DEPTH_UNITS: f32 = 16384.0;
const COLOR_UNITS: f32 = 2048.0;
// Transmittance that stands for none, and the least optical depth that does.
const OPAQUE_TRANSMITTANCE: f32 = 0.0024787522;
const OPAQUE_DEPTH: f32 = 5.99;
// A colour in 32 bits: nine for each channel, five for their common exponent.
const LEAST_EXPONENT: f32 = -15.0;

fn pack_color(color: vec3f) -> u32 {
    let largest = max(max(color.r, color.g), color.b);
    let exponent = clamp(ceil(log2(max(largest, 1e-9))), LEAST_EXPONENT, LEAST_EXPONENT + 31.0);
    let parts = vec3u(min(color * exp2(-exponent), vec3f(1.0)) * 511.0 + 0.5);
    return parts.r | (parts.g << 9u) | (parts.b << 18u) | (u32(exponent - LEAST_EXPONENT) << 27u);
}

fn unpack_color(bits: u32) -> vec3f {
    let parts = vec3f(vec3u(bits & 511u, (bits >> 9u) & 511u, (bits >> 18u) & 511u));
    return parts / 511.0 * exp2(f32(bits >> 27u) + LEAST_EXPONENT);
}

// Most radiance, in multiples of `white`.
const MOST_WHITE: f32 = 16.0;
