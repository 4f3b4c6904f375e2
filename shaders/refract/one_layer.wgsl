// Base of the published intersectors, which intersect one layer of one class at a time.
//
// A root imports this file and defines
//     fn intersect(layer_class: i32, side: i32, ray: ScreenRay) -> Interface
// Inside the liquid, `single` is the fallback for rays without an intersection.

#import refract/interfaces.wgsl
#import refract/pixels.wgsl

fn clamped_texel(u: vec2f) -> vec2i {
    return clamp(vec2i(floor(u)), vec2i(0), vec2i(camera.size) - 1);
}

// Whether the point at tau is in the picture. It may lie beyond the solid that ends the ray, which is a
// valid result too.
fn on_ray(ray: ScreenRay, tau: f32) -> bool {
    let u = ray.u + tau * ray.du;
    return tau >= 0.0 && ray.disparity + tau * ray.d_disparity > 0.0
        && all(u >= vec2f(0.0)) && all(u <= camera.size);
}

// Plane of a layer at a texel: of all that the class has there on this side, the nearest to the ray's point at tau.
fn nearest_plane(layer_class: i32, side: i32, texel: vec2i, ray: ScreenRay, tau: f32) -> vec3f {
    diagnosed.iterations += 1.0;
    var plane = class_plane(layer_class, side, texel);
    if GAPS == 0u || layer_class == OPAQUE {
        return plane;
    }
    let flags = select(FRONT, BACK, layer_class == SPLASHES);
    let has_gap = is_flagged(class_texel(AGGREGATE, flags, texel, 0).w);
    for (var gap = select(i32(GAPS), 0, has_gap); gap < i32(GAPS); gap++) {
        let other = class_plane(layer_class, select(gap_front(gap), gap_back(gap), side == BACK), texel);
        let nearer = abs(screen_ray_residual(ray, other, tau)) < abs(screen_ray_residual(ray, plane, tau));
        plane = select(plane, other, nearer && !plane_is_empty(other));
    }
    return plane;
}

fn plane_at(layer_class: i32, side: i32, u: vec2f) -> vec3f {
    diagnosed.iterations += 1.0;
    return class_plane(layer_class, side, clamped_texel(u));
}

// Offset of the lookup per unit normal and unit thickness (Sousa; value from Mayer's code).
const SINGLE_OFFSET: f32 = 0.15;

// One lookup, offset by the surface normal (Sousa, Generic Refraction Simulation, GPU Gems 2, 2005),
// here scaled by the thickness on the screen; without offset if the offset texel is empty.
fn single(layer_class: i32, side: i32, ray: ScreenRay) -> Interface {
    var normal_plane = plane_at(AGGREGATE, FRONT, ray.u);
    if SPLASH {
        let splash = plane_at(SPLASHES, FRONT, ray.u);
        if dot(splash, ray.omega) > dot(normal_plane, ray.omega) {
            normal_plane = splash;
        }
    }
    let behind = plane_at(layer_class, side, ray.u);
    let disparity = dot(behind, ray.omega);
    if plane_is_empty(normal_plane) || disparity <= 0.0 || disparity >= ray.disparity {
        return no_interface();
    }
    let thickness = select(1.0 / disparity - 1.0 / ray.disparity, ray.disparity - disparity, ORTHOGRAPHIC);
    let spread = select(ray.disparity, 1.0, ORTHOGRAPHIC);
    let pixels_per_metre = 0.5 * camera.size.y * spread / camera.tangent.y;
    let n = -plane_normal(normal_plane);
    var u = ray.u + SINGLE_OFFSET * thickness * pixels_per_metre * vec2f(-n.x, n.y);
    var plane = plane_at(layer_class, side, u);
    if plane_is_empty(plane) || any(u < vec2f(0.0)) || any(u >= camera.size) {
        u = ray.u;
        plane = behind;
    }
    let to = camera_omega(u);
    return Interface(true, camera_point(to, dot(plane, to)), plane, clamped_texel(u), false);
}

fn class_exit(layer_class: i32, ray: ScreenRay) -> Interface {
    let hit = intersect(layer_class, BACK, ray);
    if hit.found {
        return hit;
    }
    let guess = single(layer_class, BACK, ray);
    // The caller counts rays without a guess.
    diagnosed.failures += select(0.0, 1.0, guess.found);
    return guess;
}

fn liquid_exit(ray: ScreenRay, texel: vec2i) -> Interface {
    let hit = union_exit(ray, texel);
    if hit.found {
        return hit;
    }
    let start = crossed_slabs_leave(slabs_at(texel, ray, 0.0, AT_START), ray);
    if start.inside {
        return interface_at(ray, start.tau, start.plane, texel);
    }
    return hit;
}

fn union_exit(ray: ScreenRay, texel: vec2i) -> Interface {
    if !SPLASH {
        return class_exit(AGGREGATE, ray);
    }
    let slabs = slabs_at(texel, ray, 0.0, AT_START);
    let splash = slab_leave(slabs.splash, ray, 0.0, AT_START);
    let aggregate = slab_leave(slabs.aggregate, ray, 0.0, AT_START);
    let o = screen_ray_point(ray, 0.0);
    var hit = no_interface();
    if splash.inside {
        hit = class_exit(SPLASHES, ray);
    }
    if aggregate.inside || !hit.found {
        let other = class_exit(AGGREGATE, ray);
        if other.found && (!hit.found || distance(o, other.position) > distance(o, hit.position)) {
            hit = other;
        }
    }
    return hit;
}

// Accepts only hits from the front of the layer, and not on the surface that the ray just left.
fn front_entry(layer_class: i32, ray: ScreenRay) -> Interface {
    let hit = intersect(layer_class, FRONT, ray);
    let ahead = dot(hit.plane, ray.direction) > 0.0;
    let o = screen_ray_point(ray, 0.0);
    if hit.found && ahead && distance(o, hit.position) > 1e-4 * -o.z {
        return hit;
    }
    return no_interface();
}

fn opaque_entry(ray: ScreenRay) -> Interface {
    return front_entry(OPAQUE, ray);
}
