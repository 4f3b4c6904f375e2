// The sums of spheres at pixels: in the air before everything else, and in the liquid behind its first surface.

// Each pixel has its spheres' optical depth, and optical depth times radiance.
// Units of the sums.
const DEPTH_UNITS: f32 = 16384.0;
const COLOR_UNITS: f32 = 2048.0;
// Transmittance that stands for none, and the least optical depth that does.
const OPAQUE_TRANSMITTANCE: f32 = 0.0024787522;
const OPAQUE_DEPTH: f32 = 5.99;
// Most radiance, in multiples of `white`.
const MOST_WHITE: f32 = 16.0;
