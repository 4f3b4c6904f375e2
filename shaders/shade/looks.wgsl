// Radiance that reaches a body's surface along a direction: from the environment, solids, and the body itself.
//
// Along a direction the layers show what of the body lies in the way (L. Bavoil, M. Sainz and R. Dimitrov, Image-Space
// Horizon-Based Ambient Occlusion, 2008); solids are traced. A root defines `params.radius`, that of particles.

#import shade/surface.wgsl

const STEPS: u32 = 12u;         // along each
const GROWTH: f32 = 1.5;        // of a step to the next

// One of 64 even places in each 8 x 8 pixels, spread evenly over each 4 x 4 of them.
fn pattern(p: vec2i) -> vec2f {
    let fine = u32(p.x & 3) | (u32(p.y & 3) << 2u);
    let coarse = u32((p.x >> 2u) & 1) | (u32((p.y >> 2u) & 1) << 1u);
    let places = vec2u(4u * fine + coarse, 4u * ((fine * 7u) & 15u) + ((coarse * 3u + 1u) & 3u));
    return (vec2f(places) + 0.5) / 64.0;
}

struct Seen {
    radiance: vec3f,
    is_blocked: bool, // by the body itself, at `texel`
    texel: vec2i,
}

// Behind a front by less than this, in particle radii and as a share of the way, a ray is inside the body; by more, behind
// it.
const THICKNESS: f32 = 8.0;
const THICKNESS_SHARE: f32 = 0.6;
// Behind a front by less than this share of the way, a ray may just follow a level surface.
const LEVEL_SHARE: f32 = 0.01;

fn look(body: Body, d: vec3f, jitter: f32, width: f32) -> Seen {
    let side = camera_pixel_side(body.position);
    let o = body.position + 0.5 * side * body.normal;
    let world_o = camera_world_point(o);
    let world_d = camera_world_direction(d);
    let solid = scene_trace(world_o, world_d);
    var seen: Seen;
    var t = max(1.5 * side, 0.7 * params.radius) * mix(1.0, GROWTH, jitter);
    // The loop goes on after a hit, since threads beside this one do.
    for (var k = 0u; k < STEPS; k++) {
        let x = o + t * d;
        let u = camera_pixel(x);
        if -x.z <= camera.near || any(u < vec2f(0.0)) || any(u >= camera.size) || t >= solid.t {
            break;
        }
        let texel = vec2i(u);
        let omega = camera_omega(u);
        let front = front_at(texel);
        let behind = depth_below(front, omega, camera_disparity(x));
        let is_inside = !plane_is_empty(front) && behind > LEVEL_SHARE * t
            && behind < THICKNESS * params.radius + THICKNESS_SHARE * t;
        if is_inside {
            seen.is_blocked = true;
            seen.texel = texel;
            break;
        }
        t *= GROWTH;
    }
    if seen.is_blocked {
        return seen;
    }
    if solid.t >= NOTHING {
        seen.radiance = environment_over(world_d, Spread(vec3f(0.0), vec3f(0.0)));
        return seen;
    }
    let x = world_o + solid.t * world_d;
    seen.radiance =
        solid_radiance(solid.index, solid.triangle, x, solid.normal, world_d, vec3f(1.0), width * solid.t);
    return seen;
}
