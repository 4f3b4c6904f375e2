// Ellipsoids in view space: their bounds in the picture, and their intersections with pixels' rays.
//
// Bounds after Sigg, Weyrich, Botsch and Gross, GPU-Based Ray-Casting of Quadratic Surfaces (2006),
// with the discriminant expanded by hand: as published it loses all digits once an ellipsoid is
// 1e3 times as far away as it is large. The intersection is re-centred for the same reason: the ray
// is parametrised from its point at the centre's depth, so that squared terms are of the splat's size.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/splat.wgsl

// The map from view space to the space where the ellipsoid is the unit sphere: its columns and, in w, the centre in
// view space.
struct ViewSplat {
    x: vec4f,
    y: vec4f,
    z: vec4f,
}

fn view_splat(splat: Splat) -> ViewSplat {
    let to_sphere = symmetric_inverse(splat.diagonal, splat.off_diagonal) * transpose(camera.view_from_world);
    let centre = camera.view_from_world * (camera.origin + splat.centre);
    return ViewSplat(vec4f(to_sphere[0], centre.x), vec4f(to_sphere[1], centre.y), vec4f(to_sphere[2], centre.z));
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

// A rectangle of the picture: its left, upper, right and lower side, in pixels. Of nothing, it is turned inside out.
const NO_BOUNDS: vec4f = vec4f(1.0, 1.0, -1.0, -1.0);

// The bounding rectangle of an ellipsoid.
fn splat_bounds(placed: Placed) -> vec4f {
    let centre = placed.centre;
    let rows = placed.rows;
    let half_depth = length(rows[2]);
    if -centre.z + half_depth <= camera.near {
        return NO_BOUNDS; // entirely behind the near plane
    }
    if ORTHOGRAPHIC {
        let half = vec2f(length(rows[0]), length(rows[1]));
        return pixel_bounds(centre.xy - half, centre.xy + half);
    }
    if -centre.z - half_depth <= camera.near {
        let x = cut_slopes(rows[0], rows[2], centre.x, -centre.z, half_depth);
        let y = cut_slopes(rows[1], rows[2], centre.y, -centre.z, half_depth);
        return pixel_bounds(vec2f(x.x, y.x), vec2f(x.y, y.y));
    }
    // Tangent planes through the eye, { x = b z }: q b^2 - 2 r b - s = 0.
    let g = rows[2];
    let q = centre.z * centre.z - dot(g, g);
    let r = vec2f(dot(rows[0], g), dot(rows[1], g)) - centre.xy * centre.z;
    let discriminant = vec2f(
        tangent_discriminant(rows[0], g, centre.x, centre.z),
        tangent_discriminant(rows[1], g, centre.y, centre.z),
    );
    let root = sqrt(max(discriminant, vec2f(0.0)));
    return pixel_bounds((r - root) / q, (r + root) / q);
}

// The rectangle between two rays, given as the x and y of `camera_omega`; clamped far outside of the picture.
fn pixel_bounds(low: vec2f, high: vec2f) -> vec4f {
    let a = clamp((low - camera.shift) / camera.tangent, vec2f(-2.0), vec2f(2.0));
    let b = clamp((high - camera.shift) / camera.tangent, vec2f(-2.0), vec2f(2.0));
    return (vec4f(a.x, -b.y, b.x, -a.y) * 0.5 + 0.5) * camera.size.xyxy;
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

fn splat_chord(s: ViewSplat, omega: vec3f) -> Chord {
    let centre = vec3f(s.x.w, s.y.w, s.z.w);
    let to_sphere = sphere_map(s);
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
    let hit = discriminant >= 0.0 && middle + half_length >= camera.near;
    return Chord(hit, middle, half_length, f, d);
}

fn sphere_map(s: ViewSplat) -> mat3x3f {
    return mat3x3f(s.x.xyz, s.y.xyz, s.z.xyz);
}

// Tangent plane of the ellipsoid where a chord ends, `side` from its midpoint, at depth z: as `plane_from_normal` of the
// sphere's normal, mapped back. The normal's length cancels.
fn chord_plane(s: ViewSplat, chord: Chord, omega: vec3f, side: f32, z: f32) -> vec3f {
    let outwards = transpose(sphere_map(s)) * (chord.f + side * chord.d);
    let ray = select(omega, vec3f(0.0, 0.0, -1.0), ORTHOGRAPHIC);
    let ray2 = dot(ray, ray);
    let along = dot(outwards, ray);
    // Not less than EDGE_ON times the lengths.
    let least = EDGE_ON * sqrt(dot(outwards, outwards) * ray2);
    let away = select(-outwards, outwards, along > 0.0) + max(least - abs(along), 0.0) / ray2 * ray;
    if ORTHOGRAPHIC {
        let slope = away.xy / -away.z;
        return vec3f(slope, dot(slope, omega.xy) - (camera.far - z));
    }
    return away / (z * max(abs(along), least));
}

// Plane and depth of the ellipsoid's front at a pixel.
fn splat_front(s: ViewSplat, omega: vec3f) -> vec4f {
    let chord = splat_chord(s, omega);
    let near = camera.near;
    let z = chord.middle - chord.half_length;
    if z < near {
        // The ray starts inside the liquid, which a front at the near plane marks.
        return vec4f(0.0, 0.0, select(-1.0 / near, near - camera.far, ORTHOGRAPHIC), near);
    }
    return vec4f(chord_plane(s, chord, omega, -chord.half_length, z), z);
}

// The same of its back.
fn splat_back(s: ViewSplat, omega: vec3f) -> vec4f {
    let chord = splat_chord(s, omega);
    let z = chord.middle + chord.half_length;
    return vec4f(chord_plane(s, chord, omega, chord.half_length, z), z);
}
