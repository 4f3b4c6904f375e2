// Light that level turbid slabs scatter: the table of `src/passes/turbid/slab.rs`.
//
// A file that imports this one declares
//     var slab_table: texture_2d<f32>
// and defines `params.ior`.

const THICKNESSES: u32 = 27u;   // optical thicknesses, half octaves from THINNEST
const COSINES: u32 = 8u;        // directions inside, from the critical angle to the normal
const ALBEDOS: u32 = 16u;       // even steps of the root of 1 - albedo
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
    var sum = vec4f(0.0);
    for (var k = 0u; k < 4u; k++) {
        let y = row + (k & 1u) + (k >> 1u) * COSINES;
        let weight = select(1.0 - f.y, f.y, (k & 1u) == 1u) * select(1.0 - f.z, f.z, k >= 2u);
        let thinner = textureLoad(slab_table, vec2u(base.x, y), 0);
        let thicker = textureLoad(slab_table, vec2u(base.x + 1u, y), 0);
        sum += weight * mix(thinner, thicker, f.x);
    }
    return sum;
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
