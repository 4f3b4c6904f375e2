// Colours in the bits of an integer.

// RGB of a common exponent: EXT_texture_shared_exponent, without its rounding upwards.
fn packed_rgb(color: vec3f) -> u32 {
    let clamped = clamp(color, vec3f(0.0), vec3f(65408.0));
    let most = max(max(clamped.x, clamped.y), max(clamped.z, 1e-9));
    let exponent = clamp(i32(floor(log2(most))) + 16, 0, 31);
    let mantissas = min(vec3u(clamped * exp2(f32(24 - exponent)) + 0.5), vec3u(511u));
    return mantissas.x | (mantissas.y << 9u) | (mantissas.z << 18u) | (u32(exponent) << 27u);
}

fn unpacked_rgb(bits: u32) -> vec3f {
    let mantissas = vec3f(vec3u(bits, bits >> 9u, bits >> 18u) & vec3u(511u));
    return mantissas * exp2(f32(bits >> 27u) - 24.0);
}
