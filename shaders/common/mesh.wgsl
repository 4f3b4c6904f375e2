// Triangle meshes: where rays meet them, whether a point is near one, and their colours.
//
// A mesh has a space of its own, with its middle at the origin; a solid scales, rotates and moves it into
// the world. Lengths along a ray are the same in both spaces, since directions are scaled like points.
//
// Rows of `mesh_geometry`: a mesh begins with the low corner of its box, and the step of boxes within it, a
// 65535th of its size. Nodes follow depth first, so that no stack is needed: a software adapter turns one into a
// branch for each of its places. A node is its box in these steps, 16 bits for the low and 16 for the high side
// along each axis, and a number whose last 3 bits count its triangles. The others are the first of them, or, of an
// inner node, the node after all its descendants. Triangles follow the nodes, with three vertices each. Rows are
// integers, because a device may flush small floats to 0.

// A texture, because software adapters fetch a texel at once, but load each number of a buffer by itself.
@group(2) @binding(7) var mesh_geometry: texture_2d<u32>;
// Attributes of triangles, materials, and textures with their mip levels.
@group(2) @binding(8) var<storage, read> mesh_surfaces: array<u32>;

const NO_TRIANGLE: u32 = 0xffffffffu;

// Rows before a mesh's first node.
const MESH_HEADER: u32 = 2u;

struct MeshHit {
    t: f32,
    triangle: u32, // NO_TRIANGLE if none
}

// A vector of the world in the mesh's axes: rotated by the inverse of the unit quaternion q.
fn mesh_axes_from_world(q: vec4f, v: vec3f) -> vec3f {
    let u = -q.xyz;
    return v + 2.0 * cross(u, cross(u, v) + q.w * v);
}

fn world_from_mesh_axes(q: vec4f, v: vec3f) -> vec3f {
    return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v);
}

// Logarithm of the texture's width (WIDTH in src/passes/mesh_buffers.rs).
const MESH_WIDTH_BITS: u32 = 12u;

fn mesh_row(row: u32) -> vec4u {
    let at = vec2u(row & ((1u << MESH_WIDTH_BITS) - 1u), row >> MESH_WIDTH_BITS);
    return textureLoad(mesh_geometry, vec2i(at), 0);
}

fn mesh_corner(row: u32) -> vec3f {
    return bitcast<vec3f>(mesh_row(row).xyz);
}

// Bound on the nodes that a search visits.
fn most_nodes() -> u32 {
    let size = textureDimensions(mesh_geometry);
    return size.x * size.y;
}

// Nearest triangle of the solid's mesh on o + t d, 0 < t < far, or any one.
fn mesh_trace(index: u32, world_o: vec3f, world_d: vec3f, far: f32, any_one: bool) -> MeshHit {
    let solid = solids[index];
    let per_metre = solid.extent.y;
    let d = per_metre * mesh_axes_from_world(solid.rotation, world_d);
    var o = per_metre * mesh_axes_from_world(solid.rotation, world_o - solid.origin);
    // Rays from afar start where they pass the middle: differences of small numbers are precise.
    let distant = dot(o, o) > 4.0 * solid.extent.z * solid.extent.z;
    let skipped = select(0.0, -dot(o, d) / dot(d, d), distant);
    o += skipped * d;

    let nearest = -skipped;
    var hit = MeshHit(far - skipped, NO_TRIANGLE);
    let slope = 1.0 / select(d, vec3f(1e-20), abs(d) < vec3f(1e-20));
    // In parts of the mesh's box.
    let part = mesh_corner(solid.mesh.x + 1u);
    let box_o = (o - mesh_corner(solid.mesh.x)) / part;
    let box_slope = slope * part;
    if box_entry(vec3u(0xffff0000u), box_o, box_slope, nearest, hit.t) >= NOTHING {
        return MeshHit(NOTHING, NO_TRIANGLE);
    }
    let across = plane_across(d);
    let nodes = solid.mesh.x + MESH_HEADER;
    let triangles = solid.mesh.y;
    var node = nodes;
    // Boxes first, then a leaf's triangles: a software adapter runs a loop's body once even where no ray needs
    // it, and triangles take longer than boxes.
    for (var leaves = 0u; leaves < most_nodes() && node < triangles; leaves++) {
        var first = 0u;
        var count = 0u;
        for (var visited = 0u; visited < most_nodes() && node < triangles && count == 0u; visited++) {
            let row = mesh_row(node);
            let entered = box_entry(row.xyz, box_o, box_slope, nearest, hit.t) < NOTHING;
            first = row.w >> 3u;
            let inner = (row.w & 7u) == 0u;
            count = select(0u, row.w & 7u, entered);
            node = select(node + 1u, nodes + first, inner && !entered);
        }
        for (var i = first; i < first + count; i++) {
            let t = triangle_trace(triangles + 3u * i, o, d, across);
            if t > nearest && t < hit.t {
                hit = MeshHit(t, i);
            }
        }
        if any_one && hit.triangle != NO_TRIANGLE {
            break;
        }
    }
    return MeshHit(select(hit.t + skipped, NOTHING, hit.triangle == NO_TRIANGLE), hit.triangle);
}

// Sides of a node's box, in parts of the mesh's.
fn low_side(sides: vec3u) -> vec3f {
    return vec3f(vec3i(sides & vec3u(0xffffu)));
}

fn high_side(sides: vec3u) -> vec3f {
    return vec3f(vec3i(sides >> vec3u(16u)));
}

// Where the ray enters a node's box, or NOTHING if it does not between two lengths. Wider than the box by more
// than the rounding of this computation (Ize 2013).
fn box_entry(sides: vec3u, o: vec3f, slope: vec3f, nearest: f32, farthest: f32) -> f32 {
    let to_min = (low_side(sides) - o) * slope;
    let to_max = (high_side(sides) - o) * slope;
    let low = min(to_min, to_max);
    let high = max(to_min, to_max);
    let enter = max(max(low.x, low.y), low.z);
    let leave = min(min(high.x, high.y), high.z);
    let slack = 1e-6 * max(abs(enter), abs(leave));
    let missed = enter > leave + slack || leave + slack < nearest || enter - slack > farthest;
    return select(max(enter, nearest), NOTHING, missed);
}

// Vectors whose products with a point are its coordinates in the plane across the ray through the origin, seen
// along the ray: a shear along the direction's largest component (Woop, Benthin and Wald 2013).
fn plane_across(d: vec3f) -> mat2x3f {
    let a = abs(d);
    let along_x = a.x >= max(a.y, a.z);
    let along_y = !along_x && a.y >= a.z;
    let r = d / select(select(d.z, d.y, along_y), d.x, along_x);
    let x = select(select(vec3f(1.0, 0.0, -r.x), vec3f(1.0, -r.x, 0.0), along_y), vec3f(-r.y, 1.0, 0.0), along_x);
    let y = select(select(vec3f(0.0, 1.0, -r.y), vec3f(0.0, -r.z, 1.0), along_y), vec3f(-r.z, 0.0, 1.0), along_x);
    return mat2x3f(x, y);
}

// Relative rounding error of an edge function below, from two products and their difference: 4 half units in
// the last place.
const EDGE_ROUNDING: f32 = 2.4e-7;
// Distance from an edge that counts as a hit, relative to the largest coordinate: above the rounding of a
// corner's place across the ray, 7 half units, on both sides of the edge.
const ON_EDGE: f32 = 1e-6;

// Length along the ray to a triangle, or NOTHING. Rays that pass an edge within rounding hit both its
// triangles, so that none passes between them, and at the edge: a needle's, or a grazed triangle's plane may
// be anywhere. `across` is `plane_across(d)`.
fn triangle_trace(row: u32, o: vec3f, d: vec3f, across: mat2x3f) -> f32 {
    let corner_a = mesh_corner(row);
    let corner_b = mesh_corner(row + 1u);
    let corner_c = mesh_corner(row + 2u);
    var a = corner_a - o;
    var b = corner_b - o;
    var c = corner_c - o;
    // Row vectors times a matrix.
    var p = a * across;
    var q = b * across;
    var r = c * across;
    let plus = vec3f(q.x * r.y, r.x * p.y, p.x * q.y);
    let minus = vec3f(q.y * r.x, r.y * p.x, p.y * q.x);
    let edges = plus - minus;
    let slack = EDGE_ROUNDING * (abs(plus) + abs(minus));
    if !(all(edges >= -slack) || all(edges <= slack)) {
        return NOTHING;
    }
    let inv_d2 = 1.0 / dot(d, d);
    let lengths = vec3f(dot(a, d), dot(b, d), dot(c, d)) * inv_d2;
    let least = min(min(lengths.x, lengths.y), lengths.z);
    let most = max(max(lengths.x, lengths.y), lengths.z);
    // The two shorter edges meet in the first corner (`put_mesh`). They are not differences of rounded ones.
    let n = cross(corner_a - corner_c, corner_b - corner_a);
    let slope = dot(n, d);
    var t = clamp(select(dot(n, a) / slope, least, abs(slope) < 1e-37), least, most);
    let on_edge = !(all(edges > slack) || all(edges < -slack));
    let within = ON_EDGE * max(max(size_of(a), size_of(b)), size_of(c));
    var nearest2 = within * within;
    t = select(t, NOTHING, on_edge);
    // As a loop, which a software adapter skips where no ray needs it.
    for (var i = 0u; i < select(0u, 3u, on_edge); i++) {
        let edge = q - p;
        let along = clamp(-dot(p, edge) / max(dot(edge, edge), 1e-37), 0.0, 1.0);
        let off = p + along * edge;
        let off2 = dot(off, off);
        t = select(t, dot(a + along * (b - a), d) * inv_d2, off2 <= nearest2);
        nearest2 = min(nearest2, off2);
        let first = a;
        a = b;
        b = c;
        c = first;
        let first_across = p;
        p = q;
        q = r;
        r = first_across;
    }
    return t;
}

// Largest component of a vector.
fn size_of(v: vec3f) -> f32 {
    return max(max(abs(v.x), abs(v.y)), abs(v.z));
}

// Geometric unit normal of a triangle of the solid's mesh, in the world.
fn mesh_normal(index: u32, triangle: u32) -> vec3f {
    let row = solids[index].mesh.y + 3u * triangle;
    let a = mesh_corner(row);
    let n = cross(mesh_corner(row + 1u) - a, mesh_corner(row + 2u) - a);
    // The product of a sliver's sides may be 0 in 32 bits.
    let size = size_of(n);
    let normal = select(vec3f(0.0, 1.0, 0.0), normalize(n / size), size > 0.0);
    return world_from_mesh_axes(solids[index].rotation, normal);
}

// Whether the solid's mesh is within `reach` of x.
fn mesh_is_near(index: u32, world_x: vec3f, reach: f32) -> bool {
    let solid = solids[index];
    let x = solid.extent.y * mesh_axes_from_world(solid.rotation, world_x - solid.origin);
    let most = solid.extent.y * reach * solid.extent.y * reach;
    let low = mesh_corner(solid.mesh.x);
    let part = mesh_corner(solid.mesh.x + 1u);
    let nodes = solid.mesh.x + MESH_HEADER;
    var node = nodes;
    for (var visited = 0u; visited < most_nodes() && node < solid.mesh.y; visited++) {
        let row = mesh_row(node);
        let offset = x - clamp(x, low + low_side(row.xyz) * part, low + high_side(row.xyz) * part);
        let near = dot(offset, offset) <= most;
        let first = row.w >> 3u;
        let count = row.w & 7u;
        node = select(node + 1u, nodes + first, count == 0u && !near);
        for (var i = first; i < first + select(0u, count, near); i++) {
            if triangle_distance2(solid.mesh.y + 3u * i, x) <= most {
                return true;
            }
        }
    }
    return false;
}

// Squared distance of x from a triangle.
fn triangle_distance2(row: u32, x: vec3f) -> f32 {
    let a = mesh_corner(row) - x;
    let b = mesh_corner(row + 1u) - x;
    let c = mesh_corner(row + 2u) - x;
    let n = cross(b - a, c - a);
    let above = all(vec3f(dot(n, cross(b, c)), dot(n, cross(c, a)), dot(n, cross(a, b))) >= vec3f(0.0));
    let height = dot(n, a);
    let beside = min(min(segment_distance2(a, b), segment_distance2(b, c)), segment_distance2(c, a));
    return select(beside, height * height / max(dot(n, n), 1e-30), above);
}

// Squared distance of the segment from a to b from the origin.
fn segment_distance2(a: vec3f, b: vec3f) -> f32 {
    let along = b - a;
    let nearest = a + along * clamp(-dot(a, along) / max(dot(along, along), 1e-30), 0.0, 1.0);
    return dot(nearest, nearest);
}

// Words of a triangle's attributes: the place of its material; texture coordinates and normals of its corners.
const MESH_ATTRIBUTES: u32 = 10u;
// A normal that is not there.
const NO_NORMAL: u32 = 0x80008000u;

// Shares of a triangle's corners in the point of the plane that is nearest to x.
fn mesh_shares(solid: Solid, triangle: u32, world_x: vec3f) -> vec3f {
    let row = solid.mesh.y + 3u * triangle;
    let x = solid.extent.y * mesh_axes_from_world(solid.rotation, world_x - solid.origin);
    let a = mesh_corner(row) - x;
    let b = mesh_corner(row + 1u) - x;
    let c = mesh_corner(row + 2u) - x;
    let n = cross(b - a, c - a);
    let shares = max(vec3f(dot(n, cross(b, c)), dot(n, cross(c, a)), dot(n, cross(a, b))), vec3f(0.0));
    return shares / max(shares.x + shares.y + shares.z, 1e-37);
}

// Shading normal at x, on the side of the triangle's own: interpolated, if the mesh has normals.
fn mesh_shading_normal(solid: Solid, triangle: u32, x: vec3f, normal: vec3f) -> vec3f {
    let words = solid.mesh.z + MESH_ATTRIBUTES * triangle + 7u;
    let shares = mesh_shares(solid, triangle, x);
    var sum = vec3f(0.0);
    for (var i = 0u; i < 3u; i++) {
        let packed = mesh_surfaces[words + i];
        if packed == NO_NORMAL {
            return normal;
        }
        sum += shares[i] * octahedral(unpack2x16snorm(packed));
    }
    let smooth_normal = world_from_mesh_axes(solid.rotation, normalize(sum));
    return select(-smooth_normal, smooth_normal, dot(smooth_normal, normal) >= 0.0);
}

// Unit vector of a point on the unfolded octahedron (Cigolle et al. 2014).
fn octahedral(p: vec2f) -> vec3f {
    let z = 1.0 - abs(p.x) - abs(p.y);
    let fold = max(-z, 0.0);
    return normalize(vec3f(p - select(vec2f(-fold), vec2f(fold), p >= vec2f(0.0)), z));
}

// Colour of the mesh's own material at x, for a ray of this width.
fn mesh_color(solid: Solid, triangle: u32, x: vec3f, cos_theta: f32, width: f32) -> vec3f {
    let words = solid.mesh.z + MESH_ATTRIBUTES * triangle;
    let material = mesh_surfaces[words];
    let color = vec3f(surface_float(material), surface_float(material + 1u), surface_float(material + 2u));
    let texture = mesh_surfaces[material + 3u];
    if texture == 0u {
        return color;
    }
    let shares = mesh_shares(solid, triangle, x);
    var corners: array<vec2f, 3>;
    for (var i = 0u; i < 3u; i++) {
        corners[i] = vec2f(surface_float(words + 1u + 2u * i), surface_float(words + 2u + 2u * i));
    }
    let uv = shares.x * corners[0] + shares.y * corners[1] + shares.z * corners[2];
    let row = solid.mesh.y + 3u * triangle;
    let a = mesh_corner(row);
    let area = length(cross(mesh_corner(row + 1u) - a, mesh_corner(row + 2u) - a)) * solid.extent.x * solid.extent.x;
    let sides = mat2x2f(corners[1] - corners[0], corners[2] - corners[0]);
    // Copies of the texture per metre.
    let density = sqrt(abs(determinant(sides)) / max(area, 1e-37));
    return color * texture_color(texture, uv, density * width * inverseSqrt(max(abs(cos_theta), 0.05)));
}

fn surface_float(word: u32) -> f32 {
    return bitcast<f32>(mesh_surfaces[word]);
}

// Colour of a repeating texture over a footprint of this width, in copies of the texture.
fn texture_color(texture: u32, uv: vec2f, width: f32) -> vec3f {
    let size = vec2u(mesh_surfaces[texture], mesh_surfaces[texture + 1u]);
    let levels = mesh_surfaces[texture + 2u];
    let side = sqrt(f32(size.x) * f32(size.y));
    let level = select(0.0, clamp(log2(max(width * side, 1.0)), 0.0, f32(levels - 1u)), FILTER_PATTERNS);
    let lower = u32(level);
    let sharp = texture_level(texture, uv, size, lower);
    if f32(lower) == level {
        return sharp;
    }
    return mix(sharp, texture_level(texture, uv, size, lower + 1u), level - f32(lower));
}

// Bilinear lookup in a mip level.
fn texture_level(texture: u32, uv: vec2f, full: vec2u, level: u32) -> vec3f {
    var start = texture + 3u;
    var size = full;
    for (var i = 0u; i < level; i++) {
        start += size.x * size.y;
        size = max(size / 2u, vec2u(1u));
    }
    let at = (uv - floor(uv)) * vec2f(size) - 0.5;
    let base = floor(at);
    let f = at - base;
    let low = vec2u(vec2i(base) + vec2i(size)) % size;
    let high = (low + 1u) % size;
    let top = mix(texel(start + low.y * size.x + low.x), texel(start + low.y * size.x + high.x), f.x);
    let bottom = mix(texel(start + high.y * size.x + low.x), texel(start + high.y * size.x + high.x), f.x);
    return mix(top, bottom, f.y);
}

// Linear colour of an sRGB-encoded texel.
fn texel(word: u32) -> vec3f {
    let c = unpack4x8unorm(mesh_surfaces[word]).rgb;
    return select(pow((c + 0.055) / 1.055, vec3f(2.4)), c / 12.92, c <= vec3f(0.04045));
}
