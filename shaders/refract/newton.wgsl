// `newton`: a fixed number of tangent-plane iterations, tested once at the end.
//
// Mayer, Assarsson and Sintorn, refractions and caustics by Newton's method (2026). A ray that
// fails the one-pixel test falls back on a single lookup, offset by the surface normal
// (Sousa, Generic Refraction Simulation, GPU Gems 2, 2005).

#import refract/interfaces.wgsl

fn plane_at(layer_class: i32, side: i32, u: vec2f) -> vec3f {
    diagnosed.iterations += 1.0;
    return class_plane(layer_class, side, clamp(vec2i(floor(u)), vec2i(0), vec2i(camera.size) - 1));
}

fn intersect(layer_class: i32, side: i32, o: vec3f, d: vec3f) -> Interface {
    var u = camera_pixel(o);
    var plane: vec3f;
    var x = o;
    // One evaluation more than iterations: the last one is the test.
    for (var i = 0u; i <= params.iterations; i++) {
        plane = plane_at(layer_class, side, u);
        let rate = dot(plane, d);
        if plane_is_empty(plane) || abs(rate) < 1e-12 {
            return no_interface();
        }
        let t = (1.0 - dot(plane, o)) / rate;
        x = o + t * d;
        if t < 0.0 || -x.z < camera.near {
            return no_interface();
        }
        let projected = camera_pixel(x);
        if any(projected < vec2f(0.0)) || any(projected >= camera.size) {
            return no_interface();
        }
        if i == params.iterations && distance(projected, u) > 1.0 {
            return no_interface();
        }
        u = projected;
    }
    return Interface(true, x, plane, vec2i(floor(u)));
}

// One lookup: the back of the class at a pixel offset by the normal, scaled by the thickness.
fn single(layer_class: i32, o: vec3f) -> Interface {
    let u = camera_pixel(o);
    let front = plane_at(layer_class, FRONT, u);
    let back = plane_at(layer_class, BACK, u);
    if plane_is_empty(front) || plane_is_empty(back) {
        return no_interface();
    }
    let thickness = max(1.0 / dot(back, camera_omega(u)) + o.z, 0.0);
    let pixels_per_metre = 0.5 * camera.size.y / (camera.tangent.y * -o.z);
    let n = -normalize(front);
    let offset = u + 0.15 * thickness * pixels_per_metre * vec2f(-n.x, n.y);
    var at = offset;
    var plane = plane_at(layer_class, BACK, at);
    if plane_is_empty(plane) {
        at = u;
        plane = back;
    }
    let to = camera_omega(at);
    return Interface(true, to / dot(plane, to), plane, vec2i(floor(at)));
}

fn class_exit(layer_class: i32, o: vec3f, d: vec3f) -> Interface {
    let hit = intersect(layer_class, BACK, o, d);
    if hit.found {
        return hit;
    }
    let guess = single(layer_class, o);
    // One that is not even guessed is counted by the caller.
    diagnosed.failures += select(0.0, 1.0, guess.found);
    return guess;
}

fn liquid_exit(ray: ScreenRay, texel: vec2i) -> Interface {
    let o = screen_ray_point(ray, 0.0);
    let d = ray.direction;
    if !SPLASH {
        return class_exit(AGGREGATE, o, d);
    }
    let slabs = load_slabs(texel);
    let splash = slab_leave(slabs.splash_front, slabs.splash_back, ray, 0.0, AT_START);
    let aggregate = slab_leave(slabs.aggregate_front, slabs.aggregate_back, ray, 0.0, AT_START);
    var hit = no_interface();
    if splash.inside {
        hit = class_exit(SPLASHES, o, d);
    }
    if aggregate.inside || !hit.found {
        let other = class_exit(AGGREGATE, o, d);
        if other.found && (!hit.found || distance(o, other.position) > distance(o, hit.position)) {
            hit = other;
        }
    }
    return hit;
}

// Accepts only a hit from in front of the layer, and not the surface that the ray has just left.
fn front_entry(layer_class: i32, ray: ScreenRay) -> Interface {
    let o = screen_ray_point(ray, 0.0);
    let hit = intersect(layer_class, FRONT, o, ray.direction);
    let ahead = dot(hit.plane, ray.direction) > 0.0;
    if hit.found && ahead && distance(o, hit.position) > 1e-4 * -o.z {
        return hit;
    }
    return no_interface();
}
