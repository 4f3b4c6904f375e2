// Means of the four colours of an image over the 4 x 4 pixels around each that show the same surface.

#import shade/neighbours.wgsl
#import shade/packed.wgsl
#import shade/texels.wgsl

@group(1) @binding(5) var around: texture_2d<u32>;
@group(1) @binding(6) var means: texture_storage_2d<rgba32uint, write>;

// Weighted sums of the colours at texels.
struct Sums {
    colors: array<vec3f, 4>,
    weight: f32,
}

fn add(sums: ptr<function, Sums>, body: Body, texel: vec2i, weight: f32) {
    let share = select(0.0, weight, shows_surface_of(body, texel));
    // Beside the liquid's tiles `around` has what it had.
    let bits = textureLoad(around, texel, 0);
    for (var i = 0; i < 4; i++) {
        (*sums).colors[i] += share * unpacked_rgb(bits[i]);
    }
    (*sums).weight += share;
}

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
    var sums: Sums;
    for (var i = 0; i < 16; i++) {
        add(&sums, body, neighbour(p, i), 1.0);
    }
    let scale = 1.0 / max(sums.weight, 1.0);
    var bits: vec4u;
    for (var i = 0; i < 4; i++) {
        bits[i] = packed_rgb(scale * sums.colors[i]);
    }
    textureStore(means, p, bits);
}
