// Finds the nearest opaque sphere of each pixel.

#import diffuse/discs.wgsl
#import diffuse/particles.wgsl

// Disparities in the air and in the liquid, as bits.
@group(1) @binding(1) var<storage, read_write> opaque: array<array<atomic<u32>, 2>>;

fn at_pixel(sphere: Placed, index: u32, pixel: vec2i, point: Point) {
    if point.covered * opacity_of(sphere.traits) > 0.99 {
        let bits = bitcast<u32>(point.disparity);
        let share = in_air(sphere);
        atomicMax(&opaque[pixel_index(pixel)][0], select(0u, bits, share > 0.99));
        atomicMax(&opaque[pixel_index(pixel)][1], select(0u, bits, share < 0.01));
    }
}

@compute @workgroup_size(64)
fn cover(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    visit_large(group.x, groups.x, local);
}
