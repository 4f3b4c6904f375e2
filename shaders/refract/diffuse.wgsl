// Foam, spray, bubbles and dust at a pixel: diffuse/sums.wgsl.

#import diffuse/pixels.wgsl
#import refract/bindings.wgsl

override DIFFUSE: bool = false; // the frame has any

// Radiance times coverage, and coverage.
fn diffuse_of(sums: vec4u) -> vec4f {
    let depth = f32(sums.x) / DEPTH_UNITS;
    let covered = select(1.0 - exp(-depth), 1.0, depth >= OPAQUE_DEPTH);
    let radiance = vec3f(sums.yzw) / (COLOR_UNITS * max(depth, 1.0 / DEPTH_UNITS));
    return vec4f(covered * params.diffuse_white * radiance, covered);
}

fn diffuse_index(p: vec2i) -> u32 {
    return u32(p.y) * u32(camera.size.x) + u32(p.x);
}

// The spheres in the air at a pixel, over the radiance and coverage behind them.
fn behind_spheres(p: vec2i, seen: vec4f) -> vec4f {
    if !DIFFUSE {
        return seen;
    }
    let spheres = diffuse_of(diffuse_above[diffuse_index(p)]);
    return spheres + (1.0 - spheres.w) * seen;
}
