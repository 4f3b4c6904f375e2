// Radiance at the ends of rays: of solids, the environment, a host's picture or the background.
//
// A root defines
//     fn opaque_entry(ray: ScreenRay) -> Interface
//         Hit of a ray on the opaque scene.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/scene.wgsl
#import common/screen_ray.wgsl
#import refract/bindings.wgsl
#import refract/diffuse.wgsl
#import refract/host.wgsl
#import refract/opaque_fluids.wgsl
#import refract/slabs.wgsl

override SCREEN_SOLIDS: bool = false;     // look up solids in the G-buffer first
override HOST: bool = false;              // another program has drawn the opaque scene: refract/host.wgsl
override OPAQUE_FLUIDS: bool = false;     // some of the fluids are opaque: opaque.wgsl
override BACKGROUND: bool = false;        // the scene has a background picture: refract/host.wgsl
override TRANSPARENT: bool = false;       // no coverage where a ray meets neither liquid nor solid
override SAMPLES: u32 = 1u;               // rays per pixel

// Intersection of a ray with a boundary of the liquid or the opaque scene.
struct Interface {
    found: bool,
    position: vec3f,  // view space; undefined with an empty plane
    plane: vec3f,     // pi of the surface
    texel: vec2i,     // that the plane was read from
    on_outline: bool, // crosses a surface that no plane shows, at the outline of liquid in the picture
}

fn no_interface() -> Interface {
    return Interface(false, vec3f(0.0), vec3f(0.0), vec2i(0), false);
}

fn interface_at(ray: ScreenRay, tau: f32, plane: vec3f, texel: vec2i) -> Interface {
    return Interface(true, screen_ray_point(ray, tau), plane, texel, false);
}

// Solid that the ray hits; t is NOTHING if none.
fn solid_ahead(o: vec3f, d: vec3f) -> SolidHit {
    let hit = scene_trace(camera_world_point(o), camera_world_direction(d));
    if HOST {
        return host_ahead(o, d, hit);
    }
    if OPAQUE_FLUIDS {
        return opaque_fluid_ahead(o, d, hit);
    }
    return hit;
}

// Solid that the ray through `omega` in a texel's pixel hits.
fn first_solid(omega: vec3f, texel: vec2i) -> SolidHit {
    if HOST {
        return host_hit(omega, texel);
    }
    let o = camera_ray_origin(omega);
    let d = camera_ray_direction(omega);
    if OPAQUE_FLUIDS {
        let solid = scene_trace(camera_world_point(o), camera_world_direction(d));
        let shown = host_hit(omega, texel);
        if shown.t < solid.t {
            return shown;
        }
        return solid;
    }
    return solid_ahead(o, d);
}

// A terminated ray, whose radiance is looked up and weighted by `weight`.
struct Look {
    o: vec3f,
    d: vec3f,
    solid: SolidHit,
    weight: vec3f,
    screen: bool,    // whether solids may be looked up in the G-buffer first
    ambient: vec3f,  // share of ambient light that reaches the solid
    travelled: f32,  // length of the path from the eye to o
    spread: Spread,  // of d, in world axes
    medium: u32,     // of refract/diffuse.wgsl
}

fn look(ray: Look) -> vec3f {
    if !DIFFUSE {
        return look_beyond(ray);
    }
    let spheres = spheres_along(ray.o, ray.d, ray.solid.t, ray.medium);
    return ray.weight * spheres.rgb + spheres.w * look_beyond(ray);
}

// As `look`, without spheres.
fn look_beyond(ray: Look) -> vec3f {
    if HOST {
        diagnosed.looks += 1.0;
        let shown = host_look(ray.o, ray.d, ray.solid);
        if shown.w > 0.0 {
            return ray.weight * shown.rgb;
        }
        diagnosed.fallbacks += 1.0;
    }
    if SCREEN_SOLIDS && ray.screen {
        let hit = opaque_entry(screen_ray(ray.o, ray.d, NOTHING));
        if hit.found {
            return ray.weight * texel_radiance(hit.texel, ray.ambient, ray.travelled);
        }
    }
    return ray.weight * radiance_of(ray.solid, ray.o, ray.d, ray.ambient, ray.travelled, ray.spread);
}

// Width of a ray after a path of this length: that of a pixel, shared among its rays, which flat
// interfaces hardly change.
fn ray_width(travelled: f32) -> f32 {
    let spread = select(travelled, 1.0, ORTHOGRAPHIC);
    return spread * 2.0 * camera.tangent.y / (camera.size.y * sqrt(f32(SAMPLES)));
}

// Radiance of the solid at the centre of a G-buffer texel.
fn texel_radiance(texel: vec2i, ambient: vec3f, travelled: f32) -> vec3f {
    let omega = camera_omega(vec2f(texel) + 0.5);
    let plane = textureLoad(gbuffer_planes, texel, 0).xyz;
    let surface = textureLoad(gbuffer_surfaces, texel, 0);
    let d = camera_world_direction(camera_ray_direction(omega));
    if MESHES > 0u {
        // The G-buffer does not know triangles, nor in which order the solids are uploaded.
        let o = camera_world_point(camera_ray_origin(omega));
        let hit = scene_trace(o, d);
        return solid_radiance(hit.index, hit.triangle, o + hit.t * d, hit.normal, d, ambient, ray_width(travelled));
    }
    let x = camera_world_point(camera_point(omega, dot(plane, omega)));
    return solid_radiance(u32(surface.w), NO_TRIANGLE, x, surface.xyz, d, ambient, ray_width(travelled));
}

// Radiance of the solid that the ray hits, or of the environment.
fn radiance_of(solid: SolidHit, o: vec3f, d: vec3f, ambient: vec3f, travelled: f32, spread: Spread) -> vec3f {
    let world_d = camera_world_direction(d);
    if BACKGROUND && solid.t >= NOTHING && is_ahead(o, d) {
        return background_radiance(o, d, travelled);
    }
    if solid.t >= NOTHING {
        return environment_over(world_d, spread);
    }
    if OPAQUE_FLUIDS && solid.index == HOST_SCENE {
        let x = o + solid.t * d;
        // Light that comes out through the film around it, for rays that have not entered it.
        let outside = (params.ambient_shares.x + params.ambient_shares.y) / (params.ior * params.ior);
        let share = select(ambient, vec3f(outside), ambient == vec3f(1.0));
        return share * host_radiance(camera_pixel(x), camera_disparity(x), false);
    }
    let x = camera_world_point(o) + solid.t * world_d;
    let width = ray_width(travelled + solid.t);
    return solid_radiance(solid.index, solid.triangle, x, solid.normal, world_d, ambient, width);
}

// Plane of the nearest liquid at a texel; empty if there is none.
fn front_at(texel: vec2i) -> vec3f {
    let at = clamp(texel, vec2i(0), vec2i(camera.size) - 1);
    var front = textureLoad(aggregate_layers, at, FRONT$level).xyz;
    if SPLASH {
        let omega = camera_omega(vec2f(at) + 0.5);
        let splash = textureLoad(splash_layers, at, FRONT$level).xyz;
        front = select(front, splash, dot(splash, omega) > dot(front, omega));
    }
    return front;
}

// More than normals change, of a side without liquid.
const UNKNOWN: f32 = 1e9;

// Change of the normal from texel to texel along an axis: on the side where it changes less, for on the other there may
// be another surface.
fn normal_change(texel: vec2i, axis: vec2i, n: vec3f) -> vec3f {
    let before = front_at(texel - axis);
    let after = front_at(texel + axis);
    let to_before = select(n - plane_normal(before), vec3f(UNKNOWN), plane_is_empty(before));
    let to_after = select(plane_normal(after) - n, vec3f(UNKNOWN), plane_is_empty(after));
    let change = select(to_after, to_before, dot(to_before, to_before) < dot(to_after, to_after));
    return select(change, vec3f(0.0), change.x >= UNKNOWN);
}

// Spread of the rays of direction d that the liquid reflects within a pixel.
fn reflected_spread(texel: vec2i, front: vec3f, d: vec3f) -> Spread {
    let n = plane_normal(front);
    let share = inverseSqrt(f32(SAMPLES));
    let x = share * normal_change(texel, vec2i(1, 0), n);
    let y = share * normal_change(texel, vec2i(0, 1), n);
    return Spread(
        camera_world_direction(reflected_change(d, n, x)),
        camera_world_direction(reflected_change(d, n, y)),
    );
}

// Change of reflect(d, n) with that of n.
fn reflected_change(d: vec3f, n: vec3f, change: vec3f) -> vec3f {
    return -2.0 * (dot(d, change) * n + dot(d, n) * change);
}

fn in_picture(x: vec3f) -> bool {
    let u = camera_pixel(x);
    return -x.z >= camera.near && all(u >= vec2f(0.0)) && all(u < camera.size);
}
