// Light from around that reaches an opaque body: from the environment, from solids, and from the body itself.
//
// Each pixel looks along a few directions of its hemisphere, another set than its neighbours', so that the mean over 4 x 4
// pixels (shade/body.wgsl) has 16 times as many. Along a direction the layers show what of the body lies in the way
// (L. Bavoil, M. Sainz and R. Dimitrov, Image-Space Horizon-Based Ambient Occlusion, 2008); solids are traced.

#import shade/surface.wgsl

const DIRECTIONS: u32 = 4u;     // of the hemisphere
const STEPS: u32 = 12u;         // along each
const GROWTH: f32 = 1.5;        // of a step to the next
const MIRRORED: u32 = 1u;       // directions of the coat's reflection

// Light of the hemisphere, its reflection in the coat, the share of the body in the way times its albedo, and the
// reflectance of the coat.
@group(1) @binding(5) var around: texture_storage_2d<rgba32uint, write>;

struct Seen {
    radiance: vec3f,
    blocked: vec3f, // albedo of the body in the way; 0 if there is none
    is_blocked: bool,
}

// Behind a front by less than this, in particle radii and as a share of the way, a ray is inside the body; by more, behind
// it.
const THICKNESS: f32 = 8.0;
const THICKNESS_SHARE: f32 = 0.6;
// Behind a front by less than this share of the way, a ray may just follow a level surface.
const LEVEL_SHARE: f32 = 0.01;

fn look(body: Body, d: vec3f, jitter: f32, width: f32) -> Seen {
    let side = camera_pixel_side(body.position);
    let o = body.position + 0.5 * side * body.normal;
    let world_o = camera_world_point(o);
    let world_d = camera_world_direction(d);
    let solid = scene_trace(world_o, world_d);
    var seen: Seen;
    var t = max(1.5 * side, 0.7 * params.radius) * mix(1.0, GROWTH, jitter);
    // The loop goes on after a hit, since threads beside this one do.
    for (var k = 0u; k < STEPS; k++) {
        let x = o + t * d;
        let u = camera_pixel(x);
        if -x.z <= camera.near || any(u < vec2f(0.0)) || any(u >= camera.size) || t >= solid.t {
            break;
        }
        let texel = vec2i(u);
        let omega = camera_omega(u);
        let front = front_at(texel);
        let behind = depth_below(front, omega, camera_disparity(x));
        let is_inside = !plane_is_empty(front) && behind > LEVEL_SHARE * t
            && behind < THICKNESS * params.radius + THICKNESS_SHARE * t;
        if is_inside {
            seen.is_blocked = true;
            seen.blocked = albedo_at(texel);
            break;
        }
        t *= GROWTH;
    }
    if seen.is_blocked {
        return seen;
    }
    if solid.t >= NOTHING {
        seen.radiance = environment_over(world_d, Spread(vec3f(0.0), vec3f(0.0)));
        return seen;
    }
    let x = world_o + solid.t * world_d;
    seen.radiance =
        solid_radiance(solid.index, solid.triangle, x, solid.normal, world_d, vec3f(1.0), width * solid.t);
    return seen;
}

// RGB of a common exponent: EXT_texture_shared_exponent, without its rounding upwards.
fn packed_rgb(color: vec3f) -> u32 {
    let clamped = clamp(color, vec3f(0.0), vec3f(65408.0));
    let most = max(max(clamped.x, clamped.y), max(clamped.z, 1e-9));
    let exponent = clamp(i32(floor(log2(most))) + 16, 0, 31);
    let mantissas = min(vec3u(clamped * exp2(f32(24 - exponent)) + 0.5), vec3u(511u));
    return mantissas.x | (mantissas.y << 9u) | (mantissas.z << 18u) | (u32(exponent) << 27u);
}

// Three numbers from 0 to 1 in thousandths: those of four directions are exact.
fn packed_shares(shares: vec3f) -> u32 {
    let parts = vec3u(clamp(shares, vec3f(0.0), vec3f(1.0)) * 1000.0 + 0.5);
    return parts.x | (parts.y << 10u) | (parts.z << 20u);
}

@compute @workgroup_size(8, 8)
fn look_around(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let p = texel_of(group, local);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    let body = body_at(p);
    if plane_is_empty(body.front) {
        textureStore(around, p, vec4u(0u));
        return;
    }
    // One of 16 in each 4 x 4 pixels.
    let turn = u32(p.x & 3) | (u32(p.y & 3) << 2u);
    let shift = vec2f(f32(turn) + 0.5, f32((turn * 7u) & 15u) + 0.5) / 16.0;
    let across = basis_around(body.normal);
    var light = vec3f(0.0);
    var bounced = vec3f(0.0);
    for (var i = 0u; i < DIRECTIONS; i++) {
        let xi = vec2f((f32(i) + shift.x) / f32(DIRECTIONS), fract(0.61803399 * f32(i) + shift.y));
        let angle = 2.0 * PI * xi.y;
        let beside = sqrt(xi.x) * vec2f(cos(angle), sin(angle));
        let d = normalize(across * beside + sqrt(max(1.0 - xi.x, 1e-4)) * body.normal);
        let seen = look(body, d, shift.y, 0.5);
        light += seen.radiance / f32(DIRECTIONS);
        bounced += seen.blocked / f32(DIRECTIONS);
    }
    var mirrored = vec3f(0.0);
    var reflectance = 0.0;
    if COATED {
        let alpha2 = params.roughness * params.roughness;
        for (var i = 0u; i < MIRRORED; i++) {
            // GGX (Walter et al., Microfacet Models for Refraction, 2007, equations 35 and 36).
            let xi = vec2f((f32(i) + shift.x) / f32(MIRRORED), fract(0.61803399 * f32(i) + shift.y));
            let cos2 = (1.0 - xi.x) / (1.0 + (alpha2 - 1.0) * xi.x);
            let angle = 2.0 * PI * xi.y;
            let beside = sqrt(max(1.0 - cos2, 0.0)) * vec2f(cos(angle), sin(angle));
            let h = across * beside + sqrt(cos2) * body.normal;
            let cos_theta = max(dot(body.eye, h), 0.0);
            var d = 2.0 * cos_theta * h - body.eye;
            // A facet's reflection into the body meets it again at once.
            d = normalize(d + max(1e-3 - dot(d, body.normal), 0.0) * body.normal);
            let seen = look(body, d, shift.y, params.roughness);
            // The body in the way is about as bright as this place.
            let radiance = seen.radiance + seen.blocked * bounced_light(light, bounced);
            let share = coat_reflectance(cos_theta) / f32(MIRRORED);
            mirrored += share * radiance;
            reflectance += share;
        }
    }
    textureStore(
        around,
        p,
        vec4u(packed_rgb(light), packed_rgb(mirrored), packed_shares(bounced), bitcast<u32>(reflectance)),
    );
}
