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
    let light = light_views[view];
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

fn light_scattered(index: u32, interval: LitInterval) -> vec3f {
    let end = interval.o + interval.length * interval.d;
    let to_light = light_from(lights[index], interval.o);
    let from_near = dot(interval.near, to_light.direction);
    let from_far = select(dot(interval.far, to_light.direction), 0.0, interval.wet);
    let is_near = from_near > 0.0;
    let normal = select(interval.far, interval.near, is_near);
    let cos_i = max(select(from_far, from_near, is_near), 0.05);
    let cos_t = optics_cos_transmitted(cos_i, params.ior);
    let entry = select(end, interval.o, is_near);
    if cos_t < 0.0 || in_shadow(entry, normal, to_light, 0.0) {
        return vec3f(0.0);
    }
    let enters = 1.0 - optics_fresnel(cos_i, cos_t, params.ior);
    let inside = -optics_refract(-to_light.direction, normal, cos_i, cos_t, params.ior);
    let power = lights[index].power * enters / to_light.distance2;
    // A view along unrefracted light shows longer ways.
    let shortened = select(cos_i / cos_t, 1.0, lights[index].map == 1u && lights[index].straight > 0u);
    let extinction = interval.extinction;

    // Once, at places in the middle of even shares of what the interval takes from green light.
    let rate = max(extinction.g, 1e-6);
    let taken = 1.0 - exp(-rate * interval.length);
    var once = vec3f(0.0);
    for (var k = 0u; k < LIT_PLACES; k++) {
        let at = -log(1.0 - (f32(k) + 0.5) / f32(LIT_PLACES) * taken) / rate;
        let depth = shortened * depth_in_light(index, interval.o + at * interval.d);
        once += exp(rate * at - extinction * (at + depth)) * taken / rate;
    }
    let beam = power * cos_i / cos_t;
    let scattering = extinction * interval.albedo;
    let single = beam * scattering * phase(dot(inside, interval.d)) * once / f32(LIT_PLACES);

    // More than once, below the surface that the light enters by.
    let thickness = extinction * interval.length * interval.cosine;
    let slab = slab_light(SCATTERED_AGAIN, thickness, interval.cosine, interval.albedo);
    let along = slab_light(SCATTERED_AGAIN, thickness, cos_t, interval.albedo);
    let mean = slab_light(SCATTERED_AGAIN, thickness, MEAN_COSINE, interval.albedo);
    let of_near = select(slab.near, slab.near_wet, interval.wet) * along.near / max(mean.near, vec3f(1e-6));
    let share = select(slab.far, of_near, is_near);
    let hidden = max(depth_in_light(index, entry) - interval.radius, 0.0);
    let lit = exp(-extinction * (1.0 - interval.albedo * params.anisotropy) * hidden);
    let flux = power * select(max(from_far, 0.0), from_near, is_near) / (3.1415927 * params.mean_transmittance);
    let again = params.ior * params.ior * share * flux * lit * (1.0 - exp(-extinction * interval.length));
    return single + again;
}
