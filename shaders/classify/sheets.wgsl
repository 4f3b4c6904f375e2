// Sheets, whose splats have the surface on both sides.

#import classify/eigen.wgsl
#import classify/line.wgsl

// Along the short axis, the offsets of `line.wgsl` are those at which a sheet begins to have two different sides, and at
// which it is none.

// Ratio of the two shorter axes up to which a splat is flat enough for a sheet's, and from which it is not.
const FLAT: f32 = 0.7;
const NOT_FLAT: f32 = 0.9;

// The normal of the sheet that a member with these semi-axes belongs to, whose neighbours have this mean, in h; in w the
// share by which it does.
fn sheet(mean: vec3f, axes: Eigen) -> vec4f {
    let a = axes.values;
    var axis = axes.vectors[0];
    var lengths = vec2f(a.x, min(a.y, a.z));
    if a.y < a.x && a.y <= a.z {
        axis = axes.vectors[1];
        lengths = vec2f(a.y, min(a.x, a.z));
    } else if a.z < a.x && a.z < a.y {
        axis = axes.vectors[2];
        lengths = vec2f(a.z, min(a.x, a.y));
    }
    let flatness = smoothstep(FLAT, NOT_FLAT, lengths.x / lengths.y);
    let offset = smoothstep(LEAST_OFFSET, FULL_OFFSET, abs(dot(mean, axis)));
    return vec4f(axis, (1.0 - offset) * (1.0 - flatness));
}
