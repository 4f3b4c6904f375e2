// Liquid at a texel: the intervals between the fronts and backs of its layers, and where a ray leaves
// their union.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/screen_ray.wgsl

override SPLASH: bool = false; // the frame has splash layers

@group(1) @binding(1) var aggregate_layers: texture_2d_array<f32>;
@group(1) @binding(2) var splash_layers: texture_2d_array<f32>;

struct Diagnostics {
    interfaces: f32,       // interfaces crossed
    inside: f32,           // length inside the liquid, m
    iterations: f32,       // layer evaluations
    failures: f32,         // intersector failures
    fetches: f32,          // texels read
    looks: f32,            // terminated rays, with a host
    fallbacks: f32,        // those that the host's picture does not show
}

var<private> diagnosed: Diagnostics;

// Planes of a texel: front and back of both classes.
struct Slabs {
    aggregate_front: vec3f,
    aggregate_back: vec3f,
    splash_front: vec3f,
    splash_back: vec3f,
}

fn load_slabs(texel: vec2i) -> Slabs {
    var slabs: Slabs;
    slabs.aggregate_front = textureLoad(aggregate_layers, texel, FRONT, 0).xyz;
    slabs.aggregate_back = textureLoad(aggregate_layers, texel, BACK, 0).xyz;
    if SPLASH {
        slabs.splash_front = textureLoad(splash_layers, texel, FRONT, 0).xyz;
        slabs.splash_back = textureLoad(splash_layers, texel, BACK, 0).xyz;
    }
    diagnosed.iterations += 1.0;
    diagnosed.fetches += select(2.0, 4.0, SPLASH);
    return slabs;
}

// Relative disparity by which a point outside of its interval still counts as inside: rounding, and at
// the start of a ray the distance between the planes of neighbouring texels.
const ROUNDING: f32 = 1e-6;
const AT_START: f32 = 2e-3;

// State of a ray at a sample relative to the liquid interval of a texel: whether it is inside, and
// where it leaves (from inside) or crossed (from outside) the texel's planes.
struct Leave {
    inside: bool,
    tau: f32,      // NEVER if there is no intersection
    plane: vec3f,
}

// `Leave` of one class.
fn slab_leave(front: vec3f, back: vec3f, ray: ScreenRay, tau: f32, slack: f32) -> Leave {
    if plane_is_empty(front) || plane_is_empty(back) {
        return Leave(false, NEVER, vec3f(0.0));
    }
    let to_front = screen_ray_residual(ray, front, tau);
    let to_back = screen_ray_residual(ray, back, tau);
    let front_slope = screen_ray_residual_slope(ray, front);
    let back_slope = screen_ray_residual_slope(ray, back);
    let rounding = slack * (ray.disparity + tau * ray.d_disparity);
    if to_front < -rounding {
        return Leave(false, tau - to_front / front_slope, front);
    }
    if to_back > rounding {
        return Leave(false, tau - to_back / back_slope, back);
    }
    let front_tau = select(NEVER, tau + max(to_front, 0.0) / -front_slope, front_slope < 0.0);
    let back_tau = select(NEVER, tau + max(-to_back, 0.0) / back_slope, back_slope > 0.0);
    if front_tau < back_tau {
        return Leave(true, front_tau, front);
    }
    return Leave(true, back_tau, back);
}

// `Leave` of the union of both classes: inside if in either, left where the last of them is left.
fn slabs_leave(slabs: Slabs, ray: ScreenRay, tau: f32, slack: f32) -> Leave {
    let aggregate = slab_leave(slabs.aggregate_front, slabs.aggregate_back, ray, tau, slack);
    if !SPLASH {
        return aggregate;
    }
    let splash = slab_leave(slabs.splash_front, slabs.splash_back, ray, tau, slack);
    // The other class may begin before the current one ends.
    if aggregate.inside && !splash.inside && aggregate.tau < NEVER {
        let there = slab_leave(slabs.splash_front, slabs.splash_back, ray, aggregate.tau, ROUNDING);
        if there.inside {
            return there;
        }
    }
    if splash.inside && !aggregate.inside && splash.tau < NEVER {
        let there = slab_leave(slabs.aggregate_front, slabs.aggregate_back, ray, splash.tau, ROUNDING);
        if there.inside {
            return there;
        }
    }
    if aggregate.inside != splash.inside {
        if aggregate.inside {
            return aggregate;
        }
        return splash;
    }
    // Outside of both, ignores a class without an intersection.
    let silent = !aggregate.inside && aggregate.tau >= NEVER;
    if splash.tau >= NEVER && !splash.inside || aggregate.tau >= splash.tau && !silent {
        return aggregate;
    }
    return splash;
}

// As `slabs_leave`, for a ray that starts on a front of these planes.
fn slabs_leave_at_start(slabs: Slabs, ray: ScreenRay) -> Leave {
    let leave = slabs_leave(slabs, ray, 0.0, AT_START);
    if leave.inside {
        return leave;
    }
    return crossed_slabs_leave(slabs, ray);
}

// Smoothing may move a front behind its back, mostly at rims: there is no liquid between them, and a ray
// that starts on such a front leaves at once through the back.
fn crossed_slabs_leave(slabs: Slabs, ray: ScreenRay) -> Leave {
    let aggregate = crossed_leave(slabs.aggregate_front, slabs.aggregate_back, ray);
    if !SPLASH || aggregate.inside {
        return aggregate;
    }
    return crossed_leave(slabs.splash_front, slabs.splash_back, ray);
}

fn crossed_leave(front: vec3f, back: vec3f, ray: ScreenRay) -> Leave {
    let to_front = abs(screen_ray_residual(ray, front, 0.0));
    let to_back = screen_ray_residual(ray, back, 0.0);
    let slack = AT_START * ray.disparity;
    if plane_is_empty(front) || plane_is_empty(back) || to_front > slack || to_back <= slack {
        return Leave(false, NEVER, vec3f(0.0));
    }
    // Moves behind the front by more than rounding, or the ray would re-enter here.
    let slope = screen_ray_residual_slope(ray, front);
    let tau = select(0.0, 4.0 * ROUNDING * ray.disparity / slope, slope > 0.0);
    return Leave(true, min(tau, 1.0), back);
}
