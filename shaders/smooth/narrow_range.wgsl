// `narrow-range`: Truong and Yuksel, A Narrow-Range Filter for Screen-Space Fluid Rendering (2018),
// over the full window.
//
// Averages depths within delta of the centre. Taps farther behind, and empty taps, count as mu behind
// the centre, which rounds edges. Nearer taps belong to another surface and have no weight; nor has the
// tap opposite, whose pull would be unbalanced. Surfaces may leave the range gradually: each accepted
// tap widens it for taps farther out. For backs, which the paper does not treat, "behind" is towards
// the eye.

#import smooth/iterate.wgsl

fn smoothed(p: vec2i, layer: i32, z_i: f32, size: f32) -> f32 {
    let stride = tap_stride(z_i, size);
    let delta = params.delta * size;
    let mu = params.mu * size;
    let behind = select(1.0, -1.0, layer == BACK);
    var sum_w = 1.0;
    var sum_dz = 0.0;
    var alone = true;
    var range = vec2f(-delta, delta);
    // Outwards in square rings, so that the range grows symmetrically.
    for (var ring = 1; ring <= TAPS; ring++) {
        var widened = range;
        // Half of the ring's 8 * ring taps, each paired with the opposite one.
        for (var i = 0; i < 4 * ring; i++) {
            let offset = select(vec2i(ring, i - 3 * ring), vec2i(i - ring, -ring), i < 2 * ring);
            let a = tap(p + offset * stride, layer, z_i, behind, range, mu);
            let b = tap(p - offset * stride, layer, z_i, behind, range, mu);
            let w = select(0.0, tap_weight(offset), a.counts && b.counts);
            sum_w += 2.0 * w;
            sum_dz += w * (a.dz + b.dz);
            if a.in_range {
                widened = widen(widened, a.dz, delta);
            }
            if b.in_range {
                widened = widen(widened, b.dz, delta);
            }
            alone = alone && !a.in_range && !b.in_range;
        }
        range = widened;
    }
    let z = z_i + behind * sum_dz / sum_w;
    // Keeps isolated pixels, and depths that would pass the near plane.
    return select(z, z_i, alone || z <= camera.near);
}

struct Tap {
    dz: f32,        // depth behind the centre, m
    counts: bool,   // not on a nearer surface
    in_range: bool, // on the centre's surface
}

fn tap(q: vec2i, layer: i32, z_i: f32, behind: f32, range: vec2f, mu: f32) -> Tap {
    if any(q < vec2i(0)) || any(q >= vec2i(camera.size)) {
        return Tap(0.0, false, false);
    }
    let z = state_at(q, layer, z_i).w;
    if z <= 0.0 {
        return Tap(mu, true, false);
    }
    let dz = behind * (z - z_i);
    if z <= camera.near || dz < range.x {
        return Tap(0.0, false, false);
    }
    if dz > range.y {
        return Tap(mu, true, false);
    }
    return Tap(dz, true, true);
}

fn widen(range: vec2f, dz: f32, delta: f32) -> vec2f {
    return vec2f(min(range.x, dz - delta), max(range.y, dz + delta));
}
