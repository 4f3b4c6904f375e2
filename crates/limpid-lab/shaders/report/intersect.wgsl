// Intersector benchmark, one intersection per pixel: the eye ray enters the liquid at the pixel's front
// layer, and the refracted ray is intersected once.

#import $intersector

@group(3) @binding(0) var hits: texture_storage_2d<rgba32float, write>;    // u (px), depth (m), state
@group(3) @binding(1) var tallies: texture_storage_2d<rgba32float, write>; // fetches, evaluations, order, 0

const NO_LIQUID: f32 = -1.0;
const MISSED: f32 = 0.0;
const FOUND: f32 = 1.0;

// Whether the ray is intersected with the opaque scene instead of the surrounding liquid.
override TO_SOLIDS: bool = false;

@compute @workgroup_size(8, 8)
fn intersect_pixels(@builtin(global_invocation_id) id: vec3u) {
    let p = vec2i(id.xy);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    let omega = camera_omega(vec2f(p) + 0.5);
    var front = textureLoad(aggregate_layers, p, FRONT$level).xyz;
    var enters_splash = false;
    if SPLASH {
        let splash = textureLoad(splash_layers, p, FRONT$level).xyz;
        enters_splash = dot(splash, omega) > dot(front, omega);
        front = select(front, splash, enters_splash);
    }
    let disparity = dot(front, omega);
    if disparity <= 0.0 {
        textureStore(hits, p, vec4f(0.0, 0.0, 0.0, NO_LIQUID));
        return;
    }
    let o = camera_point(omega, disparity);
    let n = -plane_normal(front);
    var d = camera_ray_direction(omega);
    let cos_theta_i = -dot(d, n);
    let cos_theta_t = optics_cos_transmitted(cos_theta_i, params.ior);
    d = optics_refract(d, n, cos_theta_i, cos_theta_t, params.ior);

    diagnosed = Diagnostics();
    let ray = screen_ray(o, d, NOTHING);
    var hit: Interface;
    if TO_SOLIDS {
        hit = opaque_entry(ray);
    } else {
        hit = liquid_exit(ray, p);
    }
    let found = hit.found && diagnosed.failures == 0.0 && -hit.position.z > 0.0;
    let u = camera_pixel(hit.position);
    textureStore(hits, p, select(vec4f(0.0, 0.0, 0.0, MISSED), vec4f(u, -hit.position.z, FOUND), found));
    // Entry class plus twice the exit class: 0 for aggregates, 1 for splashes.
    var order = 0.0;
    if SPLASH && !TO_SOLIDS {
        let leaves_splash = all(hit.plane == textureLoad(splash_layers, hit.texel, BACK$level).xyz)
            || all(hit.plane == textureLoad(splash_layers, hit.texel, FRONT$level).xyz);
        order = select(0.0, 1.0, enters_splash) + select(0.0, 2.0, leaves_splash);
    }
    textureStore(tallies, p, vec4f(diagnosed.fetches, diagnosed.iterations, order, 0.0));
}
