// Lights and caustic maps.
//
// A texel of a caustic map corresponds to the patch of a solid that the light's view shows there
// without the liquid. It holds the irradiance of light that passed through liquid (rgb, W/m²).

const SUN: u32 = 0u;
const POINT: u32 = 1u;

struct Light {
    place: vec3f,       // direction towards a sun, or position of a point light
    kind: u32,          // SUN or POINT
    power: vec3f,       // irradiance of a sun, or radiant intensity of a point light
    straight: u32,      // views along the unrefracted light: 0 if the map's view is one, 1 or CUBE
    map: u32,           // 1 if the light has a caustic map
}

// A light's view and its region of the maps; of width 0 if the view does not exist.
struct LightView {
    right: vec3f,       // x axis
    half_width: f32,    // m for a sun, tangents for a point light
    up: vec3f,          // y axis
    half_height: f32,
    back: vec3f,        // z axis, against the view direction
    far: f32,           // depth of a sun's far plane, m
    origin: vec3f,
    width: f32,         // texels
    corner: vec2u,      // first texel of the region
    height: f32,        // texels
    layer: u32,         // of the maps
}

// Cube faces around a point light in the liquid.
const CUBE: u32 = 6u;
// Views per light: that of the caustic map, then those along the unrefracted light.
const VIEWS: u32 = 1u + CUBE;

const MAX_LIGHTS: u32 = 16u;
const MAX_LIGHT_VIEWS: u32 = 112u; // MAX_LIGHTS * VIEWS

// Number of lights; 0 also if no solid is lit.
override LIGHTS: u32 = 0u;
// Whether any light has views along the unrefracted light besides its map's view.
override STRAIGHT_VIEWS: bool = false;

@group(2) @binding(2) var<$branching> lights: array<Light, MAX_LIGHTS>;
@group(2) @binding(4) var caustic_maps: texture_2d_array<f32>;
@group(2) @binding(5) var caustic_receivers: texture_2d_array<f32>; // plane; disparity of the liquid's front
@group(2) @binding(6) var<$branching> light_views: array<LightView, MAX_LIGHT_VIEWS>;

struct ToLight {
    direction: vec3f, // unit
    distance: f32,    // m; 1e30 for a sun
    distance2: f32,   // squared distance; 1 for a sun, so that one formula covers both
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

// Largest distance of a point from a texel's plane at which both are on one surface, as a share of
// a texel and of the receiver's slope across it.
const SAME_RECEIVER: f32 = 0.5;

// Lookup of a point in a light's view.
struct Passed {
    dry: f32,      // share of direct light that no liquid blocks
    by_map: vec3f, // irradiance of the map over pi
}

// Irradiance over pi at x on a surface of normal n, for a light whose direct irradiance over pi there
// is `direct`. The map replaces direct light that liquid blocks. Blocking is tested in a view along
// the unrefracted light: the map's view may look along refracted light, and below bodies without
// walls.
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

// Cube face that a direction points at: +x, -x, +y, -y, +z, -z.
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
    if (!sun && view.z >= 0.0) || !all(u >= vec2f(0.0)) || !all(u < size) {
        return Passed(1.0, vec3f(0.0));
    }
    let omega = vec3f(across, -1.0);
    let towards = select(-from_origin, light.back, sun);
    let faces = dot(n, towards) > 0.0;
    // Change of disparity over a depth difference of one texel side.
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
