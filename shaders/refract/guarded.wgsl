// `guarded`: bracketed Newton's method on layer disparity minus ray disparity.
//
// A texel is a plane and the ray is linear in tau, so one fetch predicts the root. Steps are limited to
// a stride until the inside/outside state changes; then the root is bracketed and found by prediction
// where that converges, by bisection elsewhere.

#import common/tiles.wgsl
#import refract/bindings.wgsl
#import refract/interfaces.wgsl
#import refract/pixels.wgsl

override BOUNDS: bool = false; // the bounds of the layers are known

// Convergence threshold: distance, in pixels, between a predicted root and its sample.
const CLOSE_PIXELS: f32 = 0.25;
const EXIT_STEPS: u32 = 256u;
// Lower bounds on the stride in pixels, for small pictures, where the share of the height is tiny.
const LEAST_STRIDE: f32 = 4.0;
const LEAST_REACH: f32 = 8.0;
const ENTRY_STEPS: u32 = 192u;
// Most evaluations inside the bracket of an entry, the first of them where the plane behind it predicts.
const ENTRY_BISECTIONS: u32 = 8u;
const PREDICTED_BISECTIONS: u32 = 3u;

fn liquid_exit(ray: ScreenRay, texel: vec2i) -> Interface {
    let close = CLOSE_PIXELS * ray.tau_per_pixel;
    // Longest unchecked step: narrower gaps in the liquid are missed.
    let stride = max(params.reach * camera.size.y, LEAST_STRIDE) * ray.tau_per_pixel;
    var inside_tau = 0.0;
    var inside_texel = texel;
    var inside: Leave;
    // Outer end of the bracket, once a step has left the liquid.
    var outside_tau = NEVER;
    var outside_texel = texel;
    var outside: Leave;
    var width = NEVER;
    var tau = 0.0;
    var there_texel = texel;
    // One evaluation in the source, for the start too: drivers inline it where it is called.
    for (var i = 0u; i <= EXIT_STEPS; i++) {
        let slack = select(ROUNDING, AT_START, i == 0u);
        let slabs = slabs_at(there_texel, ray, tau, slack);
        var there = slabs_leave(slabs, ray, tau, slack);
        let crossed = i == 0u && !there.inside;
        for (var once = 0u; once < select(0u, 1u, crossed); once++) {
            there = crossed_slabs_leave(slabs, ray);
            if !there.inside {
                return no_interface();
            }
        }
        if there.inside {
            inside = there;
            inside_tau = tau;
            inside_texel = there_texel;
        } else {
            outside = there;
            outside_tau = tau;
            outside_texel = there_texel;
        }
        if i == EXIT_STEPS {
            break;
        }
        if inside.tau - inside_tau <= close && inside.tau <= 1.0 {
            return interface_at(ray, inside.tau, inside.plane, inside_texel);
        }
        tau = min(inside.tau, inside_tau + stride);
        if outside_tau < NEVER {
            if outside.tau >= inside_tau && abs(outside_tau - outside.tau) <= close {
                return interface_at(ray, outside.tau, outside.plane, outside_texel);
            }
            if outside_tau - inside_tau <= close {
                return outline_at(ray, inside_tau, inside.plane, inside_texel);
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
        there_texel = screen_ray_texel(ray, tau);
    }
    diagnosed.failures += 1.0;
    return interface_at(ray, inside_tau, inside.plane, inside_texel);
}

// State of a ray relative to a front layer at a sample.
struct Approach {
    behind: bool,
    deep: bool,    // behind, and at no step between texels: is_deep
    tau: f32,      // predicted intersection with the texel's plane, NEVER if there is none
    plane: vec3f,
    texel: vec2i,
}

fn approach(layer_class: i32, ray: ScreenRay, tau: f32) -> Approach {
    let texel = screen_ray_texel(ray, tau);
    diagnosed.iterations += 1.0;
    let interval = class_interval(layer_class, texel, ray, tau);
    let front = interval.front;
    let back = interval.back;
    if plane_is_empty(front) {
        return Approach(false, false, NEVER, front, texel);
    }
    let residual = screen_ray_residual(ray, front, tau);
    let slope = screen_ray_residual_slope(ray, front);
    let root = select(NEVER, tau - residual / slope, slope > 0.0);
    if residual > 0.0 && screen_ray_residual(ray, back, tau) > 0.0 {
        return Approach(false, false, NEVER, front, texel);
    }
    return Approach(residual > 0.0, is_deep(ray, front, back, tau), root, front, texel);
}

// Relative rounding error of disparities against the bounds.
const BOUNDS_ROUNDING: f32 = 1e-5;
// Bound on the tiles that a ray crosses.
const MOST_TILES: u32 = 4096u;

// Part of a pixel by which a point on the border of two tiles is moved into the next one.
const BORDER: f32 = 0.01;

// Where a ray in the air at tau leaves the last of the next tiles in which it meets no liquid of a class: all of it is
// behind the ray's part in the tile, or in front of it. tau if it may meet some in this tile.
fn clear_until(layer_class: i32, ray: ScreenRay, tau: f32) -> f32 {
    let border = BORDER * ray.tau_per_pixel;
    var end = tau;
    for (var i = select(MOST_TILES, 0u, BOUNDS); i < MOST_TILES && end < 1.0; i++) {
        let tile = screen_ray_texel(ray, end + select(border, 0.0, i == 0u)) / i32(TILE);
        let of_both = textureLoad(bounds, tile, 0);
        let of_class = select(of_both.xy, of_both.zw, layer_class == SPLASHES);
        let borders = vec2f(tile + select(vec2i(0), vec2i(1), ray.du > vec2f(0.0))) * f32(TILE);
        let leaves = select(vec2f(NEVER), (borders - ray.u) / ray.du, abs(ray.du) > vec2f(1e-6));
        let next = min(max(min(leaves.x, leaves.y), end + border), 1.0);
        let here = ray.disparity + end * ray.d_disparity;
        let there = ray.disparity + next * ray.d_disparity;
        let in_front = min(here, there) > of_class.x * (1.0 + BOUNDS_ROUNDING);
        let behind = max(here, there) < of_class.y * (1.0 - BOUNDS_ROUNDING);
        if of_class.x > 0.0 && !in_front && !behind {
            break;
        }
        end = next;
    }
    // A surface on the border is ahead.
    return select(max(end - border, tau), 1.0, end >= 1.0);
}

// One loop for strides and bisections: drivers inline the evaluation where it is called, and a group of pixels
// waits for those that bisect.
fn front_entry(layer_class: i32, ray: ScreenRay) -> Interface {
    let close = CLOSE_PIXELS * ray.tau_per_pixel;
    let longest = max(params.reach * camera.size.y, LEAST_REACH) * ray.tau_per_pixel;
    // Starts with short steps: a ray that just left may re-enter within a pixel or two.
    var stride = 0.5 * ray.tau_per_pixel;
    var tau = 0.0;
    var here: Approach;
    // The end of the stride.
    var next = 0.0;
    var there: Approach;
    // The bracket of an entry, while there is one.
    var low = 0.0;
    var bisections = 0u;
    var is_bracketed = false;
    var sample = 0.0;
    var strides = 0u;
    // The crossing, once it is found.
    var entered: Approach;
    var hit_tau = NEVER;
    var on_outline = false;
    for (var i = 0u; i < ENTRY_STEPS * (ENTRY_BISECTIONS + 1u); i++) {
        let found = approach(layer_class, ray, sample);
        var advances = true;
        if is_bracketed {
            bisections += 1u;
            if found.behind {
                next = sample;
                there = found;
            } else if found.tau - sample <= close {
                entered = found;
                hit_tau = found.tau;
                break;
            } else {
                low = sample;
            }
            advances = next - low < 0.5 * close || bisections == ENTRY_BISECTIONS;
        } else {
            there = found;
            // The ray crossed the surface, or passed behind an edge in front of it.
            advances = i == 0u || !there.behind || here.behind;
            is_bracketed = !advances;
            low = tau;
            bisections = 0u;
        }
        if advances {
            if is_bracketed && there.deep {
                entered = there;
                hit_tau = next;
                on_outline = true;
                break;
            }
            is_bracketed = false;
            tau = next;
            here = there;
            if i > 0u {
                stride = min(2.0 * stride, longest);
                strides += 1u;
            }
            if strides >= ENTRY_STEPS || tau >= 1.0 {
                break;
            }
            if !here.behind && here.tau - tau <= close {
                entered = here;
                hit_tau = here.tau;
                break;
            }
            if !here.behind {
                let clear = clear_until(layer_class, ray, tau);
                if clear > tau {
                    tau = clear;
                    here.tau = NEVER;
                }
                if tau >= 1.0 {
                    break;
                }
            }
            next = min(min(tau + stride, 1.0), select(here.tau, NEVER, here.behind || here.tau <= tau));
            sample = next;
        } else {
            if there.tau >= low && next - there.tau <= close {
                entered = there;
                hit_tau = there.tau;
                break;
            }
            let predicted = there.tau > low && there.tau < next && bisections < PREDICTED_BISECTIONS;
            sample = select(0.5 * (low + next), there.tau, predicted);
        }
    }
    if !(hit_tau >= 0.0 && hit_tau <= 1.0) {
        return no_interface();
    }
    return Interface(true, screen_ray_point(ray, hit_tau), entered.plane, entered.texel, on_outline);
}

const OPAQUE_STEPS: u32 = 128u;
// Bisections without a prediction inside the bracket, after which it is taken to hold an edge instead
// of a surface.
const BLIND_BISECTIONS: u32 = 2u;

// The ray starts in front of the opaque scene, so the first prediction may be taken at once; the skipped
// part is checked afterwards in steps of `reach`. A ray that only passes behind an edge on its way keeps
// its hit.
fn opaque_entry(ray: ScreenRay) -> Interface {
    let close = CLOSE_PIXELS * ray.tau_per_pixel;
    let reach = max(params.reach * camera.size.y, LEAST_REACH) * ray.tau_per_pixel;
    var low = 0.0;    // in front of the scene
    var high = NEVER; // behind it
    var blind = 0u;
    var hit_tau = NEVER;
    var hit_plane = vec3f(0.0);
    // First prediction, from the texel behind the start.
    let seed = class_plane(OPAQUE, FRONT, screen_ray_texel(ray, 0.0));
    let seed_rate = dot(seed, ray.d_omega) - ray.d_disparity;
    let seed_root = (ray.disparity - dot(seed, ray.omega)) / seed_rate;
    var tau = select(1.0, min(seed_root, 1.0), seed_rate > 0.0 && seed_root > 0.0);
    diagnosed.iterations += 1.0;
    for (var i = 0u; i < OPAQUE_STEPS; i++) {
        diagnosed.iterations += 1.0;
        let plane = class_plane(OPAQUE, FRONT, screen_ray_texel(ray, tau));
        let rate = dot(plane, ray.d_omega) - ray.d_disparity;
        let at = dot(plane, ray.omega) - ray.disparity;
        let root = select(NEVER, -at / rate, rate > 0.0);
        var next = low + reach;
        if abs(root - tau) <= close && root <= 1.0 {
            hit_tau = root;
            hit_plane = plane;
            high = tau;
            if next >= root {
                break;
            }
        } else {
            let behind = at + tau * rate > 0.0;
            high = select(high, tau, behind);
            low = select(tau, low, behind);
            // Keeps a hit with nothing in front of it.
            next = select(root, low + reach, hit_tau < NEVER && !behind);
            if (hit_tau < NEVER && !behind && next >= hit_tau) || low >= 1.0 || high - low <= close {
                break;
            }
            if high < NEVER && !(next > low && next < high) {
                next = 0.5 * (low + high);
                blind += 1u;
                if blind > BLIND_BISECTIONS {
                    break;
                }
            }
        }
        tau = min(next, 1.0);
    }
    if hit_tau > 1.0 {
        return no_interface();
    }
    return interface_at(ray, hit_tau, hit_plane, screen_ray_texel(ray, hit_tau));
}
