// Light around the spheres of each probe: its mean over all directions, its change with the direction, and the light on a disc
// that faces the eye.
//
// The 64 threads of a probe look in as many even directions (E. Keinert et al., Spherical Fibonacci Mapping, 2015). Irradiance
// over pi on a surface of normal n is `mean + (x, y, z) n`: the first four spherical harmonics (R. Ramamoorthi and P. Hanrahan,
// An Efficient Representation for Irradiance Environment Maps, 2001, equations 5 and 8).

#import diffuse/particles.wgsl
#import shade/looks.wgsl

@group(1) @binding(3) var<storage, read> nearest_spheres: array<u32>; // disparities by probe, as bits; 0 without spheres
@group(1) @binding(4) var probes_out: texture_storage_2d<rgba32float, write>;

const LOOKS: u32 = 64u;

var<workgroup> sums: array<array<vec3f, 4>, LOOKS>;

// Radiance of liquid that lies in the way: of what is behind it, and what it mirrors.
fn beyond(o: vec3f, d: vec3f, width: f32) -> vec3f {
    let solid = scene_trace(o, d);
    var radiance = environment_over(d, Spread(vec3f(0.0), vec3f(0.0)));
    if solid.t < NOTHING {
        let x = o + solid.t * d;
        radiance = solid_radiance(solid.index, solid.triangle, x, solid.normal, d, vec3f(1.0), width * solid.t);
    }
    let through = params.mean_transmittance / (params.ior * params.ior);
    return through * radiance + (1.0 - params.mean_transmittance) * scene.ambient;
}

@compute @workgroup_size(64)
fn look_around(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let probe = group_index(group);
    let place = vec2u(probe % probes_across(), probe / probes_across());
    let middle = place * PROBE_SIDE + PROBE_SIDE / 2u;
    let probes = arrayLength(&nearest_spheres);
    let nearest = nearest_spheres[min(probe, probes - 1u)];
    let has_spheres = probe < probes && nearest != 0u;
    var own = array<vec3f, 4>();
    if has_spheres {
        let texel = min(vec2i(middle), vec2i(camera.size) - 1);
        var body = body_at(texel);
        let disparity = bitcast<f32>(nearest);
        if plane_is_empty(body.front) || body.disparity < 0.5 * disparity {
            body.position = camera_point(body.omega, disparity);
            body.normal = vec3f(0.0);
        }
        let rise = 1.0 - (2.0 * f32(local) + 1.0) / f32(LOOKS);
        let angle = 2.3999632 * f32(local);
        let level = sqrt(1.0 - rise * rise);
        let d = vec3f(level * cos(angle), rise, level * sin(angle));
        let seen = look(body, camera_view_direction(d), 0.5, 0.5);
        var radiance = seen.radiance;
        if seen.is_blocked {
            radiance = beyond(camera_world_point(body.position), d, 0.5);
        }
        own = array<vec3f, 4>(radiance, 2.0 * d.x * radiance, 2.0 * d.y * radiance, 2.0 * d.z * radiance);
    }
    sums[local] = own;
    workgroupBarrier();
    for (var stride = LOOKS / 2u; stride > 0u; stride /= 2u) {
        if local < stride {
            for (var i = 0u; i < 4u; i++) {
                sums[local][i] += sums[local + stride][i];
            }
        }
        workgroupBarrier();
    }
    if local < PROBE_TEXELS && probe < probes {
        let texel = vec2u(PROBE_TEXELS * place.x + local, place.y);
        // The mean normal of a disc is two thirds of that at its centre.
        let n = -0.66666667 * camera_world_direction(camera_ray_direction(camera_omega(vec2f(middle))));
        let facing = max(sums[0][0] + n.x * sums[0][1] + n.y * sums[0][2] + n.z * sums[0][3], vec3f(0.0));
        let light = select(sums[0][min(local, 3u)], facing, local == u32(TO_EYE)) / f32(LOOKS);
        textureStore(probes_out, texel, vec4f(light, select(0.0, 1.0, has_spheres)));
    }
}
