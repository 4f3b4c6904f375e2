// `opaque`: a body that no light enters. The first interface is all that is drawn; shade/body.wgsl has its radiance.

#import refract/bindings.wgsl
#import refract/pixels.wgsl

fn opaque_entry(ray: ScreenRay) -> Interface {
    return no_interface();
}

fn trace(u: vec2f, texel: vec2i) -> vec4f {
    let omega = camera_omega(u);
    let disparity = dot(front_at(texel), omega);
    let solid = first_solid(omega, texel);
    let shows_body = disparity > 0.0 && solid.t > camera_distance(omega, disparity);
    diagnosed.interfaces += select(0.0, 1.0, shows_body);
    if shows_body {
        return vec4f(textureLoad(body_radiance, texel, 0).rgb, 1.0);
    }
    if TRANSPARENT && (HOST || solid.t >= NOTHING) {
        return vec4f(0.0);
    }
    let o = camera_ray_origin(omega);
    let d = camera_ray_direction(omega);
    return vec4f(look(Look(o, d, solid, vec3f(1.0), false, vec3f(1.0), 0.0, Spread(), NO_SPHERES)), 1.0);
}
