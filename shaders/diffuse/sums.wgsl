// Adds the spheres to their pixels: optical depth, and optical depth times radiance, as integers, whose sums do not depend on
// their order.
//
// Small spheres cover the share of a pixel that a square of their area would: the shares of all pixels add up to the sphere.
// Of large ones each pixel sees a point. Those behind a pixel's nearest opaque sphere are hidden.

#import diffuse/light.wgsl
#import diffuse/particles.wgsl
#import diffuse/pixels.wgsl

struct Large {
    count: u32,
    spheres: array<u32>,
}

struct Sums {
    depth: atomic<u32>,
    red: atomic<u32>,
    green: atomic<u32>,
    blue: atomic<u32>,
}

@group(1) @binding(2) var<storage, read> placed: array<Placed>;
@group(1) @binding(3) var<storage, read> large: Large;
// By pixel.
@group(1) @binding(4) var<storage, read_write> above: array<Sums>;  // in the air
@group(1) @binding(5) var<storage, read_write> inside: array<Sums>; // in the liquid
// Disparities of the nearest opaque spheres in the air and in the liquid, as bits.
@group(1) @binding(6) var<storage, read_write> opaque: array<array<atomic<u32>, 2>>;
@group(1) @binding(7) var shown: texture_2d<f32>; // planes of what a host or an opaque fluid shows

override SHOWN: bool = false; // there are such planes

// Radiance of a sphere towards the eye: of the point with normal n, in world axes, or of the whole disc if n is 0.
fn sphere_radiance(sphere: Placed, albedo: vec3f, n: vec3f) -> vec3f {
    let x = camera_world_point(sphere.position);
    let to_eye = -camera_world_direction(camera_ray_direction(camera_omega_of(sphere.position)));
    let is_point = dot(n, n) > 0.0;
    // The mean normal of a disc is two thirds of that at its centre.
    var light = irradiance_at(sphere.pixel, select(0.66666667 * to_eye, n, is_point));
    for (var i = 0u; i < LIGHTS; i++) {
        let to_light = light_from(lights.sources[i], x);
        let facing = select(phase(dot(to_eye, to_light.direction)), max(dot(n, to_light.direction), 0.0), is_point);
        light += facing * direct_light(i, x, sphere.radius, to_light, albedo);
    }
    return albedo * light;
}

fn is_in_picture(pixel: vec2i) -> bool {
    return all(pixel >= vec2i(0)) && all(pixel < vec2i(camera.size));
}

fn pixel_index(pixel: vec2i) -> u32 {
    return u32(pixel.y) * u32(camera.size.x) + u32(pixel.x);
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
    if share > 0.0 && bitcast<f32>(atomicLoad(&opaque[i][0])) <= disparity {
        let color = color_units(covered * share, radiance);
        atomicAdd(&above[i].depth, u32(depth_units(covered * share) + 0.5));
        atomicAdd(&above[i].red, color.r);
        atomicAdd(&above[i].green, color.g);
        atomicAdd(&above[i].blue, color.b);
    }
    if share < 1.0 && bitcast<f32>(atomicLoad(&opaque[i][1])) <= disparity {
        let color = color_units(covered * (1.0 - share), radiance * exp(-params.absorption * sphere.way));
        atomicAdd(&inside[i].depth, u32(depth_units(covered * (1.0 - share)) + 0.5));
        atomicAdd(&inside[i].red, color.r);
        atomicAdd(&inside[i].green, color.g);
        atomicAdd(&inside[i].blue, color.b);
    }
}

// Share of a pixel that a square of the disc's area covers, `offset` pixels from its centre.
fn covered_by_square(offset: vec2f, radius: f32) -> f32 {
    let half = 0.88622693 * radius;
    let sides = clamp(min(offset + 0.5, vec2f(half)) - max(offset - 0.5, vec2f(-half)), vec2f(0.0), vec2f(1.0));
    return sides.x * sides.y;
}

// Share of a pixel that the disc covers, whose middle is `distance` pixels away. Over all pixels it adds up to the disc's area.
fn covered_by_disc(distance: f32, radius: f32) -> f32 {
    return clamp(sqrt(max(radius * radius - 0.083333333, 0.0)) - distance + 0.5, 0.0, 1.0);
}

// Below this radius, in pixels, few pixels' centres do not sample a disc well.
const SQUARE: f32 = 1.5;
// Pixels across the largest small sphere.
const ACROSS: i32 = 6;

@compute @workgroup_size(64)
fn add_small(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = thread_index(group, local);
    if index >= params.count {
        return;
    }
    let sphere = placed[index];
    let radius = radius_in_pixels(sphere);
    if sphere.radius <= 0.0 || radius > LARGE {
        return;
    }
    let radiance = sphere_radiance(sphere, params.albedos[kind_of(sphere.traits)].rgb, vec3f(0.0));
    let opacity = opacity_of(sphere.traits);
    let disparity = camera_disparity(sphere.position);
    let first = vec2i(floor(sphere.pixel - radius - 0.5));
    let last = vec2i(floor(sphere.pixel + radius + 0.5));
    let across = min(last - first + 1, vec2i(ACROSS));
    for (var i = 0; i < across.x * across.y; i++) {
        let pixel = first + vec2i(i % across.x, i / across.x);
        let offset = vec2f(pixel) + 0.5 - sphere.pixel;
        let covered = select(
            covered_by_disc(length(offset), radius),
            covered_by_square(offset, radius),
            radius < SQUARE,
        );
        add(sphere, pixel, opacity * covered, radiance, disparity);
    }
}

// A large sphere at a pixel.
struct Point {
    covered: f32,
    disparity: f32,
    normal: vec3f, // view space
}

fn point_at(sphere: Placed, pixel: vec2i) -> Point {
    // Where refraction shifts it, the whole sphere is shifted.
    let u = vec2f(pixel) + 0.5 - sphere.pixel + camera_pixel(sphere.position);
    let omega = camera_omega(u);
    let d = camera_ray_direction(omega);
    let from_centre = camera_ray_origin(omega) - sphere.position;
    let along = -dot(from_centre, d);
    let beside = from_centre + along * d;
    let side = camera_pixel_side(sphere.position);
    let depth = sqrt(max(sphere.radius * sphere.radius - dot(beside, beside), 0.0));
    let at = camera_ray_origin(omega) + (along - depth) * d;
    return Point(
        covered_by_disc(length(beside) / side, sphere.radius / side),
        camera_disparity(at),
        normalize(at - sphere.position),
    );
}

// Visits the pixels of a large sphere with the threads of a workgroup: `i` is one of their numbers.
fn pixel_of(sphere: Placed, i: u32) -> vec2i {
    let reach = reach_of(sphere);
    let across = 2u * reach + 1u;
    return vec2i(floor(sphere.pixel)) - i32(reach) + vec2i(vec2u(i % across, i / across));
}

// A sphere beside the view direction appears longer than it is wide.
fn reach_of(sphere: Placed) -> u32 {
    let longest = 1.0 / (1.0 - min(sphere.radius / length(sphere.position), 0.9));
    let omega = camera_omega(sphere.pixel);
    let slant = select(length(omega), 1.0, ORTHOGRAPHIC);
    let reach = radius_in_pixels(sphere) * select(longest, 1.0, ORTHOGRAPHIC) * slant + 1.0;
    return u32(min(reach, max(camera.size.x, camera.size.y)));
}

// Finds the nearest opaque sphere of each pixel.
@compute @workgroup_size(64)
fn cover(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    for (var k = group.x; k < large.count; k += groups.x) {
        let index = large.spheres[k];
        let sphere = placed[index];
        let across = 2u * reach_of(sphere) + 1u;
        for (var i = local; i < across * across; i += 64u) {
            let pixel = pixel_of(sphere, i);
            let point = point_at(sphere, pixel);
            if is_in_picture(pixel) && point.covered * opacity_of(sphere.traits) > 0.99 {
                let bits = bitcast<u32>(point.disparity);
                let share = in_air(sphere);
                atomicMax(&opaque[pixel_index(pixel)][0], select(0u, bits, share > 0.99));
                atomicMax(&opaque[pixel_index(pixel)][1], select(0u, bits, share < 0.01));
            }
        }
    }
}

@compute @workgroup_size(64)
fn add_large(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    for (var k = group.x; k < large.count; k += groups.x) {
        let index = large.spheres[k];
        let sphere = placed[index];
        let albedo = params.albedos[kind_of(sphere.traits)].rgb;
        let across = 2u * reach_of(sphere) + 1u;
        for (var i = local; i < across * across; i += 64u) {
            let pixel = pixel_of(sphere, i);
            let point = point_at(sphere, pixel);
            if point.covered > 0.0 {
                let radiance = sphere_radiance(sphere, albedo, camera_world_direction(point.normal));
                add(sphere, pixel, opacity_of(sphere.traits) * point.covered, radiance, point.disparity);
            }
        }
    }
}
