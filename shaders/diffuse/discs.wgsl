// Spheres in the picture, and their pixels.

#import diffuse/particles.wgsl

struct Large {
    count: u32,
    spheres: array<u32>,
}

@group(1) @binding(2) var<storage, read> placed: array<Placed>;
@group(1) @binding(3) var<storage, read> large: Large;

fn is_in_picture(pixel: vec2i) -> bool {
    return all(pixel >= vec2i(0)) && all(pixel < vec2i(camera.size));
}

fn pixel_index(pixel: vec2i) -> u32 {
    return u32(pixel.y) * u32(camera.size.x) + u32(pixel.x);
}

// Share of a pixel that the disc covers, whose middle is `distance` pixels away. Over all pixels it adds up to the disc's area.
fn covered_by_disc(distance: f32, radius: f32) -> f32 {
    return clamp(sqrt(max(radius * radius - 0.083333333, 0.0)) - distance + 0.5, 0.0, 1.0);
}

// Below this radius, in pixels, few pixels' centres do not sample a disc well.
const SQUARE: f32 = 1.5;
// Pixels across the largest small sphere.
const ACROSS: i32 = 6;

// The pixels of a small sphere.
struct SmallSquare {
    first: vec2i,
    across: vec2i,
}

fn small_square(sphere: Placed) -> SmallSquare {
    let reach = radius_in_pixels(sphere) + 0.5;
    let first = vec2i(floor(sphere.pixel - reach));
    return SmallSquare(first, min(vec2i(floor(sphere.pixel + reach)) - first + 1, vec2i(ACROSS)));
}

fn pixel_in(square: SmallSquare, i: i32) -> vec2i {
    return square.first + vec2i(i % square.across.x, i / square.across.x);
}

// Share of a pixel that a small sphere covers.
fn covered_by_small(sphere: Placed, pixel: vec2i) -> f32 {
    let radius = radius_in_pixels(sphere);
    let offset = vec2f(pixel) + 0.5 - sphere.pixel;
    return select(covered_by_disc(length(offset), radius), covered_by_square(offset, radius), radius < SQUARE);
}

// Share of a pixel that a square of the disc's area covers, `offset` pixels from its centre.
fn covered_by_square(offset: vec2f, radius: f32) -> f32 {
    let half = 0.88622693 * radius;
    let sides = clamp(min(offset + 0.5, vec2f(half)) - max(offset - 0.5, vec2f(-half)), vec2f(0.0), vec2f(1.0));
    return sides.x * sides.y;
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

// Calls the root's `at_pixel` for each pixel of the picture that a large sphere covers. Each workgroup takes some spheres, and
// its threads take their pixels.
fn visit_large(group: u32, groups: u32, local: u32) {
    for (var k = group; k < large.count; k += groups) {
        let index = large.spheres[k];
        let sphere = placed[index];
        let across = 2u * reach_of(sphere) + 1u;
        for (var i = local; i < across * across; i += 64u) {
            let pixel = pixel_of(sphere, i);
            let point = point_at(sphere, pixel);
            if is_in_picture(pixel) && point.covered > 0.0 {
                at_pixel(sphere, index, pixel, point);
            }
        }
    }
}

// Pixel number i of the square around a large sphere.
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
