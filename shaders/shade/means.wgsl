// Light around an opaque body: means of what the 4 x 4 pixels around each pixel have seen (shade/around.wgsl).

#import shade/material.wgsl
#import shade/neighbours.wgsl
#import shade/packed.wgsl

@group(1) @binding(5) var around: texture_2d<u32>;
@group(1) @binding(6) var means: texture_storage_2d<rgba32uint, write>;

@compute @workgroup_size(8, 8)
fn average(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let p = texel_of(group, local);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    let body = body_at(p);
    if plane_is_empty(body.front) {
        return;
    }
    var light = vec3f(0.0);
    var mirrored = vec3f(0.0);
    var leaving = vec3f(0.0);
    var reflectance = vec2f(0.0);
    var weight = 0.0;
    for (var i = 0; i < 16; i++) {
        let texel = neighbour(p, i);
        // Beside the liquid's tiles `around` has what it had.
        let bits = textureLoad(around, texel, 0);
        let share = select(0.0, 1.0, shows_surface_of(body, texel));
        light += share * unpacked_rgb(bits.x);
        mirrored += share * unpacked_rgb(bits.y);
        leaving += share * unpacked_rgb(bits.z);
        reflectance += share * unpack2x16unorm(bits.w);
        weight += share;
    }
    let scale = 1.0 / max(weight, 1.0);
    textureStore(means, p, vec4u(
        packed_rgb(scale * light),
        packed_rgb(scale * mirrored),
        packed_rgb(scale * leaving),
        pack2x16unorm(scale * reflectance),
    ));
}
