// Copies of bodies' splats on the solids that they rest on: `add_wall_contacts` of `src/liquid/classify/walls.rs` on the
// device. Listed by cell, one thread per cell, behind the splats of the members.

#import classify/params.wgsl
#import common/splat.wgsl

// A solid whose distance has a closed form.
struct Wall {
    middle: vec3f,   // relative to the splats' origin, m
    kind: u32,
    // Of a plane the normal, of a box half its sides, m.
    extent: vec3f,
    size: f32,       // of a plane half the side of its square, of a sphere the radius, m
    tags: u32,       // of copies on a plane, in front of it
    behind: u32,     // further bits of those behind it
    pad: vec2u,
}

const PLANE: u32 = 0u;
const BOX: u32 = 1u;
const SPHERE: u32 = 2u;

@group(0) @binding(1) var<storage, read> starts: array<u32>;
@group(0) @binding(2) var<storage, read> order: array<vec2u>;  // member, and cell with its mark
@group(0) @binding(3) var<storage, read> walls: array<Wall>;
@group(0) @binding(4) var<storage, read> copy_starts: array<u32>;
@group(0) @binding(5) var<storage, read_write> copy_counts: array<u32>;
@group(0) @binding(6) var<storage, read_write> splats: array<Splat>;

// The unit normal of a solid's surface where it is nearest to a place, and the distance; a negative one inside.
fn nearest(wall: Wall, place: vec3f) -> vec4f {
    let offset = place - wall.middle;
    if wall.kind == SPHERE {
        let distance = length(offset);
        return vec4f(select(vec3f(0.0, 1.0, 0.0), offset / distance, distance > 0.0), distance - wall.size);
    }
    if wall.kind == BOX {
        let face = abs(offset) - wall.extent;
        let outside = max(face, vec3f(0.0));
        let most = max(max(face.x, face.y), face.z);
        let towards = select(outside, vec3f(face == vec3f(most)), all(outside == vec3f(0.0)));
        return vec4f(normalize(towards * sign(offset)), length(outside) + min(most, 0.0));
    }
    // Drops the axis closest to the normal, as `plane_coordinates` does.
    let a = abs(wall.extent);
    var within = offset.xy;
    if a.y >= max(a.x, a.z) {
        within = offset.xz;
    } else if a.x >= a.z {
        within = offset.zy;
    }
    let above = dot(offset, wall.extent);
    let is_beside = max(abs(within.x), abs(within.y)) > wall.size;
    return select(vec4f(wall.extent, above), vec4f(wall.extent, 3e38), is_beside);
}

// The copy of a splat on a wall; hidden if it does not touch.
fn copy_on(wall: Wall, splat: Splat) -> Splat {
    var found = nearest(wall, splat.centre);
    var tags = wall.tags;
    if wall.kind == PLANE && found.w < 0.0 {
        found = -found;
        tags |= wall.behind;
    }
    var copied = splat;
    copied.centre -= found.w * found.xyz;
    let touches = found.w > 0.0 && found.w <= params.wetting * splat.radius
        && (splat.tags & (SPLASH | HIDDEN)) == 0u;
    copied.tags = select(HIDDEN, splat.tags | tags, touches);
    return copied;
}

@compute @workgroup_size(64)
fn count_copies(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let cell = group_index(group) * 64u + local;
    if cell >= params.cells || crowded() {
        return;
    }
    var count = 0u;
    for (var slot = starts[cell]; slot < starts[cell + 1u]; slot++) {
        let splat = splats[order[slot].x];
        for (var i = 0u; i < arrayLength(&walls); i++) {
            count += u32((copy_on(walls[i], splat).tags & HIDDEN) == 0u);
        }
    }
    copy_counts[cell] = count;
}

@compute @workgroup_size(64)
fn list_copies(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let cell = group_index(group) * 64u + local;
    if cell >= params.cells || crowded() {
        return;
    }
    var at = copy_starts[cell];
    for (var slot = starts[cell]; slot < starts[cell + 1u]; slot++) {
        let splat = splats[order[slot].x];
        for (var i = 0u; i < arrayLength(&walls); i++) {
            let copied = copy_on(walls[i], splat);
            if (copied.tags & HIDDEN) == 0u {
                if at < params.most_copies {
                    splats[params.members + at] = copied;
                }
                at += 1u;
            }
        }
    }
}

// Hides what the list leaves free.
@compute @workgroup_size(64)
fn hide_copies(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = group_index(group) * 64u + local;
    if i < params.most_copies && (crowded() || i >= copy_starts[params.cells]) {
        splats[params.members + i].tags = HIDDEN;
    }
}
