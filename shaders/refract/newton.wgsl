// `newton`: a fixed number of tangent-plane iterations, tested once at the end.
//
// Mayer, Assarsson and Sintorn, refractions and caustics by Newton's method (2026). As there, the first
// plane is the one behind the ray's start, and a ray fails if its last sample is more than one pixel
// from it. With FILTER, planes are read from the mip level that matches half the last step, as in the
// paper's text; the last two are read unfiltered, so that the fixed point is that of the layer itself.

#import refract/one_layer.wgsl

override FILTER: bool = false;

fn intersect(layer_class: i32, side: i32, ray: ScreenRay) -> Interface {
    var tau = 0.0;
    var level = 0;
    // One evaluation more than iterations, for the final test.
    for (var i = 0u; i <= ITERATIONS; i++) {
        let texel = screen_ray_texel(ray, tau);
        var plane: vec3f;
        if FILTER && i + 2u <= ITERATIONS {
            diagnosed.iterations += 1.0;
            plane = class_plane_at(layer_class, side, mip_texel(texel, level), level);
        } else {
            plane = nearest_plane(layer_class, side, texel, ray, tau);
        }
        let slope = screen_ray_residual_slope(ray, plane);
        let next = tau - screen_ray_residual(ray, plane, tau) / slope;
        if plane_is_empty(plane) || !on_ray(ray, next) {
            return no_interface();
        }
        let pixels = abs(next - tau) / ray.tau_per_pixel;
        if i == ITERATIONS {
            if pixels > 1.0 {
                return no_interface();
            }
            return interface_at(ray, next, plane, texel);
        }
        level = clamp(i32(log2(max(0.5 * pixels, 1.0))), 0, mip_last());
        tau = next;
    }
    return no_interface();
}
