// `plane-fit`: plane fit of Imai, Kanamori and Mitani, Real-Time Screen-Space Liquid Rendering with
// Complex Refractions (2016), eqs. 1 to 5.

#import smooth/iterate.wgsl

fn smoothed(p: vec2i, layer: i32, z_i: f32, size: f32) -> f32 {
    let stride = tap_stride(z_i, size);
    let inv_sigma2 = params.inv_sigma2 / (size * size);

    // Weighted sums of eqs. 2 to 4. The mean point is relative to the centre, in units of the tap
    // spacing, for precision at large depths.
    let per_tap = f32(stride) * vec2f(2.0, -2.0) * camera.tangent / camera.size;
    // The view ray per unit of depth.
    let ray = select(camera_omega(vec2f(p) + 0.5), vec3f(0.0, 0.0, -1.0), ORTHOGRAPHIC);
    var sum_w = 0.0;
    var sum_n = vec3f(0.0);
    var sum_dz = 0.0;
    var sum_xy = vec2f(0.0);
    // Branchless: over tens of lanes, both sides of a branch would run anyway.
    for (var y = -TAPS; y <= TAPS; y++) {
        for (var x = -TAPS; x <= TAPS; x++) {
            let tap = state_at(p + vec2i(x, y) * stride, layer, z_i);
            let dz = tap.w - z_i;
            let w = select(0.0, exp(-dz * dz * inv_sigma2), tap.w > camera.near);
            sum_w += w;
            sum_n += w * tap.xyz;
            sum_dz += w * dz;
            sum_xy += w * select(tap.w, 1.0, ORTHOGRAPHIC) * vec2f(vec2i(x, y));
        }
    }
    let sum_p = sum_dz * ray + vec3f(sum_xy * per_tap, 0.0);
    // Eq. 5 as a step from the old depth: n.(mean - p_i) / n.ray.
    let n_length = length(sum_n);
    let n = sum_n / max(n_length, 1e-20);
    let slope = dot(n, ray) / length(ray);
    let dz = dot(n, sum_p) / (sum_w * dot(n, ray));
    // Keeps the depth where the fit is unreliable: opposing normals, a plane seen edge-on, a step beyond
    // the range of the weights, or one past the near plane.
    let keep = n_length < 1e-3 * sum_w || abs(slope) < 0.02 || !(dz * dz * inv_sigma2 < 1.0)
        || z_i + dz <= camera.near;
    return select(z_i + dz, z_i, keep);
}
