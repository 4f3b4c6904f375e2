// Lights, and what the liquid lets through of them: the caustic maps.
//
// A texel of a map stands for the patch of a solid that the light's view shows there, the liquid
// left out. It holds the irradiance there by light that came through liquid (rgb, W/m²).

const SUN: u32 = 0u;
const POINT: u32 = 1u;

struct Light {
    place: vec3f,       // a sun's direction towards it, or a point light's position
    kind: u32,
    power: vec3f,       // a sun's irradiance, or a point light's radiant intensity
    map: u32,           // 1 if it has a map, seen by the view below
    right: vec3f,       // axes of the map's view
    half_width: f32,    // of the view: m for a sun, tangents for a point light
    up: vec3f,
    half_height: f32,
    back: vec3f,        // against the view
    far: f32,           // depth of a sun's far plane, m
    origin: vec3f,      // of the map's view
    width: f32,         // of the map, texels
    height: f32,
}

const MAX_LIGHTS: u32 = 16u;

// 0 as well where nothing is lit.
override LIGHTS: u32 = 0u;

@group(2) @binding(2) var<uniform> lights: array<Light, MAX_LIGHTS>;
@group(2) @binding(4) var caustic_maps: texture_2d_array<f32>;      // a layer for each light
@group(2) @binding(5) var caustic_receivers: texture_2d_array<f32>; // planes; disparity of the liquid's front

struct ToLight {
    direction: vec3f, // unit
    distance: f32,    // m; beyond everything for a sun
    distance2: f32,   // its square; 1 for a sun, so that one formula serves both
}

fn light_from(light: Light, x: vec3f) -> ToLight {
    let sun = light.kind == SUN;
    let to_light = light.place - x;
    let distance2 = max(dot(to_light, to_light), 1e-20);
    return ToLight(
        select(to_light * inverseSqrt(distance2), light.place, sun),
        select(sqrt(distance2), 1e30, sun),
        select(distance2, 1.0, sun),
    );
}

// Share of a texel, and of what the receiver's slope explains across it, by which a texel's plane
// may miss a point and still be of the same surface.
const SAME_RECEIVER: f32 = 0.5;

// Irradiance, over pi, at x on a surface of normal n, of a light whose direct irradiance there is
// `direct`: what meets liquid comes by the map instead.
fn light_with_liquid(index: u32, x: vec3f, n: vec3f, direct: vec3f) -> vec3f {
    let light = lights[index];
    let from_origin = x - light.origin;
    let view = vec3f(dot(from_origin, light.right), dot(from_origin, light.up), dot(from_origin, light.back));
    let half = vec2f(light.half_width, light.half_height);
    let size = vec2f(light.width, light.height);
    let sun = light.kind == SUN;
    let across = select(view.xy / -view.z, view.xy, sun);
    let disparity = select(1.0 / -view.z, light.far + view.z, sun);
    let u = (vec2f(across.x, -across.y) / half * 0.5 + 0.5) * size;
    // A light without a map has one of no texels.
    if !sun && view.z >= 0.0 || !all(u >= vec2f(0.0)) || !all(u < size) {
        return direct;
    }
    let omega = vec3f(across, -1.0);
    let towards = select(-from_origin, light.back, sun);
    let faces = dot(n, towards) > 0.0;
    // What stands for disparity changes so much over a texel of a receiver across the view.
    let texel = 2.0 * half.x / light.width * select(disparity, 1.0, sun);
    let base = floor(u - 0.5);
    let f = u - 0.5 - base;
    var sum = vec3f(0.0);
    var weight = 0.0;
    var dry = 0.0;
    for (var i = 0; i < 4; i++) {
        let corner = vec2f(f32(i & 1), f32(i >> 1u));
        let at = vec2i(clamp(base + corner, vec2f(0.0), size - 1.0));
        let receiver = textureLoad(caustic_receivers, at, index, 0);
        let share = mix(1.0 - f, f, corner);
        let w = max(share.x * share.y, 1e-6);
        dry += select(0.0, w, receiver.w <= disparity);
        let slope = 2.0 * half / size * abs(receiver.xy);
        let miss = abs(dot(receiver.xyz, omega) - disparity);
        if faces && miss <= SAME_RECEIVER * (texel + slope.x + slope.y) {
            sum += w * textureLoad(caustic_maps, at, index, 0).rgb;
            weight += w;
        }
    }
    return min(dry, 1.0) * direct + sum / (max(weight, 1e-20) * 3.14159265);
}
