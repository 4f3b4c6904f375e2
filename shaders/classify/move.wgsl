// Moves splats so that they end at the smoothed iso-surface, one thread per line, of which a member's first does the
// work: `Point::change` of `src/liquid/classify/iso_surface.rs` on the device.

#import classify/around.wgsl
#import classify/sheets.wgsl
#import common/splat.wgsl

@group(0) @binding(3) var<storage, read> normals: array<vec4f>;  // 0 in w: there is no point
@group(0) @binding(4) var<storage, read> lines: array<Line>;
@group(0) @binding(5) var<storage, read> means: array<vec4f>;    // in h, and share of a sheet
@group(0) @binding(6) var<storage, read> order: array<vec2u>;    // member, and cell with its mark
@group(0) @binding(7) var<storage, read_write> splats: array<Splat>;

// Radius of the smoothing step, in r.
const SMOOTHING: f32 = 3.5;
// Cosine between normals from which points count, and at which they do so fully: edges should survive.
const OTHER_FACE: f32 = 0.35;
const ONE_FACE: f32 = 0.95;
// Largest share by which one side's distance is reduced, so that axes stay positive.
const THINNEST: f32 = 0.75;

// A times a vector.
fn stretched(splat: Splat, v: vec3f) -> vec3f {
    let d = splat.diagonal;
    let o = splat.off_diagonal;
    return vec3f(
        d.x * v.x + o.x * v.y + o.y * v.z,
        o.x * v.x + d.y * v.y + o.z * v.z,
        o.y * v.x + o.z * v.y + d.z * v.z,
    );
}

// How far a step of Laplacian smoothing moves a point along its normal, m.
fn smoothing(i: u32, all: u32) -> f32 {
    let point = points[i];
    let normal = normals[i].xyz;
    let cells = cells_around(point, SMOOTHING);
    var sum = vec2f(0.0);
    for (var z = cells.first.z; z <= cells.last.z; z++) {
        for (var y = cells.first.y; y <= cells.last.y; y++) {
            let end = min(line_starts[cell_index(vec3u(cells.last.x, y, z)) + 1u], all);
            for (var k = line_starts[cell_index(vec3u(cells.first.x, y, z))]; k < end; k++) {
                let other = normals[k];
                let to = (points[k].place - point.place) / point.radius;
                let near = 1.0 - dot(to, to) / (SMOOTHING * SMOOTHING);
                if other.w > 0.0 && near > 0.0 {
                    let w = near * near * smoothstep(OTHER_FACE, ONE_FACE, dot(normal, other.xyz));
                    sum += w * vec2f(dot(to, normal), 1.0);
                }
            }
        }
    }
    return select(0.0, point.radius * sum.x / max(sum.y, 1e-30), sum.y > 0.0);
}

@compute @workgroup_size(64)
fn move_splats(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let first = group_index(group) * 64u + local;
    let all = listed(line_starts[params.cells]);
    if crowded() || first >= all {
        return;
    }
    let slot = lines[first].tag >> 2u;
    let kind = lines[first].tag & 3u;
    let mean = means[slot];
    if kind == OTHER_SIDE || kind == NO_LINE || (kind == SIDE && goes_out(mean)) {
        return;
    }
    let count = u32(goes_out(mean)) + 2u * u32(has_sides(mean));
    if first + count > all {
        return;
    }
    let member = order[slot].x;
    let before = splats[member];
    var splat = before;
    for (var i = first; i < first + count; i++) {
        if normals[i].w == 0.0 {
            continue;
        }
        let normal = normals[i].xyz;
        let level = smoothing(i, all);
        let surface = points[i].place - before.centre;
        if (lines[i].tag & 3u) == OUT {
            // The sides of a sheet have points of their own: this one is for its rim.
            var share = smoothstep(LEAST_OFFSET, FULL_OFFSET, length(mean.xyz));
            if has_sides(mean) {
                share *= 1.0 - mean.w * abs(dot(normal, lines[i + 1u].out));
            }
            let up = dot(surface, normal) + level - length(stretched(before, normal));
            splat.centre += share * up * normal;
        } else {
            // The centre halfway between the sides: each moves it by half of its own way.
            let out = lines[i].out;
            let axis = length(stretched(before, out));
            let up = dot(surface + level * normal, out) - axis;
            let half = 0.5 * mean.w * max(up, -THINNEST * axis);
            splat.centre += half * out;
            splat.diagonal += half * out * out;
            splat.off_diagonal += half * out.xxy * out.yzz;
        }
    }
    splats[member] = splat;
}
