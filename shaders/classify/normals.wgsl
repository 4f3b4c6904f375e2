// Normals of the points of the iso-surface, averaged over the points around them, one thread per point.

#import classify/around.wgsl

@group(0) @binding(3) var<storage, read_write> normals: array<vec4f>; // 0 in w: there is no point

// Radius of the mean, in r.
const NORMALS: f32 = 3.0;

@compute @workgroup_size(64)
fn mean_normals(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = group_index(group) * 64u + local;
    let all = listed(line_starts[params.cells]);
    if crowded() || i >= all {
        return;
    }
    let point = points[i];
    if point.found == 0u {
        normals[i] = vec4f(0.0);
        return;
    }
    let cells = cells_around(point, NORMALS);
    var sum = vec3f(0.0);
    for (var z = cells.first.z; z <= cells.last.z; z++) {
        for (var y = cells.first.y; y <= cells.last.y; y++) {
            let end = min(line_starts[cell_index(vec3u(cells.last.x, y, z)) + 1u], all);
            for (var k = line_starts[cell_index(vec3u(cells.first.x, y, z))]; k < end; k++) {
                let other = points[k];
                let to = (other.place - point.place) / point.radius;
                let near = 1.0 - dot(to, to) / (NORMALS * NORMALS);
                if other.found != 0u && near > 0.0 {
                    let one_side = smoothstep(OTHER_SIDE_FROM, ONE_SIDE, dot(point.normal, other.normal));
                    sum += near * near * one_side * other.normal;
                }
            }
        }
    }
    let size = length(sum);
    normals[i] = vec4f(select(point.normal, sum / max(size, 1e-30), size > 1e-30), 1.0);
}
