// Adds the spheres to their pixels: optical depth, and optical depth times radiance, as integers, whose sums do not depend on
// their order.
//
// Small spheres cover the share of a pixel that a square of their area would: the shares of all pixels add up to the sphere.
// Of large ones each pixel sees a point. Those behind a pixel's nearest opaque sphere are hidden.

#import diffuse/discs.wgsl
#import diffuse/light.wgsl
#import diffuse/particles.wgsl
#import diffuse/pixels.wgsl

struct Sums {
    depth: atomic<u32>,
    red: atomic<u32>,
    green: atomic<u32>,
    blue: atomic<u32>,
}

// By pixel.
@group(1) @binding(4) var<storage, read_write> above: array<Sums>;  // in the air
@group(1) @binding(5) var<storage, read_write> inside: array<Sums>; // in the liquid
// Disparities of the nearest opaque spheres in the air and in the liquid, as bits.
@group(1) @binding(6) var<storage, read> opaque: array<vec2u>;
@group(1) @binding(7) var shown: texture_2d<f32>; // planes of what a host or an opaque fluid shows

override SHOWN: bool = false; // there are such planes

// Radiance towards the eye of a sphere's whole disc.
fn disc_radiance(sphere: Placed, albedo: vec3f) -> vec3f {
    let x = camera_world_point(sphere.position);
    let to_eye = -camera_world_direction(camera_ray_direction(camera_omega_of(sphere.position)));
    var light = irradiance_near(sphere.pixel, TO_EYE);
    for (var i = 0u; i < LIGHTS; i++) {
        let to_light = light_from(lights[i], x);
        light += phase(dot(to_eye, to_light.direction)) * direct_light(i, x, sphere.radius, to_light, albedo);
    }
    return albedo * light;
}

// Radiance of the point of a sphere that has the normal n, in world axes.
fn point_radiance(sphere: Placed, albedo: vec3f, n: vec3f) -> vec3f {
    let x = camera_world_point(sphere.position);
    var light = irradiance_on(sphere.pixel, n);
    for (var i = 0u; i < LIGHTS; i++) {
        let to_light = light_from(lights[i], x);
        light += max(dot(n, to_light.direction), 0.0) * direct_light(i, x, sphere.radius, to_light, albedo);
    }
    return albedo * light;
}

fn depth_units(covered: f32) -> f32 {
    return -log(max(1.0 - covered, OPAQUE_TRANSMITTANCE)) * DEPTH_UNITS;
}

// Optical depth times radiance.
fn color_units(covered: f32, radiance: vec3f) -> vec3u {
    let shares = min(radiance / params.white, vec3f(MOST_WHITE));
    return vec3u(depth_units(covered) * (COLOR_UNITS / DEPTH_UNITS) * shares + 0.5);
}

// Adds a sphere's part in the air, and that in the liquid.
fn add(sphere: Placed, pixel: vec2i, covered: f32, radiance: vec3f, disparity: f32) {
    if !is_in_picture(pixel) || covered <= 0.0 {
        return;
    }
    if SHOWN && dot(textureLoad(shown, pixel, 0).xyz, camera_omega(vec2f(pixel) + 0.5)) > disparity {
        return;
    }
    let i = pixel_index(pixel);
    let share = in_air(sphere);
    let nearest = bitcast<vec2f>(opaque[i]);
    if share > 0.0 && nearest.x <= disparity {
        let color = color_units(covered * share, radiance);
        atomicAdd(&above[i].depth, u32(depth_units(covered * share) + 0.5));
        atomicAdd(&above[i].red, color.r);
        atomicAdd(&above[i].green, color.g);
        atomicAdd(&above[i].blue, color.b);
    }
    if share < 1.0 && nearest.y <= disparity {
        let color = color_units(covered * (1.0 - share), radiance * exp(-params.absorption * sphere.way));
        atomicAdd(&inside[i].depth, u32(depth_units(covered * (1.0 - share)) + 0.5));
        atomicAdd(&inside[i].red, color.r);
        atomicAdd(&inside[i].green, color.g);
        atomicAdd(&inside[i].blue, color.b);
    }
}

@compute @workgroup_size(64)
fn add_small(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = thread_index(group, local);
    // Software adapters load what all threads share once where no thread has left, and otherwise for each.
    let sphere = placed[min(index, params.count - 1u)];
    let radius = radius_in_pixels(sphere);
    let is_drawn = index < params.count && sphere.radius > 0.0 && radius <= LARGE;
    let radiance = disc_radiance(sphere, params.albedos[kind_of(sphere.traits)].rgb);
    let opacity = opacity_of(sphere.traits);
    let disparity = camera_disparity(sphere.position);
    let square = small_square(sphere);
    for (var i = 0; i < select(0, square.across.x * square.across.y, is_drawn); i++) {
        let pixel = pixel_in(square, i);
        let covered = covered_by_small(sphere, pixel);
        add(sphere, pixel, opacity * covered, radiance, disparity);
    }
}

fn at_pixel(sphere: Placed, index: u32, pixel: vec2i, point: Point) {
    let albedo = params.albedos[kind_of(sphere.traits)].rgb;
    let radiance = point_radiance(sphere, albedo, camera_world_direction(point.normal));
    add(sphere, pixel, opacity_of(sphere.traits) * point.covered, radiance, point.disparity);
}

@compute @workgroup_size(64)
fn add_large(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    visit_large(group.x, groups.x, local);
}
