// The material of an opaque body.

#import common/optics.wgsl
#import shade/surface.wgsl

struct Params {
    albedo: vec3f,             // linear RGB, where no colours are given
    ior: f32,                  // of the coat; 1 for none
    roughness: f32,            // alpha of the coat's microfacets (Walter et al. 2007)
    mean_transmittance: f32,   // of the coat, for light from everywhere
    radius: f32,               // of particles, m
    film_reflectance: f32,     // of the surface of liquid around the body, for light from everywhere inside; 0 for none
}

override COLORED: bool = false; // particles have colours: color/means.wgsl
override COATED: bool = false;  // the body has a coat

@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(3) var colors: texture_2d<f32>;

fn albedo_at(texel: vec2i) -> vec3f {
    if COLORED {
        return textureLoad(colors, texel, 0).rgb;
    }
    return params.albedo;
}

// Share of light that the coat reflects at a microfacet.
fn coat_reflectance(cos_theta: f32) -> f32 {
    return optics_fresnel(cos_theta, optics_cos_transmitted(cos_theta, params.ior), params.ior);
}
