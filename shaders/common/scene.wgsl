// What surrounds the liquid: solids, lights and the environment. All along the world's axes, with
// positions seen from the eye.

#import common/lights.wgsl

struct Scene {
    zenith: vec3f,  // radiance straight up; everywhere if constant
    horizon: vec3f,
    nadir: vec3f,
    ambient: vec3f, // mean radiance: lights lit solids evenly
}

const ENVIRONMENT_CONSTANT: u32 = 0u;
const ENVIRONMENT_GRADIENT: u32 = 1u;
const ENVIRONMENT_MAP: u32 = 2u;

const PLANE: u32 = 0u;
const BOX: u32 = 1u;
const SPHERE: u32 = 2u;

struct Solid {
    origin: vec3f,      // a point of the plane; the centre of a box or sphere
    shape: u32,
    extent: vec3f,      // a plane's normal, a box's half sides, a sphere's radius in x
    half_extent: f32,   // half the side of a plane's square
    even: vec3f,        // colour; with tile > 0, of even tiles
    tile: f32,          // side of a checker's tiles, m; 0 for one colour
    odd: vec3f,
    lit: u32,           // 0: the colour is radiance; 1: albedo under the lights
    phase: vec3f,       // where the eye is in the checker, in tiles modulo 2
}

@group(2) @binding(0) var<uniform> scene: Scene;
// Uniform memory, and what is known of it when the pipeline is made: a software adapter unrolls the
// loops over it, which is worth more there than anything else in this file. No branch depends on the
// solids alone (`uniforms_are_stored` in src/gpu.rs says why): what a scene lacks is left out by SHAPES
// and ANY_LIT, the rest is selected.
override SOLIDS: u32 = 0u;
override SHAPES: u32 = 7u;      // of the solids, 1 << PLANE and so on
override ANY_LIT: bool = true;      // whether any is lit
override ENVIRONMENT: u32 = 0u; // one of ENVIRONMENT_*

const MAX_SOLIDS: u32 = 512u;

@group(2) @binding(1) var<uniform> solids: array<Solid, MAX_SOLIDS>;
@group(2) @binding(3) var environment_map: texture_2d<f32>;

const NOTHING: f32 = 1e30;

struct SolidHit {
    t: f32,      // distance along the unit direction, NOTHING if none
    index: u32,
    normal: vec3f,
}

// The nearest solid along o + t d, t > 0, d a unit vector.
fn scene_trace(o: vec3f, d: vec3f) -> SolidHit {
    var hit = SolidHit(NOTHING, 0u, vec3f(0.0));
    for (var i = 0u; i < SOLIDS; i++) {
        let t = solid_trace(solids[i], o, d);
        if t > 0.0 && t < hit.t {
            hit.t = t;
            hit.index = i;
        }
    }
    if hit.t < NOTHING {
        hit.normal = solid_normal(solids[hit.index], o + hit.t * d);
    }
    return hit;
}

// Whether any solid is on o + t d, 0 < t < far.
fn scene_blocks(o: vec3f, d: vec3f, far: f32) -> bool {
    var nearest = NOTHING;
    for (var i = 0u; i < SOLIDS; i++) {
        let t = solid_trace(solids[i], o, d);
        nearest = select(nearest, min(nearest, t), t > 0.0);
    }
    return nearest < min(far, NOTHING);
}

// The shape, by a condition that looks as if it depended on a point or direction: else a software
// adapter takes what is selected by it for a branch on uniform memory.
fn shape_of(solid: Solid, x: vec3f) -> u32 {
    return select(solid.shape, 3u, x.x > 3e38);
}

fn has(shape: u32) -> bool {
    return (SHAPES & (1u << shape)) != 0u;
}

fn solid_trace(solid: Solid, o: vec3f, d: vec3f) -> f32 {
    let from_origin = o - solid.origin;
    let shape = shape_of(solid, d);
    var t = NOTHING;
    if has(PLANE) {
        t = select(t, plane_trace(solid, from_origin, d), shape == PLANE);
    }
    if has(BOX) {
        t = select(t, box_trace(solid, from_origin, d), shape == BOX);
    }
    if has(SPHERE) {
        t = select(t, sphere_trace(solid, from_origin, d), shape == SPHERE);
    }
    return t;
}

fn plane_trace(solid: Solid, from_origin: vec3f, d: vec3f) -> f32 {
    let n = solid.extent;
    let slope = dot(d, n);
    let along = abs(slope) < 1e-20;
    let t = -dot(from_origin, n) / select(slope, 1.0, along);
    let within = plane_coordinates(n, from_origin + t * d);
    return select(NOTHING, t, !along && all(abs(within) <= vec2f(solid.half_extent)));
}

fn box_trace(solid: Solid, from_origin: vec3f, d: vec3f) -> f32 {
    // Never 1/0: infinity minus infinity would be a hit.
    let slope = 1.0 / select(d, vec3f(1e-20), abs(d) < vec3f(1e-20));
    let middle = -from_origin * slope;
    let half = abs(slope) * solid.extent;
    let t0 = max(max(middle.x - half.x, middle.y - half.y), middle.z - half.z);
    let t1 = min(min(middle.x + half.x, middle.y + half.y), middle.z + half.z);
    return select(NOTHING, select(t1, t0, t0 > 0.0), t0 <= t1);
}

fn sphere_trace(solid: Solid, from_origin: vec3f, d: vec3f) -> f32 {
    // Perpendicular to the ray before squaring, so that far spheres keep their digits.
    let along = -dot(from_origin, d);
    let f = from_origin + along * d;
    let radius = solid.extent.x;
    let discriminant = (radius - length(f)) * (radius + length(f));
    let half = sqrt(max(discriminant, 0.0));
    let t0 = along - half;
    return select(NOTHING, select(along + half, t0, t0 > 0.0), discriminant >= 0.0);
}

fn solid_normal(solid: Solid, x: vec3f) -> vec3f {
    let from_origin = x - solid.origin;
    let shape = shape_of(solid, x);
    var normal = solid.extent;
    if has(BOX) {
        let face = abs(from_origin) - solid.extent;
        let largest = max(max(face.x, face.y), face.z);
        let box_normal = normalize(sign(from_origin) * step(vec3f(largest), face));
        normal = select(normal, box_normal, shape == BOX);
    }
    if has(SPHERE) {
        normal = select(normal, normalize(from_origin), shape == SPHERE);
    }
    return normal;
}

// Distance from x to the solid's surface along its normal there; large beside a plane's square.
fn solid_distance(solid: Solid, x: vec3f) -> f32 {
    let from_origin = x - solid.origin;
    let shape = shape_of(solid, x);
    var nearest = NOTHING;
    if has(PLANE) {
        let within = plane_coordinates(solid.extent, from_origin);
        let above = abs(dot(from_origin, solid.extent));
        let on = (shape == PLANE) & all(abs(within) <= vec2f(solid.half_extent));
        nearest = select(nearest, above, on);
    }
    if has(BOX) {
        let face = abs(from_origin) - solid.extent;
        let distance = length(max(face, vec3f(0.0))) + min(max(max(face.x, face.y), face.z), 0.0);
        nearest = select(nearest, distance, shape == BOX);
    }
    if has(SPHERE) {
        nearest = select(nearest, length(from_origin) - solid.extent.x, shape == SPHERE);
    }
    return nearest;
}

// Coordinates in a plane through the origin: (x, z) if it is horizontal.
fn plane_coordinates(n: vec3f, x: vec3f) -> vec2f {
    let a = abs(n);
    return select(select(x.xy, x.zy, a.x >= a.z), x.xz, a.y >= max(a.x, a.z));
}

// Checker tiles are counted from the world's origin, so that neighbouring solids match.
fn solid_color(solid: Solid, x: vec3f, normal: vec3f) -> vec3f {
    let plain = solid.tile <= 0.0;
    let at = x / select(solid.tile, 1.0, plain) + solid.phase;
    let tile = floor(plane_coordinates(normal, at));
    var parity = tile.x + tile.y;
    if has(SPHERE) {
        let cell = floor(at);
        parity = select(parity, cell.x + cell.y + cell.z, shape_of(solid, x) == SPHERE);
    }
    return select(solid.odd, solid.even, plain | (parity - 2.0 * floor(0.5 * parity) < 0.5));
}

// Whether a solid is between x, on a surface with normal n, and a light.
fn in_shadow(x: vec3f, n: vec3f, to_light: ToLight) -> bool {
    // Off the surface by more than rounding.
    let start = x + 1e-5 * length(x) * n;
    return scene_blocks(start, to_light.direction, to_light.distance);
}

// Radiance that leaves the solid at x towards the side from which `d` arrives: its colour, or
// Lambert's reflection of the lights and of the ambient radiance, of which the share `ambient` gets there.
fn solid_radiance(index: u32, x: vec3f, normal: vec3f, d: vec3f, ambient: vec3f) -> vec3f {
    let solid = solids[index];
    let color = solid_color(solid, x, normal);
    if !ANY_LIT {
        return color;
    }
    let n = select(normal, -normal, dot(d, normal) > 0.0);
    var irradiance_over_pi = ambient * scene.ambient;
    for (var i = 0u; i < LIGHTS; i++) {
        let to_light = light_from(lights[i], x);
        let cos_theta = max(dot(n, to_light.direction), 0.0);
        var direct = lights[i].power * cos_theta / (to_light.distance2 * 3.14159265);
        if in_shadow(x, n, to_light) {
            direct = vec3f(0.0);
        }
        irradiance_over_pi += light_with_liquid(i, x, n, direct);
    }
    return color * select(vec3f(1.0), irradiance_over_pi, solid.lit == 1u);
}

fn environment_radiance(d: vec3f) -> vec3f {
    if ENVIRONMENT == ENVIRONMENT_CONSTANT {
        return scene.zenith;
    }
    if ENVIRONMENT == ENVIRONMENT_GRADIENT {
        let end = select(scene.nadir, scene.zenith, d.y > 0.0);
        return mix(scene.horizon, end, abs(d.y));
    }
    return environment_lookup(d);
}

// Equirectangular: the centre of the map is -z, its top row +y. Bilinear by hand: filtering of
// 32-bit floats is not in every adapter.
fn environment_lookup(d: vec3f) -> vec3f {
    let size = vec2f(textureDimensions(environment_map));
    let longitude = atan2(d.x, -d.z) / 6.28318531 + 0.5;
    let latitude = acos(clamp(d.y, -1.0, 1.0)) / 3.14159265;
    let u = vec2f(longitude, latitude) * size - 0.5;
    let base = floor(u);
    let f = u - base;
    let top = mix(environment_texel(base, size), environment_texel(base + vec2f(1.0, 0.0), size), f.x);
    let low = mix(
        environment_texel(base + vec2f(0.0, 1.0), size),
        environment_texel(base + 1.0, size),
        f.x,
    );
    return mix(top, low, f.y);
}

fn environment_texel(at: vec2f, size: vec2f) -> vec3f {
    let x = at.x - size.x * floor(at.x / size.x);
    let y = clamp(at.y, 0.0, size.y - 1.0);
    return textureLoad(environment_map, vec2i(vec2f(x, y)), 0).rgb;
}
