// The points of the iso-surface around one of them.

#import classify/line.wgsl

@group(0) @binding(1) var<storage, read> line_starts: array<u32>;
@group(0) @binding(2) var<storage, read> points: array<Point>;

// Cosine between normals from which points count in the mean of normals, and at which they do so fully: the other
// side of a sheet does not.
const OTHER_SIDE_FROM: f32 = -0.5;
const ONE_SIDE: f32 = 0.5;

// The first and last cell of members whose points may count.
struct Cells {
    first: vec3u,
    last: vec3u,
}

// The cells of the members with points within `reach` r of a point.
fn cells_around(point: Point, reach: f32) -> Cells {
    let at = point.place + params.shift;
    let farthest = reach * point.radius + FARTHEST * params.largest_radius + 1e-6 * abs(at);
    return Cells(cell_around(at - farthest), cell_around(at + farthest));
}
