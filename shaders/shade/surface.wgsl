// The first surface of a body at a pixel, and the light around it.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/scene.wgsl

override SPLASH: bool = false;  // the frame has splash layers

@group(1) @binding(1) var aggregate_layers: $layers;
@group(1) @binding(2) var splash_layers: $layers;

const PI: f32 = 3.14159265;

// Plane of the nearest liquid at a texel; empty if there is none.
fn front_at(texel: vec2i) -> vec3f {
    var front = textureLoad(aggregate_layers, texel, FRONT$level).xyz;
    if SPLASH {
        let omega = camera_omega(vec2f(texel) + 0.5);
        let splash = textureLoad(splash_layers, texel, FRONT$level).xyz;
        front = select(front, splash, dot(splash, omega) > dot(front, omega));
    }
    return front;
}

// Last plane of liquid at a texel.
fn back_at(texel: vec2i) -> vec3f {
    var back = textureLoad(aggregate_layers, texel, BACK$level).xyz;
    if SPLASH {
        let omega = camera_omega(vec2f(texel) + 0.5);
        let splash = textureLoad(splash_layers, texel, BACK$level).xyz;
        let is_farther = plane_is_empty(back) || dot(splash, omega) < dot(back, omega);
        back = select(back, splash, !plane_is_empty(splash) && is_farther);
    }
    return back;
}

// The surface at a texel's centre.
struct Body {
    front: vec3f,     // plane; empty if there is none
    omega: vec3f,
    disparity: f32,
    position: vec3f,  // view space
    normal: vec3f,    // unit, towards the eye
    eye: vec3f,       // unit, towards the eye
}

fn body_at(texel: vec2i) -> Body {
    var body: Body;
    body.front = front_at(texel);
    body.omega = camera_omega(vec2f(texel) + 0.5);
    body.disparity = dot(body.front, body.omega);
    body.position = camera_point(body.omega, body.disparity);
    body.normal = -plane_normal(body.front);
    body.eye = -camera_ray_direction(body.omega);
    return body;
}

// Distance of the point at a disparity of the ray through `omega` from a plane; positive behind it.
fn depth_below(plane: vec3f, omega: vec3f, disparity: f32) -> f32 {
    let way = camera_distance(omega, disparity) - camera_distance(omega, max(dot(plane, omega), 1e-20));
    return way * dot(plane_normal(plane), camera_ray_direction(omega));
}

// Share of the hemisphere that the directions may miss.
const NARROW: f32 = 0.003;

// Light of the hemisphere with all bounces between places that are lit alike: a geometric series of the albedo of the body in
// the way. Where no direction leads out, a narrower one might.
fn bounced_light(light: vec3f, bounced: vec3f) -> vec3f {
    return (light + NARROW * scene.ambient) / (vec3f(1.0 + NARROW) - bounced);
}

// Two unit vectors perpendicular to a unit vector and to each other (Duff et al., Building an Orthonormal Basis,
// Revisited, 2017).
fn basis_around(n: vec3f) -> mat2x3f {
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return mat2x3f(vec3f(1.0 + s * n.x * n.x * a, s * b, -s * n.x), vec3f(b, s + n.y * n.y * a, -n.y));
}
