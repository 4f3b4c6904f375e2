// `bilateral`: bilateral depth filter (Green, Screen Space Fluid Rendering for Games, 2010), iterated
// as in Imai, Kanamori, Fukui and Mitani (2014); over the full window, not separably.

#import smooth/iterate.wgsl

fn smoothed(p: vec2i, layer: i32, z_i: f32, size: f32) -> f32 {
    let stride = tap_stride(z_i, size);
    let inv_sigma2 = params.inv_sigma2 / (size * size);
    var sum_w = 0.0;
    // Relative to the centre, for precision at large depths.
    var sum_dz = 0.0;
    for (var y = -TAPS; y <= TAPS; y++) {
        for (var x = -TAPS; x <= TAPS; x++) {
            let offset = vec2i(x, y);
            let z = state_at(p + offset * stride, layer, z_i).w;
            let dz = z - z_i;
            let near = exp(-dz * dz * inv_sigma2);
            let w = select(0.0, tap_weight(offset) * near, z > camera.near);
            sum_w += w;
            sum_dz += w * dz;
        }
    }
    return z_i + sum_dz / sum_w;
}
