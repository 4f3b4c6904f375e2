// Light that level turbid slabs scatter: the table of `src/passes/turbid/slab.rs`.
//
// A file that imports this one declares
//     var slab_table: texture_2d<f32>
// and defines `params.ior`.

const THICKNESSES: u32 = 27u;   // optical thicknesses, half octaves from THINNEST
const COSINES: u32 = 8u;        // directions inside, from the critical angle to the normal
const ALBEDOS: u32 = 32u;       // even steps of the root of 1 - albedo
const THINNEST: f32 = 0.015625;

// Parts of the table: all scattered light, and that which is scattered more than once.
const SCATTERED: u32 = 0u;
const SCATTERED_AGAIN: u32 = 1u;

// The radiance that scattering adds along a ray, by the light on the sides at which it enters and leaves the slab, as a share
// of what that would add from everywhere: of a slab with air on both sides, and with a wet solid on the far side.
fn slab_scattered(part: u32, thickness: f32, cosine: f32, albedo: f32) -> vec4f {
    let critical = sqrt(max(1.0 - 1.0 / (params.ior * params.ior), 0.0));
    let last = vec3f(vec3u(THICKNESSES, COSINES, ALBEDOS) - 1u);
    let place = vec3f(
        2.0 * log2(max(thickness, THINNEST) / THINNEST),
        (cosine - critical) / (1.0 - critical) * last.y,
        sqrt(clamp(1.0 - albedo, 0.0, 1.0)) * last.z,
    );
    let at = clamp(place, vec3f(0.0), last - 1e-3);
    let base = vec3u(at);
    let f = at - vec3f(base);
    let row = (part * ALBEDOS + base.z) * COSINES + base.y;
    var thinner = vec4f(0.0);
    var thicker = vec4f(0.0);
    for (var k = 0u; k < 4u; k++) {
        let y = row + (k & 1u) + (k >> 1u) * COSINES;
        let weight = select(1.0 - f.y, f.y, (k & 1u) == 1u) * select(1.0 - f.z, f.z, k >= 2u);
        thinner += weight * textureLoad(slab_table, vec2u(base.x, y), 0);
        thicker += weight * textureLoad(slab_table, vec2u(base.x + 1u, y), 0);
    }
    // Light from the far side falls off exponentially. Both sides together are even, and 1 without absorption.
    let start = THINNEST * exp2(0.5 * f32(base.x));
    let share = clamp((thickness / start - 1.0) / (sqrt(2.0) - 1.0), 0.0, 1.0);
    let least = vec2f(1e-20);
    let far = exp2(mix(log2(max(thinner.yw, least)), log2(max(thicker.yw, least)), share));
    let near = mix(thinner.xz + thinner.yw, thicker.xz + thicker.yw, f.x) - far;
    return vec4f(near.x, far.x, near.y, far.y);
}

// The same for red, green and blue light, by the light on the side where the ray enters.
struct SlabLight {
    near: vec3f,     // share of light from the side where the ray enters
    far: vec3f,      // and from the other one
    near_wet: vec3f, // the same with a wet solid on the far side
    far_wet: vec3f,
}

fn slab_light(part: u32, thickness: vec3f, cosine: f32, albedo: vec3f) -> SlabLight {
    var light: SlabLight;
    for (var c = 0; c < 3; c++) {
        let shares = slab_scattered(part, thickness[c], cosine, albedo[c]);
        light.near[c] = shares.x;
        light.far[c] = shares.y;
        light.near_wet[c] = shares.z;
        light.far_wet[c] = shares.w;
    }
    return light;
}
