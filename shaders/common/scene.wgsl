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
// Uniform memory and counts known when the pipeline is made: a software adapter unrolls the loops
// over them, which is worth more there than anything else in this file.
override SOLIDS: u32 = 0u;
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

fn solid_trace(solid: Solid, o: vec3f, d: vec3f) -> f32 {
    let from_origin = o - solid.origin;
    switch solid.shape {
        case PLANE: {
            let n = solid.extent;
            let slope = dot(d, n);
            if abs(slope) < 1e-20 {
                return NOTHING;
            }
            let t = -dot(from_origin, n) / slope;
            let within = plane_coordinates(n, from_origin + t * d);
            return select(NOTHING, t, all(abs(within) <= vec2f(solid.half_extent)));
        }
        case BOX: {
            // Never 1/0: infinity minus infinity would be a hit.
            let slope = 1.0 / select(d, vec3f(1e-20), abs(d) < vec3f(1e-20));
            let middle = -from_origin * slope;
            let half = abs(slope) * solid.extent;
            let t0 = max(max(middle.x - half.x, middle.y - half.y), middle.z - half.z);
            let t1 = min(min(middle.x + half.x, middle.y + half.y), middle.z + half.z);
            return select(NOTHING, select(t1, t0, t0 > 0.0), t0 <= t1);
        }
        default: {
            // Perpendicular to the ray before squaring, so that far spheres keep their digits.
            let along = -dot(from_origin, d);
            let f = from_origin + along * d;
            let radius = solid.extent.x;
            let discriminant = (radius - length(f)) * (radius + length(f));
            let half = sqrt(max(discriminant, 0.0));
            let t0 = along - half;
            return select(NOTHING, select(along + half, t0, t0 > 0.0), discriminant >= 0.0);
        }
    }
}

fn solid_normal(solid: Solid, x: vec3f) -> vec3f {
    let from_origin = x - solid.origin;
    switch solid.shape {
        case PLANE: {
            return solid.extent;
        }
        case BOX: {
            let face = abs(from_origin) - solid.extent;
            let largest = max(max(face.x, face.y), face.z);
            return normalize(sign(from_origin) * step(vec3f(largest), face));
        }
        default: {
            return normalize(from_origin);
        }
    }
}

// Distance from x to the solid's surface along its normal there; large beside a plane's square.
fn solid_distance(solid: Solid, x: vec3f) -> f32 {
    let from_origin = x - solid.origin;
    switch solid.shape {
        case PLANE: {
            let within = plane_coordinates(solid.extent, from_origin);
            let above = abs(dot(from_origin, solid.extent));
            return select(NOTHING, above, all(abs(within) <= vec2f(solid.half_extent)));
        }
        case BOX: {
            let face = abs(from_origin) - solid.extent;
            return length(max(face, vec3f(0.0))) + min(max(max(face.x, face.y), face.z), 0.0);
        }
        default: {
            return length(from_origin) - solid.extent.x;
        }
    }
}

// Coordinates in a plane through the origin: (x, z) if it is horizontal.
fn plane_coordinates(n: vec3f, x: vec3f) -> vec2f {
    let a = abs(n);
    if a.y >= max(a.x, a.z) {
        return x.xz;
    }
    return select(x.xy, x.zy, a.x >= a.z);
}

// Checker tiles are counted from the world's origin, so that neighbouring solids match.
fn solid_color(solid: Solid, x: vec3f, normal: vec3f) -> vec3f {
    if solid.tile <= 0.0 {
        return solid.even;
    }
    var parity: f32;
    if solid.shape == SPHERE {
        let tile = floor(x / solid.tile + solid.phase);
        parity = tile.x + tile.y + tile.z;
    } else {
        let tile = floor(plane_coordinates(normal, x / solid.tile + solid.phase));
        parity = tile.x + tile.y;
    }
    return select(solid.odd, solid.even, parity - 2.0 * floor(0.5 * parity) < 0.5);
}

// Whether a solid is between x, on a surface with normal n, and a light.
fn in_shadow(x: vec3f, n: vec3f, to_light: ToLight) -> bool {
    // Off the surface by more than rounding.
    let start = x + 1e-5 * length(x) * n;
    return scene_blocks(start, to_light.direction, to_light.distance);
}

// Radiance that leaves the solid at x towards the side from which `d` arrives: its colour, or
// Lambert's reflection of the lights and of the ambient radiance.
fn solid_radiance(index: u32, x: vec3f, normal: vec3f, d: vec3f) -> vec3f {
    let solid = solids[index];
    let color = solid_color(solid, x, normal);
    if solid.lit == 0u {
        return color;
    }
    let n = select(normal, -normal, dot(d, normal) > 0.0);
    var irradiance_over_pi = scene.ambient;
    for (var i = 0u; i < LIGHTS; i++) {
        let to_light = light_from(lights[i], x);
        let cos_theta = max(dot(n, to_light.direction), 0.0);
        var direct = lights[i].power * cos_theta / (to_light.distance2 * 3.14159265);
        if in_shadow(x, n, to_light) {
            direct = vec3f(0.0);
        }
        irradiance_over_pi += light_with_liquid(i, x, n, direct);
    }
    return color * irradiance_over_pi;
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
