// `plane-fit`: Imai, Kanamori and Mitani, Real-Time Screen-Space Liquid Rendering with Complex
// Refractions (2016), eqs. 1 to 5.

#import smooth/iterate.wgsl

fn smoothed(p: vec2i, layer: i32, z_i: f32) -> f32 {
    let size = vec2i(camera.size);
    let stride = tap_stride(z_i);

    // Weighted sums of eqs. 2 to 4. The mean point is kept relative to the centre, in units of
    // the tap: sums of absolute positions would lose digits at a distance.
    let per_pixel = vec2f(2.0, -2.0) * camera.tangent / camera.size;
    // The view ray per unit of depth.
    let ray = select(camera_omega(vec2f(p) + 0.5), vec3f(0.0, 0.0, -1.0), ORTHOGRAPHIC);
    var sum_w = 0.0;
    var sum_n = vec3f(0.0);
    var sum_p = vec3f(0.0);
    for (var y = -params.taps; y <= params.taps; y++) {
        for (var x = -params.taps; x <= params.taps; x++) {
            let offset = vec2i(x, y) * stride;
            let q = p + offset;
            if any(q < vec2i(0)) || any(q >= size) {
                continue;
            }
            let tap = textureLoad(source, q, layer, 0);
            if tap.w <= camera.near {
                continue;
            }
            let dz = tap.w - z_i;
            let w = exp(-dz * dz * params.inv_sigma2);
            sum_w += w;
            sum_n += w * tap.xyz;
            let spread = select(tap.w, 1.0, ORTHOGRAPHIC);
            sum_p += w * (dz * ray + vec3f(spread * vec2f(offset) * per_pixel, 0.0));
        }
    }
    // Eq. 5 as a step from the old depth: n.(mean - p_i) / n.ray.
    let n_length = length(sum_n);
    let n = sum_n / max(n_length, 1e-20);
    let slope = dot(n, ray) / length(ray);
    let dz = dot(n, sum_p) / (sum_w * dot(n, ray));
    // Keep the depth where the fit says nothing: opposing normals, a plane seen edge-on, a step
    // larger than the weights' own reach, or one past the near plane.
    let keep = n_length < 1e-3 * sum_w || abs(slope) < 0.02 || !(dz * dz * params.inv_sigma2 < 1.0)
        || z_i + dz <= camera.near;
    return select(z_i + dz, z_i, keep);
}
