// `march`: every texel that the ray crosses, in order; exact for the layers as they are.
//
// After McGuire and Mara, Efficient GPU Screen-Space Ray Tracing (2014), with texel (i, j)
// covering [i, i + 1), and with each texel's plane intersected instead of its depth compared.

#import refract/interfaces.wgsl

// Steps through the texels along the ray.
struct Walk {
    texel: vec2i,
    step: vec2i,
    next: vec2f,    // tau at which the ray leaves the texel, by axis
    delta: vec2f,   // tau per texel
    tau: f32,
}

fn walk_start(ray: ScreenRay) -> Walk {
    var walk: Walk;
    walk.texel = screen_ray_texel(ray, 0.0);
    walk.step = vec2i(sign(ray.du));
    walk.delta = 1.0 / max(abs(ray.du), vec2f(1e-9));
    let ahead = select(ray.u - vec2f(walk.texel), vec2f(walk.texel) + 1.0 - ray.u, ray.du > vec2f(0.0));
    walk.next = max(ahead, vec2f(0.0)) * walk.delta;
    walk.tau = 0.0;
    return walk;
}

// The tau at which the ray leaves the present texel.
fn walk_end(walk: Walk) -> f32 {
    return min(min(walk.next.x, walk.next.y), 1.0);
}

fn walk_on(walk: ptr<function, Walk>) {
    let w = *walk;
    if w.next.x < w.next.y {
        (*walk).tau = w.next.x;
        (*walk).texel.x += w.step.x;
        (*walk).next.x += w.delta.x;
    } else {
        (*walk).tau = w.next.y;
        (*walk).texel.y += w.step.y;
        (*walk).next.y += w.delta.y;
    }
    (*walk).texel = clamp((*walk).texel, vec2i(0), vec2i(camera.size) - 1);
}

fn liquid_exit(ray: ScreenRay, texel: vec2i) -> Interface {
    var walk = walk_start(ray);
    var plane = vec3f(0.0);
    var last = texel;
    var leave = slabs_leave(load_slabs(texel), ray, 0.0, AT_START);
    while walk.tau < 1.0 {
        if !leave.inside {
            if plane_is_empty(plane) {
                return no_interface();
            }
            // A silhouette, or a step between texels: the last plane inside gives the normal.
            return interface_at(ray, walk.tau, plane, last);
        }
        plane = leave.plane;
        last = walk.texel;
        if leave.tau <= walk_end(walk) {
            return interface_at(ray, leave.tau, plane, last);
        }
        walk_on(&walk);
        if walk.tau >= 1.0 {
            return beyond_picture(ray, leave, last);
        }
        leave = slabs_leave(load_slabs(walk.texel), ray, walk.tau, ROUNDING);
    }
    return no_interface();
}

fn front_entry(layer_class: i32, ray: ScreenRay) -> Interface {
    var walk = walk_start(ray);
    // Whether the ray was in front of the layer, or beside it, when it came to this texel.
    var ahead = false;
    while walk.tau < 1.0 {
        diagnosed.iterations += 1.0;
        let front = class_plane(layer_class, FRONT, walk.texel);
        let back = class_plane(layer_class, BACK, walk.texel);
        if plane_is_empty(front) {
            ahead = true;
        } else {
            let residual = screen_ray_residual(ray, front, walk.tau);
            let slope = screen_ray_residual_slope(ray, front);
            let end = walk_end(walk);
            if residual <= 0.0 {
                ahead = true;
                if slope > 0.0 && walk.tau - residual / slope <= end {
                    let tau = walk.tau - residual / slope;
                    return interface_at(ray, tau, front, walk.texel);
                }
            } else if screen_ray_residual(ray, back, walk.tau) <= 0.0 {
                // Behind the front: a step no larger than its slope over a texel was crossed.
                if ahead && slope > 0.0 && residual <= slope * ray.tau_per_pixel {
                    return interface_at(ray, walk.tau, front, walk.texel);
                }
                ahead = false;
            }
        }
        walk_on(&walk);
    }
    return no_interface();
}
