// Light that a turbid liquid scatters towards the eye, and takes away, along an interval of a ray.
//
// Around an interval the liquid counts as a level slab of the interval's thickness, which the light on the surfaces at both
// ends illuminates (turbid/around.wgsl). That is exact for level liquid under an even sky.

#import common/camera.wgsl
#import refract/bindings.wgsl
#import shade/packed.wgsl
#import turbid/slab.wgsl

override SCATTERING_MIXTURE: bool = false; // there are fluids of different scattering

// Light on the surfaces around an interval, relative to the squared index.
struct Around {
    near: vec3f,   // at its start
    far: vec3f,    // at its end
    ground: vec3f, // of a wet solid at its end
    curvature: f32, // mean curvature of the liquid's surface, 1/m
}

// Effect of an interval on light.
struct Passage {
    passed: vec3f,   // share that is neither absorbed nor scattered
    added: vec3f,    // scattered light
    returned: vec3f, // the same of the way back
}

fn light_around(texel: vec2i) -> Around {
    let bits = textureLoad(turbid_light, clamp(texel, vec2i(0), vec2i(camera.size) - 1), 0);
    return Around(unpacked_rgb(bits.x), unpacked_rgb(bits.y), unpacked_rgb(bits.z), bitcast<f32>(bits.w));
}

// Sums of a mixture at a point's pixel.
fn sums_at(sums: texture_2d<f32>, x: vec3f) -> vec4f {
    let last = vec2i(camera.size) - 1;
    let pixel = select(0.5 * camera.size, camera_pixel(x), ORTHOGRAPHIC || -x.z >= camera.near);
    return textureLoad(sums, clamp(vec2i(floor(pixel)), vec2i(0), last), 0);
}

// Scattering between two points, as `absorption_between`.
fn scattering_between(o: vec3f, x: vec3f) -> vec3f {
    var scattering = params.scattering;
    if SCATTERING_MIXTURE {
        let a = sums_at(scattering_mixture, o);
        let b = sums_at(scattering_mixture, x);
        scattering *= 0.5 * (a.rgb / max(a.a, 1e-3) + b.rgb / max(b.a, 1e-3));
    }
    return scattering;
}

// Share of even light that scattering lets down to a depth: by diffusion without absorption, from a source one mean free
// path deep to a black floor (Ishimaru 1978, chapter 9).
fn scattering_lets_through(scattering: vec3f, depth: f32) -> vec3f {
    return 1.0 / (1.0 + 0.75 * (1.0 - params.anisotropy) * scattering * depth);
}

// Thickness of the slab that stands for the liquid around an interval. In even light a body that absorbs little takes as
// much as a slab twice as thick as the body's volume over its surface: half a cylinder's diameter, a third of a ball's.
fn slab_thickness(length: f32, cosine: f32, curvature: f32) -> f32 {
    let bent = curvature * length;
    // Of level liquid, and of a ball.
    let across = length * pow(cosine, (1.0 - bent) / (1.0 + bent));
    return across / (1.0 + curvature * across);
}

// The interval of `length` metres of a ray whose cosine with the normal at its start is `cosine`.
fn interval_of(
    absorption: vec3f,
    scattering: vec3f,
    length: f32,
    cosine: f32,
    light: Around,
    wet: bool,
    scale: f32,
) -> Passage {
    let extinction = absorption + scattering;
    let albedo = scattering / max(extinction, vec3f(1e-20));
    let slab = slab_light(SCATTERED, extinction * slab_thickness(length, cosine, light.curvature), cosine, albedo);
    let passed = optics_transmittance(extinction, length);
    let taken = 1.0 - passed;
    if wet {
        return Passage(passed, taken * (scale * slab.near_wet * light.near + slab.far_wet * light.ground), vec3f(0.0));
    }
    return Passage(
        passed,
        taken * scale * (slab.near * light.near + slab.far * light.far),
        taken * scale * (slab.near * light.far + slab.far * light.near),
    );
}
