// Images of the first interface of each pixel: depth, normal, motion, coverage and fluid.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/samples.wgsl
#import common/scene.wgsl
#import surface/before.wgsl

override SPLASH: bool = false;
override HOST: bool = false;          // a host has drawn the opaque scene
override VELOCITIES: bool = false;    // the particles' velocities are known
override SPHERE_MOTION: bool = false; // there are spheres
override SAMPLES: u32 = 1u;           // rays per pixel

@group(1) @binding(0) var<uniform> before: Before;
@group(1) @binding(1) var aggregate_layers: texture_2d_array<f32>;
@group(1) @binding(2) var splash_layers: texture_2d_array<f32>;
@group(1) @binding(3) var gbuffer_planes: texture_2d<f32>;
// Particle, from 1, and fluid of each front.
@group(1) @binding(4) var aggregate_tags: texture_2d<u32>;
@group(1) @binding(5) var splash_tags: texture_2d<u32>;
@group(1) @binding(6) var<storage, read> velocities: array<f32>; // three for each particle, m/s
@group(1) @binding(7) var surface: texture_storage_2d<rgba32float, write>; // normal, depth
@group(1) @binding(8) var motion: texture_storage_2d<rgba32float, write>;  // motion, coverage, fluid
@group(1) @binding(9) var<storage, read> sphere_motions: array<vec4i>;     // by pixel: surface/spheres.wgsl

// Whether a splash is in front of the texel's body at `omega`.
fn splash_is_nearest(texel: vec2i, omega: vec3f) -> bool {
    if !SPLASH {
        return false;
    }
    let aggregate = textureLoad(aggregate_layers, texel, FRONT, 0).xyz;
    let splash = textureLoad(splash_layers, texel, FRONT, 0).xyz;
    return dot(splash, omega) > dot(aggregate, omega);
}

// The nearest front, for its disparity at `omega`.
fn nearest_front(texel: vec2i, omega: vec3f) -> vec3f {
    if splash_is_nearest(texel, omega) {
        return textureLoad(splash_layers, texel, FRONT, 0).xyz;
    }
    return textureLoad(aggregate_layers, texel, FRONT, 0).xyz;
}

// Particle, from 1, and fluid of that front.
fn nearest_tags(texel: vec2i, omega: vec3f) -> vec2u {
    if splash_is_nearest(texel, omega) {
        return textureLoad(splash_tags, texel, 0).xy;
    }
    return textureLoad(aggregate_tags, texel, 0).xy;
}

// Whether the opaque scene is in front of a disparity.
fn is_hidden(texel: vec2i, omega: vec3f, disparity: f32) -> bool {
    if HOST {
        let plane = textureLoad(gbuffer_planes, texel, 0).xyz;
        return !plane_is_empty(plane) && dot(plane, omega) >= disparity;
    }
    let o = camera_world_point(camera_ray_origin(omega));
    let hit = scene_trace(o, camera_world_direction(camera_ray_direction(omega)));
    return hit.t <= camera_distance(omega, disparity);
}

fn shows_liquid(texel: vec2i, omega: vec3f) -> bool {
    let disparity = dot(nearest_front(texel, omega), omega);
    return disparity > 0.0 && !is_hidden(texel, omega, disparity);
}

// Distance of the averaged velocities, in particle radii, and their number to each side.
const SPACING: f32 = 0.7;
const SIDE: i32 = 1;

// Velocity at a point of the surface: the mean of the particles' velocities around it, which is exact
// where they change evenly.
fn surface_velocity(texel: vec2i, x: vec3f) -> vec3f {
    if !VELOCITIES {
        return vec3f(0.0);
    }
    let spacing = max(SPACING * before.reach / camera_pixel_side(x), 1.0);
    let last = vec2i(camera.size) - 1;
    var sum = vec4f(0.0);
    for (var k = 0; k < (2 * SIDE + 1) * (2 * SIDE + 1); k++) {
        let beside = vec2i(k % (2 * SIDE + 1), k / (2 * SIDE + 1)) - SIDE;
        let at = texel + vec2i(round(spacing * vec2f(beside)));
        let omega = camera_omega(vec2f(at) + 0.5);
        let particle = nearest_tags(clamp(at, vec2i(0), last), omega).x;
        let there = camera_point(omega, dot(nearest_front(clamp(at, vec2i(0), last), omega), omega));
        let near = all(at >= vec2i(0)) && all(at <= last) && abs(there.z - x.z) <= before.reach;
        if particle > 0u && (near || all(beside == vec2i(0))) {
            let i = 3u * (particle - 1u);
            let weight = exp(-0.5 * f32(dot(beside, beside)));
            sum += weight * vec4f(velocities[i], velocities[i + 1u], velocities[i + 2u], 1.0);
        }
    }
    return sum.xyz / max(sum.w, 1e-6);
}

@compute @workgroup_size(8, 8)
fn images(@builtin(global_invocation_id) id: vec3u) {
    let p = vec2i(id.xy);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    var covered = 0.0;
    for (var i = 0u; i < SAMPLES; i++) {
        let shows = shows_liquid(p, camera_omega(vec2f(p) + sample_offset(i, SAMPLES)));
        covered += select(0.0, 1.0 / f32(SAMPLES), shows);
    }
    let u = vec2f(p) + 0.5;
    let omega = camera_omega(u);
    let front = nearest_front(p, omega);
    var normal_depth = vec4f(0.0);
    var moved = vec2f(0.0);
    if shows_liquid(p, omega) {
        let x = camera_point(omega, dot(front, omega));
        normal_depth = vec4f(-plane_normal(front), -x.z);
        let velocity = surface_velocity(p, x);
        let world = camera_world_point(x);
        moved = u - previous_pixel(before, world, velocity, u);
    }
    if SPHERE_MOTION {
        let sum = sphere_motions[u32(p.y) * u32(camera.size.x) + u32(p.x)];
        moved = select(moved, vec2f(sum.xy) / max(f32(sum.z), 1.0), sum.z >= HALF_COVERED);
    }
    let fluid = f32(nearest_tags(p, omega).y);
    textureStore(surface, p, normal_depth);
    textureStore(motion, p, vec4f(moved, covered, fluid));
}
