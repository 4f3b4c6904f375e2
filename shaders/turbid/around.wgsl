// Light around a turbid liquid at each pixel: on its first surface, on its last, and from a solid that the refracted line of
// sight meets.
//
// Each pixel looks along a few directions, another set than its neighbours'; turbid/means.wgsl has the mean over 4 x 4 pixels.

#import common/optics.wgsl
#import shade/looks.wgsl
#import shade/packed.wgsl
#import shade/texels.wgsl
#import turbid/params.wgsl
#import turbid/slab.wgsl

@group(1) @binding(3) var mixture: texture_2d<f32>;
@group(1) @binding(5) var scattering_mixture: texture_2d<f32>;
@group(1) @binding(6) var slab_table: texture_2d<f32>;
// Light on the first surface, share that leaves it, light on the last surface, light of the solid.
@group(1) @binding(7) var around: texture_storage_2d<rgba32uint, write>;

override MIXTURE: bool = false;            // fluids differ in absorption
override SCATTERING_MIXTURE: bool = false; // and in scattering

const DIRECTIONS: u32 = 2u;     // of the hemisphere in front
const BACK_DIRECTIONS: u32 = 1u;

fn share_of(sums: vec4f) -> vec3f {
    return sums.rgb / max(sums.a, 1e-3);
}

// Share of light that the liquid at a texel does not absorb.
fn left_by(texel: vec2i) -> vec3f {
    let omega = camera_omega(vec2f(texel) + 0.5);
    let front = front_at(texel);
    let thickness = max(depth_below(front, omega, max(dot(back_at(texel), omega), 1e-20)), 0.0);
    var absorption = params.absorption;
    var scattering = params.scattering;
    if MIXTURE {
        absorption *= share_of(textureLoad(mixture, texel, 0));
    }
    if SCATTERING_MIXTURE {
        scattering *= share_of(textureLoad(scattering_mixture, texel, 0));
    }
    let extinction = absorption + scattering;
    let albedo = scattering / max(extinction, vec3f(1e-20));
    let cosine = 0.85;
    let slab = slab_light(SCATTERED, thickness * extinction, cosine, albedo);
    let unscattered = exp(-thickness * extinction / cosine);
    return mix(slab.near + slab.far, vec3f(1.0), unscattered);
}

// Radiance along a direction without the liquid.
fn beyond(o: vec3f, d: vec3f, width: f32) -> vec3f {
    let world_o = camera_world_point(o);
    let world_d = camera_world_direction(d);
    let solid = scene_trace(world_o, world_d);
    if solid.t >= NOTHING {
        return environment_over(world_d, Spread(vec3f(0.0), vec3f(0.0)));
    }
    let x = world_o + solid.t * world_d;
    return solid_radiance(solid.index, solid.triangle, x, solid.normal, world_d, vec3f(1.0), width * solid.t);
}

fn hemisphere(across: mat2x3f, normal: vec3f, xi: vec2f) -> vec3f {
    let angle = 6.2831853 * xi.y;
    let beside = sqrt(xi.x) * vec2f(cos(angle), sin(angle));
    return normalize(across * beside + sqrt(max(1.0 - xi.x, 1e-4)) * normal);
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
    var across = basis_around(body.normal);
    var light = vec3f(0.0);
    var bounced = vec3f(0.0);
    for (var i = 0u; i < DIRECTIONS; i++) {
        let xi = vec2f((f32(i) + shift.x) / f32(DIRECTIONS), fract(0.61803399 * f32(i) + shift.y));
        let seen = look(body, hemisphere(across, body.normal, xi), shift.y, 0.5);
        light += seen.radiance / f32(DIRECTIONS);
        if seen.is_blocked {
            bounced += left_by(seen.texel) / f32(DIRECTIONS);
        }
    }
    let back = back_at(p);
    var behind = light;
    if !plane_is_empty(back) {
        let normal = plane_normal(back);
        let position = camera_point(body.omega, dot(back, body.omega));
        across = basis_around(normal);
        behind = vec3f(0.0);
        for (var i = 0u; i < BACK_DIRECTIONS; i++) {
            let xi = vec2f((f32(i) + shift.x) / f32(BACK_DIRECTIONS), fract(0.61803399 * f32(i) + shift.y));
            behind += beyond(position, hemisphere(across, normal, xi), 0.5) / f32(BACK_DIRECTIONS);
        }
    }
    let cos_i = dot(body.eye, body.normal);
    let cos_t = optics_cos_transmitted(cos_i, params.ior);
    let refracted = optics_refract(-body.eye, body.normal, cos_i, max(cos_t, 0.0), params.ior);
    let ground = beyond(body.position, refracted, 1.0);
    textureStore(around, p, vec4u(packed_rgb(light), packed_rgb(1.0 - bounced), packed_rgb(behind), packed_rgb(ground)));
}
