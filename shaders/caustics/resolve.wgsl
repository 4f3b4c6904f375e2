// Resolves the caustic map of one light: irradiance on each texel's receiver. The layers are those of
// the light's view.

#import $intersector
#import caustics/light_sums.wgsl
#import caustics/light.wgsl
#import caustics/params.wgsl

@group(3) @binding(0) var<$branching> caustics: CausticParams;
@group(3) @binding(1) var<storage, read> light_sums: array<u32>;
@group(3) @binding(2) var gathered: texture_2d<f32>; // irradiance, state: gather.wgsl
@group(3) @binding(3) var map_out: texture_storage_2d<rgba32float, write>;
@group(3) @binding(4) var receiver_out: texture_storage_2d<rgba32float, write>;

override METHOD: u32 = 0u;
const STRAIGHT: u32 = 0u;
const FORWARD: u32 = 1u;
const GATHER: u32 = 2u;

// Transmittance of unrefracted light to a receiver: in through the front, and out through the back if
// that is in front of the receiver.
fn straight(texel: vec2i, slabs: Slabs, receiver: vec3f, omega: vec3f) -> vec3f {
    let d = camera_ray_direction(omega);
    let end = camera_point(omega, dot(receiver, omega));
    let n_r = plane_normal(receiver);
    let wet = caustics.wet == 1u;
    var passed = vec3f(1.0);
    var rest = slabs.aggregate;
    for (var gap = select(i32(GAPS), 0, slabs.aggregate_has_gap); gap < i32(GAPS); gap++) {
        let planes = aggregate_gap(texel, gap);
        passed *= slab_transmittance(before_gap(rest, planes), omega, d, end, n_r, wet);
        rest = after_gap(rest, planes);
    }
    let undivided = all(rest.front == slabs.aggregate.front);
    passed *= slab_transmittance(rest, omega, d, end, n_r, wet && undivided);
    rest = slabs.splash;
    for (var gap = select(i32(GAPS), 0, slabs.splash_has_gap); gap < i32(GAPS); gap++) {
        let planes = splash_gap(texel, gap);
        passed *= slab_transmittance(before_gap(rest, planes), omega, d, end, n_r, false);
        rest = after_gap(rest, planes);
    }
    if SPLASH {
        passed *= slab_transmittance(rest, omega, d, end, n_r, false);
    }
    return passed;
}

fn slab_transmittance(
    slab: Slab,
    omega: vec3f,
    d: vec3f,
    end: vec3f,
    n_r: vec3f,
    starts_wet: bool,
) -> vec3f {
    let front = slab.front;
    let back = slab.back;
    let disparity = dot(front, omega);
    if plane_is_empty(front) || disparity <= camera_disparity(end) {
        return vec3f(1.0);
    }
    var from_point = camera_point(omega, disparity);
    var to_point = camera_point(omega, max(dot(back, omega), 1e-20));
    let cos_theta_i = abs(dot(caustics_to_light(from_point), plane_normal(front)));
    let cos_theta_t = optics_cos_transmitted(cos_theta_i, params.ior);
    var passed = 1.0 - reflectance(cos_theta_i, cos_theta_t, params.ior);
    if starts_wet {
        from_point = camera_ray_origin(omega);
        passed = 1.0;
    }
    let wet = CONTACT && abs(dot(n_r, to_point - end)) <= params.contact;
    if dot(back, omega) <= camera_disparity(end) || wet {
        to_point = end;
    } else {
        // The angle inside is the one for parallel faces.
        let cos_out = abs(dot(d, plane_normal(back)));
        passed *= 1.0 - reflectance(cos_out, optics_cos_transmitted(cos_out, params.ior), params.ior);
    }
    return passed * transmittance_between(from_point, to_point);
}

@compute @workgroup_size(8, 8)
fn resolve(@builtin(global_invocation_id) id: vec3u) {
    let p = vec2i(id.xy + caustics.first);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    let plane = textureLoad(gbuffer_planes, p, 0);
    let omega = camera_omega(vec2f(p) + 0.5);
    let slabs = whole_slabs(p);
    let nearest = max(dot(slabs.aggregate.front, omega), dot(slabs.splash.front, omega));
    let out = p + vec2i(caustics.corner);
    textureStore(receiver_out, out, vec4f(plane.xyz, nearest));
    if plane_is_empty(plane.xyz) {
        textureStore(map_out, out, vec4f(0.0));
        return;
    }
    let covered = nearest > dot(plane.xyz, omega);

    // Irradiance of the receiver by light along the view's rays.
    let x = camera_point(omega, dot(plane.xyz, omega));
    let cos_theta = dot(plane_normal(plane.xyz), camera_ray_direction(omega));
    let distance2 = select(dot(x, x), 1.0, ORTHOGRAPHIC);
    let direct = caustics.power * cos_theta / distance2;

    var irradiance = vec3f(0.0);
    if METHOD == FORWARD {
        let word = 6u * u32(p.y * i32(camera.size.x) + p.x);
        irradiance = direct * light_ratio(word) / view_power(omega);
    } else if covered {
        let passed = straight(p, slabs, plane.xyz, omega) * passed_below(x, 0.0);
        irradiance = caustics.gain * direct * passed;
        if METHOD == GATHER {
            let found = textureLoad(gathered, p, 0);
            irradiance = select(irradiance, found.rgb, found.a > 0.5);
        }
    }
    textureStore(map_out, out, vec4f(irradiance, select(1.0, 0.0, covered)));
}

fn light_ratio(word: u32) -> vec3f {
    let low = vec3u(light_sums[word], light_sums[word + 2u], light_sums[word + 4u]);
    let high = vec3u(light_sums[word + 1u], light_sums[word + 3u], light_sums[word + 5u]);
    return (vec3f(low) + vec3f(high) * 4294967296.0) / UNIT;
}
