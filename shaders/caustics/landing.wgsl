// Where the light through a vertex of the grid ends.

struct Landing {
    position: vec3f,  // on the receiver, view space
    state: u32,
    passed: vec3f,    // light that arrives, over what a pixel of the view would bring
    plane: vec3f,     // pi of the receiver
}

const NO_LIQUID: u32 = 0u; // it met none, or a solid before
const LOST: u32 = 1u;      // reflected totally, out of the view, or on what the view does not show
const LANDED: u32 = 2u;
