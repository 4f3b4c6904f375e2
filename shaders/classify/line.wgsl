// A line from a member on which the iso-surface is looked for, and the point of the surface on it.

#import classify/params.wgsl

struct Line {
    out: vec3f,  // unit vector
    tag: u32,    // the kind in the lowest two bits, above them the sorted index of the member
}

// Kinds of lines. A member's follow each other in this order.
const OUT: u32 = 0u;
const SIDE: u32 = 1u;
const OTHER_SIDE: u32 = 2u;
// Where the list ends between a sheet's two.
const NO_LINE: u32 = 3u;

// A point of the surface.
struct Point {
    place: vec3f,   // relative to the splats' origin, m
    radius: f32,    // of its particle, m
    normal: vec3f,
    found: u32,     // 0: there is no surface on the line
}

// Offset of the neighbours' mean, in h, from which splats are moved, and at which they are moved all the way.
const LEAST_OFFSET: f32 = 0.05;
const FULL_OFFSET: f32 = 0.08;

// Farthest that the surface may be from a particle, in r.
const FARTHEST: f32 = 3.0;
// Largest distance between a particle of a sheet and the sheet's sides, in r.
const HALF_SHEET: f32 = 2.0;

// Whether a member with this mean, in h, and share of a sheet has a line out of the liquid.
fn goes_out(mean: vec4f) -> bool {
    return length(mean.xyz) >= LEAST_OFFSET;
}

// Whether it has lines to the sides of a sheet.
fn has_sides(mean: vec4f) -> bool {
    return mean.w > 0.0;
}

// Number of listed lines.
fn listed(all: u32) -> u32 {
    return min(all, params.most_lines);
}
