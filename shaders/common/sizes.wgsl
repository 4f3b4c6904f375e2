// Particles' sizes in planes and normals.
//
// Where radii differ, the lowest bits of a splat's plane hold its particle's size: four times the binary logarithm of
// the radius, modulo 64. They change a component by 3 units in the last place at most.
fn particle_size_of(radius: f32) -> u32 {
    return u32(i32(round(4.0 * log2(radius)))) & 63u;
}

fn with_particle_size(v: vec3f, size: u32) -> vec3f {
    // Devices may lose the bits of numbers too small for their exponent.
    let kept = select(v, vec3f(1e-30), abs(v) < vec3f(1e-30));
    let bits = (vec3u(size) >> vec3u(0u, 2u, 4u)) & vec3u(3u);
    return bitcast<vec3f>((bitcast<vec3u>(kept) & vec3u(0xfffffffcu)) | bits);
}

fn particle_size(v: vec3f) -> u32 {
    let bits = (bitcast<vec3u>(v) & vec3u(3u)) << vec3u(0u, 2u, 4u);
    return bits.x | bits.y | bits.z;
}

// Radius of a size relative to another radius, to a fifth between 2^-8 and 2^8, and exactly 1 for that radius.
fn relative_size(size: u32, radius: f32) -> f32 {
    let steps = i32((size - particle_size_of(radius) + 32u) & 63u) - 32;
    return exp2(0.25 * f32(steps));
}
