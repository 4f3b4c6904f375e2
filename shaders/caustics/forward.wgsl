// Forward caustics: traces light through each grid vertex, refracted on entering and leaving the liquid,
// to its receiver.
//
// After Wallace (Rendering realtime caustics in WebGL, 2016), Renou (Real-time rendering of water
// caustics, 2020) and Mayer, Assarsson and Sintorn (2026), section 2.2. `deposit.wgsl` then deposits
// the light between three vertices in the map.

#import $intersector
#import caustics/landing.wgsl
#import caustics/light_sums.wgsl
#import caustics/light.wgsl
#import caustics/params.wgsl

@group(3) @binding(0) var<$branching> caustics: CausticParams;
@group(3) @binding(1) var<storage, read> grid: array<GridVertex>;
@group(3) @binding(2) var<storage, read_write> landings: array<Landing>;

// First solid along a light ray that the light's view shows.
fn light_receiver(ray: ScreenRay) -> Interface {
    return opaque_entry(ray);
}

// Whether liquid that ends at x wets the receiver ahead.
fn wets(receiver: Interface, x: vec3f) -> bool {
    return CONTACT && abs(dot(plane_normal(receiver.plane), x - receiver.position)) <= params.contact;
}

fn no_path() -> Landing {
    return Landing(vec3f(0.0), NO_PATH, vec3f(0.0), 0u, vec3f(0.0), 0u);
}

fn light_path(vertex: GridVertex) -> Landing {
    let o = vertex.position;
    let to_light = caustics_to_light(o);
    var n = vertex.normal;
    var cos_theta_i = dot(to_light, n);
    var cos_theta_t = optics_cos_transmitted(cos_theta_i, params.ior);
    if vertex.valid == NONE || cos_theta_i <= 0.0 || cos_theta_t < 0.0 {
        return no_path();
    }
    // Light on the surface relative to that along the view's rays: the ratio of cosines, and for a point
    // light also of squared distances and of the solid angles of pixels.
    let omega = camera_omega_of(o);
    var share = cos_theta_i / max(-dot(camera_ray_direction(omega), n), 1e-3);
    if !ORTHOGRAPHIC {
        let to_point = caustics.light - o;
        share *= dot(o, o) / dot(to_point, to_point) * view_power(omega);
    }
    var passed = vec3f(share * (1.0 - reflectance(cos_theta_i, cos_theta_t, params.ior)));
    var start = o;
    var d = optics_refract(-to_light, n, cos_theta_i, cos_theta_t, params.ior);
    // Shadowed vertices are traced too: their landing points define the shadow's edge.
    var state = select(DARK, LANDED, vertex.valid == LIT);
    var receiver: Interface;
    var dry = false;
    // One body of liquid after the other, as far as the layers tell them apart.
    for (var body = 0u; body <= GAPS; body++) {
        let inside = screen_ray(start, d, NOTHING);
        let texel = screen_ray_texel(inside, 0.0);
        receiver = light_receiver(inside);
        dry = false;
        if caustics.interfaces < 2u {
            break;
        }
        let exit = liquid_exit(inside, texel);
        let to_exit = distance(start, exit.position);
        dry = exit.found && !(receiver.found
            && (distance(start, receiver.position) <= to_exit || wets(receiver, exit.position)));
        if !dry {
            break;
        }
        n = interface_normal(exit, d);
        let eta = 1.0 / params.ior;
        cos_theta_i = -dot(d, n);
        cos_theta_t = optics_cos_transmitted(cos_theta_i, eta);
        if cos_theta_t < 0.0 {
            return no_path();
        }
        passed *= transmittance_between(start, exit.position)
            * (1.0 - reflectance(cos_theta_i, cos_theta_t, eta));
        start = exit.position;
        d = optics_refract(d, n, cos_theta_i, cos_theta_t, eta);
        let outside = screen_ray(start, d, NOTHING);
        receiver = light_receiver(outside);
        if body == GAPS {
            break;
        }
        let entry = liquid_entry(outside);
        let to_entry = distance(start, entry.position);
        if !entry.found || (receiver.found && distance(start, receiver.position) <= to_entry) {
            break;
        }
        n = interface_normal(entry, d);
        cos_theta_i = -dot(d, n);
        cos_theta_t = optics_cos_transmitted(cos_theta_i, params.ior);
        passed *= 1.0 - reflectance(cos_theta_i, cos_theta_t, params.ior);
        start = entry.position;
        d = optics_refract(d, n, cos_theta_i, cos_theta_t, params.ior);
    }
    if !receiver.found {
        state = min(state, HIDDEN);
    } else if !dry {
        passed *= transmittance_between(start, receiver.position);
    }
    passed *= passed_below(o, select(0.0, distance(o, receiver.position), receiver.found));
    let normal = pack_unit(plane_normal(receiver.plane));
    return Landing(receiver.position, state, passed, normal, start, pack_unit(d));
}

@compute @workgroup_size(8, 8)
fn trace_light(@builtin(global_invocation_id) thread: vec3u) {
    let id = thread.xy + caustics.first;
    if any(id > caustics.cells) {
        return;
    }
    let index = id.y * (caustics.cells.x + 1u) + id.x;
    landings[index] = light_path(grid[index]);
}
