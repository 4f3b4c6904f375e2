// Lists of the splats that each tile needs: A. Lauritzen, Deferred Rendering for Current and Future Rendering Pipelines
// (SIGGRAPH 2010 courses); lists of exact length by a prefix sum, as B. Kerbl et al., 3D Gaussian Splatting (2023).

struct Params {
    splats: u32,
    lanes: u32,    // threads that share a splat's tiles
    tiles: vec2u,  // of the picture
    entries: u32,  // of the lists of a band of tiles, not counting the last tile's
    band: u32,
    swell: f32,    // scale of the ellipsoids that tiles list
    rest: u32,     // 1: of tiles beyond all bands, whose list is that of all splats
    kinds: u32,    // splats to draw: ALL, or those that classification on the device has marked as such
    pad: u32,
}

const ALL: u32 = 0u;
const BODIES: u32 = 1u;
const DROPLETS: u32 = 2u;

@group(2) @binding(0) var<$branching> params: Params;

// Where lists exceed the memory for them, they are made for one band of tiles after the other.
fn band_of(start: u32) -> u32 {
    return start / params.entries;
}

// Whether the tile whose list starts here belongs to the band.
fn is_in_band(start: u32) -> bool {
    let band = band_of(start);
    return band == params.band || (params.rest != 0u && band > params.band);
}
