// Planes of the opaque fluids' first and last surface, for rays through the other fluids.

#import shade/surface.wgsl

struct Params {
    depth: f32, // of the surface below that of the particles, m: a film of the other fluids always covers it
}

@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(3) var planes: texture_storage_2d<rgba32float, write>; // pi, depth
@group(1) @binding(4) var backs: texture_storage_2d<rgba32float, write>; // pi

@compute @workgroup_size(8, 8)
fn opaque(@builtin(global_invocation_id) id: vec3u) {
    let p = vec2i(id.xy);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    let body = body_at(p);
    var plane = vec4f(0.0);
    if !plane_is_empty(body.front) {
        let z = params.depth - body.position.z;
        plane = vec4f(plane_from_normal(body.omega, z, body.normal), z);
    }
    textureStore(planes, p, plane);
    textureStore(backs, p, vec4f(back_at(p), 0.0));
}
