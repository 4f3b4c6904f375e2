// Light as it is added up: integers, and by what a pixel of the view carries.

// Of a texel's undisturbed light.
const UNIT: f32 = 1048576.0;

// Light that a pixel's worth of the view carries, as a share of that in its middle.
fn view_power(omega: vec3f) -> f32 {
    return select(pow(dot(omega, omega), -1.5), 1.0, ORTHOGRAPHIC);
}
