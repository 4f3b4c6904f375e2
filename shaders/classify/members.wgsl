// The members of a frame whose particles are in buffers of the device: positions and radii as the kernels read them. Each
// splat starts as a sphere, and stays one in a crowd.

#import classify/params.wgsl
#import common/splat.wgsl

// Where the numbers of particles are: of the first, and from one to the next, in 32-bit words.
struct Source {
    position: vec2u,
    radius: vec2u,
    has_radii: u32,
    counter: u32,       // index of the number of particles in `counters`
    has_counter: u32,
    common_radius: f32, // m
}

@group(0) @binding(1) var<storage, read> source: Source;
@group(0) @binding(2) var<storage, read> positions: array<f32>;
@group(0) @binding(3) var<storage, read> radii: array<f32>;
@group(0) @binding(4) var<storage, read> counters: array<u32>;
@group(0) @binding(5) var<storage, read_write> members: array<vec4f>; // position and radius, m; radius 0: none
@group(0) @binding(6) var<storage, read_write> splats: array<Splat>;

// Largest ratio of a radius to the common one or vice versa.
const MAX_RADIUS_RATIO: f32 = 4.0;

// Whether a number is finite: neither an infinity nor not a number, whatever the adapter makes of these.
fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

@compute @workgroup_size(256)
fn gather(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = group_index(group) * 256u + local;
    if i >= params.members {
        return;
    }
    var radius = source.common_radius;
    var is_drawn = true;
    if source.has_counter != 0u {
        is_drawn = i < counters[source.counter];
    }
    if source.has_radii != 0u {
        let own = radii[source.radius.x + source.radius.y * i];
        is_drawn = is_drawn && is_finite(own) && own > 0.0;
        radius = clamp(own, radius / MAX_RADIUS_RATIO, radius * MAX_RADIUS_RATIO);
    }
    let at = source.position.x + source.position.y * i;
    let place = vec3f(positions[at], positions[at + 1u], positions[at + 2u]);
    is_drawn = is_drawn && is_finite(place.x) && is_finite(place.y) && is_finite(place.z);
    if is_drawn {
        members[i] = vec4f(place, radius);
        let sphere = vec3f(params.short_axis * radius);
        splats[i] = Splat(place - params.shift, radius, sphere, i, vec3f(0.0), 0u);
    } else {
        members[i] = vec4f(0.0);
        splats[i] = Splat(vec3f(0.0), source.common_radius, vec3f(0.0), i, vec3f(0.0), HIDDEN);
    }
}
