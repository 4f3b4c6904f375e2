// `bilateral`: the bilateral filter on depth of screen-space fluids (Green, Screen Space Fluid
// Rendering for Games, 2010), iterated as by Imai, Kanamori, Fukui and Mitani (2014); over the
// whole window, not one axis after the other.

#import smooth/iterate.wgsl

fn smoothed(p: vec2i, layer: i32, z_i: f32) -> f32 {
    let size = vec2i(camera.size);
    let stride = tap_stride(z_i);
    var sum_w = 0.0;
    // Relative to the centre: sums of depths would lose digits at a distance.
    var sum_dz = 0.0;
    for (var y = -params.taps; y <= params.taps; y++) {
        for (var x = -params.taps; x <= params.taps; x++) {
            let offset = vec2i(x, y);
            let q = p + offset * stride;
            if any(q < vec2i(0)) || any(q >= size) {
                continue;
            }
            let z = textureLoad(source, q, layer, 0).w;
            if z <= camera.near {
                continue;
            }
            let dz = z - z_i;
            let w = tap_weight(offset) * exp(-dz * dz * params.inv_sigma2);
            sum_w += w;
            sum_dz += w * dz;
        }
    }
    return z_i + sum_dz / sum_w;
}
