// A turbid liquid.

struct Params {
    absorption: vec3f, // 1/m; for several fluids the largest component, in all three channels
    radius: f32,       // of particles, m
    scattering: vec3f, // 1/m, likewise
    ior: f32,
}

@group(1) @binding(0) var<uniform> params: Params;
