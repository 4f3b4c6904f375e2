// Class and splat of each member: `src/liquid/classify/shape.rs` on the device. One thread per member,
// in sorted order.

#import classify/params.wgsl
#import classify/eigen.wgsl
#import classify/moments.wgsl
#import classify/sheets.wgsl
#import common/splat.wgsl

// As in `src/liquid/classify/moments.rs`.
const DENSITY_AROUND: f32 = 0.85;
const OFFSET_AROUND: f32 = 0.06;

@group(0) @binding(3) var<storage, read> order: array<vec2u>;         // member, and cell with its mark
@group(0) @binding(4) var<storage, read> tags: array<u32>;            // of each member, or one for all: fluid, GIVEN
@group(0) @binding(5) var<storage, read_write> splats: array<Splat>;  // in file order
// Mean of the neighbours, in h, and the share by which the member belongs to a sheet; 0 where the splat stays.
@group(0) @binding(6) var<storage, read_write> means: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> fields: array<f32>;    // density whose iso-surface is looked for

// Bit of the tags of a member whose shape the host knows.
const GIVEN: u32 = 0x80000000u;

// Eigenvalues of the covariance below this, in h^2, are rounding errors of coincident neighbours.
const COINCIDENT_SQUARED: f32 = 1e-8;

// With fewer neighbours the papers draw a sphere.
const FEW_NEIGHBOURS: u32 = 25u;

// Ratio of the covariance's trace to the squared mean below which the one-pass covariance has lost
// precision, as for small members beside large ones. The sums are then repeated about the mean.
const FAR_MEAN: f32 = 0.25;

// Longest semi-axis of a volume-preserving kernel, in r (Imai et al. 2016).
const VOLUME_CAP: f32 = 1.2;

@compute @workgroup_size(64)
fn shape(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let slot = group_index(group) * 64u + local;
    if slot >= starts[params.cells] || crowded() {
        return;
    }
    let member = order[slot];
    let cell = member.y & ~INTERIOR_CELL;
    let own = sorted[slot];
    let near = moments(own, cell, vec3f(0.0));
    let mean = near.first / near.weight;
    let tag = tags[select(0u, member.x, params.tagged != 0u)];

    var splat = Splat(own.xyz - params.shift, own.w, vec3f(0.0), member.x, vec3f(0.0), tag & ~GIVEN);
    var moved = vec4f(0.0);
    if cell != member.y {
        // One member stands for its cell: a sphere through the corners.
        let width = 1.0 / params.per_cell;
        splat.centre = params.least + width * (vec3f(cell_at(cell)) + 0.5) - params.shift;
        splat.diagonal = vec3f(0.5 * sqrt(3.0) * width);
        splat.tags |= select(HIDDEN, BURIED | INTERIOR, slot == starts[cell]);
    } else if near.weight < params.least_weight {
        splat.diagonal = vec3f(params.splash_radius * own.w);
        splat.tags |= SPLASH;
    } else {
        var spread = covariance(near);
        if dot(spread.diagonal, vec3f(1.0)) < FAR_MEAN * dot(mean, mean) {
            spread = covariance(moments(own, cell, mean));
        }
        let found = eigen(spread);
        let axes = semi_axes(found.values, near.count - 1u);
        let ellipsoid = compose(axes, found.vectors);
        let density = near.weight / params.density_at_rest;
        let surrounded = density >= DENSITY_AROUND && length(mean) <= OFFSET_AROUND;
        splat.centre += params.smoothing * params.support * own.w * mean;
        splat.diagonal = own.w * ellipsoid.diagonal;
        splat.off_diagonal = own.w * ellipsoid.off_diagonal;
        splat.tags |= select(0u, BURIED, surrounded);
        let stays = surrounded || near.count > params.most_neighbours || (tag & GIVEN) != 0u;
        moved = select(vec4f(mean, sheet(mean, Eigen(axes, found.vectors)).w), vec4f(0.0), stays);
    }
    splats[member.x] = splat;
    means[slot] = moved;
    fields[slot] = near.field;
}

// Semi-axes in r, from the eigenvalues of the covariance in h^2. The eigenvalues themselves, not their
// square roots, are the relative axes, as in Yu and Turk 2013.
fn semi_axes(spread: vec3f, neighbours: u32) -> vec3f {
    let longest = max(max(spread.x, spread.y), spread.z);
    var relative = vec3f(1.0);
    if longest > COINCIDENT_SQUARED {
        relative = max(spread / longest, vec3f(1.0 / params.max_ratio));
    }
    if params.volume_kernel == 0u {
        let shortest = min(min(relative.x, relative.y), relative.z);
        return min(params.short_axis / shortest * relative, vec3f(params.long_axis));
    }
    if neighbours < FEW_NEIGHBOURS {
        return vec3f(1.0);
    }
    let volume = relative.x * relative.y * relative.z;
    // Refines the inexact power by a step of Newton's method.
    var edge = pow(volume, 1.0 / 3.0);
    edge = (2.0 * edge + volume / (edge * edge)) / 3.0;
    return min(relative / edge, vec3f(VOLUME_CAP));
}
