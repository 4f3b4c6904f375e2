// The density whose iso-surface is the liquid's: `src/liquid/classify/iso_surface.rs` has the same constants and functions.

// Radius of its kernel, in r.
const FIELD: f32 = 4.0;

// The cubic spline kernel, 1 at 0 and 0 from 1 on.
fn spline(q: f32) -> f32 {
    let outer = max(1.0 - q, 0.0);
    let inner = max(0.5 - q, 0.0);
    return 2.0 * outer * outer * outer - 8.0 * inner * inner * inner;
}

// Its derivative.
fn slope(q: f32) -> f32 {
    let outer = max(1.0 - q, 0.0);
    let inner = max(0.5 - q, 0.0);
    return 24.0 * inner * inner - 6.0 * outer * outer;
}

// Volume of a particle relative to another one's. Bounded, so that products stay finite.
fn relative_volume(radius: f32, relative_to: f32) -> f32 {
    let ratio = clamp(radius / relative_to, 1e-9, 1e9);
    return ratio * ratio * ratio;
}
