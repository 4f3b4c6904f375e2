// Where rays meet the opaque fluids among others, which the picture shows between two planes at each texel: opaque.wgsl.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/scene.wgsl
#import common/screen_ray.wgsl
#import refract/bindings.wgsl
#import refract/host.wgsl

// Samples of a ray, at most, and pixels between them, at least.
const SAMPLED: u32 = 64u;
const SAMPLED_PIXELS: f32 = 1.0;
const REFINEMENTS: u32 = 3u;

// The nearer of a solid's hit and the hit on the opaque fluids.
fn opaque_fluid_ahead(o: vec3f, d: vec3f, solid: SolidHit) -> SolidHit {
    let ray = screen_ray(o, d, solid.t);
    let step = clamp(SAMPLED_PIXELS * ray.tau_per_pixel, 1.0 / f32(SAMPLED), 1.0);
    var before = 0.0;
    var tau = 0.0;
    var plane = vec3f(0.0);
    for (var i = 0u; i <= SAMPLED; i++) {
        tau = min(f32(i) * step, 1.0);
        let texel = screen_ray_texel(ray, tau);
        let front = textureLoad(gbuffer_planes, texel, 0).xyz;
        let back = textureLoad(gbuffer_surfaces, texel, 0).xyz;
        let is_behind = !plane_is_empty(front) && screen_ray_residual(ray, front, tau) > 0.0;
        // Between the planes, or through both within a texel.
        let crosses = all(screen_ray_texel(ray, before) == texel) && screen_ray_residual(ray, front, before) <= 0.0;
        if is_behind && (crosses || screen_ray_residual(ray, back, tau) < 0.0) {
            plane = front;
            break;
        }
        if tau >= 1.0 {
            return solid;
        }
        before = tau;
    }
    if plane_is_empty(plane) {
        return solid;
    }
    // Newton's method between both samples, on the planes of its texels.
    for (var i = 0u; i < REFINEMENTS; i++) {
        let next = tau - screen_ray_residual(ray, plane, tau) / screen_ray_residual_slope(ray, plane);
        let at = clamp(next, before, tau);
        let found = textureLoad(gbuffer_planes, screen_ray_texel(ray, at), 0).xyz;
        if plane_is_empty(found) {
            break;
        }
        tau = select(tau, at, at == at);
        plane = found;
    }
    let x = screen_ray_point(ray, tau);
    return SolidHit(distance(o, x), HOST_SCENE, NO_TRIANGLE, camera_world_direction(plane_normal(plane)));
}
