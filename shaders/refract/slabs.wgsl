// Liquid at a texel: the intervals between the fronts and backs of its layers, without their gaps, and
// where a ray leaves their union.
//
// A file that imports this one declares
//     var aggregate_layers: $layers
//     var splash_layers: $layers

#import common/camera.wgsl
#import common/layers.wgsl
#import common/screen_ray.wgsl

override SPLASH: bool = false; // the frame has splash layers
override GAPS: u32 = 0u;       // gaps that the layers of a class have at most

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

// Front and back of one class at a texel: of all its liquid, or of one of its intervals.
struct Slab {
    front: vec3f,
    back: vec3f,
}

// Slabs of both classes, and whether they have gaps.
struct Slabs {
    aggregate: Slab,
    splash: Slab,
    aggregate_has_gap: bool,
    splash_has_gap: bool,
}

fn has_liquid(texel: vec2i) -> bool {
    var covered = !plane_is_empty(textureLoad(aggregate_layers, texel, FRONT$level).xyz);
    if SPLASH {
        covered |= !plane_is_empty(textureLoad(splash_layers, texel, FRONT$level).xyz);
    }
    return covered;
}

// The first front and the last back of each class at a texel.
fn whole_slabs(texel: vec2i) -> Slabs {
    var slabs: Slabs;
    let front = textureLoad(aggregate_layers, texel, FRONT$level);
    let back = textureLoad(aggregate_layers, texel, BACK$level);
    slabs.aggregate = Slab(front.xyz, back.xyz);
    slabs.aggregate_has_gap = GAPS > 0u && is_flagged(front.w);
    slabs.splash_has_gap = GAPS > 0u && SPLASH && is_flagged(back.w);
    diagnosed.iterations += 1.0;
    diagnosed.fetches += 2.0;
    if SPLASH {
        slabs.splash.front = textureLoad(splash_layers, texel, FRONT$level).xyz;
        slabs.splash.back = textureLoad(splash_layers, texel, BACK$level).xyz;
        diagnosed.fetches += 2.0;
    }
    return slabs;
}

// The interval of each class at a texel in which the ray's point at tau lies, or which it has left; `slack` as
// for `slab_leave`.
fn slabs_at(texel: vec2i, ray: ScreenRay, tau: f32, slack: f32) -> Slabs {
    var slabs = whole_slabs(texel);
    let whole = slabs;
    let rounding = slack * (ray.disparity + tau * ray.d_disparity);
    // Loops in place of branches: software adapters skip them where no pixel of a group has gaps.
    for (var gap = select(i32(GAPS), 0, slabs.aggregate_has_gap); gap < i32(GAPS); gap++) {
        let planes = aggregate_gap(texel, gap);
        slabs.aggregate = without_gap(slabs.aggregate, planes, whole.aggregate.back, ray, tau, rounding);
    }
    for (var gap = select(i32(GAPS), 0, slabs.splash_has_gap); gap < i32(GAPS); gap++) {
        let planes = splash_gap(texel, gap);
        slabs.splash = without_gap(slabs.splash, planes, whole.splash.back, ray, tau, rounding);
    }
    return slabs;
}

fn is_open(gap: Slab) -> bool {
    return !plane_is_empty(gap.back) && !plane_is_empty(gap.front);
}

// The slab up to its gap; empty without a gap.
fn before_gap(slab: Slab, gap: Slab) -> Slab {
    return Slab(select(vec3f(0.0), slab.front, is_open(gap)), select(vec3f(0.0), gap.back, is_open(gap)));
}

// The slab from its gap on; all of it without a gap.
fn after_gap(slab: Slab, gap: Slab) -> Slab {
    return Slab(select(slab.front, gap.front, is_open(gap)), slab.back);
}

// A gap of one class at a texel: its sides are the back in front of it and the front behind it.
fn aggregate_gap(texel: vec2i, gap: i32) -> Slab {
    let back = textureLoad(aggregate_layers, texel, gap_back(gap)$level).xyz;
    let front = textureLoad(aggregate_layers, texel, gap_front(gap)$level).xyz;
    diagnosed.fetches += 2.0;
    return Slab(front, back);
}

fn splash_gap(texel: vec2i, gap: i32) -> Slab {
    let back = textureLoad(splash_layers, texel, gap_back(gap)$level).xyz;
    let front = textureLoad(splash_layers, texel, gap_front(gap)$level).xyz;
    diagnosed.fetches += 2.0;
    return Slab(front, back);
}

// A slab without a gap in it, between `gap.back` and `gap.front`: its part on that side of the gap where the ray's
// point at tau is; in the gap, the part that the ray has left. `last` is the slab's back before any gap was taken from
// it, nearest first. Smoothing may move a gap's front in front of its back: then there is no gap.
fn without_gap(slab: Slab, gap: Slab, last: vec3f, ray: ScreenRay, tau: f32, rounding: f32) -> Slab {
    let before = screen_ray_residual(ray, gap.back, tau) <= rounding;
    let after = screen_ray_residual(ray, gap.front, tau) >= -rounding;
    let onwards = screen_ray_residual_slope(ray, gap.back) > 0.0;
    // Gaps behind the one that ends the part do not matter.
    let divides = is_open(gap) && all(slab.back == last);
    let front = select(slab.front, gap.front, divides && !before && (after || !onwards));
    let back = select(slab.back, gap.back, divides && !after && (before || onwards));
    return Slab(front, back);
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
fn slab_leave(slab: Slab, ray: ScreenRay, tau: f32, slack: f32) -> Leave {
    let front = slab.front;
    let back = slab.back;
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

// Whether the start of a ray lies between the front and the back of a slab.
fn starts_inside(slab: Slab, ray: ScreenRay) -> bool {
    let rounding = ROUNDING * ray.disparity;
    return !plane_is_empty(slab.front) && !plane_is_empty(slab.back)
        && screen_ray_residual(ray, slab.front, 0.0) >= -rounding
        && screen_ray_residual(ray, slab.back, 0.0) <= rounding;
}

// `Leave` of the union of both classes: inside if in either, left where the last of them is left.
fn slabs_leave(slabs: Slabs, ray: ScreenRay, tau: f32, slack: f32) -> Leave {
    let aggregate = slab_leave(slabs.aggregate, ray, tau, slack);
    if !SPLASH {
        return aggregate;
    }
    let splash = slab_leave(slabs.splash, ray, tau, slack);
    // The other class may begin before the current one ends.
    if aggregate.inside && !splash.inside && aggregate.tau < NEVER {
        let there = slab_leave(slabs.splash, ray, aggregate.tau, ROUNDING);
        if there.inside {
            return there;
        }
    }
    if splash.inside && !aggregate.inside && splash.tau < NEVER {
        let there = slab_leave(slabs.aggregate, ray, splash.tau, ROUNDING);
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
    if (splash.tau >= NEVER && !splash.inside) || (aggregate.tau >= splash.tau && !silent) {
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
    let aggregate = crossed_leave(slabs.aggregate, ray);
    if !SPLASH || aggregate.inside {
        return aggregate;
    }
    return crossed_leave(slabs.splash, ray);
}

fn crossed_leave(slab: Slab, ray: ScreenRay) -> Leave {
    let front = slab.front;
    let back = slab.back;
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
