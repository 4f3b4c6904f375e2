// Weighted moments of a member's neighbourhood, in units of h.

#import classify/params.wgsl
#import classify/eigen.wgsl
#import classify/spline.wgsl

@group(0) @binding(1) var<storage, read> starts: array<u32>;
@group(0) @binding(2) var<storage, read> sorted: array<vec4f>; // position and radius, m

// Largest squared distance of a neighbour, in h^2. On a lattice many neighbours are at distance h,
// where their weight is 0; the margin makes their count independent of rounding.
const WITHIN: f32 = 1.00002;

// Safety factor for the reach in cells: cells are slightly wider than h of the median radius, so
// rounding moves no neighbour further.
const ROUNDING: f32 = 1.001;

struct Moments {
    count: u32,         // members within h, including the member itself
    weight: f32,        // sum of w, which includes the volume relative to the member's
    first: vec3f,       // sum of w x, x relative to a point near the member
    diagonal: vec3f,    // sums of w x^2, y^2, z^2
    off_diagonal: vec3f,// sums of w xy, xz, yz
    field: f32,         // sum of V W: the density whose iso-surface is looked for
}

// Yu and Turk's weight 1 - (d/h)^3 of a neighbour, from the square of d/h.
fn weight(square: f32) -> f32 {
    return max(1.0 - square * sqrt(square), 0.0);
}

// Moments of the member with position and radius `own` in `cell`, about the point at offset `point`
// from the member, in h.
fn moments(own: vec4f, cell: u32, point: vec3f) -> Moments {
    let h = params.support * own.w;
    let farthest = max(h, select(0.0, FIELD * own.w, params.most_neighbours > 0u));
    let per_field = params.support / FIELD;
    let reach = vec3u(u32(ceil(farthest * params.per_cell * ROUNDING)));
    let at = cell_at(cell);
    let first = at - min(at, reach);
    let last = min(at + reach, params.counts - 1u);

    var all = Moments();
    for (var z = first.z; z <= last.z; z++) {
        for (var y = first.y; y <= last.y; y++) {
            // A row of cells is one run of members. Each run is summed separately for precision.
            let begin = starts[cell_index(vec3u(first.x, y, z))];
            let end = starts[cell_index(vec3u(last.x, y, z)) + 1u];
            var run = Moments();
            for (var slot = begin; slot < end; slot++) {
                let other = sorted[slot];
                // Halves cannot overflow; distant members are clamped to twice the farthest that counts.
                let half = clamp(0.5 * other.xyz - 0.5 * own.xyz, vec3f(-farthest), vec3f(farthest));
                let offset = half * (2.0 / h);
                let square = dot(offset, offset);
                let volume = relative_volume(other.w, own.w);
                run.field += volume * spline(per_field * sqrt(square));
                if square > WITHIN {
                    continue;
                }
                let w = volume * weight(square);
                run.count += 1u;
                run.weight += w;
                let x = offset - point;
                run.first += w * x;
                run.diagonal += w * x * x;
                run.off_diagonal += w * x.xxy * x.yzz;
            }
            all.count += run.count;
            all.weight += run.weight;
            all.first += run.first;
            all.diagonal += run.diagonal;
            all.off_diagonal += run.off_diagonal;
            all.field += run.field;
        }
    }
    return all;
}

// Covariance about the mean, in h^2.
fn covariance(near: Moments) -> Symmetric {
    let mean = near.first / near.weight;
    return Symmetric(
        near.diagonal / near.weight - mean * mean,
        near.off_diagonal / near.weight - mean.xxy * mean.yzz,
    );
}
