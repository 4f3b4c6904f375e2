// The opaque scene as another picture shows it: that of a host program, of opaque fluids, or the background.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/scene.wgsl
#import common/screen_ray.wgsl
#import refract/bindings.wgsl

// Index of a hit on the host's scene, in place of a solid's.
const HOST_SCENE: u32 = 0xffffffffu;

// Distance in depth, in pixel sides, up to which a point counts as one that the picture shows.
const SHOWN: f32 = 4.0;

// Hit of the eye's ray through `omega` on what the picture shows at a texel.
fn host_hit(omega: vec3f, texel: vec2i) -> SolidHit {
    let plane = textureLoad(gbuffer_planes, texel, 0).xyz;
    let disparity = dot(plane, omega);
    let hit = !plane_is_empty(plane) && (ORTHOGRAPHIC || disparity > 0.0);
    let t = select(NOTHING, camera_distance(omega, disparity), hit);
    return SolidHit(t, HOST_SCENE, NO_TRIANGLE, camera_world_direction(plane_normal(plane)));
}

// The nearer of a solid's hit and the hit on what the picture shows.
fn host_ahead(o: vec3f, d: vec3f, solid: SolidHit) -> SolidHit {
    let shown = opaque_entry(screen_ray(o, d, solid.t));
    if !shown.found {
        return solid;
    }
    let normal = camera_world_direction(plane_normal(shown.plane));
    return SolidHit(distance(o, shown.position), HOST_SCENE, NO_TRIANGLE, normal);
}

// Radiance of the host's picture where a ray ends: on its scene, on a solid that stands for a part of it, or
// on the sky. w is 0 if the picture does not show that.
fn host_look(o: vec3f, d: vec3f, solid: SolidHit) -> vec4f {
    if solid.t >= NOTHING {
        // The sky has the direction's place in the picture.
        let u = camera_pixel(d);
        let within = !ORTHOGRAPHIC && d.z < 0.0 && all(u >= vec2f(0.0)) && all(u < camera.size);
        if !within || !plane_is_empty(textureLoad(gbuffer_planes, vec2i(u), 0).xyz) {
            return vec4f(0.0);
        }
        return vec4f(host_radiance(u, 0.0, true), 1.0);
    }
    let x = o + solid.t * d;
    if solid.index != HOST_SCENE && !shows(x) {
        return vec4f(0.0);
    }
    return vec4f(host_radiance(camera_pixel(x), camera_disparity(x), false), 1.0);
}

// Whether the picture shows a point of a solid.
fn shows(x: vec3f) -> bool {
    if !in_picture(x) {
        return false;
    }
    let u = camera_pixel(x);
    let plane = textureLoad(gbuffer_planes, vec2i(u), 0).xyz;
    let difference = abs(dot(plane, camera_omega(u)) - camera_disparity(x));
    return !plane_is_empty(plane) && difference <= shown_difference(x);
}

// Difference of disparity at a point that is SHOWN pixel sides in depth.
fn shown_difference(x: vec3f) -> f32 {
    let disparity = camera_disparity(x);
    return SHOWN * camera_pixel_side(x) * select(disparity * disparity, 1.0, ORTHOGRAPHIC);
}

fn shown_color(texel: vec2i) -> vec3f {
    if OPAQUE_FLUIDS {
        return textureLoad(body_radiance, texel, 0).rgb;
    }
    return textureLoad(host_color, texel, 0).rgb;
}

// Radiance at a pixel position, interpolated between those texels that show the sky, or a surface of this
// disparity there.
fn host_radiance(u: vec2f, disparity: f32, sky: bool) -> vec3f {
    let omega = camera_omega(u);
    let base = floor(u - 0.5);
    let f = u - 0.5 - base;
    var most = shown_difference(vec3f(0.0, 0.0, -1.0));
    if !sky {
        most = shown_difference(camera_point(omega, disparity));
    }
    var sum = vec4f(0.0);
    var any_surface = vec4f(0.0);
    for (var k = 0u; k < 4u; k++) {
        let corner = vec2f(vec2u(k & 1u, k >> 1u));
        let texel = clamp(vec2i(base + corner), vec2i(0), vec2i(camera.size) - 1);
        let plane = textureLoad(gbuffer_planes, texel, 0).xyz;
        let near = !plane_is_empty(plane) && abs(dot(plane, omega) - disparity) <= most;
        let share = mix(1.0 - f, f, corner);
        let weight = select(0.0, share.x * share.y, select(near, plane_is_empty(plane), sky));
        let color = vec4f(shown_color(texel), 1.0);
        sum += weight * color;
        any_surface += select(share.x * share.y, 0.0, plane_is_empty(plane)) * color;
    }
    if OPAQUE_FLUIDS && sum.w < 1e-3 && any_surface.w > 0.0 {
        // Elsewhere the picture has no color.
        return any_surface.rgb / any_surface.w;
    }
    let nearest = shown_color(clamp(vec2i(u), vec2i(0), vec2i(camera.size) - 1));
    return select(nearest, sum.rgb / max(sum.w, 1e-3), sum.w >= 1e-3);
}

// Pixel position at which the picture shows what a ray meets in the distance.
fn pixel_ahead(o: vec3f, d: vec3f) -> vec2f {
    return camera_pixel(select(d, o, ORTHOGRAPHIC));
}

// Whether the picture shows what a ray meets in the distance; with parallel rays, only straight ahead.
fn is_ahead(o: vec3f, d: vec3f) -> bool {
    let u = pixel_ahead(o, d);
    let forward = select(d.z < 0.0, d.z < -0.99999, ORTHOGRAPHIC);
    return forward && all(u >= vec2f(0.0)) && all(u <= camera.size);
}

// The background that a ray sees: the eye's the pixel itself, others between pixels.
fn background_radiance(o: vec3f, d: vec3f, travelled: f32) -> vec3f {
    let u = pixel_ahead(o, d);
    let last = vec2i(camera.size) - 1;
    let base = select(floor(u - 0.5), floor(u), travelled == 0.0);
    let f = select(u - 0.5 - base, vec2f(0.0), travelled == 0.0);
    var sum = vec3f(0.0);
    for (var k = 0u; k < 4u; k++) {
        let corner = vec2f(vec2u(k & 1u, k >> 1u));
        let share = mix(1.0 - f, f, corner);
        let texel = clamp(vec2i(base + corner), vec2i(0), last);
        sum += share.x * share.y * textureLoad(host_color, texel, 0).rgb;
    }
    return sum;
}
