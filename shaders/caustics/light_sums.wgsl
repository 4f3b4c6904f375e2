// Fixed-point accumulation of light, relative to the light of an undisturbed pixel.

// Integer value of a texel's undisturbed light.
const UNIT: f32 = 1048576.0;

// Light per pixel of the view, relative to that at its centre.
fn view_power(omega: vec3f) -> f32 {
    return select(pow(dot(omega, omega), -1.5), 1.0, ORTHOGRAPHIC);
}
