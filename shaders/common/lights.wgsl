// Lights and caustic maps.
//
// A texel of a caustic map corresponds to the patch of a solid that the light's view shows there
// without the liquid. It holds the irradiance of light that passed through liquid (rgb, W/m²).

#import common/light_grid.wgsl

const SUN: u32 = 0u;
const POINT: u32 = 1u;

struct Light {
    place: vec3f,       // direction towards a sun, or position of a point light
    kind: u32,          // SUN or POINT
    power: vec3f,       // irradiance of a sun, or radiant intensity of a point light
    straight: u32,      // views along the unrefracted light: 0 if the map's view is one, 1 or CUBE
    map: u32,           // 1 if the light has a caustic map
    spheres: u32,       // shape of its columns through foam, spray and bubbles
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

// No branch depends on these values alone, so they need no storage buffer (`Gpu::branching`), of which WebGPU's core allows a
// stage 8, and which software adapters read lane by lane.
struct LightViews {
    views: array<LightView, MAX_LIGHT_VIEWS>,
    grids: array<LightGrid, MAX_LIGHTS>,
}

// Number of lights; 0 also if no solid is lit.
override LIGHTS: u32 = 0u;
// Whether any light has views along the unrefracted light besides its map's view.
override STRAIGHT_VIEWS: bool = false;

@group(2) @binding(2) var<$branching> lights: array<Light, MAX_LIGHTS>;
@group(2) @binding(4) var caustic_maps: texture_2d_array<f32>;
@group(2) @binding(5) var caustic_receivers: texture_2d_array<f32>; // plane; disparity of the liquid's front
@group(2) @binding(6) var<uniform> light_views: LightViews;
// Optical depths from each light to the ends of the slices of its columns, as bits.
@group(2) @binding(9) var<storage, read> sphere_depths: array<u32>;

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

// Irradiance over pi at x on a surface of normal n, for a light whose direct irradiance over pi there
// is `direct`. The map replaces direct light that liquid blocks. Blocking is tested in a view along
// the unrefracted light: the map's view may look along refracted light, and below bodies without
// walls.
fn light_with_liquid(index: u32, x: vec3f, n: vec3f, direct: vec3f) -> vec3f {
    let sun = lights[index].kind == SUN;
    let map = VIEWS * index;
    let passed = passed_by_spheres(index, x, 0.0, vec3f(1.0)) * direct;
    if !STRAIGHT_VIEWS {
        return dry_share(map, sun, x) * passed + light_of_map(map, sun, x, n);
    }
    let straight = lights[index].straight;
    var view = map + min(straight, 1u);
    if straight == CUBE {
        view += cube_face(x - lights[index].place);
    }
    let with_light = select(view, map, lights[index].map == 1u);
    return dry_share(view, sun, x) * passed + light_of_map(with_light, sun, x, n);
}

// Cube face that a direction points at: +x, -x, +y, -y, +z, -z.
fn cube_face(d: vec3f) -> u32 {
    let a = abs(d);
    let along = select(select(2u, 1u, a.y >= a.z), 0u, a.x >= max(a.y, a.z));
    let component = select(select(d.z, d.y, along == 1u), d.x, along == 0u);
    return 2u * along + select(0u, 1u, component < 0.0);
}

// A point in a light's view, between four texels.
struct InView {
    inside: bool,
    omega: vec3f,
    disparity: f32,
    first: vec2f, // texel
    f: vec2f,     // share of the way to the last one
}

// Texels around a point of a view.
const AROUND: i32 = 4;

fn in_light_view(light: LightView, sun: bool, x: vec3f) -> InView {
    let from_origin = x - light.origin;
    let view = vec3f(dot(from_origin, light.right), dot(from_origin, light.up), dot(from_origin, light.back));
    let half = vec2f(light.half_width, light.half_height);
    let size = vec2f(light.width, light.height);
    let across = select(view.xy / -view.z, view.xy, sun);
    let disparity = select(1.0 / -view.z, light.far + view.z, sun);
    let u = (vec2f(across.x, -across.y) / half * 0.5 + 0.5) * size;
    let inside = (sun || view.z < 0.0) && all(u >= vec2f(0.0)) && all(u < size);
    let first = floor(u - 0.5);
    return InView(inside, vec3f(across, -1.0), disparity, first, u - 0.5 - first);
}

// One of the texels around a point of a light's view, in the maps, with its bilinear weight.
struct NearTexel {
    at: vec2i,
    weight: f32,
}

fn near_texel(light: LightView, point: InView, i: i32) -> NearTexel {
    let corner = vec2f(f32(i & 1), f32(i >> 1u));
    let inside = clamp(point.first + corner, vec2f(0.0), vec2f(light.width, light.height) - 1.0);
    let share = mix(1.0 - point.f, point.f, corner);
    return NearTexel(vec2i(light.corner) + vec2i(inside), max(share.x * share.y, 1e-6));
}

// Share of direct light at x that no liquid blocks in a view; 1 outside of it. Drivers skip a loop without rounds, where
// they would run through a branch.
fn dry_share(index: u32, sun: bool, x: vec3f) -> f32 {
    let light = light_views.views[index];
    let point = in_light_view(light, sun, x);
    var dry = 0.0;
    for (var i = 0; i < select(0, AROUND, point.inside); i++) {
        let texel = near_texel(light, point, i);
        let front = textureLoad(caustic_receivers, texel.at, light.layer, 0).w;
        dry += select(0.0, texel.weight, front <= point.disparity);
    }
    return select(1.0, min(dry, 1.0), point.inside);
}

// Whether no liquid blocks direct light at x in a view, by its texel.
fn is_dry(index: u32, sun: bool, x: vec3f) -> bool {
    let light = light_views.views[index];
    let point = in_light_view(light, sun, x);
    let at = clamp(round(point.first + point.f), vec2f(0.0), vec2f(light.width, light.height) - 1.0);
    let front = textureLoad(caustic_receivers, vec2i(light.corner) + vec2i(at), light.layer, 0).w;
    return !point.inside || front <= point.disparity;
}

// Irradiance over pi of a view's map at x on a surface of normal n: of the texels on the same surface.
fn light_of_map(index: u32, sun: bool, x: vec3f, n: vec3f) -> vec3f {
    let light = light_views.views[index];
    let point = in_light_view(light, sun, x);
    let faces = dot(n, select(light.origin - x, light.back, sun)) > 0.0;
    // Extent of a texel, and change of disparity over a depth difference of one side.
    let texel_size = 2.0 * vec2f(light.half_width, light.half_height) / vec2f(light.width, light.height);
    let side = texel_size.x * select(point.disparity, 1.0, sun);
    var sum = vec3f(0.0);
    var weight = 0.0;
    for (var i = 0; i < select(0, AROUND, point.inside && faces); i++) {
        let texel = near_texel(light, point, i);
        let receiver = textureLoad(caustic_receivers, texel.at, light.layer, 0).xyz;
        let slope = texel_size * abs(receiver.xy);
        let miss = abs(dot(receiver, point.omega) - point.disparity);
        if miss <= SAME_RECEIVER * (side + slope.x + slope.y) {
            sum += texel.weight * textureLoad(caustic_maps, texel.at, light.layer, 0).rgb;
            weight += texel.weight;
        }
    }
    return sum / (max(weight, 1e-20) * 3.14159265);
}

// Whether there are foam, spray or bubbles.
override SPHERES: bool = false;
// Share of a light that passes the spheres on its straight way to x, as far as `nearer` slices before it. `part` of their optical
// depth takes light away.
fn passed_by_spheres(index: u32, x: vec3f, nearer: f32, part: vec3f) -> vec3f {
    if !SPHERES || lights[index].spheres == NO_GRID {
        return vec3f(1.0);
    }
    let grid = light_views.grids[index];
    let at = in_light_grid(grid, lights[index].spheres, x);
    let slice = clamp(at.z * f32(LIGHT_SLICES) - nearer, 0.0, f32(LIGHT_SLICES));
    let inside = all(at.xy >= vec2f(0.0)) && all(at.xy <= vec2f(1.0)) && slice > 0.0;
    let column = at.xy * f32(grid.columns) - 0.5;
    let first = floor(column);
    let share = column - first;
    let end = min(u32(slice), LIGHT_SLICES - 1u);
    let before = max(end, 1u) - 1u;
    var passed = vec3f(0.0);
    for (var i = 0; i < select(0, 4, inside); i++) {
        let corner = vec2f(f32(i & 1), f32(i >> 1u));
        let near = vec2u(clamp(first + corner, vec2f(0.0), vec2f(f32(grid.columns) - 1.0)));
        let weight = mix(1.0 - share, share, corner);
        let word = grid.first + (near.y * grid.columns + near.x) * LIGHT_SLICES;
        let far_depth = bitcast<f32>(sphere_depths[word + end]);
        let near_depth = select(0.0, bitcast<f32>(sphere_depths[word + before]), end > 0u);
        let depth = mix(near_depth, far_depth, slice - f32(end));
        passed += weight.x * weight.y * exp(-part * depth);
    }
    return select(vec3f(1.0), passed, inside);
}
