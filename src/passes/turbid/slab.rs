//! Light that level turbid slabs scatter, by adding and doubling (van de Hulst 1980, chapter 4; Prahl, van Gemert and
//! Welch 1993), with Fresnel's reflection at their boundaries.

use rayon::prelude::*;

/// Optical thicknesses of the table: half octaves from [`THINNEST`].
pub const THICKNESSES: usize = 27;
/// Directions of the table: cosines from that of the critical angle, or 0, to 1.
pub const COSINES: usize = 8;
/// Albedos of the table: those whose √(1 − albedo) are even steps from 0 to 1.
pub const ALBEDOS: usize = 32;
/// Least optical thickness of the table.
pub const THINNEST: f64 = 1.0 / 64.0;

/// Nodes of Gauss and Legendre on each side of the critical angle.
const GAUSS: usize = 8;
/// Nodes: those that integrate, then the table's, of weight 0.
const NODES: usize = 2 * GAUSS + COSINES;
/// Terms of the phase function. The rest of its forward peak counts as unscattered (δ-M, Wiscombe 1977).
const TERMS: usize = 2 * GAUSS;
/// Doublings up to the least thickness, from one at which light is scattered once.
const FIRST_DOUBLINGS: i32 = 16;

type Vector = [f64; NODES];
type Matrix = [Vector; NODES];

/// The radiance that scattering adds along a ray through a slab, as a share of that which it would add if the
/// radiance of one side came from everywhere. By the side that the light comes from: that which the ray enters the
/// slab by against the light's path, and the other one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Scattered {
    /// Both sides reflect as a liquid in air.
    pub free: [f64; 2],
    /// The other side is a black, wet solid that glows.
    pub wet: [f64; 2],
}

/// Scattered light by thickness, direction and albedo.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// All of it, then that which is scattered more than once; thicknesses vary fastest, then cosines, then albedos.
    pub texels: [Vec<Scattered>; 2],
}

impl Table {
    /// The table of slabs of index `eta` relative to the air around them and anisotropy `g`.
    pub fn new(eta: f64, g: f64) -> Self {
        let optics = Optics::new(eta, g);
        let albedos: Vec<_> = (0..ALBEDOS)
            .into_par_iter()
            .map(|i| optics.of_albedo(1.0 - (i as f64 / (ALBEDOS - 1) as f64).powi(2)))
            .collect();
        let texels = [0, 1].map(|part| {
            let of_albedo = |slabs: &Vec<[[Scattered; COSINES]; 2]>| {
                let at = |k: usize| slabs.iter().map(move |slab| slab[part][k]).collect::<Vec<_>>();
                (0..COSINES).flat_map(at).collect::<Vec<_>>()
            };
            albedos.iter().flat_map(of_albedo).collect()
        });
        Self { texels }
    }

    /// Texels as `turbid/slab.wgsl` reads them: thicknesses side by side, the parts one below the other.
    pub fn texture(&self) -> Vec<[f32; 4]> {
        let packed = |s: &Scattered| [s.free[0], s.free[1], s.wet[0], s.wet[1]].map(|x| x as f32);
        self.texels.iter().flatten().map(packed).collect()
    }
}

/// Least cosine inside of light that leaves a liquid of index `eta`.
pub fn critical_cosine(eta: f64) -> f64 {
    (1.0 - 1.0 / (eta * eta)).max(0.0).sqrt()
}

/// Share of light from everywhere outside that enters a liquid of index `eta`: by reciprocity, the share that leaves
/// it times eta².
pub fn mean_transmittance(eta: f64) -> f64 {
    let critical = critical_cosine(eta);
    let nodes = gauss_legendre();
    let leaves = |x: f64| 2.0 * x * (1.0 - reflectance(x, eta));
    let part = |(x, w): &(f64, f64)| {
        // Steps that are finer towards the critical angle, where the reflectance is steep.
        let cos = critical + (1.0 - critical) * x * x;
        2.0 * x * w * (1.0 - critical) * leaves(cos)
    };
    eta * eta * nodes.iter().map(part).sum::<f64>()
}

/// Reflectance of the boundary for light from inside.
fn reflectance(cos_i: f64, eta: f64) -> f64 {
    let sin2 = (1.0 - cos_i * cos_i) * eta * eta;
    if sin2 >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin2).sqrt();
    let along = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let across = (eta * cos_i - cos_t) / (eta * cos_i + cos_t).max(1e-300);
    0.5 * (along * along + across * across)
}

/// Tables that slabs of one index and anisotropy share.
struct Optics {
    cosines: Vector,
    weights: Vector,
    /// Of the boundary, from inside.
    reflectance: Vector,
    /// Phase function between directions on one side, and on both, averaged over azimuths; without the peak.
    forward: Matrix,
    backward: Matrix,
    /// Share of the peak.
    peak: f64,
}

impl Optics {
    fn new(eta: f64, g: f64) -> Self {
        let critical = critical_cosine(eta);
        let split = if critical > 0.0 { critical } else { 0.5 };
        let (mut cosines, mut weights) = ([0.0; NODES], [0.0; NODES]);
        for (i, (x, w)) in gauss_legendre().into_iter().enumerate() {
            (cosines[i], weights[i]) = (split * x, split * w);
            let (rest, k) = (1.0 - split, GAUSS + i);
            (cosines[k], weights[k]) = (split + rest * x, rest * w);
        }
        for k in 0..COSINES {
            let at = critical + (1.0 - critical) * k as f64 / (COSINES - 1) as f64;
            cosines[2 * GAUSS + k] = at.max(1e-3);
        }
        let peak = g.powi(TERMS as i32);
        let legendre = cosines.map(legendre);
        let phase = |i: usize, j: usize, sign: f64| -> f64 {
            let term = |l: usize| {
                let moment = (g.powi(l as i32) - peak) / (1.0 - peak);
                (2 * l + 1) as f64 * moment * sign.powi(l as i32) * legendre[i][l] * legendre[j][l]
            };
            (0..TERMS).map(term).sum()
        };
        let matrix = |sign| std::array::from_fn(|i| std::array::from_fn(|j| phase(i, j, sign)));
        Self {
            cosines,
            weights,
            reflectance: cosines.map(|cos| reflectance(cos, eta)),
            forward: matrix(1.0),
            backward: matrix(-1.0),
            peak,
        }
    }

    /// Slabs of all thicknesses of an albedo.
    fn of_albedo(&self, albedo: f64) -> Vec<[[Scattered; COSINES]; 2]> {
        let mut slabs = vec![Default::default(); THICKNESSES];
        for half in 0..2 {
            let mut thickness =
                THINNEST * 2f64.powf(0.5 * f64::from(half)) / 2f64.powi(FIRST_DOUBLINGS);
            let mut slab = self.thin(albedo, thickness);
            for _ in 0..FIRST_DOUBLINGS {
                slab = slab.doubled();
                thickness *= 2.0;
            }
            for i in (half as usize..THICKNESSES).step_by(2) {
                slabs[i] = self.scattered(&slab, albedo, thickness);
                slab = slab.doubled();
                thickness *= 2.0;
            }
        }
        slabs
    }

    /// A slab in which light is scattered once.
    fn thin(&self, albedo: f64, thickness: f64) -> Slab {
        let kept = 1.0 - albedo * self.peak;
        let (thickness, albedo) = (kept * thickness, albedo * (1.0 - self.peak) / kept);
        let scattered = |phase: &Matrix, i: usize, j: usize| {
            0.5 * albedo * phase[i][j] * self.weights[j] * thickness / self.cosines[i]
        };
        let mut transmits: Matrix =
            std::array::from_fn(|i| std::array::from_fn(|j| scattered(&self.forward, i, j)));
        for (i, row) in transmits.iter_mut().enumerate() {
            row[i] += 1.0 - thickness / self.cosines[i];
        }
        let reflects =
            std::array::from_fn(|i| std::array::from_fn(|j| scattered(&self.backward, i, j)));
        Slab { reflects, transmits }
    }

    /// Light that a slab scatters towards the table's directions: all of it, and the part scattered more than once.
    fn scattered(&self, slab: &Slab, albedo: f64, thickness: f64) -> [[Scattered; COSINES]; 2] {
        let Slab { reflects, transmits } = slab;
        let r = &self.reflectance;
        let enters: Vector = r.map(|r| 1.0 - r);
        let inside = |matrix: &dyn Fn(usize, usize) -> f64, from: &Vector| {
            let mut system: Matrix =
                std::array::from_fn(|i| std::array::from_fn(|j| -r[i] * matrix(i, j)));
            (0..NODES).for_each(|i| system[i][i] += 1.0);
            solved(system, std::array::from_fn(|i| [from[i]])).map(|row| row[0])
        };
        // Light from both sides, and its difference.
        let even = inside(&|i, j| reflects[i][j] + transmits[i][j], &enters);
        let odd = inside(&|i, j| reflects[i][j] - transmits[i][j], &enters);
        let near: Vector = std::array::from_fn(|i| 0.5 * (even[i] + odd[i]));
        let far: Vector = std::array::from_fn(|i| 0.5 * (even[i] - odd[i]));
        // A glowing floor, and the sky above one.
        let up = [1.0; NODES];
        let risen = times(transmits, &up);
        let returned: Vector = std::array::from_fn(|i| r[i] * risen[i]);
        let of_sky = inside(&|i, j| reflects[i][j], &enters);
        let of_floor = inside(&|i, j| reflects[i][j], &returned);
        let dark = [0.0; NODES];
        let added = |down: &Vector, up: &Vector, k: usize| {
            let (unscattered, row) = self.unscattered(thickness, k);
            let sum = dot(&reflects[row], down) + dot(&transmits[row], up) - unscattered * up[row];
            sum / (1.0 - unscattered)
        };
        let once = |k: usize| self.scattered_once(albedo, thickness, k);
        let all = std::array::from_fn(|k| Scattered {
            free: [added(&near, &far, k), added(&far, &near, k)],
            wet: [added(&of_sky, &dark, k), added(&of_floor, &up, k)],
        });
        let more = std::array::from_fn(|k| {
            let (all, once): (&Scattered, _) = (&all[k], once(k));
            let less = |all: [f64; 2]| [(all[0] - once[0]).max(0.0), (all[1] - once[1]).max(0.0)];
            Scattered { free: less(all.free), wet: less(all.wet) }
        });
        [all, more]
    }

    /// Share of a ray in a direction of the table that a slab does not scatter, and the direction's node.
    fn unscattered(&self, thickness: f64, k: usize) -> (f64, usize) {
        let row = 2 * GAUSS + k;
        ((-thickness / self.cosines[row]).exp(), row)
    }

    /// Light scattered once, of that which enters from the air on either side.
    fn scattered_once(&self, albedo: f64, thickness: f64, k: usize) -> [f64; 2] {
        let (unscattered, i) = self.unscattered(thickness, k);
        let mut sums = [0.0; 2];
        let kept = 1.0 - albedo * self.peak;
        let (albedo, thickness) = (albedo * (1.0 - self.peak) / kept, kept * thickness);
        for j in 0..2 * GAUSS {
            let (a, b) = (self.cosines[i], self.cosines[j]);
            let light = 0.5 * albedo * self.weights[j] * (1.0 - self.reflectance[j]);
            let both = 1.0 / a + 1.0 / b;
            sums[0] += light * self.backward[i][j] * (1.0 - (-thickness * both).exp()) / (a * both);
            let difference = 1.0 / b - 1.0 / a;
            let along = if (thickness * difference).abs() < 1e-6 {
                thickness * (-thickness / a).exp()
            } else {
                ((-thickness / a).exp() - (-thickness / b).exp()) / difference
            };
            sums[1] += light * self.forward[i][j] * along / a;
        }
        sums.map(|sum| sum / (1.0 - unscattered))
    }
}

/// A slab without boundaries, as operators on radiance.
struct Slab {
    reflects: Matrix,
    transmits: Matrix,
}

impl Slab {
    /// Two of it.
    fn doubled(&self) -> Self {
        let Self { reflects, transmits } = self;
        let mut system = product(reflects, reflects);
        for (i, row) in system.iter_mut().enumerate() {
            *row = row.map(|x| -x);
            row[i] += 1.0;
        }
        // Light that goes on between the two.
        let between = solved(system, *transmits);
        let returned = product(transmits, &product(reflects, &between));
        let sum = |a: &Matrix, b: &Matrix| {
            std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + b[i][j]))
        };
        Self { reflects: sum(reflects, &returned), transmits: product(transmits, &between) }
    }
}

fn dot(a: &Vector, b: &Vector) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn times(a: &Matrix, x: &Vector) -> Vector {
    std::array::from_fn(|i| dot(&a[i], x))
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let mut result = [[0.0; NODES]; NODES];
    for (row, a) in result.iter_mut().zip(a) {
        for (&a, b) in a.iter().zip(b).filter(|(a, _)| **a != 0.0) {
            row.iter_mut().zip(b).for_each(|(sum, b)| *sum += a * b);
        }
    }
    result
}

/// Solves a system for several right sides, by Gaussian elimination: its diagonal dominates.
fn solved<const SIDES: usize>(
    mut system: Matrix,
    mut sides: [[f64; SIDES]; NODES],
) -> [[f64; SIDES]; NODES] {
    for k in 0..NODES {
        let (pivot, side) = (system[k], sides[k]);
        for i in (0..NODES).filter(|&i| i != k) {
            let factor = system[i][k] / pivot[k];
            if factor != 0.0 {
                system[i].iter_mut().zip(&pivot).for_each(|(x, p)| *x -= factor * p);
                sides[i].iter_mut().zip(&side).for_each(|(x, p)| *x -= factor * p);
            }
        }
    }
    std::array::from_fn(|i| sides[i].map(|x| x / system[i][i]))
}

/// Legendre's polynomials of a number.
fn legendre(x: f64) -> [f64; TERMS] {
    let mut values = [1.0; TERMS];
    values[1] = x;
    for l in 2..TERMS {
        let n = l as f64;
        values[l] = ((2.0 * n - 1.0) * x * values[l - 1] - (n - 1.0) * values[l - 2]) / n;
    }
    values
}

/// Nodes and weights of Gauss and Legendre's quadrature from 0 to 1, by Newton's method.
fn gauss_legendre() -> [(f64, f64); GAUSS] {
    let n = GAUSS as f64;
    std::array::from_fn(|i| {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..64 {
            let values = legendre(x);
            slope = n * (x * values[GAUSS] - values[GAUSS - 1]) / (x * x - 1.0);
            x -= values[GAUSS] / slope;
        }
        (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Flux from a slab in uniform light on one side, without boundaries: reflected and transmitted.
    fn fluxes(albedo: f64, thickness: f64, g: f64) -> [f64; 2] {
        let optics = Optics::new(1.0, g);
        let doublings = 20;
        let mut slab = optics.thin(albedo, thickness / 2f64.powi(doublings));
        (0..doublings).for_each(|_| slab = slab.doubled());
        let lit = [1.0; NODES];
        let flux = |radiance: Vector| {
            let part = |i: usize| 2.0 * optics.weights[i] * optics.cosines[i] * radiance[i];
            (0..NODES).map(part).sum()
        };
        [flux(times(&slab.reflects, &lit)), flux(times(&slab.transmits, &lit))]
    }

    /// Transmittance of white slabs for light from everywhere: Heaslet and Warming (1965), table 1.
    #[test]
    fn white_slabs_transmit_as_tabulated() {
        for (thickness, expected) in [(0.1, 0.9157), (0.5, 0.7040), (1.0, 0.5532), (2.0, 0.3900)] {
            let [reflected, transmitted] = fluxes(1.0, thickness, 0.0);
            assert!((transmitted - expected).abs() < 5e-4, "{thickness}: {transmitted}");
            assert!((reflected + transmitted - 1.0).abs() < 1e-6, "{reflected} {transmitted}");
        }
    }

    /// As the known reflectances of even light: 0.0664 of water and 0.0918 of glass (d'Eon and Irving 2011).
    #[test]
    fn surfaces_let_even_light_in() {
        for (eta, reflected) in [(1.0, 0.0), (1.33, 0.0664), (1.5, 0.0918)] {
            assert!((mean_transmittance(eta) - 1.0 + reflected).abs() < 1.5e-3, "{eta}");
        }
    }

    /// Without absorption, light of one radiance from both sides fills a slab, whatever it scatters.
    #[test]
    fn white_slabs_vanish_in_a_furnace() {
        for (eta, g) in [(1.33, 0.0), (1.5, 0.8), (0.75, 0.3)] {
            let table = Table::new(eta, g);
            for slab in &table.texels[0][..THICKNESSES * COSINES] {
                let sum = slab.free[0] + slab.free[1];
                assert!((sum - 1.0).abs() < 1e-3, "{eta}, {g}: {slab:?}");
            }
        }
    }
}
