// `plane`: approximates the layer by its tangent plane behind the ray's start.
//
// Mayer and Assarsson, constant-time refraction, poster, method 1 ("normal-based").

#import refract/one_layer.wgsl

fn intersect(layer_class: i32, side: i32, ray: ScreenRay) -> Interface {
    let plane = nearest_plane(layer_class, side, clamped_texel(ray.u), ray, 0.0);
    let tau = -screen_ray_residual(ray, plane, 0.0) / screen_ray_residual_slope(ray, plane);
    if plane_is_empty(plane) || !on_ray(ray, tau) {
        return no_interface();
    }
    let there = nearest_plane(layer_class, side, clamped_texel(ray.u + tau * ray.du), ray, tau);
    if plane_is_empty(there) {
        return no_interface();
    }
    return interface_at(ray, tau, there, screen_ray_texel(ray, tau));
}
