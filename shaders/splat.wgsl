// Splats ellipsoids into layers by exact ray casting: front or back root of the pixel's ray.
//
// Bounds after Sigg, Weyrich, Botsch and Gross, GPU-Based Ray-Casting of Quadratic Surfaces (2006),
// with the discriminant expanded by hand: as published it loses all digits once an ellipsoid is
// 1e3 times as far away as it is large. The intersection is re-centred for the same reason: the ray
// is parametrised from its point at the centre's depth, so that squared terms are of the splat's size.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/sizes.wgsl

// The ellipsoid { centre + A s : |s| <= 1 } in world axes, A symmetric.
struct Splat {
    centre: vec3f,       // relative to camera.origin
    radius: f32,
    diagonal: vec3f,     // A_xx, A_yy, A_zz
    particle: u32,
    off_diagonal: vec3f, // A_xy, A_xz, A_yz
    tags: u32,           // index of the fluid; BURIED
}

// Bit of the tags that marks a splat surrounded by liquid.
const BURIED: u32 = 0x10000u;

@group(1) @binding(0) var<storage, read> splats: array<Splat>;

// 0: nearest fronts, 1: farthest backs.
override SIDE: i32 = 0;
// Whether radii differ, so that planes bear sizes: common/sizes.wgsl.
override SIZES: bool = false;

struct Varying {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) centre: vec3f, // view space
    // Columns of the map from view space to the space where the ellipsoid is the unit sphere.
    @location(1) @interpolate(flat) sphere_x: vec3f,
    @location(2) @interpolate(flat) sphere_y: vec3f,
    @location(3) @interpolate(flat) sphere_z: vec3f,
    @location(4) @interpolate(flat) tag: vec3u, // particle, from 1; fluid; size
    // The camera, for the fragments: software adapters read uniforms lane by lane there.
    @location(5) @interpolate(flat) omega_map: vec4f, // camera_omega: of pixel position 0, and its change per pixel
    @location(6) @interpolate(flat) range: vec2f,     // near and far, m
}

// Six vertices draw a splat, two triangles. They are not instances: SwiftShader, the software adapter of browsers, takes
// 15 µs for each (docs/web.md).
const VERTICES: u32 = 6u;

// The corner of a splat's rectangle that a vertex is: bit 0 right, bit 1 up.
fn vertex_corner(vertex: u32) -> u32 {
    // 0, 1, 2; 2, 1, 3.
    return (0xda4u >> (2u * (vertex % VERTICES))) & 3u;
}

@vertex
fn vertex(@builtin(vertex_index) vertex: u32) -> Varying {
    return splat_varying(vertex_corner(vertex), splats[vertex / VERTICES]);
}

fn splat_varying(corner: u32, splat: Splat) -> Varying {
    let placed = splat_in_view(splat);
    let to_sphere = splat_to_sphere(splat);

    var out: Varying;
    out.centre = placed.centre;
    out.sphere_x = to_sphere[0];
    out.sphere_y = to_sphere[1];
    out.sphere_z = to_sphere[2];
    let omega = camera_omega(vec2f(0.0)).xy;
    out.omega_map = vec4f(omega, vec2f(2.0, -2.0) * camera.tangent / camera.size);
    out.range = vec2f(camera.near, camera.far);
    out.tag = vec3u(splat.particle + 1u, splat.tags & (BURIED - 1u), particle_size_of(splat.radius));
    out.clip = vec4f(splat_corner(corner, placed.centre, placed.rows), depth_bound(placed), 1.0);
    return out;
}

// Bound on the depths that the splat's fragments write: nearer than all fronts, farther than all
// backs. Lets devices with conservative depth tests skip hidden fragments.
fn depth_bound(placed: Placed) -> f32 {
    let towards_kept = select(1.0, -1.0, SIDE == BACK);
    let half_depth = length(placed.rows[2]);
    let middle = -placed.centre.z;
    let reach = half_depth + depth_margin(middle, half_depth);
    let depth = depth_at(max(middle - towards_kept * reach, camera.near));
    return clamp(depth + select(0.0, towards_kept * 1e-6, ORTHOGRAPHIC), 0.0, 1.0);
}

// Upper bound on the rounding error of a splat's depths, m: that of its centre, and that of the inverse
// of its axes matrix, which is inaccurate for flat splats.
fn depth_margin(middle: f32, half_depth: f32) -> f32 {
    return 1e-5 * abs(middle) + 1e-3 * half_depth;
}

// Map from view space to the space where the ellipsoid is the unit sphere.
fn splat_to_sphere(splat: Splat) -> mat3x3f {
    return symmetric_inverse(splat.diagonal, splat.off_diagonal)
        * transpose(camera.view_from_world);
}

fn varying_to_sphere(in: Varying) -> mat3x3f {
    return mat3x3f(in.sphere_x, in.sphere_y, in.sphere_z);
}

// An ellipsoid in view space.
struct Placed {
    centre: vec3f,
    rows: mat3x3f, // columns: the rows of the axes matrix
}

fn splat_in_view(splat: Splat) -> Placed {
    let a = splat.diagonal;
    let b = splat.off_diagonal;
    let shape = mat3x3f(vec3f(a.x, b.x, b.y), vec3f(b.x, a.y, b.z), vec3f(b.y, b.z, a.z));
    let rotation = camera.view_from_world;
    return Placed(rotation * (camera.origin + splat.centre), transpose(rotation * shape));
}

fn symmetric_inverse(a: vec3f, b: vec3f) -> mat3x3f {
    let c0 = vec3f(a.y * a.z - b.z * b.z, b.y * b.z - b.x * a.z, b.x * b.z - b.y * a.y);
    let c1 = vec3f(c0.y, a.x * a.z - b.y * b.y, b.x * b.y - a.x * b.z);
    let c2 = vec3f(c0.z, c1.z, a.x * a.y - b.x * b.x);
    let determinant = dot(vec3f(a.x, b.x, b.y), c0);
    return mat3x3f(c0, c1, c2) * (1.0 / determinant);
}

// Corner of the ellipsoid's bounding rectangle, in normalised device coordinates. The columns of
// `rows` are the rows of the ellipsoid's axes matrix in view space.
fn splat_corner(corner: u32, centre: vec3f, rows: mat3x3f) -> vec2f {
    let sign = vec2f(f32(corner & 1u), f32(corner >> 1u)) * 2.0 - 1.0;
    let half_depth = length(rows[2]);
    if -centre.z + half_depth <= camera.near {
        return vec2f(2.0); // entirely behind the near plane: an empty rectangle
    }
    // Enlarged by 1/8 pixel against rounding; the fragment stage tests exactly.
    let margin = 0.25 / camera.size;
    if ORTHOGRAPHIC {
        let half = vec2f(length(rows[0]), length(rows[1]));
        return (centre.xy + sign * half - camera.shift) / camera.tangent + sign * margin;
    }
    if -centre.z - half_depth <= camera.near {
        let x = cut_slopes(rows[0], rows[2], centre.x, -centre.z, half_depth);
        let y = cut_slopes(rows[1], rows[2], centre.y, -centre.z, half_depth);
        // Clamped just outside of the picture: the visible part may be arbitrarily wide.
        let bounds = vec2f(select(x.x, x.y, sign.x > 0.0), select(y.x, y.y, sign.y > 0.0));
        return clamp((bounds - camera.shift) / camera.tangent + sign * margin, vec2f(-2.0), vec2f(2.0));
    }
    // Tangent planes through the eye, { x = b z }: q b^2 - 2 r b - s = 0.
    let g = rows[2];
    let q = centre.z * centre.z - dot(g, g);
    let r = vec2f(dot(rows[0], g), dot(rows[1], g)) - centre.xy * centre.z;
    let discriminant = vec2f(
        tangent_discriminant(rows[0], g, centre.x, centre.z),
        tangent_discriminant(rows[1], g, centre.y, centre.z),
    );
    let bounds = (r + sign * sqrt(max(discriminant, vec2f(0.0)))) / q;
    return (bounds - camera.shift) / camera.tangent + sign * margin;
}

fn tangent_discriminant(a: vec3f, g: vec3f, x: f32, z: f32) -> f32 {
    let along = z * a - x * g;
    let across = cross(a, g);
    return dot(along, along) - dot(across, across);
}

// Smallest and largest x / depth of the part of an ellipsoid beyond the near plane. `a` and `g` are the
// x and z rows of its axes matrix, `x` and `depth` the coordinates of its centre.
//
// Projected onto x and depth, the part is an ellipse cut by a line. Its slope is extreme where a line
// through the eye touches the ellipse, or at an end of the cut.
fn cut_slopes(a: vec3f, g: vec3f, x: f32, depth: f32, half_depth: f32) -> vec2f {
    let half_x = length(a);
    // The cut, { depth = near }.
    let beyond = (depth - camera.near) / half_depth;
    let middle = x + beyond * dot(a, g) / half_depth;
    // Slightly enlarged: for a barely cut ellipse the square root amplifies rounding.
    let share = sqrt(max(1.0 - beyond * beyond, 0.0) + 1e-6);
    let half = share * length(cross(a, g)) / half_depth + 2e-6 * (abs(x) + half_x);
    var bounds = vec2f(middle - half, middle + half) / camera.near;

    // Tangent lines { x = b depth }: q b^2 - 2 r b - s = 0. The roots are kept as quotients, for one of
    // them is infinite when the ellipse touches the plane of the eye.
    let discriminant = tangent_discriminant(a, g, x, -depth);
    if discriminant <= 0.0 {
        return bounds; // the eye is inside the ellipse
    }
    let q = (depth - half_depth) * (depth + half_depth);
    let r = dot(a, g) + x * depth;
    let s = (half_x - x) * (half_x + x);
    let sum = r + select(-1.0, 1.0, r >= 0.0) * sqrt(discriminant);
    var roots = array(vec2f(sum, q), vec2f(-s, sum));
    for (var i = 0; i < 2; i++) {
        // Depth of the point of contact. Doubtful contacts count, which only enlarges the bounds.
        let root = roots[i];
        let across = root.y * a + root.x * g;
        let at = depth + dot(g, across) * (root.y * x - root.x * depth) / dot(across, across);
        if at >= 0.99999 * camera.near - 1e-4 * half_depth {
            let slope = root.x / root.y;
            bounds = vec2f(min(bounds.x, slope), max(bounds.y, slope));
        }
    }
    return bounds;
}

// Intersection of the pixel's ray with the ellipsoid.
struct Chord {
    hit: bool,
    middle: f32,         // depth of the midpoint, m
    half_length: f32,    // half the extent in depth, m
    f: vec3f,            // from the centre to the midpoint, in sphere space
    d: vec3f,            // the ray per unit of depth, in sphere space
}

fn splat_chord(centre: vec3f, to_sphere: mat3x3f, omega: vec3f, near: f32) -> Chord {
    let centre_depth = -centre.z;
    // The ray per unit of depth, and its offset from the centre at the centre's depth.
    var ray = omega;
    var beside = centre_depth * omega.xy - centre.xy;
    if ORTHOGRAPHIC {
        ray = vec3f(0.0, 0.0, -1.0);
        beside = omega.xy - centre.xy;
    }
    let d = to_sphere * ray;
    let d2 = dot(d, d);
    let start = to_sphere * vec3f(beside, 0.0);
    let along = dot(start, d) / d2;
    let f = start - along * d; // from the centre, perpendicular to the ray
    let discriminant = 1.0 - dot(f, f);
    let half_length = sqrt(max(discriminant, 0.0) / d2);
    let middle = centre_depth - along;
    let hit = discriminant >= 0.0 && middle + half_length >= near;
    return Chord(hit, middle, half_length, f, d);
}

struct Fragment {
    @location(0) plane: vec4f,
    @builtin(frag_depth) depth: f32,
}

// The chord of a fragment.
fn fragment_chord(in: Varying, omega: vec3f) -> Chord {
    return splat_chord(in.centre, varying_to_sphere(in), omega, in.range.x);
}

// View ray of a fragment, as `camera_omega`.
fn fragment_omega(in: Varying) -> vec3f {
    return vec3f(in.omega_map.xy + in.omega_map.zw * in.clip.xy, -1.0);
}

// Tangent plane of the ellipsoid where a chord ends, `side` from its midpoint, at depth z: as `plane_from_normal` of the
// sphere's normal, mapped back. The normal's length cancels.
fn chord_plane(in: Varying, chord: Chord, omega: vec3f, side: f32, z: f32) -> vec3f {
    let outwards = transpose(varying_to_sphere(in)) * (chord.f + side * chord.d);
    let ray = select(omega, vec3f(0.0, 0.0, -1.0), ORTHOGRAPHIC);
    let ray2 = dot(ray, ray);
    let along = dot(outwards, ray);
    // Not less than EDGE_ON times the lengths.
    let least = EDGE_ON * sqrt(dot(outwards, outwards) * ray2);
    let away = select(-outwards, outwards, along > 0.0) + max(least - abs(along), 0.0) / ray2 * ray;
    if ORTHOGRAPHIC {
        let slope = away.xy / -away.z;
        return vec3f(slope, dot(slope, omega.xy) - (in.range.y - z));
    }
    return away / (z * max(abs(along), least));
}

$early_depth @fragment
fn fragment(in: Varying) -> Fragment {
    let omega = fragment_omega(in);
    let chord = fragment_chord(in, omega);
    if !chord.hit {
        discard;
    }
    let side = select(-chord.half_length, chord.half_length, SIDE == BACK);
    var z = chord.middle + side;
    var pi = chord_plane(in, chord, omega, side, z);
    let near = in.range.x;
    if z < near {
        // The ray starts inside the liquid, which a front at the near plane marks.
        z = near;
        pi = vec3f(0.0, 0.0, select(-1.0 / near, near - in.range.y, ORTHOGRAPHIC));
    }
    return Fragment(vec4f(sized(pi, in), z), fragment_depth(in, z));
}

// The plane of a splat with its size, where sizes differ.
fn sized(pi: vec3f, in: Varying) -> vec3f {
    return select(pi, with_particle_size(pi, in.tag.z), SIZES);
}

// Value of the reversed depth buffer: 1 at the near plane.
fn depth_at(z: f32) -> f32 {
    return depth_within(vec2f(camera.near, camera.far), z);
}

// The same of a fragment.
fn fragment_depth(in: Varying, z: f32) -> f32 {
    return depth_within(in.range, z);
}

fn depth_within(range: vec2f, z: f32) -> f32 {
    return select(range.x / z, 1.0 - z / range.y, ORTHOGRAPHIC);
}
