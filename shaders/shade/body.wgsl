// Radiance of an opaque body: Lambertian, with a rough dielectric coat, in the light from around it (shade/around.wgsl) and
// of the lights.

#import shade/material.wgsl
#import shade/neighbours.wgsl
#import shade/packed.wgsl
#import shade/texels.wgsl

@group(1) @binding(5) var means: texture_2d<u32>;
@group(1) @binding(6) var body_radiance: texture_storage_2d<rgba32float, write>;

// Means of what the pixels around a texel see that are of its surface.
struct Around {
    light: vec3f,
    mirrored: vec3f,
    bounced: vec3f,
    reflectance: vec2f, // of the coat, and the part of it that meets the body
}

// The light over 12 x 12 pixels, and the coat's over 4 x 4.
fn around_of(p: vec2i, body: Body) -> Around {
    var light = vec3f(0.0);
    var leaving = vec3f(0.0);
    var weight = 0.0;
    for (var i = 0; i < 9; i++) {
        let texel = further_neighbour(p, i);
        let bits = textureLoad(means, texel, 0);
        let share = select(0.0, further_weight(i), shows_surface_of(body, texel));
        light += share * unpacked_rgb(bits.x);
        leaving += share * unpacked_rgb(bits.z);
        weight += share;
    }
    let scale = 1.0 / max(weight, 1.0);
    let own = textureLoad(means, p, 0);
    return Around(scale * light, unpacked_rgb(own.y), 1.0 - scale * leaving, unpacked_rgb(own.w).xy);
}

// Share of a light that the body does not keep from itself. Its layers seen from the light say where that enters it; a place
// counts as lit up to a particle radius below.
fn own_light(index: u32, x: vec3f, n: vec3f) -> f32 {
    let sun = lights[index].kind == SUN;
    var view = VIEWS * index;
    if STRAIGHT_VIEWS {
        let straight = lights[index].straight;
        view += min(straight, 1u);
        if straight == CUBE {
            view += cube_face(x - lights[index].place);
        }
    }
    let light = light_views.views[view];
    let point = in_light_view(light, sun, x + params.radius * n);
    let slack = params.radius * select(point.disparity * point.disparity, 1.0, sun);
    var dry = 0.0;
    for (var i = 0; i < select(0, AROUND, point.inside); i++) {
        let texel = near_texel(light, point, i);
        let front = textureLoad(caustic_receivers, texel.at, light.layer, 0).w;
        dry += select(0.0, texel.weight, front <= point.disparity + slack);
    }
    return select(1.0, min(dry, 1.0), point.inside);
}

// Of the coat: distribution of its facets times their visibility, over four times both cosines (Walter et al. 2007,
// equations 20, 33 and 34).
fn coat_lobe(cos_h: f32, cos_i: f32, cos_o: f32) -> f32 {
    let alpha2 = max(params.roughness * params.roughness, 1e-4);
    let spread = cos_h * cos_h * (alpha2 - 1.0) + 1.0;
    let g_i = cos_i + sqrt(alpha2 + (1.0 - alpha2) * cos_i * cos_i);
    let g_o = cos_o + sqrt(alpha2 + (1.0 - alpha2) * cos_o * cos_o);
    return alpha2 / (PI * spread * spread) / (g_i * g_o);
}

@compute @workgroup_size(8, 8)
fn shade_body(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let p = texel_of(group, local);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    let body = body_at(p);
    if plane_is_empty(body.front) {
        return;
    }
    let albedo = albedo_at(p);
    let around = around_of(p, body);
    var diffuse = bounced_light(around.light, around.bounced);
    // The body in the way is about as bright as this place.
    var mirrored = around.mirrored + around.reflectance.y * albedo * diffuse;
    let cos_o = max(dot(body.normal, body.eye), 1e-3);
    let x = camera_world_point(body.position);
    let n = camera_world_direction(body.normal);
    for (var i = 0u; i < LIGHTS; i++) {
        let to_light = light_from(lights[i], x);
        let cos_i = dot(n, to_light.direction);
        if cos_i <= 0.0 || in_shadow(x, n, to_light, 0.0) {
            continue;
        }
        let reaches = own_light(i, x, n) * passed_by_spheres(i, x, 0.0, vec3f(1.0));
        let irradiance = lights[i].power * cos_i / to_light.distance2 * reaches;
        if !COATED {
            diffuse += irradiance / PI;
            continue;
        }
        let transmitted = (1.0 - coat_reflectance(cos_i)) / params.mean_transmittance;
        diffuse += transmitted * irradiance / PI;
        let h = normalize(camera_world_direction(body.eye) + to_light.direction);
        let reflected = coat_reflectance(max(dot(h, to_light.direction), 0.0));
        mirrored += reflected * coat_lobe(max(dot(h, n), 0.0), cos_i, cos_o) * irradiance;
    }
    var radiance = albedo * diffuse / (1.0 - params.film_reflectance * albedo);
    if COATED {
        radiance = (1.0 - around.reflectance.x) * radiance + mirrored;
    }
    textureStore(body_radiance, p, vec4f(radiance, 1.0));
}
