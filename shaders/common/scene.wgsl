// Solids, lighting and the environment, in world axes relative to the eye.

#import common/lights.wgsl
#import common/mesh.wgsl

struct Scene {
    zenith: vec3f,  // radiance straight up, or in all directions of a constant environment
    horizon: vec3f,
    nadir: vec3f,
    ambient: vec3f, // mean radiance, the ambient light on lit solids
    glow_lobes: array<vec4f, 2>,     // direction towards the centre of a sky's glow, sharpness
    glow_radiances: array<vec4f, 2>, // radiance at the centre
}

const ENVIRONMENT_CONSTANT: u32 = 0u;
const ENVIRONMENT_GRADIENT: u32 = 1u;
const ENVIRONMENT_MAP: u32 = 2u;
const ENVIRONMENT_SKY: u32 = 3u;

const PLANE: u32 = 0u;
const BOX: u32 = 1u;
const SPHERE: u32 = 2u;
const MESH: u32 = 3u;

struct Solid {
    origin: vec3f,      // centre of the square, box or sphere; a mesh's middle
    shape: u32,         // PLANE, BOX, SPHERE or MESH
    extent: vec3f,      // a plane's normal, a box's half sides, a sphere's radius in x; a mesh's scale, the
                        // inverse of its scale, and the largest distance from its middle, unscaled
    half_extent: f32,   // half the side of a plane's square
    even: vec3f,        // colour; with tile > 0, of even tiles
    tile: f32,          // side of a checker's tiles, m; 0 for a single colour
    odd: vec3f,         // colour of odd tiles
    lit: u32,           // 0: the colour is emitted radiance; 1: the albedo under the lights
    phase: vec3f,       // position of the eye in the checker, in tiles modulo 2
    inv_fade2: f32,     // 1/m², squared: distance over which it fades into the environment; 0 never
    middle: vec3f,      // the point that it fades around
    texture: u32,       // place of its texture in `mesh_surfaces`, or 1 for a mesh's own colours; 0 for neither
    rotation: vec4f,    // of a mesh, a unit quaternion
    mesh: vec3u,        // rows where it begins and of its first triangle, word of its first attributes
    number: u32,        // in the scene, from 0: here meshes come last
}

@group(2) @binding(0) var<uniform> scene: Scene;
// Pipeline constants that describe the solids in uniform memory, so that a software adapter unrolls
// the loops over them: the most effective optimisation in this file there. No branch depends on the
// solids' data (for the reason see `uniforms_are_stored` in src/gpu.rs): constants remove what a scene
// lacks (src/gpu/prune.rs), the rest uses `select`.
override SOLIDS: u32 = 0u;      // number of solids
override MESHES: u32 = 0u;      // number of meshes, the last solids
override HAS_PLANES: bool = true;  // whether any solid is a plane
override HAS_BOXES: bool = true;
override HAS_SPHERES: bool = true;
override TEXTURES: bool = false; // whether any solid but a mesh has a texture
override ANY_LIT: bool = true;  // whether any solid is lit
override ENVIRONMENT: u32 = 0u; // one of ENVIRONMENT_*
override FADES: bool = false;   // whether any solid fades into the environment
override FILTER_PATTERNS: bool = false; // whether patterns are averaged over a ray's footprint

const MAX_SOLIDS: u32 = 512u;

@group(2) @binding(1) var<uniform> solids: array<Solid, MAX_SOLIDS>;
@group(2) @binding(3) var environment_map: texture_2d<f32>;

// Ray parameter of a miss.
const NOTHING: f32 = 1e30;

struct SolidHit {
    t: f32,      // distance along the unit direction, NOTHING if none
    index: u32,
    triangle: u32, // of a mesh
    normal: vec3f,
}

// Nearest solid along o + t d, t > 0, with a unit vector d.
fn scene_trace(o: vec3f, d: vec3f) -> SolidHit {
    var hit = SolidHit(NOTHING, 0u, NO_TRIANGLE, vec3f(0.0));
    for (var i = 0u; i < SOLIDS - MESHES; i++) {
        let t = solid_trace(solids[i], o, d);
        if t > 0.0 && t < hit.t {
            hit.t = t;
            hit.index = i;
        }
    }
    if MESHES > 0u {
        for (var i = SOLIDS - MESHES; i < SOLIDS; i++) {
            // As in `shape_of`: constant indices would make uniform memory decide branches.
            let index = select(i, MAX_SOLIDS - 1u, d.x > 3e38);
            let found = mesh_trace(index, o, d, hit.t, false);
            if found.t < hit.t {
                hit = SolidHit(found.t, index, found.triangle, vec3f(0.0));
            }
        }
    }
    if hit.t < NOTHING {
        hit.normal = solid_normal(solids[hit.index], o + hit.t * d);
        if MESHES > 0u && hit.triangle != NO_TRIANGLE {
            hit.normal = mesh_normal(hit.index, hit.triangle);
        }
    }
    return hit;
}

// Whether any solid intersects o + t d, 0 < t < far.
fn scene_blocks(o: vec3f, d: vec3f, far: f32) -> bool {
    var nearest = NOTHING;
    for (var i = 0u; i < SOLIDS - MESHES; i++) {
        let t = solid_trace(solids[i], o, d);
        nearest = select(nearest, min(nearest, t), t > 0.0);
    }
    if MESHES > 0u && nearest >= min(far, NOTHING) {
        for (var i = SOLIDS - MESHES; i < SOLIDS; i++) {
            let index = select(i, MAX_SOLIDS - 1u, d.x > 3e38);
            nearest = min(nearest, mesh_trace(index, o, d, min(far, NOTHING), true).t);
        }
    }
    return nearest < min(far, NOTHING);
}

// A shape that no solid has.
const NO_SHAPE = 31u;

// The solid's shape, made to appear dependent on a point or direction. Otherwise a software adapter
// turns a `select` on the shape into a branch on uniform memory.
fn shape_of(solid: Solid, x: vec3f) -> u32 {
    return select(solid.shape, NO_SHAPE, x.x > 3e38);
}

fn solid_trace(solid: Solid, o: vec3f, d: vec3f) -> f32 {
    let from_origin = o - solid.origin;
    let shape = shape_of(solid, d);
    var t = NOTHING;
    if HAS_PLANES {
        t = select(t, plane_trace(solid, from_origin, d), shape == PLANE);
    }
    if HAS_BOXES {
        t = select(t, box_trace(solid, from_origin, d), shape == BOX);
    }
    if HAS_SPHERES {
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
    // Avoids 1/0: infinity minus infinity would count as a hit.
    let slope = 1.0 / select(d, vec3f(1e-20), abs(d) < vec3f(1e-20));
    let middle = -from_origin * slope;
    let half = abs(slope) * solid.extent;
    let t0 = max(max(middle.x - half.x, middle.y - half.y), middle.z - half.z);
    let t1 = min(min(middle.x + half.x, middle.y + half.y), middle.z + half.z);
    return select(NOTHING, select(t1, t0, t0 > 0.0), t0 <= t1);
}

fn sphere_trace(solid: Solid, from_origin: vec3f, d: vec3f) -> f32 {
    // Projects perpendicular to the ray before squaring, so that far spheres keep their precision.
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
    if HAS_BOXES {
        let face = abs(from_origin) - solid.extent;
        let largest = max(max(face.x, face.y), face.z);
        let box_normal = normalize(sign(from_origin) * step(vec3f(largest), face));
        normal = select(normal, box_normal, shape == BOX);
    }
    if HAS_SPHERES {
        normal = select(normal, normalize(from_origin), shape == SPHERE);
    }
    return normal;
}

// Signed distance from x to the solid's surface, unsigned for a plane; NOTHING beside a plane's square.
fn solid_distance(solid: Solid, x: vec3f) -> f32 {
    let from_origin = x - solid.origin;
    let shape = shape_of(solid, x);
    var nearest = NOTHING;
    if HAS_PLANES {
        let within = plane_coordinates(solid.extent, from_origin);
        let above = abs(dot(from_origin, solid.extent));
        let on = (shape == PLANE) & all(abs(within) <= vec2f(solid.half_extent));
        nearest = select(nearest, above, on);
    }
    if HAS_BOXES {
        let face = abs(from_origin) - solid.extent;
        let distance = length(max(face, vec3f(0.0))) + min(max(max(face.x, face.y), face.z), 0.0);
        nearest = select(nearest, distance, shape == BOX);
    }
    if HAS_SPHERES {
        nearest = select(nearest, length(from_origin) - solid.extent.x, shape == SPHERE);
    }
    return nearest;
}

// Coordinates in the plane of normal n: drops the axis closest to n, (x, z) for a horizontal plane.
fn plane_coordinates(n: vec3f, x: vec3f) -> vec2f {
    let a = abs(n);
    return select(select(x.xy, x.zy, a.x >= a.z), x.xz, a.y >= max(a.x, a.z));
}

// Colour of a solid, seen along d by a ray of this width at x. Checkers are aligned with the world
// origin, so that adjacent solids match.
fn solid_color(solid: Solid, triangle: u32, x: vec3f, normal: vec3f, d: vec3f, width: f32) -> vec3f {
    // As in `shape_of`.
    let texture = select(solid.texture, 0u, x.x > 3e38);
    if MESHES > 0u && triangle != NO_TRIANGLE && texture != 0u {
        return mesh_color(solid, triangle, x, dot(normal, d), width);
    }
    if TEXTURES && texture != 0u {
        return solid.even * solid_texture(solid, texture, x, normal, d, width);
    }
    let plain = solid.tile <= 0.0;
    let tile_side = select(solid.tile, 1.0, plain);
    let at = x / tile_side + solid.phase;
    if FILTER_PATTERNS {
        return mix(solid.odd, solid.even, select(even_share(solid, at, normal, d, width / tile_side), 1.0, plain));
    }
    let tile = floor(plane_coordinates(normal, at));
    var parity = tile.x + tile.y;
    if HAS_SPHERES || MESHES > 0u {
        let cell = floor(at);
        parity = select(parity, cell.x + cell.y + cell.z, is_round(solid, x));
    }
    return select(solid.odd, solid.even, plain | (parity - 2.0 * floor(0.5 * parity) < 0.5));
}

// Whether tiles are cubes instead of squares.
fn is_round(solid: Solid, x: vec3f) -> bool {
    let shape = shape_of(solid, x);
    return shape == SPHERE || shape == MESH;
}

// Colour of the texture of a plane, box or sphere: around a sphere, elsewhere once per tile, upright on walls.
fn solid_texture(solid: Solid, texture: u32, x: vec3f, normal: vec3f, d: vec3f, width: f32) -> vec3f {
    let at = x - solid.origin;
    let level = abs(normal.y) >= max(abs(normal.x), abs(normal.z));
    let flat_at = plane_coordinates(normal, at) * select(vec2f(1.0, -1.0), vec2f(1.0), level);
    let aspect = f32(mesh_surfaces[texture]) / f32(mesh_surfaces[texture + 1u]);
    var uv = flat_at / solid.tile * vec2f(1.0, aspect) + 0.5;
    var copies = width / solid.tile * sqrt(aspect);
    if HAS_SPHERES {
        let around = vec2f(atan2(normal.x, -normal.z) / 6.28318531 + 0.5, acos(clamp(normal.y, -1.0, 1.0)) / 3.14159265);
        let round = shape_of(solid, x) == SPHERE;
        uv = select(uv, around, round);
        copies = select(copies, width / (4.44 * solid.extent.x), round);
    }
    return texture_color(texture, uv, copies * inverseSqrt(max(abs(dot(normal, d)), 0.05)));
}

// Share of even tiles in the footprint of a ray of this width, in tiles: of the parallelogram around `at`
// whose sides are the extents of the footprint along the pattern's axes (after I. Quilez, Filtering the
// checkerboard pattern, 2017).
fn even_share(solid: Solid, at: vec3f, normal: vec3f, d: vec3f, width: f32) -> f32 {
    // Along the unit vector a, the ray's disc is cast onto the surface with the extent |a - n (a·d)/(n·d)|.
    let slope = dot(normal, d);
    let shear = d / select(slope, 1e-4, abs(slope) < 1e-4);
    let extent = max(width * sqrt(1.0 + shear * shear), vec3f(SHARPEST));
    let side = alternation(at, extent);
    let sides = plane_coordinates(normal, side);
    var product = sides.x * sides.y;
    if HAS_SPHERES || MESHES > 0u {
        product = select(product, side.x * side.y * side.z, is_round(solid, at));
    }
    return 0.5 + 0.5 * product;
}

// Smallest footprint, tiles: differences of nearby integrals would be rounding errors.
const SHARPEST: f32 = 0.01;

// Mean of the square wave that is 1 on even and -1 on odd unit intervals, over `extent` around `at`: the
// difference of its integral, a triangle wave.
fn alternation(at: vec3f, extent: vec3f) -> vec3f {
    return (alternation_integral(at + 0.5 * extent) - alternation_integral(at - 0.5 * extent)) / extent;
}

fn alternation_integral(at: vec3f) -> vec3f {
    return 1.0 - abs(at - 2.0 * floor(0.5 * at) - 1.0);
}

// Whether a solid shadows x, on a surface with normal n, from a light. `rounding` is the error of x, m.
fn in_shadow(x: vec3f, n: vec3f, to_light: ToLight, rounding: f32) -> bool {
    // Offset from the surface beyond rounding errors.
    let start = x + max(1e-5 * length(x), rounding) * n;
    return scene_blocks(start, to_light.direction, to_light.distance);
}

// Radiance that the last ray would have received in addition if a lit, filtered pattern had its mean colour everywhere.
var<private> without_pattern: vec3f;

// Radiance from the solid at x along -d, seen by a ray of this width there: its colour, or the Lambertian
// reflection of the lights and of the share `ambient` of the ambient light.
fn solid_radiance(
    index: u32,
    triangle: u32,
    x: vec3f,
    normal: vec3f,
    d: vec3f,
    ambient: vec3f,
    width: f32,
) -> vec3f {
    let solid = solids[index];
    let color = solid_color(solid, triangle, x, normal, d, width);
    if !ANY_LIT {
        return faded(solid, x, d, color);
    }
    let n = select(normal, -normal, dot(d, normal) > 0.0);
    var shading_n = n;
    var rounding = 0.0;
    if MESHES > 0u && triangle != NO_TRIANGLE {
        shading_n = mesh_shading_normal(solid, triangle, x, n);
        rounding = 1e-6 * solid.extent.x * solid.extent.z;
    }
    var irradiance_over_pi = ambient * scene.ambient;
    for (var i = 0u; i < LIGHTS; i++) {
        let to_light = light_from(lights[i], x);
        let cos_theta = max(dot(shading_n, to_light.direction), 0.0);
        var direct = lights[i].power * cos_theta / (to_light.distance2 * 3.14159265);
        if in_shadow(x, n, to_light, rounding) {
            direct = vec3f(0.0);
        }
        irradiance_over_pi += light_with_liquid(i, x, n, direct);
    }
    let lit = select(vec3f(1.0), irradiance_over_pi, solid.lit == 1u);
    if FILTER_PATTERNS {
        // As in `shape_of`.
        let filtered = solid.lit == 1u && select(solid.texture, 0u, x.x > 3e38) == 0u && solid.tile > 0.0;
        let change = (0.5 * (solid.even + solid.odd) - color) * lit * faded_share(solid, x);
        without_pattern = select(vec3f(0.0), change, filtered);
    }
    return faded(solid, x, d, color * lit);
}

// Radiance of a solid with its share of the environment at the horizon.
fn faded(solid: Solid, x: vec3f, d: vec3f, radiance: vec3f) -> vec3f {
    if !FADES {
        return radiance;
    }
    let level = vec3f(d.x, 0.0, d.z) * inverseSqrt(max(dot(d.xz, d.xz), 1e-20));
    return mix(environment_radiance(level), radiance, faded_share(solid, x));
}

// Share of a solid's radiance at x that does not fade.
fn faded_share(solid: Solid, x: vec3f) -> f32 {
    if !FADES {
        return 1.0;
    }
    let offset = x - solid.middle;
    return exp(-solid.inv_fade2 * dot(offset, offset));
}

// Change of a ray's unit direction across the part of the picture that it stands for, along either axis.
struct Spread {
    x: vec3f,
    y: vec3f,
}

fn environment_radiance(d: vec3f) -> vec3f {
    return environment_over(d, Spread(vec3f(0.0), vec3f(0.0)));
}

// The same, averaged over directions around d; of a sky, whose sun may be smaller than a pixel shows in a curved surface.
fn environment_over(d: vec3f, spread: Spread) -> vec3f {
    if ENVIRONMENT == ENVIRONMENT_CONSTANT {
        return scene.zenith;
    }
    if ENVIRONMENT == ENVIRONMENT_GRADIENT {
        let end = select(scene.nadir, scene.zenith, d.y > 0.0);
        return mix(scene.horizon, end, abs(d.y));
    }
    if ENVIRONMENT == ENVIRONMENT_SKY {
        return sky_radiance(d, spread);
    }
    return environment_lookup(d);
}

fn sky_radiance(d: vec3f, spread: Spread) -> vec3f {
    let rise = abs(d.y);
    let end = select(scene.nadir, scene.zenith, d.y > 0.0);
    let glows = glow_over(0, d, spread) + glow_over(1, d, spread);
    return mix(scene.horizon, end, rise * (2.0 - rise)) + glows;
}

// A spherical Gaussian: of variance 1 / lobe.w along either axis, to which the pixel adds a sixth of the spread's squares, as
// a tent does from centre to centre: a square's twelfth leaves lines dotted. Their sum is (I + x xᵀ + y yᵀ) / lobe.w, inverted
// by Woodbury's identity.
fn glow_over(i: i32, d: vec3f, spread: Spread) -> vec3f {
    let lobe = scene.glow_lobes[i];
    let scale = sqrt(lobe.w / 6.0);
    let x = scale * spread.x;
    let y = scale * spread.y;
    let offset = lobe.xyz - d;
    let along = vec2f(dot(x, offset), dot(y, offset));
    let xx = 1.0 + dot(x, x);
    let yy = 1.0 + dot(y, y);
    let xy = dot(x, y);
    let determinant = max(xx * yy - xy * xy, 1.0);
    let taken = (yy * along.x * along.x - 2.0 * xy * along.x * along.y + xx * along.y * along.y) / determinant;
    let exponent = lobe.w * (dot(lobe.xyz, d) - 1.0 + 0.5 * taken);
    return scene.glow_radiances[i].rgb * exp(min(exponent, 0.0)) * inverseSqrt(determinant);
}

// Lookup in an equirectangular map, with -z at its centre and +y in its top row. Bilinear filtering
// by hand: not every adapter can filter 32-bit floats.
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
