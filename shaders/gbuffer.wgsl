// G-buffer of the opaque scene: tangent plane, normal and index of the nearest solid.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/scene.wgsl

@group(1) @binding(0) var planes: texture_storage_2d<rgba32float, write>; // pi, depth
@group(1) @binding(1) var surfaces: texture_storage_2d<rgba32float, write>; // world normal, solid index

@compute @workgroup_size(8, 8)
fn gbuffer(@builtin(global_invocation_id) id: vec3u) {
    let p = vec2i(id.xy);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    let omega = camera_omega(vec2f(p) + 0.5);
    let o = camera_world_point(camera_ray_origin(omega));
    let d = camera_world_direction(camera_ray_direction(omega));
    let hit = scene_trace(o, d);
    var plane = vec4f(0.0);
    var surface = vec4f(0.0);
    if hit.t < NOTHING {
        let z = hit.t * -camera_ray_direction(omega).z;
        plane = vec4f(plane_from_normal(omega, z, camera_view_direction(hit.normal)), z);
        surface = vec4f(hit.normal, f32(solids[hit.index].number));
    }
    textureStore(planes, p, plane);
    textureStore(surfaces, p, surface);
}
