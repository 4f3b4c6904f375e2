// `plane3`: approximates the layer by the plane through three of its depths.
//
// Mayer and Assarsson, constant-time refraction, poster, method 2 ("depth-based"). With the ray's start
// W, the three points are the layer B behind W, the layer at distance |BW| along the ray, and a
// neighbour of B perpendicular to the ray; all from the mip level that matches their spacing.

#import refract/one_layer.wgsl

fn point_at(layer_class: i32, side: i32, u: vec2f, level: i32) -> vec3f {
    diagnosed.iterations += 1.0;
    let omega = camera_omega(u);
    let disparity = dot(class_plane_at(layer_class, side, mip_texel(clamped_texel(u), level), level), omega);
    return select(vec3f(0.0), camera_point(omega, disparity), disparity > 0.0);
}

fn intersect(layer_class: i32, side: i32, ray: ScreenRay) -> Interface {
    let o = screen_ray_point(ray, 0.0);
    let behind = plane_at(layer_class, side, ray.u);
    let disparity = dot(behind, ray.omega);
    if disparity <= 0.0 {
        return no_interface();
    }
    let far = o + distance(o, camera_point(ray.omega, disparity)) * ray.direction;
    if far.z >= -camera.near {
        return no_interface();
    }
    let u_far = clamp(camera_pixel(far), vec2f(0.0), camera.size - 1.0);
    let along = u_far - ray.u;
    let span = max(length(along), 1.0);
    let level = clamp(i32(ceil(log2(span))), 0, mip_last());
    let a = point_at(layer_class, side, ray.u, level);
    let b = point_at(layer_class, side, u_far, level);
    let across = select(vec2f(span, 0.0), vec2f(-along.y, along.x), length(along) >= 1.0);
    let side_of = select(-1.0, 1.0, all(ray.u + across >= vec2f(0.0)) && all(ray.u + across < camera.size));
    let c = point_at(layer_class, side, ray.u + side_of * across, level);
    let n = cross(b - a, c - a);
    let rate = dot(n, a);
    if a.z == 0.0 || b.z == 0.0 || c.z == 0.0 || abs(rate) < 1e-6 * length(n) * length(a) {
        return no_interface();
    }
    let plane = n / rate;
    let tau = -screen_ray_residual(ray, plane, 0.0) / screen_ray_residual_slope(ray, plane);
    if !on_ray(ray, tau) {
        return no_interface();
    }
    let there = plane_at(layer_class, side, ray.u + tau * ray.du);
    if plane_is_empty(there) {
        return no_interface();
    }
    return interface_at(ray, tau, there, screen_ray_texel(ray, tau));
}
