// Adds the motion of the spheres in the air to their pixels, weighted by the shares of the pixels that they cover. Sums of
// integers do not depend on the order.

#import diffuse/discs.wgsl
#import diffuse/particles.wgsl
#import surface/before.wgsl

struct Sum {
    right: atomic<i32>,
    down: atomic<i32>,
    covered: atomic<i32>,
    pad: i32,
}

// Disparities of the nearest opaque spheres in the air and in the liquid, as bits.
@group(1) @binding(1) var<storage, read_write> opaque: array<vec2u>;
@group(3) @binding(0) var<uniform> before: Before;
@group(3) @binding(1) var<storage, read> sphere_velocities: array<f32>; // three for each sphere, m/s
@group(3) @binding(2) var<storage, read_write> sums: array<Sum>;        // by pixel
@group(3) @binding(3) var shown: texture_2d<f32>;                       // planes of the G-buffer

override SHOWN: bool = false;             // it has what a host shows
override SPHERE_VELOCITIES: bool = false; // the spheres' velocities are known

// Longer motion has this length along each axis, pixels.
const LONGEST: f32 = 512.0;

// Motion of a sphere since the frame before, pixels.
fn motion_of(sphere: Placed, index: u32) -> vec2f {
    var velocity = vec3f(0.0);
    if SPHERE_VELOCITIES {
        let i = 3u * index;
        velocity = vec3f(sphere_velocities[i], sphere_velocities[i + 1u], sphere_velocities[i + 2u]);
    }
    let now = camera_pixel(sphere.position);
    let moved = now - previous_pixel(before, camera_world_point(sphere.position), velocity, now);
    return clamp(moved, vec2f(-LONGEST), vec2f(LONGEST));
}

fn add(sphere: Placed, pixel: vec2i, covered: f32, disparity: f32, moved: vec2f) {
    let weight = covered * opacity_of(sphere.traits) * in_air(sphere) * MOTION_UNITS;
    if !is_in_picture(pixel) || weight < 0.5 || bitcast<f32>(opaque[pixel_index(pixel)].x) > disparity {
        return;
    }
    if SHOWN && dot(textureLoad(shown, pixel, 0).xyz, camera_omega(vec2f(pixel) + 0.5)) > disparity {
        return;
    }
    let i = pixel_index(pixel);
    let amounts = vec2i(round(weight * moved));
    atomicAdd(&sums[i].right, amounts.x);
    atomicAdd(&sums[i].down, amounts.y);
    atomicAdd(&sums[i].covered, i32(weight + 0.5));
}

@compute @workgroup_size(64)
fn add_small(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = thread_index(group, local);
    if index >= params.count || placed[index].radius <= 0.0 || radius_in_pixels(placed[index]) > LARGE {
        return;
    }
    let sphere = placed[index];
    let moved = motion_of(sphere, index);
    let square = small_square(sphere);
    for (var i = 0; i < square.across.x * square.across.y; i++) {
        let pixel = pixel_in(square, i);
        add(sphere, pixel, covered_by_small(sphere, pixel), camera_disparity(sphere.position), moved);
    }
}

fn at_pixel(sphere: Placed, index: u32, pixel: vec2i, point: Point) {
    add(sphere, pixel, point.covered, point.disparity, motion_of(sphere, index));
}

@compute @workgroup_size(64)
fn add_large(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    visit_large(group.x, groups.x, local);
}
