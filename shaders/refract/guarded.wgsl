// `guarded`: Newton's method on layer disparity minus ray disparity, kept inside a bracket.
//
// A texel is a plane and the ray is linear in tau, so one fetch predicts the root; the step is
// taken in bounded strides until the state changes, then between the bracket's ends, by
// prediction where that helps and by bisection where it does not.

#import refract/interfaces.wgsl

// A prediction this close to the texel it was read from is the root.
const CLOSE_PIXELS: f32 = 0.25;
const EXIT_STEPS: u32 = 48u;
const ENTRY_STEPS: u32 = 96u;
// Longest step that is not checked from inside: shorter gaps between liquid are stepped over.
const STRIDE_PIXELS: f32 = 16.0;
const ENTRY_STRIDE_PIXELS: f32 = 8.0;

fn liquid_exit(ray: ScreenRay, texel: vec2i) -> Interface {
    let close = CLOSE_PIXELS * ray.tau_per_pixel;
    let stride = STRIDE_PIXELS * ray.tau_per_pixel;
    var inside_tau = 0.0;
    var inside_texel = texel;
    var inside = slabs_leave(load_slabs(texel), ray, 0.0, AT_START);
    if !inside.inside {
        return no_interface();
    }
    // The other end of the bracket, once a step has left the liquid.
    var outside_tau = NEVER;
    var outside_texel = texel;
    var outside = inside;
    var width = NEVER;
    for (var i = 0u; i < EXIT_STEPS; i++) {
        if inside.tau - inside_tau <= close && inside.tau <= 1.0 {
            return interface_at(ray, inside.tau, inside.plane, inside_texel);
        }
        var tau = min(inside.tau, inside_tau + stride);
        if outside_tau < NEVER {
            if outside.tau >= inside_tau && abs(outside_tau - outside.tau) <= close {
                return interface_at(ray, outside.tau, outside.plane, outside_texel);
            }
            if outside_tau - inside_tau <= close {
                // A silhouette: the last plane inside gives the normal.
                return interface_at(ray, inside_tau, inside.plane, inside_texel);
            }
            let halved = outside_tau - inside_tau <= 0.5 * width;
            width = outside_tau - inside_tau;
            tau = select(outside.tau, inside.tau, inside.tau < outside_tau);
            if !halved || !(tau > inside_tau && tau < outside_tau) {
                tau = 0.5 * (inside_tau + outside_tau);
            }
        } else if inside_tau >= 1.0 {
            return beyond_picture(ray, inside, inside_texel);
        }
        tau = min(tau, 1.0);
        let there_texel = screen_ray_texel(ray, tau);
        let there = slabs_leave(load_slabs(there_texel), ray, tau, ROUNDING);
        if there.inside {
            inside = there;
            inside_tau = tau;
            inside_texel = there_texel;
        } else {
            outside = there;
            outside_tau = tau;
            outside_texel = there_texel;
        }
    }
    diagnosed.failures += 1.0;
    return interface_at(ray, inside_tau, inside.plane, inside_texel);
}

// How a ray stands to one front layer.
struct Approach {
    behind: bool,
    tau: f32,      // where the texel's plane says that the ray meets it, NEVER if it does not
    plane: vec3f,
    texel: vec2i,
}

fn approach(layer_class: i32, ray: ScreenRay, tau: f32) -> Approach {
    let texel = screen_ray_texel(ray, tau);
    diagnosed.iterations += 1.0;
    let front = class_plane(layer_class, FRONT, texel);
    let back = class_plane(layer_class, BACK, texel);
    if plane_is_empty(front) {
        return Approach(false, NEVER, front, texel);
    }
    let residual = screen_ray_residual(ray, front, tau);
    let slope = screen_ray_residual_slope(ray, front);
    let root = select(NEVER, tau - residual / slope, slope > 0.0);
    let beyond = screen_ray_residual(ray, back, tau) > 0.0;
    return Approach(residual > 0.0 && !beyond, select(root, NEVER, residual > 0.0 && beyond), front, texel);
}

fn front_entry(layer_class: i32, ray: ScreenRay) -> Interface {
    let close = CLOSE_PIXELS * ray.tau_per_pixel;
    // Short steps first: a ray that has just left may enter again within a pixel or two.
    var stride = 0.5 * ray.tau_per_pixel;
    var tau = 0.0;
    var here = approach(layer_class, ray, tau);
    for (var i = 0u; i < ENTRY_STEPS && tau < 1.0; i++) {
        if !here.behind && here.tau - tau <= close {
            return entry_at(ray, here);
        }
        var next = min(min(tau + stride, 1.0), select(here.tau, NEVER, here.behind || here.tau <= tau));
        var there = approach(layer_class, ray, next);
        if there.behind && !here.behind {
            // The ray passed the surface, or slipped behind an edge in front of it.
            var low = tau;
            for (var k = 0u; k < 8u; k++) {
                if there.tau >= low && next - there.tau <= close {
                    return entry_at(ray, there);
                }
                let middle = select(0.5 * (low + next), there.tau, there.tau > low && there.tau < next && k < 3u);
                let between = approach(layer_class, ray, middle);
                if between.behind {
                    next = middle;
                    there = between;
                } else {
                    if between.tau - middle <= close {
                        return entry_at(ray, between);
                    }
                    low = middle;
                }
                if next - low < 0.5 * close {
                    break;
                }
            }
        }
        tau = next;
        here = there;
        stride = min(2.0 * stride, ENTRY_STRIDE_PIXELS * ray.tau_per_pixel);
    }
    return no_interface();
}

fn entry_at(ray: ScreenRay, at: Approach) -> Interface {
    if at.tau > 1.0 || at.tau < 0.0 {
        return no_interface();
    }
    return interface_at(ray, at.tau, at.plane, at.texel);
}
