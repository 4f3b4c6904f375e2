// Ray tracing through the layers: refraction at several interfaces, internal reflection, absorption and
// wetting.
//
// After Imai, Kanamori and Mitani (2016), section 4, with these differences: the liquid at a pixel is
// the union of the intervals of its layers; strong internal reflections are followed; liquid wets the
// solids that it touches; radiance is scaled by the squared index of refraction.
//
// A root imports this file and defines the intersector:
//     fn liquid_exit(ray: ScreenRay, texel: vec2i) -> Interface
//         Exit of a ray inside the liquid, which starts between the planes of `texel`.
//     fn front_entry(layer_class: i32, ray: ScreenRay) -> Interface
//         Entry of a ray through the fronts of a class of layers, or its hit on the opaque scene.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/optics.wgsl
#import common/samples.wgsl
#import common/scene.wgsl
#import common/screen_ray.wgsl
#import common/tiles.wgsl
#import refract/host.wgsl

struct Params {
    absorption: vec3f,     // 1/m; for several fluids the largest component, in all three channels
    ior: f32,              // of the liquid, relative to the surrounding medium
    contact: f32,          // largest distance of a wetted solid, m
    interfaces: u32,       // largest number of interfaces per ray
    internal_bounces: u32, // largest number of internal reflections per ray
    reach: f32,            // longest unchecked step of `guarded`, as a share of the height
    ambient_shares: vec2f, // shares of ambient light that enter level liquid by two paths
    ambient_paths: vec2f,  // lengths of these paths per metre of depth
    eye_depth: f32,        // depth of the eye below the liquid's surface, m; 0 outside
}

override SPLASH: bool = false;            // the frame has splash layers
override ABSORPTION: bool = true;         // any absorption component is above 0
override MIXTURE: bool = false;           // there are fluids of different absorption
override SCHLICK: bool = false;           // Schlick's approximation instead of Fresnel's equations
override RADIANCE_SCALING: bool = true;   // scale radiance by the squared index
override CONTACT: bool = true;            // there are solids, and contact > 0
override SCREEN_SOLIDS: bool = false;     // look up solids in the G-buffer first
override REFLECT_SOLIDS: bool = true;     // reflections see the solids
override HOST: bool = false;              // another program has drawn the opaque scene: refract/host.wgsl
override BACKGROUND: bool = false;        // the scene has a background picture: refract/host.wgsl
override TRANSPARENT: bool = false;       // no coverage where a ray meets neither liquid nor solid
override COUNT: bool = false;             // write the diagnostics
override SAMPLES: u32 = 1u;               // rays per pixel
override EDGE_SAMPLES: u32 = 16u;         // rays per edge pixel without liquid
override ITERATIONS: u32 = 4u;            // of `newton` and `secant`

@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var aggregate_layers: texture_2d_array<f32>;
@group(1) @binding(2) var splash_layers: texture_2d_array<f32>;
@group(1) @binding(3) var gbuffer_planes: texture_2d<f32>;
@group(1) @binding(4) var mixture: texture_2d<f32>; // absorption times length, length: mixture.wgsl
@group(1) @binding(5) var gbuffer_surfaces: texture_2d<f32>; // world normal, solid index
@group(1) @binding(6) var radiance: texture_storage_2d<rgba32float, write>;
// Interfaces, length inside (m), solver iterations and solver failures: means over the samples.
@group(1) @binding(7) var diagnostics: texture_storage_2d<rgba32float, write>;
// Tiles of the entry point: those with liquid, or the others.
@group(1) @binding(8) var<storage, read> tiles: TileList;

// Pixels without liquid that contain an edge. The other entry points defer them to `edge_pixels`, so
// that their many rays do not diverge from pixels with a single ray.
struct Edges {
    count: atomic<u32>,
    looks: atomic<u32>,     // of the first ray of each pixel, with a host: terminated rays,
    fallbacks: atomic<u32>, // and those that the host's picture does not show
    pixels: array<u32>, // x + 65536 y
}

@group(3) @binding(0) var<storage, read_write> edges: Edges;
// Indirect dispatch size of `edge_pixels` in x: groups of EDGE_GROUP pixels.
@group(3) @binding(1) var<storage, read_write> edge_groups: atomic<u32>;

const EDGE_GROUP: u32 = 64u;

// Capacity: that of the list, and of the largest dispatch that every adapter supports. Further edge
// pixels are drawn where they are found.
fn most_edges() -> u32 {
    return min(65535u * EDGE_GROUP, arrayLength(&edges.pixels));
}

// Reflectance above which an internal reflection is followed and the transmitted ray is only looked up.
const STRONG: f32 = 0.3;

// Whether limpid lights the solid.
fn is_lit(solid: SolidHit) -> bool {
    if HOST && solid.index == HOST_SCENE {
        return false;
    }
    return solids[solid.index].lit == 1u;
}

// Transmittance of the liquid from `o` to `x`.
fn transmittance_between(o: vec3f, x: vec3f) -> vec3f {
    return optics_transmittance(absorption_between(o, x), distance(o, x));
}

// Absorption between two points. Several fluids are approximated by the mean of the mixtures at the
// pixels of the end points.
fn absorption_between(o: vec3f, x: vec3f) -> vec3f {
    var absorption = params.absorption;
    if MIXTURE {
        absorption *= 0.5 * (mixture_at(o) + mixture_at(x));
    }
    return absorption;
}

// Transmittance for ambient light at x, `depth` below the liquid's surface.
fn ambient_at(x: vec3f, depth: f32) -> vec3f {
    let up = camera_view_direction(vec3f(0.0, 1.0, 0.0));
    let absorption = absorption_between(x, x + depth * up);
    return params.ambient_shares.x * optics_transmittance(absorption, params.ambient_paths.x * depth)
        + params.ambient_shares.y * optics_transmittance(absorption, params.ambient_paths.y * depth);
}

fn mixture_at(x: vec3f) -> vec3f {
    let last = vec2i(camera.size) - 1;
    let pixel = select(0.5 * camera.size, camera_pixel(x), ORTHOGRAPHIC || -x.z >= camera.near);
    let sums = textureLoad(mixture, clamp(vec2i(floor(pixel)), vec2i(0), last), 0);
    return sums.rgb / max(sums.a, 1e-3);
}

// Intersection of a ray with a boundary of the liquid or the opaque scene.
struct Interface {
    found: bool,
    position: vec3f,  // view space; undefined with an empty plane
    plane: vec3f,     // pi of the surface
    texel: vec2i,     // that the plane was read from
}

struct Diagnostics {
    interfaces: f32,       // interfaces crossed
    inside: f32,           // length inside the liquid, m
    iterations: f32,       // layer evaluations
    failures: f32,         // intersector failures
    fetches: f32,          // texels read
    looks: f32,            // terminated rays, with a host
    fallbacks: f32,        // those that the host's picture does not show
}

var<private> diagnosed: Diagnostics;

fn no_interface() -> Interface {
    return Interface(false, vec3f(0.0), vec3f(0.0), vec2i(0));
}

fn interface_at(ray: ScreenRay, tau: f32, plane: vec3f, texel: vec2i) -> Interface {
    return Interface(true, screen_ray_point(ray, tau), plane, texel);
}

// Result for a ray that leaves the picture while inside: not found, but extrapolated on the last plane.
fn beyond_picture(ray: ScreenRay, leave: Leave, texel: vec2i) -> Interface {
    if ray.disparity + leave.tau * ray.d_disparity <= 0.0 || leave.tau >= NEVER {
        return no_interface();
    }
    return Interface(false, screen_ray_point(ray, leave.tau), leave.plane, texel);
}

// Planes of a texel: front and back of both classes.
struct Slabs {
    aggregate_front: vec3f,
    aggregate_back: vec3f,
    splash_front: vec3f,
    splash_back: vec3f,
}

fn load_slabs(texel: vec2i) -> Slabs {
    var slabs: Slabs;
    slabs.aggregate_front = textureLoad(aggregate_layers, texel, FRONT, 0).xyz;
    slabs.aggregate_back = textureLoad(aggregate_layers, texel, BACK, 0).xyz;
    if SPLASH {
        slabs.splash_front = textureLoad(splash_layers, texel, FRONT, 0).xyz;
        slabs.splash_back = textureLoad(splash_layers, texel, BACK, 0).xyz;
    }
    diagnosed.iterations += 1.0;
    diagnosed.fetches += select(2.0, 4.0, SPLASH);
    return slabs;
}

// Relative disparity by which a point outside of its interval still counts as inside: rounding, and at
// the start of a ray the distance between the planes of neighbouring texels.
const ROUNDING: f32 = 1e-6;
const AT_START: f32 = 2e-3;

// State of a ray at a sample relative to the liquid interval of a texel: whether it is inside, and
// where it leaves (from inside) or crossed (from outside) the texel's planes.
struct Leave {
    inside: bool,
    tau: f32,      // NEVER if there is no intersection
    plane: vec3f,
}

// `Leave` of one class.

fn slab_leave(front: vec3f, back: vec3f, ray: ScreenRay, tau: f32, slack: f32) -> Leave {
    if plane_is_empty(front) || plane_is_empty(back) {
        return Leave(false, NEVER, vec3f(0.0));
    }
    let to_front = screen_ray_residual(ray, front, tau);
    let to_back = screen_ray_residual(ray, back, tau);
    let front_slope = screen_ray_residual_slope(ray, front);
    let back_slope = screen_ray_residual_slope(ray, back);
    let rounding = slack * (ray.disparity + tau * ray.d_disparity);
    if to_front < -rounding {
        return Leave(false, tau - to_front / front_slope, front);
    }
    if to_back > rounding {
        return Leave(false, tau - to_back / back_slope, back);
    }
    let front_tau = select(NEVER, tau + max(to_front, 0.0) / -front_slope, front_slope < 0.0);
    let back_tau = select(NEVER, tau + max(-to_back, 0.0) / back_slope, back_slope > 0.0);
    if front_tau < back_tau {
        return Leave(true, front_tau, front);
    }
    return Leave(true, back_tau, back);
}

// `Leave` of the union of both classes: inside if in either, left where the last of them is left.
fn slabs_leave(slabs: Slabs, ray: ScreenRay, tau: f32, slack: f32) -> Leave {
    let aggregate = slab_leave(slabs.aggregate_front, slabs.aggregate_back, ray, tau, slack);
    if !SPLASH {
        return aggregate;
    }
    let splash = slab_leave(slabs.splash_front, slabs.splash_back, ray, tau, slack);
    // The other class may begin before the current one ends.
    if aggregate.inside && !splash.inside && aggregate.tau < NEVER {
        let there = slab_leave(slabs.splash_front, slabs.splash_back, ray, aggregate.tau, ROUNDING);
        if there.inside {
            return there;
        }
    }
    if splash.inside && !aggregate.inside && splash.tau < NEVER {
        let there = slab_leave(slabs.aggregate_front, slabs.aggregate_back, ray, splash.tau, ROUNDING);
        if there.inside {
            return there;
        }
    }
    if aggregate.inside != splash.inside {
        if aggregate.inside {
            return aggregate;
        }
        return splash;
    }
    // Outside of both, ignores a class without an intersection.
    let silent = !aggregate.inside && aggregate.tau >= NEVER;
    if splash.tau >= NEVER && !splash.inside || aggregate.tau >= splash.tau && !silent {
        return aggregate;
    }
    return splash;
}

// As `slabs_leave`, for a ray that starts on a front of these planes.
fn slabs_leave_at_start(slabs: Slabs, ray: ScreenRay) -> Leave {
    let leave = slabs_leave(slabs, ray, 0.0, AT_START);
    if leave.inside {
        return leave;
    }
    return crossed_slabs_leave(slabs, ray);
}

// Smoothing may move a front behind its back, mostly at rims: there is no liquid between them, and a ray
// that starts on such a front leaves at once through the back.
fn crossed_slabs_leave(slabs: Slabs, ray: ScreenRay) -> Leave {
    let aggregate = crossed_leave(slabs.aggregate_front, slabs.aggregate_back, ray);
    if !SPLASH || aggregate.inside {
        return aggregate;
    }
    return crossed_leave(slabs.splash_front, slabs.splash_back, ray);
}

fn crossed_leave(front: vec3f, back: vec3f, ray: ScreenRay) -> Leave {
    let to_front = abs(screen_ray_residual(ray, front, 0.0));
    let to_back = screen_ray_residual(ray, back, 0.0);
    let slack = AT_START * ray.disparity;
    if plane_is_empty(front) || plane_is_empty(back) || to_front > slack || to_back <= slack {
        return Leave(false, NEVER, vec3f(0.0));
    }
    // Moves behind the front by more than rounding, or the ray would re-enter here.
    let slope = screen_ray_residual_slope(ray, front);
    let tau = select(0.0, 4.0 * ROUNDING * ray.disparity / slope, slope > 0.0);
    return Leave(true, min(tau, 1.0), back);
}

const AGGREGATE: i32 = 0;
const SPLASHES: i32 = 1;
const OPAQUE: i32 = 2;

// Plane of a class of layers at a mip level; the opaque scene has no backs.
fn class_plane_at(layer_class: i32, side: i32, texel: vec2i, level: i32) -> vec3f {
    if layer_class == OPAQUE && side == BACK {
        return vec3f(0.0);
    }
    diagnosed.fetches += 1.0;
    switch layer_class {
        case AGGREGATE: {
            return textureLoad(aggregate_layers, texel, side, level).xyz;
        }
        case SPLASHES: {
            return textureLoad(splash_layers, texel, side, level).xyz;
        }
        default: {
            return textureLoad(gbuffer_planes, texel, level).xyz;
        }
    }
}

fn class_plane(layer_class: i32, side: i32, texel: vec2i) -> vec3f {
    return class_plane_at(layer_class, side, texel, 0);
}

// Entry of a ray from outside into the liquid.
fn liquid_entry(ray: ScreenRay) -> Interface {
    let aggregate = front_entry(AGGREGATE, ray);
    if !SPLASH {
        return aggregate;
    }
    let splash = front_entry(SPLASHES, ray);
    let o = screen_ray_point(ray, 0.0);
    let nearer = distance(o, splash.position) < distance(o, aggregate.position);
    if splash.found && (!aggregate.found || nearer) {
        return splash;
    }
    return aggregate;
}

fn reflectance(cos_theta_i: f32, cos_theta_t: f32, eta: f32) -> f32 {
    if SCHLICK {
        return optics_schlick(cos_theta_i, cos_theta_t, eta);
    }
    return optics_fresnel(cos_theta_i, cos_theta_t, eta);
}

// Solid that the ray hits; t is NOTHING if none.
fn solid_ahead(o: vec3f, d: vec3f) -> SolidHit {
    let hit = scene_trace(camera_world_point(o), camera_world_direction(d));
    if HOST {
        return host_ahead(o, d, hit);
    }
    return hit;
}

// Solid that the ray through `omega` in a texel's pixel hits.
fn first_solid(omega: vec3f, texel: vec2i) -> SolidHit {
    if HOST {
        return host_hit(omega, texel);
    }
    return solid_ahead(camera_ray_origin(omega), camera_ray_direction(omega));
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
}

fn look(ray: Look) -> vec3f {
    if HOST {
        diagnosed.looks += 1.0;
        let shown = host_look(ray.o, ray.d, ray.solid);
        if shown.w > 0.0 {
            return ray.weight * shown.rgb;
        }
        diagnosed.fallbacks += 1.0;
    }
    if SCREEN_SOLIDS && ray.screen {
        let hit = front_entry(OPAQUE, screen_ray(ray.o, ray.d, NOTHING));
        if hit.found {
            return ray.weight * texel_radiance(hit.texel, ray.ambient, ray.travelled);
        }
    }
    return ray.weight * radiance_of(ray.solid, ray.o, ray.d, ray.ambient, ray.travelled);
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
    if has_shape(MESH) {
        // The G-buffer does not know triangles, nor in which order the solids are uploaded.
        let o = camera_world_point(camera_ray_origin(omega));
        let hit = scene_trace(o, d);
        return solid_radiance(hit.index, hit.triangle, o + hit.t * d, hit.normal, d, ambient, ray_width(travelled));
    }
    let x = camera_world_point(camera_point(omega, dot(plane, omega)));
    return solid_radiance(u32(surface.w), NO_TRIANGLE, x, surface.xyz, d, ambient, ray_width(travelled));
}

// Radiance of the solid that the ray hits, or of the environment.
fn radiance_of(solid: SolidHit, o: vec3f, d: vec3f, ambient: vec3f, travelled: f32) -> vec3f {
    let world_d = camera_world_direction(d);
    if BACKGROUND && solid.t >= NOTHING && is_ahead(o, d) {
        return background_radiance(o, d, travelled);
    }
    if solid.t >= NOTHING {
        return environment_radiance(world_d);
    }
    let x = camera_world_point(o) + solid.t * world_d;
    let width = ray_width(travelled + solid.t);
    return solid_radiance(solid.index, solid.triangle, x, solid.normal, world_d, ambient, width);
}

fn in_picture(x: vec3f) -> bool {
    let u = camera_pixel(x);
    return -x.z >= camera.near && all(u >= vec2f(0.0)) && all(u < camera.size);
}

// Whether the picture shows liquid in front of x.
fn covered(x: vec3f) -> bool {
    if !in_picture(x) {
        return false;
    }
    let u = camera_pixel(x);
    let texel = vec2i(u);
    var front = textureLoad(aggregate_layers, texel, FRONT, 0).xyz;
    if plane_is_empty(front) && SPLASH {
        front = textureLoad(splash_layers, texel, FRONT, 0).xyz;
    }
    return dot(front, camera_omega(u)) > camera_disparity(x);
}

// Whether the solid ahead, which the ray hits at `at`, is within `contact` of x, so that the liquid wets it.
fn touches(solid: SolidHit, at: vec3f, x: vec3f) -> bool {
    if !CONTACT || solid.t >= NOTHING {
        return false;
    }
    if HOST && solid.index == HOST_SCENE {
        return abs(dot(solid.normal, camera_world_direction(x - at))) <= params.contact;
    }
    if has_shape(MESH) && solid.triangle != NO_TRIANGLE {
        return mesh_is_near(solid.index, camera_world_point(x), params.contact);
    }
    return abs(solid_distance(solids[solid.index], camera_world_point(x))) <= params.contact;
}

// Traces the ray through pixel position `u` and returns its radiance and coverage.
//
// Each loop iteration handles one event, for rays on either side of the liquid: intersects the next
// interface, looks up one of the reflected and refracted rays, and follows the other. The expensive
// parts thus appear only once and divergent rays share them. A ray that ends on a wet, lit solid takes
// another iteration straight up to the surface, for the attenuation of ambient light.
fn trace(u: vec2f, texel: vec2i) -> vec4f {
    let omega = camera_omega(u);
    var o = camera_ray_origin(omega);
    var d = camera_ray_direction(omega);
    let slabs = load_slabs(texel);
    let aggregate = dot(slabs.aggregate_front, omega);
    let splash = dot(slabs.splash_front, omega);
    var front = slabs.aggregate_front;
    if SPLASH && splash > aggregate {
        front = slabs.splash_front;
    }
    let disparity = max(aggregate, splash);
    var solid = first_solid(omega, texel);
    let t_front = camera_distance(omega, disparity);

    var result = vec3f(0.0);
    var weight = vec3f(1.0);
    var interfaces = 0u;
    var bounces = 0u;
    var start = texel;
    let scale = select(1.0, params.ior * params.ior, RADIANCE_SCALING);

    // First interface, unless a solid is in front of it or the eye is in the liquid.
    var hit = Interface(disparity > 0.0 && solid.t > t_front, camera_point(omega, disparity), front, texel);
    if TRANSPARENT && !hit.found && (HOST || solid.t >= NOTHING) {
        return vec4f(0.0);
    }
    var inside = hit.found && disparity >= camera_near_disparity();
    var eye = true;
    var travelled = 0.0;
    if inside {
        o = select(omega * camera.near, camera_point(omega, camera_near_disparity()), ORTHOGRAPHIC);
    }

    // The terminated ray, kept until its depth below the surface is known.
    var seen: Look;
    // Whether this iteration traces upwards for the ambient light.
    var rises = false;
    let up = camera_view_direction(vec3f(0.0, 1.0, 0.0));
    // Height of the last interface: a lower bound on the surface where the picture does not show it or
    // the upward ray runs along a wall.
    var height = params.eye_depth;

    // At most 8 interfaces, 8 bounces, the final event and the upward ray.
    for (var event = 0u; event < 18u; event++) {
        // The path ends without more liquid, on a solid, or at the picture's border.
        var ends = rises || !inside && !hit.found;
        var end_scale = 1.0;
        var screen = !eye;
        var wet = false;
        var to_hit = 0.0;
        if inside {
            solid = solid_ahead(o, d);
            if !rises && interfaces >= params.interfaces {
                ends = true;
                end_scale = scale;
            } else {
                hit = liquid_exit(screen_ray(o, d, select(solid.t, NOTHING, rises)), start);
                if !hit.found && !rises {
                    diagnosed.failures += 1.0;
                    hit.found = !plane_is_empty(hit.plane);
                }
                to_hit = distance(hit.position, o);
                // Whether the liquid reaches the solid.
                wet = !rises && solid.t < NOTHING
                    && (!hit.found || solid.t <= to_hit || touches(solid, o + solid.t * d, hit.position));
            }
            if rises {
                let depth = max(height - dot(o, up), 0.0);
                seen.ambient = ambient_at(o, max(depth, select(0.0, to_hit, hit.found)));
            } else if !ends {
                ends = wet || !hit.found;
                // Left the picture while inside, without a plane to extrapolate: the environment.
                end_scale = select(scale, 1.0, wet);
                solid.t = select(solid.t, NOTHING, ends && !wet);
                screen = false;
                if wet || hit.found {
                    diagnosed.inside += select(to_hit, solid.t, wet);
                    if ABSORPTION {
                        weight *= transmittance_between(o, select(hit.position, o + solid.t * d, wet));
                    }
                }
            }
        }
        eye = false;
        if !rises {
            seen = Look(o, d, solid, end_scale * weight, screen, vec3f(1.0), travelled);
        }
        if !ends {
            travelled += distance(o, hit.position);
            o = hit.position;
            start = hit.texel;
            var n = plane_normal(hit.plane);
            if dot(n, d) > 0.0 {
                n = -n;
            }
            let eta = select(params.ior, 1.0 / params.ior, inside);
            let cos_theta_i = -dot(d, n);
            let cos_theta_t = optics_cos_transmitted(cos_theta_i, eta);
            let f = reflectance(cos_theta_i, cos_theta_t, eta);
            let reflected = reflect(d, n);
            var transmitted = d;
            if f < 1.0 {
                transmitted = optics_refract(d, n, cos_theta_i, cos_theta_t, eta);
            }
            let through = (1.0 - f) * select(1.0 / scale, scale, inside);
            // Inside, a strong reflection is followed, and the transmitted ray is looked up.
            let bounce = inside && f > STRONG && bounces < params.internal_bounces;
            bounces += select(0u, 1u, bounce);
            interfaces += select(1u, 0u, bounce);
            diagnosed.interfaces += select(1.0, 0.0, bounce);
            // Lookups from inside are scaled as if the ray had left the liquid.
            let out = select(1.0, scale, inside);
            seen.o = o;
            seen.travelled = travelled;
            seen.d = select(reflected, transmitted, bounce);
            seen.weight = weight * select(f * out, through, bounce);
            seen.screen = inside && (bounce || REFLECT_SOLIDS);
            seen.solid.t = NOTHING;
            if bounce || REFLECT_SOLIDS {
                seen.solid = solid_ahead(o, seen.d);
            }
            // External reflections are not followed. A solid that liquid covers in this view is shaded as
            // seen through the liquid; otherwise crests would mirror a dry floor.
            height = dot(o, up);
            if REFLECT_SOLIDS && seen.solid.t < NOTHING && (!inside || ANY_LIT) {
                let x = o + seen.solid.t * seen.d;
                let below = !inside && covered(x);
                seen.weight /= select(1.0, scale, below);
                if ANY_LIT && (below || inside && !bounce) {
                    seen.ambient = ambient_at(x, max(height - dot(x, up), 0.0));
                }
            }
            weight *= select(through, f, bounce);
            d = select(transmitted, reflected, bounce);
            // Ends on total reflection beyond the bounce limit.
            ends = !bounce && f >= 1.0;
            if !bounce && inside {
                // Leaves the liquid and may enter it again.
                inside = false;
                solid = solid_ahead(o, d);
                hit = no_interface();
                if interfaces < params.interfaces && !ends {
                    hit = liquid_entry(screen_ray(o, d, solid.t));
                }
            } else {
                inside = true;
            }
        }
        if ANY_LIT && wet {
            // Starts within the layers' liquid: the solid may be slightly beyond it.
            o += min(solid.t, select(NOTHING, to_hit, hit.found)) * d;
            rises = ABSORPTION && is_lit(solid) && in_picture(o);
            if rises {
                d = up;
                start = vec2i(camera_pixel(o));
                continue;
            }
            seen.ambient = ambient_at(o, max(height - dot(o, up), 0.0));
        }
        if any(seen.weight > vec3f(0.0)) {
            result += look(seen);
        }
        if ends {
            return vec4f(result, 1.0);
        }
    }
    return vec4f(result, 1.0);
}

// Relative difference of radiance that distinguishes an edge from shading, and from filtered patterns.
const EDGE: f32 = 0.02;
const FILTERED_EDGE: f32 = 0.1;

fn background_ray(u: vec2f) -> vec4f {
    let omega = camera_omega(u);
    let o = camera_ray_origin(omega);
    let d = camera_ray_direction(omega);
    let solid = solid_ahead(o, d);
    let seen = radiance_of(solid, o, d, vec3f(1.0), 0.0);
    return select(vec4f(seen, 1.0), vec4f(0.0), TRANSPARENT && solid.t >= NOTHING);
}

fn background_mean(p: vec2i, count: u32) -> vec4f {
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        sum += background_ray(vec2f(p) + sample_offset(i, count));
    }
    return sum / f32(count);
}

// Draws a pixel without liquid. If its corners and centre differ, it contains an edge (T. Whitted, An
// Improved Illumination Model for Shaded Display, 1980) and gets many rays, which is affordable: they
// are short, and few pixels contain edges.
//
// One loop for all rays: drivers inline the shading where it is called, and compile it as often.
fn draw_background(p: vec2i) {
    if COUNT {
        textureStore(diagnostics, p, vec4f(0.0));
    }
    if HOST {
        let drawn = vec4f(textureLoad(host_color, p, 0).rgb, 1.0);
        textureStore(radiance, p, select(drawn, vec4f(0.0), TRANSPARENT));
        return;
    }
    if EDGE_SAMPLES <= SAMPLES {
        textureStore(radiance, p, background_mean(p, SAMPLES));
        return;
    }
    var low = vec4f(NOTHING);
    var high = vec4f(0.0);
    var sum = vec4f(0.0);
    for (var probe = 0u; probe < 5u + EDGE_SAMPLES; probe++) {
        var at = vec2f(vec2u(probe & 1u, probe >> 1u));
        if probe >= 5u {
            at = sample_offset(probe - 5u, EDGE_SAMPLES);
        }
        let seen = background_ray(vec2f(p) + select(at, vec2f(0.5), probe == 4u));
        if probe < 5u {
            low = min(low, seen);
            high = max(high, seen);
        } else {
            sum += seen;
        }
        if probe == 4u && (is_flat(p, seen, low, high) || is_deferred(p)) {
            return;
        }
    }
    textureStore(radiance, p, sum / f32(EDGE_SAMPLES));
}

// Draws a pixel whose probes hardly differ in the colour of its centre.
fn is_flat(p: vec2i, centre: vec4f, low: vec4f, high: vec4f) -> bool {
    let flat = all(high - low <= select(EDGE, FILTERED_EDGE, FILTER_PATTERNS) * high);
    if flat {
        textureStore(radiance, p, centre);
    }
    return flat;
}

// Adds a pixel to the list of `edge_pixels`, unless the list is full.
fn is_deferred(p: vec2i) -> bool {
    let index = atomicAdd(&edges.count, 1u);
    if index >= most_edges() {
        return false;
    }
    edges.pixels[index] = u32(p.x) | (u32(p.y) << 16u);
    if index % EDGE_GROUP == 0u {
        atomicAdd(&edge_groups, 1u);
    }
    return true;
}

@compute @workgroup_size(64)
fn edge_pixels(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= min(atomicLoad(&edges.count), most_edges()) {
        return;
    }
    let packed = edges.pixels[id.x];
    let p = vec2i(vec2u(packed & 0xffffu, packed >> 16u));
    textureStore(radiance, p, background_mean(p, EDGE_SAMPLES));
}

fn has_liquid(texel: vec2i) -> bool {
    var covered = !plane_is_empty(textureLoad(aggregate_layers, texel, FRONT, 0).xyz);
    if SPLASH {
        covered |= !plane_is_empty(textureLoad(splash_layers, texel, FRONT, 0).xyz);
    }
    return covered;
}

// Whether solids hide the liquid over the whole pixel, tested at its centre and corners. The front's
// plane may be steep at a rim, so a solid in front of its depth at the centre suffices.
fn is_hidden(p: vec2i) -> bool {
    if SOLIDS == 0u && !HOST {
        return false;
    }
    let middle = camera_omega(vec2f(p) + 0.5);
    var front = textureLoad(aggregate_layers, p, FRONT, 0).xyz;
    if SPLASH {
        let splash = textureLoad(splash_layers, p, FRONT, 0).xyz;
        front = select(front, splash, dot(splash, middle) > dot(front, middle));
    }
    let disparity = dot(front, middle);
    for (var probe = 0; probe < 5; probe++) {
        let corner = vec2f(vec2i(probe & 1, (probe >> 1u) & 1));
        let omega = camera_omega(vec2f(p) + select(corner, vec2f(0.5), probe == 0));
        let solid = first_solid(omega, p);
        if camera_disparity_at(omega, solid.t) < min(disparity, dot(front, omega)) {
            return false;
        }
    }
    return true;
}

@compute @workgroup_size(8, 8)
fn refract_pixels(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = group_index(group);
    if index >= tiles.count {
        return;
    }
    let p = tile_pixel(tiles.tiles[index], local.xy);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    // A solid in front of the liquid is drawn like one without liquid.
    if !has_liquid(p) || is_hidden(p) {
        draw_background(p);
        return;
    }
    diagnosed = Diagnostics();
    let share = 1.0 / f32(SAMPLES);
    var color = vec4f(0.0);
    for (var i = 0u; i < SAMPLES; i++) {
        color += share * trace(vec2f(p) + sample_offset(i, SAMPLES), p);
        if HOST && i == 0u {
            atomicAdd(&edges.looks, u32(diagnosed.looks));
            atomicAdd(&edges.fallbacks, u32(diagnosed.fallbacks));
        }
    }
    textureStore(radiance, p, vec4f(color.rgb, select(1.0, color.a, TRANSPARENT)));
    if COUNT {
        let d = diagnosed;
        textureStore(diagnostics, p, vec4f(d.interfaces, d.inside, d.iterations, d.failures) * share);
    }
}

@compute @workgroup_size(8, 8)
fn background_pixels(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = group_index(group);
    if index >= tiles.count {
        return;
    }
    let p = tile_pixel(tiles.tiles[index], local.xy);
    if EDGE_SAMPLES <= SAMPLES || HOST {
        if all(p < vec2i(camera.size)) {
            draw_background(p);
        }
        return;
    }
    // Adjacent pixels share corners: each thread shades one, 17 threads another on the far sides, and each
    // the centre of its pixel. One loop, as in `draw_background`.
    let thread = i32(local.y) * 8 + i32(local.x);
    let first = p - vec2i(local.xy);
    let far = select(vec2i(8, thread), vec2i(thread - 9, 8), thread >= 9);
    var centre = vec4f(0.0);
    for (var k = 0; k < 3; k++) {
        if k == 1 && thread >= 17 {
            continue;
        }
        let corner = vec2f(select(p, first + far, k == 1));
        centre = background_ray(corner + select(0.0, 0.5, k == 2));
        if k < 2 {
            tile_corners[select(thread + i32(local.y), far.y * 9 + far.x, k == 1)] = centre;
        }
    }
    workgroupBarrier();
    if any(p >= vec2i(camera.size)) {
        return;
    }
    if COUNT {
        textureStore(diagnostics, p, vec4f(0.0));
    }
    let at = i32(local.y) * 9 + i32(local.x);
    var low = centre;
    var high = centre;
    for (var k = 0; k < 4; k++) {
        let corner = tile_corners[at + (k & 1) + 9 * (k >> 1u)];
        low = min(low, corner);
        high = max(high, corner);
    }
    if !is_flat(p, centre, low, high) && !is_deferred(p) {
        textureStore(radiance, p, background_mean(p, EDGE_SAMPLES));
    }
}

// Radiance of the background at the corners of a tile's pixels, by rows.
var<workgroup> tile_corners: array<vec4f, 81>;
