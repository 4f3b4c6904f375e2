// Light that reaches a sphere.

#import common/scene.wgsl
#import diffuse/particles.wgsl

@group(1) @binding(1) var probes: texture_2d<f32>; // diffuse/around.wgsl

const PI: f32 = 3.14159265;

// One of the four probes around a pixel: its first texel, and its share of their mean.
struct NearProbe {
    texel: vec2i,
    share: f32,
}

fn near_probe(pixel: vec2f, i: i32) -> NearProbe {
    let at = pixel / f32(PROBE_SIDE) - 0.5;
    let first = floor(at);
    let last = (vec2i(camera.size) - 1) / i32(PROBE_SIDE);
    let corner = vec2i(i & 1, i >> 1u);
    let probe = clamp(vec2i(first) + corner, vec2i(0), last);
    let part = mix(1.0 - (at - first), at - first, vec2f(corner));
    return NearProbe(vec2i(i32(PROBE_TEXELS) * probe.x, probe.y), max(part.x * part.y, 1e-4));
}

// Irradiance over pi around a pixel: the mean of this texel of the probes around it, MEAN or TO_EYE.
fn irradiance_near(pixel: vec2f, texel: i32) -> vec3f {
    var sum = vec4f(0.0);
    for (var i = 0; i < 4; i++) {
        let probe = near_probe(pixel, i);
        let light = textureLoad(probes, probe.texel + vec2i(texel, 0), 0);
        sum += select(vec4f(0.0), probe.share * light, light.w > 0.0);
    }
    return select(sum.rgb / max(sum.w, 1e-4), scene.ambient, sum.w == 0.0);
}

// The same, on a surface of normal n.
fn irradiance_on(pixel: vec2f, n: vec3f) -> vec3f {
    var sum = vec4f(0.0);
    for (var i = 0; i < 4; i++) {
        let probe = near_probe(pixel, i);
        let mean = textureLoad(probes, probe.texel + vec2i(MEAN, 0), 0);
        if mean.w > 0.0 {
            let x = textureLoad(probes, probe.texel + vec2i(1, 0), 0).xyz;
            let y = textureLoad(probes, probe.texel + vec2i(2, 0), 0).xyz;
            let z = textureLoad(probes, probe.texel + vec2i(3, 0), 0).xyz;
            sum += probe.share * vec4f(max(mean.rgb + x * n.x + y * n.y + z * n.z, vec3f(0.0)), 1.0);
        }
    }
    return select(sum.rgb / max(sum.w, 1e-4), scene.ambient, sum.w == 0.0);
}

// Share of the light that a Lambertian sphere reflects to an eye at this cosine from the light, over that which faces both
// (E. Schoenberg 1929).
fn phase(cosine: f32) -> f32 {
    let angle = acos(clamp(cosine, -1.0, 1.0));
    return 0.21220659 * (sin(angle) + (PI - angle) * cos(angle));
}

// Part of the optical depth of spheres that takes light away, as they scatter some of it on: the diffusion exponent (H. C. van
// de Hulst, Multiple Light Scattering, 1980). A Lambertian sphere's mean cosine is -4/9.
fn taken_by_spheres(albedo: vec3f) -> vec3f {
    return sqrt(min(3.0 * (1.0 - albedo) * (1.0 + 0.44444444 * albedo), vec3f(1.0)));
}

// Irradiance over pi, of light number i, that neither solids nor the liquid block.
fn direct_light(i: u32, x: vec3f, radius: f32, to_light: ToLight, albedo: vec3f) -> vec3f {
    let start = x + radius * to_light.direction;
    let is_lit = !scene_blocks(start, to_light.direction, to_light.distance - radius);
    let sun = lights[i].kind == SUN;
    let straight = VIEWS * i + select(0u, min(lights[i].straight, 1u), STRAIGHT_VIEWS);
    // Beside the surface that it floats on.
    let dry = is_dry(straight, sun, x + params.radius * to_light.direction);
    let through = select(params.mean_transmittance, 1.0, dry);
    // A sphere does not shade itself.
    let left = passed_by_spheres(i, start, 1.0, taken_by_spheres(albedo));
    let light = left * through * lights[i].power / (to_light.distance2 * PI);
    return select(vec3f(0.0), light, is_lit);
}
