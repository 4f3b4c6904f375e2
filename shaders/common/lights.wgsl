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
    straight: u32,      // views along the light itself: 0 if the map's is one, 1, or the CUBE's faces
    map: u32,           // 1 if it has a caustic map
}

// A light's view, of which a part of the maps was made; of no texels where there is none.
struct LightView {
    right: vec3f,       // its axes
    half_width: f32,    // m for a sun, tangents for a point light
    up: vec3f,
    half_height: f32,
    back: vec3f,        // against the view
    far: f32,           // depth of a sun's far plane, m
    origin: vec3f,
    width: f32,         // texels
    corner: vec2u,      // where they begin in the maps
    height: f32,
    layer: u32,
}

const CUBE: u32 = 6u;
// The caustic map's view, then those along the light itself.
const VIEWS: u32 = 1u + CUBE;

const MAX_LIGHTS: u32 = 16u;
const MAX_LIGHT_VIEWS: u32 = 112u; // MAX_LIGHTS * VIEWS

// 0 as well where nothing is lit.
override LIGHTS: u32 = 0u;
// Whether any has views along the light itself beside its map's.
override STRAIGHT_VIEWS: bool = false;

@group(2) @binding(2) var<$branching> lights: array<Light, MAX_LIGHTS>;
@group(2) @binding(4) var caustic_maps: texture_2d_array<f32>;
@group(2) @binding(5) var caustic_receivers: texture_2d_array<f32>; // planes; disparity of the liquid's front
@group(2) @binding(6) var<$branching> light_views: array<LightView, MAX_LIGHT_VIEWS>;

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

// What a view tells of a point: the share of direct light that no liquid is in the way of, and the
// irradiance, over pi, that the map has.
struct Passed {
    dry: f32,
    by_map: vec3f,
}

// Irradiance, over pi, at x on a surface of normal n, of a light whose direct irradiance there is
// `direct`: what meets liquid comes by the map instead. Whether it meets liquid is told by a view along
// the light itself: that of the map may look along refracted light, and under bodies without walls.
fn light_with_liquid(index: u32, x: vec3f, n: vec3f, direct: vec3f) -> vec3f {
    let sun = lights[index].kind == SUN;
    if !STRAIGHT_VIEWS {
        let passed = passed_by_view(VIEWS * index, sun, x, n);
        return passed.dry * direct + passed.by_map;
    }
    let straight = lights[index].straight;
    var view = VIEWS * index + min(straight, 1u);
    if straight == CUBE {
        view += cube_face(x - lights[index].place);
    }
    var passed = passed_by_view(view, sun, x, n);
    if straight > 0u && lights[index].map == 1u {
        passed.by_map = passed_by_view(VIEWS * index, sun, x, n).by_map;
    }
    return passed.dry * direct + passed.by_map;
}

// The face of a cube that a direction points at: +x, -x, +y, -y, +z, -z.
fn cube_face(d: vec3f) -> u32 {
    let a = abs(d);
    let along = select(select(2u, 1u, a.y >= a.z), 0u, a.x >= max(a.y, a.z));
    let component = select(select(d.z, d.y, along == 1u), d.x, along == 0u);
    return 2u * along + select(0u, 1u, component < 0.0);
}

fn passed_by_view(index: u32, sun: bool, x: vec3f, n: vec3f) -> Passed {
    let light = light_views[index];
    let from_origin = x - light.origin;
    let view = vec3f(dot(from_origin, light.right), dot(from_origin, light.up), dot(from_origin, light.back));
    let half = vec2f(light.half_width, light.half_height);
    let size = vec2f(light.width, light.height);
    let across = select(view.xy / -view.z, view.xy, sun);
    let disparity = select(1.0 / -view.z, light.far + view.z, sun);
    let u = (vec2f(across.x, -across.y) / half * 0.5 + 0.5) * size;
    if !sun && view.z >= 0.0 || !all(u >= vec2f(0.0)) || !all(u < size) {
        return Passed(1.0, vec3f(0.0));
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
        let at = vec2i(light.corner) + vec2i(clamp(base + corner, vec2f(0.0), size - 1.0));
        let receiver = textureLoad(caustic_receivers, at, light.layer, 0);
        let share = mix(1.0 - f, f, corner);
        let w = max(share.x * share.y, 1e-6);
        dry += select(0.0, w, receiver.w <= disparity);
        let slope = 2.0 * half / size * abs(receiver.xy);
        let miss = abs(dot(receiver.xyz, omega) - disparity);
        if faces && miss <= SAME_RECEIVER * (texel + slope.x + slope.y) {
            sum += w * textureLoad(caustic_maps, at, light.layer, 0).rgb;
            weight += w;
        }
    }
    return Passed(min(dry, 1.0), sum / (max(weight, 1e-20) * 3.14159265));
}
