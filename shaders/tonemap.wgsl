// Tone mapping: exposure, an optional curve, and the sRGB transfer function (IEC 61966-2-1).

@group(0) @binding(0) var radiance: texture_2d<f32>;
@group(0) @binding(1) var<$branching> tonemap: Params;

struct Params {
    gain: f32,   // 2^exposure
    curve: u32,  // 0: none, 1: filmic
    encode: u32, // 0: linear, or the target encodes sRGB itself; 1: encode here
    bounded: u32, // 1: the target holds 0 to 1
    dither: f32,  // width of the dither, a step of the encoded target; 0 for none
    first_row: u32, // of `picture`
}

// A band of the picture in memory: red in the lowest byte, rows from the top.
@group(1) @binding(0) var<storage, read_write> picture: array<u32>;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    // A single triangle that covers the screen.
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
    return mapped(vec2u(position.xy));
}

// Rounds to nearest here: adapters round differently where they store.
@compute @workgroup_size(8, 8)
fn bytes(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(radiance);
    let texel = id.y * size.x + id.x;
    if id.x >= size.x || texel >= arrayLength(&picture) {
        return;
    }
    let mapped = mapped(vec2u(id.x, id.y + tonemap.first_row));
    let rounded = vec4u(255.0 * clamp(mapped, vec4f(0.0), vec4f(1.0)) + 0.5);
    picture[texel] = rounded.x | (rounded.y << 8u) | (rounded.z << 16u) | (rounded.w << 24u);
}

// Colour and coverage of a pixel.
fn mapped(p: vec2u) -> vec4f {
    let texel = textureLoad(radiance, p, 0);
    // Of the covered part alone: curves are not linear, and pictures store colour apart from coverage.
    let covered = select(texel.a, 1.0, texel.a == 0.0);
    var c = max(texel.rgb / covered * tonemap.gain, vec3f(0.0));
    if tonemap.curve == 1u {
        // Bounded, because the curve squares it.
        c = filmic(min(c, vec3f(1e4)));
    }
    if tonemap.bounded == 1u {
        c = min(c, vec3f(1.0));
    }
    if tonemap.encode == 1u {
        c = select(1.055 * pow(c, vec3f(1.0 / 2.4)) - 0.055, 12.92 * c, c <= vec3f(0.0031308));
        c += vec3f(tonemap.dither * (gradient_noise(vec2f(p) + 0.5) - 0.5));
    }
    return vec4f(c, texel.a);
}

// Interleaved gradient noise, 0 to 1: any 3×3 pixels have values far apart (J. Jimenez, Next Generation Post Processing in
// Call of Duty: Advanced Warfare, 2014).
fn gradient_noise(p: vec2f) -> f32 {
    return fract(52.9829189 * fract(dot(p, vec2f(0.06711056, 0.00583715))));
}

// A rational fit of the ACES reference curve (Narkowicz 2015).
fn filmic(c: vec3f) -> vec3f {
    return c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14);
}
