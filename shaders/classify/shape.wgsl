// Class and shape of each member: `src/liquid/classify/shape.rs` on the device. One thread per member,
// in sorted order.

#import classify/sums.wgsl
#import classify/eigen.wgsl
#import classify/moments.wgsl

// Result for one member, from which the host builds its splat.
struct Shaped {
    mean: vec3f,         // of the neighbours from the member, m
    density: f32,        // relative to that inside a body at rest
    diagonal: vec3f,     // A_xx, A_yy, A_zz, m
    flags: u32,          // SPLASH, SURROUNDED
    off_diagonal: vec3f, // A_xy, A_xz, A_yz, m
    count: u32,          // members within h, including itself
}

const SPLASH: u32 = 1u;
const SURROUNDED: u32 = 2u;

// As in `src/liquid/classify/moments.rs`.
const DENSITY_AROUND: f32 = 0.85;
const OFFSET_AROUND: f32 = 0.06;

@group(0) @binding(3) var<storage, read> order: array<vec2u>; // member and cell
@group(0) @binding(4) var<storage, read> sums: array<Sum>;
@group(0) @binding(5) var<storage, read_write> shaped: array<Shaped>; // in file order

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
    if slot >= params.members || crowded(sums[blocks()]) {
        return;
    }
    let member = order[slot];
    let own = sorted[slot];
    let near = moments(own, member.y, vec3f(0.0));
    let mean = near.first / near.weight;

    var result = Shaped();
    result.density = near.weight / params.density_at_rest;
    result.count = near.count;
    if near.weight < params.least_weight {
        result.flags = SPLASH;
        result.diagonal = vec3f(params.splash_radius * own.w);
    } else {
        var spread = covariance(near);
        if dot(spread.diagonal, vec3f(1.0)) < FAR_MEAN * dot(mean, mean) {
            spread = covariance(moments(own, member.y, mean));
        }
        let ellipsoid = kernel(spread, near.count - 1u);
        let surrounded = result.density >= DENSITY_AROUND && length(mean) <= OFFSET_AROUND;
        result.flags = select(0u, SURROUNDED, surrounded);
        result.mean = params.support * own.w * mean;
        result.diagonal = own.w * ellipsoid.diagonal;
        result.off_diagonal = own.w * ellipsoid.off_diagonal;
    }
    shaped[member.x] = result;
}

// Kernel of a neighbourhood, in r: the matrix with the eigenvectors of the covariance and the
// semi-axes as eigenvalues.
fn kernel(covariance: Symmetric, neighbours: u32) -> Symmetric {
    let found = eigen(covariance);
    return compose(semi_axes(found.values, neighbours), found.vectors);
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
