// End point of the light path through a grid vertex.

struct Landing {
    position: vec3f,   // on the receiver, view space
    state: u32,        // NO_PATH, HIDDEN, LANDED or DARK
    passed: vec3f,     // arriving light, relative to that of a pixel of the view
    normal: u32,       // of the receiver, packed
    start: vec3f,      // origin of the last straight segment of the path
    direction: u32,    // of that segment, packed
}

const NO_PATH: u32 = 0u; // no liquid, or total reflection
const HIDDEN: u32 = 1u;  // the path is known but leaves the view or ends on a hidden receiver
const LANDED: u32 = 2u;
const DARK: u32 = 3u;    // landed, but the vertex is in the shadow of a solid

// Octahedral encoding of a unit vector in two 16-bit numbers (Cigolle et al., A Survey of Efficient
// Representations for Independent Unit Vectors, 2014).
fn pack_unit(v: vec3f) -> u32 {
    let p = v.xy / (abs(v.x) + abs(v.y) + abs(v.z));
    let sign = select(vec2f(-1.0), vec2f(1.0), p >= vec2f(0.0));
    return pack2x16snorm(select(p, (1.0 - abs(p.yx)) * sign, v.z < 0.0));
}

fn unpack_unit(packed: u32) -> vec3f {
    let p = unpack2x16snorm(packed);
    let z = 1.0 - abs(p.x) - abs(p.y);
    let sign = select(vec2f(-1.0), vec2f(1.0), p >= vec2f(0.0));
    return normalize(vec3f(select(p, (1.0 - abs(p.yx)) * sign, z < 0.0), z));
}
