// Finds the nearest opaque sphere of each pixel.

#import diffuse/discs.wgsl
#import diffuse/particles.wgsl

// Disparities in the air and in the liquid, as bits.
@group(1) @binding(1) var<storage, read_write> opaque: array<array<atomic<u32>, 2>>;

@compute @workgroup_size(64)
fn cover(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    for (var k = group.x; k < large.count; k += groups.x) {
        let index = large.spheres[k];
        let sphere = placed[index];
        let across = 2u * reach_of(sphere) + 1u;
        for (var i = local; i < across * across; i += 64u) {
            let pixel = pixel_of(sphere, i);
            let point = point_at(sphere, pixel);
            if is_in_picture(pixel) && point.covered * opacity_of(sphere.traits) > 0.99 {
                let bits = bitcast<u32>(point.disparity);
                let share = in_air(sphere);
                atomicMax(&opaque[pixel_index(pixel)][0], select(0u, bits, share > 0.99));
                atomicMax(&opaque[pixel_index(pixel)][1], select(0u, bits, share < 0.01));
            }
        }
    }
}
