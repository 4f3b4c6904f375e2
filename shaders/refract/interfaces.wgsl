// Ray tracing through the layers: refraction at several interfaces, internal reflection, absorption and
// wetting.
//
// After Imai, Kanamori and Mitani (2016), section 4, with these differences: the liquid at a pixel is
// the union of the intervals of its layers; strong internal reflections are followed; liquid wets the
// solids that it touches; radiance is scaled by the squared index of refraction.
//
// A root imports refract/pixels.wgsl and defines the intersector:
//     fn liquid_exit(ray: ScreenRay, texel: vec2i) -> Interface
//         Exit of a ray inside the liquid, which starts between the planes of `texel`.
//     fn front_entry(layer_class: i32, ray: ScreenRay) -> Interface
//         Entry of a ray through the fronts of a class of layers.
// and what refract/looks.wgsl needs.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/optics.wgsl
#import common/screen_ray.wgsl
#import refract/bindings.wgsl
#import refract/diffuse.wgsl
#import refract/looks.wgsl
#import refract/slabs.wgsl
#import refract/turbid.wgsl
#import refract/turbid_lights.wgsl

override ABSORPTION: bool = true;         // any absorption component is above 0
override MIXTURE: bool = false;           // there are fluids of different absorption
override TURBID: bool = false;            // the liquid scatters light: refract/turbid.wgsl
override SCHLICK: bool = false;           // Schlick's approximation instead of Fresnel's equations
override RADIANCE_SCALING: bool = true;   // scale radiance by the squared index
override CONTACT: bool = true;            // there are solids, and contact > 0
override REFLECT_SOLIDS: bool = true;     // reflections see the solids
override ITERATIONS: u32 = 4u;            // of `newton` and `secant`

// Reflectance above which an internal reflection is followed and the transmitted ray is only looked up.
const STRONG: f32 = 0.3;

// Whether limpid lights the solid.
fn is_lit(solid: SolidHit) -> bool {
    if (HOST || OPAQUE_FLUIDS) && solid.index == HOST_SCENE {
        return OPAQUE_FLUIDS;
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
    let ambient = params.ambient_shares.x * optics_transmittance(absorption, params.ambient_paths.x * depth)
        + params.ambient_shares.y * optics_transmittance(absorption, params.ambient_paths.y * depth);
    if TURBID {
        return ambient * scattering_lets_through(scattering_between(x, x + depth * up), depth);
    }
    return ambient;
}

fn mixture_at(x: vec3f) -> vec3f {
    let last = vec2i(camera.size) - 1;
    let pixel = select(0.5 * camera.size, camera_pixel(x), ORTHOGRAPHIC || -x.z >= camera.near);
    let sums = textureLoad(mixture, clamp(vec2i(floor(pixel)), vec2i(0), last), 0);
    return sums.rgb / max(sums.a, 1e-3);
}

// Crossing of the outline of liquid in the picture, whose surface there holds the lines of sight.
fn outline_at(ray: ScreenRay, tau: f32, plane: vec3f, texel: vec2i) -> Interface {
    return Interface(true, screen_ray_point(ray, tau), plane, texel, true);
}

// Whether the ray's point at tau, between front and back, is more than two pixels' way from both. Smaller steps lie
// between the planes of neighbouring texels, and are no outline.
fn is_deep(ray: ScreenRay, front: vec3f, back: vec3f, tau: f32) -> bool {
    let way = 2.0 * ray.tau_per_pixel;
    return screen_ray_residual(ray, front, tau) > abs(screen_ray_residual_slope(ray, front)) * way
        && -screen_ray_residual(ray, back, tau) > abs(screen_ray_residual_slope(ray, back)) * way;
}

// Texels around a crossing of an outline, on two circles, and their radii in pixels.
const OUTLINE_TEXELS: u32 = 8u;
const OUTLINE_RADII: vec2f = vec2f(2.0, 3.5);

// Normal of an interface on the side of a ray of direction `d`. That of an outline is perpendicular to the line of sight
// and to the edge between texels around it that have liquid at its depth and those that have none.
fn interface_normal(hit: Interface, d: vec3f) -> vec3f {
    var n = plane_normal(hit.plane);
    let u = camera_pixel(hit.position);
    var at: ScreenRay;
    at.disparity = camera_disparity(hit.position);
    var outwards = vec2f(0.0);
    // A loop in place of a branch, as in `slabs_at`.
    for (var i = 0u; i < select(0u, OUTLINE_TEXELS, hit.on_outline); i++) {
        let angle = 6.2831853 * f32(i) / f32(OUTLINE_TEXELS);
        let direction = vec2f(cos(angle), sin(angle));
        let texel = vec2i(floor(u + OUTLINE_RADII[i & 1u] * direction));
        at.omega = camera_omega(vec2f(texel) + 0.5);
        let slabs = slabs_at(clamp(texel, vec2i(0), vec2i(camera.size) - 1), at, 0.0, ROUNDING);
        let inside = starts_inside(slabs.aggregate, at) || (SPLASH && starts_inside(slabs.splash, at));
        outwards += select(direction, -direction, inside);
    }
    // All around or nowhere: no outline is seen.
    if length(outwards) >= 1.0 {
        let omega = camera_omega(u);
        let across = (camera_omega(u + outwards) - omega).xy;
        n = normalize(vec3f(across, select(dot(across, omega.xy), 0.0, ORTHOGRAPHIC)));
    }
    return select(n, -n, dot(n, d) > 0.0);
}

// Result for a ray that leaves the picture while inside: not found, but extrapolated on the last plane.
fn beyond_picture(ray: ScreenRay, leave: Leave, texel: vec2i) -> Interface {
    if ray.disparity + leave.tau * ray.d_disparity <= 0.0 || leave.tau >= NEVER {
        return no_interface();
    }
    return Interface(false, screen_ray_point(ray, leave.tau), leave.plane, texel, false);
}

const AGGREGATE: i32 = 0;
const SPLASHES: i32 = 1;
const OPAQUE: i32 = 2;

// Plane of a class of layers at a mip level; the opaque scene has no backs.
fn class_plane_at(layer_class: i32, side: i32, texel: vec2i, level: i32) -> vec3f {
    return class_texel(layer_class, side, texel, level).xyz;
}

// The same with its depth, which may bear a flag.
fn class_texel(layer_class: i32, side: i32, texel: vec2i, level: i32) -> vec4f {
    if layer_class == OPAQUE && side == BACK {
        return vec4f(0.0);
    }
    diagnosed.fetches += 1.0;
    switch layer_class {
        case AGGREGATE: {
            return textureLoad(aggregate_layers, texel, side$at_level);
        }
        case SPLASHES: {
            return textureLoad(splash_layers, texel, side$at_level);
        }
        default: {
            return textureLoad(gbuffer_planes, texel, level);
        }
    }
}

fn class_plane(layer_class: i32, side: i32, texel: vec2i) -> vec3f {
    return class_plane_at(layer_class, side, texel, 0);
}

// Front and back of a class at a texel: of the first interval whose back lies ahead of the ray's point at tau,
// or of the last if none does.
fn class_interval(layer_class: i32, texel: vec2i, ray: ScreenRay, tau: f32) -> Slab {
    let first = class_texel(layer_class, FRONT, texel, 0);
    var interval = Slab(first.xyz, class_plane(layer_class, BACK, texel));
    if GAPS == 0u || layer_class == OPAQUE {
        return interval;
    }
    // Loops in place of branches, as in `slabs_at`.
    var has_gap = layer_class == AGGREGATE && is_flagged(first.w);
    let of_splashes = layer_class == SPLASHES && !plane_is_empty(first.xyz);
    for (var once = 0; once < select(0, 1, of_splashes); once++) {
        has_gap = is_flagged(class_texel(AGGREGATE, BACK, texel, 0).w);
    }
    var ended = false;
    for (var gap = select(i32(GAPS), 0, has_gap); gap < i32(GAPS); gap++) {
        let back = class_plane(layer_class, gap_back(gap), texel);
        let front = class_plane(layer_class, gap_front(gap), texel);
        let divides = !ended && !plane_is_empty(back) && !plane_is_empty(front);
        // A ray that has just left through a back lies on it.
        let disparity = ray.disparity + tau * ray.d_disparity;
        let ahead = screen_ray_residual(ray, back, tau) <= -4.0 * ROUNDING * disparity;
        interval.back = select(interval.back, back, divides && ahead);
        interval.front = select(interval.front, front, divides && !ahead);
        ended = ended || (divides && ahead);
    }
    return interval;
}

// Entry of a ray from outside into the liquid.
fn liquid_entry(ray: ScreenRay) -> Interface {
    let o = screen_ray_point(ray, 0.0);
    var nearest = no_interface();
    // One search in the source: drivers inline it where it is called, and compile it as often.
    for (var i = 0; i < select(1, 2, SPLASH); i++) {
        let hit = front_entry(select(AGGREGATE, SPLASHES, i == 1), ray);
        if hit.found && (!nearest.found || distance(o, hit.position) < distance(o, nearest.position)) {
            nearest = hit;
        }
    }
    return nearest;
}

fn reflectance(cos_theta_i: f32, cos_theta_t: f32, eta: f32) -> f32 {
    if SCHLICK {
        return optics_schlick(cos_theta_i, cos_theta_t, eta);
    }
    return optics_fresnel(cos_theta_i, cos_theta_t, eta);
}

// Whether the picture shows liquid in front of x.
fn covered(x: vec3f) -> bool {
    if !in_picture(x) {
        return false;
    }
    let u = camera_pixel(x);
    let texel = vec2i(u);
    var front = textureLoad(aggregate_layers, texel, FRONT$level).xyz;
    if plane_is_empty(front) && SPLASH {
        front = textureLoad(splash_layers, texel, FRONT$level).xyz;
    }
    return dot(front, camera_omega(u)) > camera_disparity(x);
}

// A ray through the turbid liquid that covers a solid at x, from o above it.
fn covering(o: vec3f, x: vec3f) -> Passage {
    let light = light_around(vec2i(camera_pixel(x)));
    let length = distance(o, x);
    return interval_of(absorption_between(o, x), scattering_between(o, x), length, MEAN_COSINE, light, true, 1.0);
}

// Whether the solid ahead, which the ray hits at `at`, is within `contact` of x, so that the liquid wets it.
fn touches(solid: SolidHit, at: vec3f, x: vec3f) -> bool {
    if !CONTACT || solid.t >= NOTHING {
        return false;
    }
    if (HOST || OPAQUE_FLUIDS) && solid.index == HOST_SCENE {
        return abs(dot(solid.normal, camera_world_direction(x - at))) <= params.contact;
    }
    if MESHES > 0u && solid.triangle != NO_TRIANGLE {
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
    let slabs = whole_slabs(texel);
    let aggregate = dot(slabs.aggregate.front, omega);
    let splash = dot(slabs.splash.front, omega);
    var front = slabs.aggregate.front;
    if SPLASH && splash > aggregate {
        front = slabs.splash.front;
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
    var hit = Interface(disparity > 0.0 && solid.t > t_front, camera_point(omega, disparity), front, texel, false);
    if TRANSPARENT && !hit.found && (HOST || solid.t >= NOTHING) {
        return vec4f(0.0);
    }
    var inside = hit.found && disparity >= camera_near_disparity();
    var eye = true;
    var travelled = 0.0;
    // Of the light that the first interface reflects.
    var spread: Spread;
    if ENVIRONMENT == ENVIRONMENT_SKY && hit.found && !inside {
        spread = reflected_spread(texel, front, d);
    }
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
    // Of a turbid liquid: the light around the interval, the last interval, and the ray's cosine at its start.
    var light: Around;
    var interval = Passage(vec3f(1.0), vec3f(0.0), vec3f(0.0));
    var cosine = 1.0;
    var entry_normal = -d;
    // Whether the ray has not left the first liquid that it meets.
    var is_first = true;
    if TURBID && inside {
        light = light_around(texel);
    }

    // At most 8 interfaces, 8 bounces, the final event and the upward ray.
    for (var event = 0u; event < 18u; event++) {
        if !eye || inside {
            solid = solid_ahead(o, d);
        }
        if !eye && !inside {
            // Left the liquid, and may enter it again.
            hit = no_interface();
            if interfaces < params.interfaces {
                hit = liquid_entry(screen_ray(o, d, solid.t));
            }
        }
        // The path ends without more liquid, on a solid, or at the picture's border.
        var ends = rises || (!inside && !hit.found);
        var end_scale = 1.0;
        var screen = !eye;
        var wet = false;
        var to_hit = 0.0;
        // Spheres on the way to the next interface or the end in liquid; pixels have their own of the eye's ray.
        var medium = select(NO_SPHERES, IN_AIR, !eye && !inside && hit.found);
        var way = distance(o, hit.position);
        let first_liquid = inside && is_first;
        let weight_before = weight;
        if inside {
            if !rises && interfaces >= params.interfaces {
                ends = true;
                end_scale = scale;
            } else {
                hit = liquid_exit(screen_ray(o, d, select(solid.t, NOTHING, rises)), start);
                let missed = !hit.found && !rises;
                if missed {
                    hit.found = !plane_is_empty(hit.plane);
                }
                to_hit = distance(hit.position, o);
                // Whether the liquid reaches the solid.
                wet = !rises && solid.t < NOTHING
                    && (!hit.found || solid.t <= to_hit || touches(solid, o + solid.t * d, hit.position));
                // A ray that ends on a solid in the liquid has no exit to find.
                diagnosed.failures += select(0.0, 1.0, missed && !wet);
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
                medium = IN_LIQUID;
                way = select(select(NOTHING, to_hit, hit.found), solid.t, wet);
                is_first = false;
                if wet || hit.found {
                    diagnosed.inside += select(to_hit, solid.t, wet);
                    if TURBID {
                        let end = select(hit.position, o + solid.t * d, wet);
                        let absorption = absorption_between(o, end);
                        let scattering = scattering_between(o, end);
                        interval = interval_of(absorption, scattering, distance(o, end), cosine, light, wet, scale);
                        result += weight * interval.added;
                        if LIGHTS > 0u {
                            let extinction = absorption + scattering;
                            let lit = LitInterval(
                                camera_world_point(o),
                                camera_world_direction(d),
                                distance(o, end),
                                cosine,
                                camera_world_direction(entry_normal),
                                camera_world_direction(-interface_normal(hit, d)),
                                wet,
                                extinction,
                                scattering / max(extinction, vec3f(1e-20)),
                                params.radius,
                            );
                            result += weight * lights_scattered(lit);
                        }
                        weight *= interval.passed;
                    } else if ABSORPTION {
                        weight *= transmittance_between(o, select(hit.position, o + solid.t * d, wet));
                    }
                }
            }
        }
        if DIFFUSE {
            var spheres: vec4f;
            if first_liquid && medium == IN_LIQUID {
                spheres = diffuse_of(diffuse_inside[diffuse_index(texel)]);
                spheres.w = 1.0 - spheres.w;
            } else {
                spheres = spheres_along(o, d, way, medium);
            }
            result += weight_before * spheres.rgb;
            weight *= spheres.w;
        }
        if !rises {
            // Where nothing was seen on the way yet.
            let last = select(select(IN_LIQUID, IN_AIR, !inside), NO_SPHERES, (eye && !inside) || medium != NO_SPHERES);
            seen = Look(o, d, solid, end_scale * weight, screen, vec3f(1.0), travelled, Spread(), last);
        }
        eye = false;
        if !ends {
            travelled += distance(o, hit.position);
            o = hit.position;
            start = hit.texel;
            let n = interface_normal(hit, d);
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
            seen.spread = spread;
            spread = Spread();
            seen.d = select(reflected, transmitted, bounce);
            seen.weight = weight * select(f * out, through, bounce);
            seen.screen = inside && (bounce || REFLECT_SOLIDS);
            seen.medium = select(IN_AIR, IN_LIQUID, inside && !bounce);
            seen.solid.t = NOTHING;
            if bounce || REFLECT_SOLIDS {
                seen.solid = solid_ahead(o, seen.d);
            }
            if TURBID && inside && !bounce {
                // Reflected light goes the same way back through the liquid.
                result += weight * f * interval.returned;
                seen.weight *= interval.passed;
            }
            if TURBID {
                cosine = select(cos_theta_t, cos_theta_i, bounce);
                entry_normal = select(n, -n, inside);
                if bounce {
                    light = Around(light.far, light.near, light.ground, light.curvature);
                } else if !inside {
                    light = light_around(hit.texel);
                }
            }
            // External reflections are not followed. A solid that liquid covers in this view is shaded as
            // seen through the liquid; otherwise crests would mirror a dry floor.
            height = dot(o, up);
            if REFLECT_SOLIDS && seen.solid.t < NOTHING && (!inside || ANY_LIT) {
                let x = o + seen.solid.t * seen.d;
                let below = !inside && covered(x);
                seen.weight /= select(1.0, scale, below);
                if TURBID && below {
                    // Outlines mirror the liquid around them.
                    let passage = covering(o, x);
                    result += seen.weight * passage.added;
                    seen.weight *= passage.passed;
                }
                if ANY_LIT && (below || (inside && !bounce)) {
                    seen.ambient = ambient_at(x, max(height - dot(x, up), 0.0));
                }
            }
            weight *= select(through, f, bounce);
            d = select(transmitted, reflected, bounce);
            // Ends on total reflection beyond the bounce limit.
            ends = !bounce && f >= 1.0;
            inside = bounce || !inside;
        }
        if (ANY_LIT || OPAQUE_FLUIDS) && wet {
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

