// Light from around that reaches an opaque body: from the environment, from solids, and from the body itself.
//
// Each pixel looks along a few directions of its hemisphere, another set than its neighbours'; shade/means.wgsl and
// shade/body.wgsl have the mean over pixels around it. Along a direction the layers show what of the body lies in the way
// (L. Bavoil, M. Sainz and R. Dimitrov, Image-Space Horizon-Based Ambient Occlusion, 2008); solids are traced.

#import shade/looks.wgsl
#import shade/material.wgsl
#import shade/packed.wgsl
#import shade/texels.wgsl

const DIRECTIONS: u32 = 2u;     // of the hemisphere
const MIRRORED: u32 = 1u;       // directions of the coat's reflection

// Light of the hemisphere, its reflection in the coat, 1 less the share of the body in the way times its albedo, and the
// reflectance of the coat with the part of it that meets the body.
@group(1) @binding(5) var around: texture_storage_2d<rgba32uint, write>;

// Albedo of the body in the way; 0 if there is none.
fn blocked_by(seen: Seen) -> vec3f {
    if seen.is_blocked {
        return albedo_at(seen.texel);
    }
    return vec3f(0.0);
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
    let shift = pattern(p);
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
        bounced += blocked_by(seen) / f32(DIRECTIONS);
    }
    var mirrored = vec3f(0.0);
    var reflectance = vec2f(0.0);
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
            let share = coat_reflectance(cos_theta) / f32(MIRRORED);
            mirrored += share * seen.radiance;
            reflectance += vec2f(share, select(0.0, share, seen.is_blocked));
        }
    }
    textureStore(
        around,
        p,
        vec4u(packed_rgb(light), packed_rgb(mirrored), packed_rgb(1.0 - bounced), packed_rgb(vec3f(reflectance, 0.0))),
    );
}
