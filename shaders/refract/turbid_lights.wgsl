// Light of suns and lamps that a turbid liquid scatters towards the eye.
//
// It is scattered once at a few places of an interval, as deep below the surface as the light's view shows
// (src/light_view.rs). The rest is scattered as by a level slab in even light: reciprocity gives the share of a direction.

#import common/optics.wgsl
#import common/scene.wgsl
#import refract/bindings.wgsl
#import turbid/slab.wgsl

const LIT_PLACES: u32 = 4u;
const FOUR_PI: f32 = 12.566371;
// Cosine inside of even light's mean direction.
const MEAN_COSINE: f32 = 0.86;

// An interval of a turbid liquid, in world axes relative to the eye.
struct LitInterval {
    o: vec3f,
    d: vec3f,
    length: f32,
    cosine: f32,        // of d with the normal where it starts
    near: vec3f,        // outward normals at its start and its end
    far: vec3f,
    wet: bool,          // ends on a solid
    extinction: vec3f,  // 1/m
    albedo: vec3f,
    radius: f32,        // of particles, m
}

// Length of liquid between x and a light, m. The view of the caustic map looks along refracted light, if that differs.
fn depth_in_light(index: u32, x: vec3f) -> f32 {
    let sun = lights[index].kind == SUN;
    var view = VIEWS * index;
    if lights[index].map == 0u {
        let straight = lights[index].straight;
        view += min(straight, 1u);
        if straight == CUBE {
            view += cube_face(x - lights[index].place);
        }
    }
    let light = light_views.views[view];
    let point = in_light_view(light, sun, x);
    var depth = 0.0;
    for (var i = 0; i < select(0, AROUND, point.inside); i++) {
        let texel = near_texel(light, point, i);
        let front = textureLoad(caustic_receivers, texel.at, light.layer, 0).w;
        let behind = max(front - point.disparity, 0.0);
        // Along the view's rays.
        let way = select(length(point.omega) * behind / max(front * point.disparity, 1e-20), behind, sun);
        depth += texel.weight * way;
    }
    return depth;
}

// Henyey and Greenstein's phase function of the cosine of the scattering angle.
fn phase(cosine: f32) -> f32 {
    let g = params.anisotropy;
    let base = max(1.0 + g * g - 2.0 * g * cosine, 1e-6);
    return (1.0 - g * g) / (FOUR_PI * base * sqrt(base));
}

fn lights_scattered(interval: LitInterval) -> vec3f {
    var sum = vec3f(0.0);
    for (var i = 0u; i < LIGHTS; i++) {
        sum += light_scattered(i, interval);
    }
    return sum;
}

// Light of a sun or lamp at a place in level liquid, by straight ways through its surface.
struct Beam {
    to_light: ToLight,
    inside: vec3f,   // its direction there
    cos_i: f32,      // with the normal, of the light outside
    cos_t: f32,      // and inside; negative if it does not enter
    irradiance: f32, // on what faces it, of unit power, without extinction
}

// At `x` below the plane at `entry`. A lamp's way meets the plane at about its apparent depth.
fn beam_at(index: u32, x: vec3f, entry: vec3f, normal: vec3f) -> Beam {
    let light = lights[index];
    var at = entry;
    var beam: Beam;
    if light.kind != SUN {
        let below = max(dot(entry - x, normal), 0.0) / params.ior;
        let above = max(dot(light.place - entry, normal), 0.0);
        let foot = x + dot(entry - x, normal) * normal;
        let lamp_foot = light.place + dot(entry - light.place, normal) * normal;
        at = mix(foot, lamp_foot, below / max(above + below, 1e-20));
    }
    beam.to_light = light_from(light, at);
    beam.cos_i = max(dot(normal, beam.to_light.direction), 0.05);
    beam.cos_t = optics_cos_transmitted(beam.cos_i, params.ior);
    beam.inside = -optics_refract(-beam.to_light.direction, normal, beam.cos_i, beam.cos_t, params.ior);
    let ratio = beam.cos_i / beam.cos_t;
    let enters = 1.0 - optics_fresnel(beam.cos_i, beam.cos_t, params.ior);
    let spread = spread_within(light, beam.to_light, ratio, vec3f(distance(at, x))).x;
    beam.irradiance = enters * ratio / (beam.to_light.distance2 * spread);
    return beam;
}

// Factor by which a lamp's light spreads on its way of `length` inside, in the plane of incidence and across it; 1 of a sun.
fn spread_within(light: Light, to_light: ToLight, ratio: f32, length: vec3f) -> vec3f {
    let far = select(length / (params.ior * sqrt(to_light.distance2)), vec3f(0.0), light.kind == SUN);
    return (1.0 + far) * (1.0 + ratio * ratio * far);
}

fn light_scattered(index: u32, interval: LitInterval) -> vec3f {
    let end = interval.o + interval.length * interval.d;
    let is_near = dot(interval.near, light_from(lights[index], interval.o).direction) > 0.0;
    let entry = select(end, interval.o, is_near);
    let normal = select(interval.far, interval.near, is_near);
    let beam = beam_at(index, entry, entry, normal);
    let is_lit = is_near || (!interval.wet && dot(normal, beam.to_light.direction) > 0.0);
    if !is_lit || beam.cos_t < 0.0 || in_shadow(entry, normal, beam.to_light, 0.0) {
        return vec3f(0.0);
    }
    let power = lights[index].power * passed_by_spheres(index, entry, 0.0, vec3f(1.0));
    // A view along unrefracted light shows longer or shorter ways.
    let is_straight = lights[index].map == 1u && lights[index].straight > 0u;
    let extinction = interval.extinction;

    // Once, at places in the middle of even shares of what the interval takes from green light.
    let rate = max(extinction.g, 1e-6);
    let taken = 1.0 - exp(-rate * interval.length);
    var once = vec3f(0.0);
    for (var k = 0u; k < LIT_PLACES; k++) {
        let at = -log(1.0 - (f32(k) + 0.5) / f32(LIT_PLACES) * taken) / rate;
        let x = interval.o + at * interval.d;
        let arrives = beam_at(index, x, entry, normal);
        let cos_view = dot(normal, light_from(lights[index], x).direction);
        let depth = depth_in_light(index, x) * select(max(cos_view, 0.05) / arrives.cos_t, 1.0, is_straight);
        let scattered = arrives.irradiance * phase(dot(arrives.inside, interval.d));
        once += scattered * exp(rate * at - extinction * (at + depth)) * taken / rate;
    }
    let single = power * extinction * interval.albedo * once / f32(LIT_PLACES);

    // More than once, below the surface that the light enters by.
    let thickness = extinction * interval.length * interval.cosine;
    let slab = slab_light(SCATTERED_AGAIN, thickness, interval.cosine, interval.albedo);
    let along = slab_light(SCATTERED_AGAIN, thickness, beam.cos_t, interval.albedo);
    let mean = slab_light(SCATTERED_AGAIN, thickness, MEAN_COSINE, interval.albedo);
    let of_near = select(slab.near, slab.near_wet, interval.wet) * along.near / max(mean.near, vec3f(1e-6));
    let share = select(slab.far, of_near, is_near);
    let hidden = max(depth_in_light(index, entry) - interval.radius, 0.0);
    let lit = exp(-extinction * (1.0 - interval.albedo * params.anisotropy) * hidden);
    let flux = power * beam.irradiance * beam.cos_t / (3.1415927 * params.mean_transmittance);
    // About one transport mean free path deep.
    let path = 1.0 / max(extinction * (1.0 - interval.albedo * params.anisotropy), vec3f(1e-6));
    let deep = min(path, vec3f(0.5 * interval.length * interval.cosine));
    let spread = spread_within(lights[index], beam.to_light, beam.cos_i / beam.cos_t, deep);
    let removed = 1.0 - exp(-extinction * interval.length);
    let again = params.ior * params.ior * share * flux * lit * removed / spread;
    return single + again;
}
