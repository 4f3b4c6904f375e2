// Particle and fluid of the nearest front at each pixel.

#import splat.wgsl

struct Tagged {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) centre: vec3f,
    @location(1) @interpolate(flat) sphere_x: vec3f,
    @location(2) @interpolate(flat) sphere_y: vec3f,
    @location(3) @interpolate(flat) sphere_z: vec3f,
    @location(4) @interpolate(flat) tag: vec2u,
}

@vertex
fn vertex_tagged(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> Tagged {
    let splat = splats[instance];
    let v = splat_varying(corner, splat);
    return Tagged(v.clip, v.centre, v.sphere_x, v.sphere_y, v.sphere_z, vec2u(splat.particle + 1u, v.fluid));
}

struct Nearest {
    @location(0) tag: vec2u, // particle, from 1, and fluid
    @builtin(frag_depth) depth: f32,
}

@fragment
fn nearest(in: Tagged) -> Nearest {
    let to_sphere = mat3x3f(in.sphere_x, in.sphere_y, in.sphere_z);
    let chord = splat_chord(in.centre, to_sphere, camera_omega(in.clip.xy));
    if !chord.hit {
        discard;
    }
    return Nearest(in.tag, depth_at(max(chord.middle - chord.half_length, camera.near)));
}
