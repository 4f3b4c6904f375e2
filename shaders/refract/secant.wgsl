// `secant`: a fixed number of secant steps on layer disparity minus ray disparity.
//
// Imai, Kanamori and Mitani (2016), section 4.4, and Imai et al. (2014). They do not state the second
// point, here as far along the ray as the layer lies behind its start, and the success criterion, here
// a last step of at most one pixel.

#import refract/one_layer.wgsl

fn intersect(layer_class: i32, side: i32, ray: ScreenRay) -> Interface {
    let behind = nearest_plane(layer_class, side, clamped_texel(ray.u), ray, 0.0);
    let disparity = dot(behind, ray.omega);
    if disparity <= 0.0 {
        return no_interface();
    }
    let o = screen_ray_point(ray, 0.0);
    let far = o + distance(o, ray.omega / disparity) * ray.direction;
    var tau0 = 0.0;
    var residual0 = screen_ray_residual(ray, behind, 0.0);
    // Parameter tau of the point at that distance, from its disparity.
    var tau = select(1.0, (1.0 / -far.z - ray.disparity) / ray.d_disparity, far.z < -camera.near);
    if abs(ray.d_disparity) < 1e-6 * ray.disparity {
        tau = distance(camera_pixel(far), ray.u) * ray.tau_per_pixel;
    }
    tau = clamp(tau, min(ray.tau_per_pixel, 1.0), 1.0);
    for (var i = 0u; i < ITERATIONS; i++) {
        let plane = nearest_plane(layer_class, side, clamped_texel(ray.u + tau * ray.du), ray, tau);
        if plane_is_empty(plane) {
            return no_interface();
        }
        let residual = screen_ray_residual(ray, plane, tau);
        let next = tau - residual * (tau - tau0) / (residual - residual0);
        if residual == 0.0 || residual == residual0 {
            if abs(residual) <= 1e-6 * ray.disparity {
                return interface_at(ray, tau, plane, screen_ray_texel(ray, tau));
            }
            return no_interface();
        }
        if !on_ray(ray, next) {
            return no_interface();
        }
        let pixels = abs(next - tau) / ray.tau_per_pixel;
        if i + 1u == ITERATIONS {
            if pixels > 1.0 {
                return no_interface();
            }
            return interface_at(ray, next, plane, screen_ray_texel(ray, next));
        }
        tau0 = tau;
        residual0 = residual;
        tau = next;
    }
    return no_interface();
}
