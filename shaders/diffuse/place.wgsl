// Finds where each sphere is seen: in front of the liquid, or refracted by its first surface.

#import common/optics.wgsl
#import diffuse/particles.wgsl
#import shade/surface.wgsl

struct Large {
    count: atomic<u32>,
    spheres: array<u32>,
}

@group(1) @binding(3) var<storage, read> spheres: array<vec4f>; // centre, relative to the particles' origin, and radius; m
@group(1) @binding(4) var<storage, read> traits: array<u32>;    // kind and opacity
@group(1) @binding(5) var<storage, read_write> placed: array<Placed>;
@group(1) @binding(6) var<storage, read_write> nearest_spheres: array<atomic<u32>>; // disparities by probe, as bits
@group(1) @binding(7) var<storage, read_write> large: Large;

// Foam that the smoothed surface has buried less deeply than this floats on it, in radii of the liquid's particles.
const AFLOAT: f32 = 1.0;

// Whether the liquid lets light through.
override CLEAR: bool = true;

const FOAM: u32 = 0u;

const STEPS: u32 = 4u;

// The point of the surface where the sight of x, in the liquid, is refracted, as a pixel, with the length of its way in the
// liquid. Each step moves the point by what the refracted ray misses.
fn seen_through(x: vec3f) -> vec3f {
    var u = camera_pixel(x);
    var way = 0.0;
    for (var i = 0u; i < STEPS; i++) {
        let omega = camera_omega(u);
        let front = front_at(clamp(vec2i(u), vec2i(0), vec2i(camera.size) - 1));
        let disparity = dot(front, omega);
        if disparity <= 0.0 || disparity >= camera_near_disparity() {
            break;
        }
        let at = camera_point(omega, disparity);
        let d = camera_ray_direction(omega);
        let n = -plane_normal(front);
        let cos_theta_i = -dot(d, n);
        let cos_theta_t = optics_cos_transmitted(cos_theta_i, params.ior);
        let refracted = optics_refract(d, n, cos_theta_i, max(cos_theta_t, 0.0), params.ior);
        way = max(dot(x - at, refracted), 0.0);
        let moved = at + (x - at - way * refracted);
        if -moved.z <= camera.near && !ORTHOGRAPHIC {
            break;
        }
        u = camera_pixel(moved);
    }
    return vec3f(u, way);
}

// Share of a sphere's disc above a surface that its centre lies below by `depth`.
fn share_above(depth: f32, radius: f32) -> f32 {
    let ratio = clamp(depth / radius, 0.0, 1.0);
    return 1.0 - ratio * ratio;
}

@compute @workgroup_size(64)
fn place(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = min(thread_index(group, local), params.count - 1u);
    let sphere = spheres[index];
    let own = traits[index];
    let x = camera_view_direction(params.origin + sphere.xyz);
    let margin = sphere.w / camera_pixel_side(x) + 1.0;
    var seen = Placed(x, 0.0, camera_pixel(x), 0.0, 0u);
    let is_ahead = ORTHOGRAPHIC || -x.z > camera.near + sphere.w;
    let is_near = all(seen.pixel > vec2f(-margin)) && all(seen.pixel < camera.size + margin);
    let omega = camera_omega_of(x);
    let o = camera_ray_origin(omega);
    let d = camera_ray_direction(omega);
    let is_blocked = scene_blocks(camera_world_point(o), camera_world_direction(d), dot(x - o, d) - sphere.w);
    if thread_index(group, local) >= params.count {
        return;
    }
    if is_ahead && is_near && own > 3u && !is_blocked {
        seen = seen_sphere(x, sphere.w, own);
    }
    placed[index] = seen;
    if seen.radius <= 0.0 {
        return;
    }
    atomicMax(&nearest_spheres[probe_of(seen.pixel)], bitcast<u32>(camera_disparity(x)));
    if radius_in_pixels(seen) > LARGE {
        large.spheres[atomicAdd(&large.count, 1u)] = index;
    }
}

// Where a sphere in the picture is seen; of radius 0 if it is hidden.
fn seen_sphere(x: vec3f, radius: f32, own: u32) -> Placed {
    var seen = Placed(x, radius, camera_pixel(x), 0.0, 0u);
    let omega = camera_omega_of(x);
    let texel = clamp(vec2i(seen.pixel), vec2i(0), vec2i(camera.size) - 1);
    let disparity = camera_disparity(x);
    let front = front_at(texel);
    var share = 1.0;
    if !plane_is_empty(front) {
        let depth = depth_below(front, omega, disparity);
        let floats = kind_of(own) == FOAM && depth < AFLOAT * params.radius;
        share = select(share_above(depth, radius), 1.0, floats);
    }
    seen.traits = with_share_in_air(own, share);
    if share < 1.0 {
        let is_inside = depth_below(back_at(texel), omega, disparity) < radius;
        if CLEAR && is_inside {
            let through = seen_through(x);
            seen.pixel = through.xy;
            seen.way = through.z;
        } else if share == 0.0 {
            seen.radius = 0.0;
        }
    }
    return seen;
}
