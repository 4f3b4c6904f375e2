// Where the light through a vertex of the grid ends.

struct Landing {
    position: vec3f,   // on the receiver, view space
    state: u32,
    passed: vec3f,     // light that arrives, over what a pixel of the view would bring
    normal: u32,       // of the receiver, packed
    start: vec3f,      // of the last straight part of its path
    direction: u32,    // of that part, packed
}

const NO_PATH: u32 = 0u; // it met no liquid, or was reflected totally
const HIDDEN: u32 = 1u;  // its path is known, but not to where: out of the view, or not shown by it
const LANDED: u32 = 2u;
const DARK: u32 = 3u;    // landed, but it starts in the shadow of a solid

// Unit vectors as two numbers of 16 bits (Cigolle et al., A Survey of Efficient Representations for
// Independent Unit Vectors, 2014: octahedral).
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
