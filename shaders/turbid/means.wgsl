// Light on a turbid liquid: means of what the pixels around each pixel have seen (turbid/around.wgsl), first of 4 x 4, then
// of 3 x 3 such means. Where much of what is seen is the liquid itself, its light is a series that enlarges errors.

#import shade/averages.wgsl
#import shade/texels.wgsl
#import turbid/params.wgsl

// Way across the surface over which its curvature is measured, as a share of the liquid's thickness.
const CURVED_OVER: f32 = 0.35;
// Most pixels on either side.
const MOST_PIXELS: f32 = 64.0;

// Mean curvature of the first surface, 1/m; 0 where it is hollow. Finer waves than the liquid is thick count as flat.
fn mean_curvature(p: vec2i, body: Body) -> f32 {
    let last = vec2i(camera.size) - 1;
    let thickness = depth_below(body.front, body.omega, max(dot(back_at(p), body.omega), 1e-20));
    let way = CURVED_OVER * thickness;
    let pixels = i32(clamp(way / camera_pixel_side(body.position), 1.0, MOST_PIXELS));
    var sum = 0.0;
    var weight = 0.0;
    for (var i = 0; i < 4; i++) {
        let step = select(vec2i(pixels, 0), vec2i(0, pixels), i >= 2) * select(1, -1, (i & 1) == 1);
        let there = body_at(clamp(p + step, vec2i(0), last));
        let offset = there.position - body.position;
        let distance2 = dot(offset, offset);
        let is_same = !plane_is_empty(there.front) && distance2 < 16.0 * way * way && distance2 > 0.0;
        let bend = dot(there.normal - body.normal, offset) / max(distance2, 1e-20);
        sum += select(0.0, bend, is_same);
        weight += select(0.0, 1.0, is_same);
    }
    return max(sum / max(weight, 1.0), 0.0);
}

@compute @workgroup_size(8, 8)
fn spread(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let p = texel_of(group, local);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    let body = body_at(p);
    if plane_is_empty(body.front) {
        return;
    }
    // On the first surface, the share of it that leaves, on the last, and of a wet solid.
    var sums: Sums;
    for (var i = 0; i < 9; i++) {
        add(&sums, body, further_neighbour(p, i), further_weight(i));
    }
    let scale = 1.0 / max(sums.weight, 1.0);
    let near = bounced_light(scale * sums.colors[0], 1.0 - scale * sums.colors[1]);
    textureStore(means, p, vec4u(
        packed_rgb(near),
        packed_rgb(scale * sums.colors[2]),
        packed_rgb(scale * sums.colors[3]),
        bitcast<u32>(mean_curvature(p, body)),
    ));
}
