// `march`: visits every texel that the ray crosses, in order; exact for the given layers.
//
// After McGuire and Mara, Efficient GPU Screen-Space Ray Tracing (2014), with texel (i, j) covering
// [i, i + 1), and intersecting each texel's plane instead of comparing its depth. With a STRIDE above 1
// it samples every STRIDE-th pixel, like their faster variant.

#import refract/interfaces.wgsl
#import refract/pixels.wgsl

override STRIDE: u32 = 1u;

// Upper bound on the texels that a line through the picture crosses, doubled against rounding.
fn most_texels() -> u32 {
    let size = textureDimensions(aggregate_layers);
    return 2u * (size.x + size.y);
}

// Grid traversal along the ray.
struct Walk {
    texel: vec2i,
    step: vec2i,
    next: vec2f,    // tau at which the ray leaves the texel along each axis
    delta: vec2f,   // tau per texel along each axis
    tau: f32,       // at which the ray entered the texel
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

// Tau at which the ray leaves the current texel.
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
    if STRIDE > 1u {
        return strided_exit(ray, texel);
    }
    var walk = walk_start(ray);
    var plane = vec3f(0.0);
    var last = texel;
    var leave = slabs_leave_at_start(slabs_at(texel, ray, 0.0, AT_START), ray);
    for (var i = 0u; i < most_texels() && walk.tau < 1.0; i++) {
        if !leave.inside {
            if plane_is_empty(plane) {
                return no_interface();
            }
            // A step between the planes of neighbouring texels belongs to the surface, any other to an outline.
            if leave.tau <= walk.tau && leave.tau >= walk.tau - ray.tau_per_pixel {
                return interface_at(ray, walk.tau, plane, last);
            }
            return outline_at(ray, walk.tau, plane, last);
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
        leave = slabs_leave(slabs_at(walk.texel, ray, walk.tau, ROUNDING), ray, walk.tau, ROUNDING);
    }
    return no_interface();
}

fn front_entry(layer_class: i32, ray: ScreenRay) -> Interface {
    if STRIDE > 1u {
        return strided_entry(layer_class, ray);
    }
    var walk = walk_start(ray);
    // Whether the ray entered this texel in front of the layer, beyond it, or over an empty texel.
    var ahead = false;
    for (var i = 0u; i < most_texels() && walk.tau < 1.0; i++) {
        diagnosed.iterations += 1.0;
        let interval = class_interval(layer_class, walk.texel, ray, walk.tau);
        let front = interval.front;
        let back = interval.back;
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
                // Just behind the front: crossed a step no larger than its slope over a texel.
                if ahead && slope > 0.0 && residual <= slope * ray.tau_per_pixel {
                    return interface_at(ray, walk.tau, front, walk.texel);
                }
                if ahead && i > 0u && layer_class != OPAQUE && is_deep(ray, front, back, walk.tau) {
                    return outline_at(ray, walk.tau, front, walk.texel);
                }
                ahead = false;
            } else {
                ahead = true;
            }
        }
        walk_on(&walk);
    }
    return no_interface();
}

// Change of tau between samples: STRIDE pixels along the ray's major axis.
fn strided_step(ray: ScreenRay) -> f32 {
    return f32(STRIDE) / max(max(abs(ray.du.x), abs(ray.du.y)), 1e-6);
}

fn strided_exit(ray: ScreenRay, texel: vec2i) -> Interface {
    let step = strided_step(ray);
    var tau = 0.0;
    var last = texel;
    var leave = slabs_leave_at_start(slabs_at(texel, ray, 0.0, AT_START), ray);
    if !leave.inside {
        return no_interface();
    }
    for (var i = 0u; i < most_texels() && tau < 1.0; i++) {
        let next = min(tau + step, 1.0);
        if leave.tau <= next {
            return interface_at(ray, leave.tau, leave.plane, last);
        }
        if next >= 1.0 {
            break;
        }
        let there = screen_ray_texel(ray, next);
        let beyond = slabs_leave(slabs_at(there, ray, next, ROUNDING), ray, next, ROUNDING);
        if !beyond.inside {
            // Left since the last sample: at the root of this texel's plane if it lies in between.
            if beyond.tau >= tau && beyond.tau <= next {
                return interface_at(ray, beyond.tau, beyond.plane, there);
            }
            return outline_at(ray, next, leave.plane, last);
        }
        leave = beyond;
        last = there;
        tau = next;
    }
    return beyond_picture(ray, leave, last);
}

fn strided_entry(layer_class: i32, ray: ScreenRay) -> Interface {
    let step = strided_step(ray);
    var tau = 0.0;
    var ahead = false;
    var root = NEVER;
    var plane = vec3f(0.0);
    var texel = vec2i(0);
    for (var i = 0u; i < most_texels() && tau < 1.0; i++) {
        diagnosed.iterations += 1.0;
        let there = screen_ray_texel(ray, tau);
        let interval = class_interval(layer_class, there, ray, tau);
        let front = interval.front;
        let back = interval.back;
        let residual = screen_ray_residual(ray, front, tau);
        let slope = screen_ray_residual_slope(ray, front);
        let own = select(NEVER, tau - residual / slope, slope > 0.0);
        if plane_is_empty(front) {
            ahead = true;
            root = NEVER;
        } else if residual <= 0.0 {
            ahead = true;
            root = own;
            plane = front;
            texel = there;
        } else {
            if ahead && screen_ray_residual(ray, back, tau) <= 0.0 {
                // Crossed since the last sample, by this texel's plane or by the last one's.
                if own >= tau - step {
                    return interface_at(ray, own, front, there);
                }
                if root <= tau {
                    return interface_at(ray, root, plane, texel);
                }
                if layer_class != OPAQUE && is_deep(ray, front, back, tau) {
                    return outline_at(ray, tau, front, there);
                }
            }
            ahead = screen_ray_residual(ray, back, tau) > 0.0;
            root = NEVER;
        }
        if ahead && root <= tau + step && root <= 1.0 && tau + step > 1.0 {
            return interface_at(ray, root, plane, texel);
        }
        tau += step;
    }
    return no_interface();
}

fn opaque_entry(ray: ScreenRay) -> Interface {
    return front_entry(OPAQUE, ray);
}
