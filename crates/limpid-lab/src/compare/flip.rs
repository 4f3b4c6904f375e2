//! LDR-FLIP: visibility of the difference between two pictures that alternate on a screen.
//!
//! After P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström and
//! M. D. Fairchild, "FLIP: A Difference Evaluator for Alternating Images", Proceedings of the
//! ACM on Computer Graphics and Interactive Techniques 3(2), 2020,
//! <https://doi.org/10.1145/3406183>; symbols are the paper's.
//!
//! Per pixel, a colour difference `ΔE_c` of the pictures blurred by contrast sensitivity, and a
//! feature difference `ΔE_f` of edges and points, combine to `ΔE = ΔE_c^(1 − ΔE_f)`.
//!
//! The implementation deviates from the paper's text, but not in its result:
//! - Filters are separable; that of Cz, a sum of two Gaussians, is a sum of two separable passes.
//! - The factors of `YCxCz` (116, 500, 200, and the offset −16) are omitted: the filters are linear
//!   and sum to one, so the factors would cancel on the way back to linear RGB.
//! - Each row is filtered vertically first, then horizontally, so it needs no other row's result:
//!   rows run in parallel, no filtered picture is stored, and channels are kept for one band of
//!   rows only.

use std::f32::consts::FRAC_1_SQRT_2;
use std::f64::consts::PI;
use std::ops::Range;

use glam::{Mat3, Vec2, Vec3};
use image::RgbImage;
use rayon::prelude::*;

use super::{FlipMap, check_sizes};
use limpid::memory;
use limpid_io::error::{Error, Result};

/// Pixels per degree of the visual field proposed by the paper, 67.02: a screen 0.7 m wide with
/// 3840 pixels, seen from 0.7 m.
pub const PIXELS_PER_DEGREE: f32 = (0.7 * (3840.0 / 0.7) * (PI / 180.0)) as f32;

/// Exponent of the `HyAB` colour distance, `q_c`.
const COLOUR_EXPONENT: f32 = 0.7;
/// Fraction `p_c` of the greatest colour error that maps to `p_t`.
const KNEE_INPUT: f32 = 0.4;
/// Colour difference `p_t` at that fraction: the few larger errors share the rest up to 1.
const KNEE_OUTPUT: f32 = 0.95;
/// Width w of the feature detectors, in degrees of the visual field.
const FEATURE_WIDTH_IN_DEGREES: f64 = 0.082;

/// Rows compared at a time: their channels take little memory compared with the picture.
const BAND: usize = 256;

/// Contrast sensitivity per opponent channel as sums of `a √(π/b) exp(−π² d²/b)`, d in
/// degrees, listed as (a, b).
///
/// After normalization `a` matters only where there are two terms, in Cz.
const CONTRAST_SENSITIVITY: [&[(f64, f64)]; 3] =
    [&[(1.0, 0.0047)], &[(1.0, 0.0053)], &[(34.1, 0.04), (13.5, 0.025)]];

/// CIE XYZ relative to the D65 white, from linear sRGB: every row sums to one.
const RELATIVE_XYZ_FROM_LINEAR: Mat3 = Mat3::from_cols(
    Vec3::new(0.433_895_4, 0.212_636_82, 0.017_752_423),
    Vec3::new(0.376_242_37, 0.715_182_98, 0.109_465_63),
    Vec3::new(0.189_862_28, 0.072_180_2, 0.872_781_94),
);

/// Luminance Y, red-green Cx = X − Y and blue-yellow Cz = Y − Z, from relative XYZ.
const OPPONENT_FROM_RELATIVE_XYZ: Mat3 =
    Mat3::from_cols(Vec3::new(0.0, 1.0, 0.0), Vec3::new(1.0, -1.0, 1.0), Vec3::new(0.0, 0.0, -1.0));

/// The FLIP map of two pictures of one size, seen at `pixels_per_degree` (1 to 1000).
///
/// More pixels per degree correspond to a greater distance, which hides finer differences.
pub fn flip(reference: &RgbImage, test: &RgbImage, pixels_per_degree: f32) -> Result<FlipMap> {
    check_sizes(reference.dimensions(), test.dimensions())?;
    // Below 1 the detectors are far narrower than a pixel, above 1000 the filters span thousands.
    if !(1.0..=1000.0).contains(&pixels_per_degree) {
        return Err(Error::Usage(format!(
            "pixels per degree must be from 1 to 1000, not {pixels_per_degree}"
        )));
    }

    let (width, height) = reference.dimensions();
    let observer = Observer::new(f64::from(pixels_per_degree));
    let (width, height) = (width as usize, height as usize);
    let mut values = memory::zeroed(width * height, "the FLIP map of a picture")?;
    for (band, rows) in values.chunks_mut(BAND * width).enumerate() {
        let top = band * BAND;
        observer.compare_rows(reference, test, top, rows)?;
    }
    Ok(FlipMap { width: width as u32, height: height as u32, values })
}

impl Observer {
    /// Computes FLIP of the rows from `top` on.
    fn compare_rows(
        &self,
        reference: &RgbImage,
        test: &RgbImage,
        top: usize,
        values: &mut [f32],
    ) -> Result<()> {
        let width = reference.width() as usize;
        let end = top + values.len() / width;
        let seen =
            top.saturating_sub(self.reach())..(end + self.reach()).min(reference.height() as usize);
        // Three channels of two pictures, and the filtered rows of each thread.
        let floats = width * (6 * seen.len() + 64 * rayon::current_num_threads());
        memory::probe(floats * size_of::<f32>(), "rows of a picture to compare")?;
        let (reference, test) = rayon::join(
            || Opponent::new(reference, seen.clone()),
            || Opponent::new(test, seen.clone()),
        );
        let rows = values.par_chunks_exact_mut(width).enumerate();
        rows.for_each(|(y, row)| {
            let y = top + y;
            let colours = self.colours(&reference, y).zip(self.colours(&test, y));
            let features = self.features(&reference, y).zip(self.features(&test, y));
            for ((value, (c0, c1)), (f0, f1)) in row.iter_mut().zip(colours).zip(features) {
                let colour_difference = self.colour_difference(c0, c1);
                *value = colour_difference.powf(1.0 - feature_difference(f0, f1));
            }
        });
        Ok(())
    }

    /// Radius of the largest kernel, rows.
    fn reach(&self) -> usize {
        let kernels =
            self.contrast.iter().flatten().chain([&self.gaussian, &self.edge, &self.point]);
        kernels.map(|kernel| kernel.len() / 2).max().unwrap_or(0)
    }
}

/// Weights of an odd number of taps, the pixel itself in the middle.
type Kernel = Vec<f32>;

/// One channel of some rows of a picture.
struct Plane {
    width: usize,
    /// Height of the whole picture.
    height: usize,
    /// The first row.
    top: usize,
    values: Vec<f32>,
}

impl Plane {
    /// Filters row `y` of the plane by `down` along columns and `along` along rows, kernels of
    /// equal length. Border values extend beyond the border.
    fn filtered_row(&self, y: usize, down: &[f32], along: &[f32]) -> Vec<f32> {
        let radius = down.len() / 2;
        let inside = radius..radius + self.width;

        let mut column_sums = vec![0.0; self.width + 2 * radius];
        for (tap, &weight) in down.iter().enumerate() {
            let source = (y + tap).saturating_sub(radius).min(self.height - 1) - self.top;
            let row = &self.values[source * self.width..][..self.width];
            add_weighted(&mut column_sums[inside.clone()], row, weight);
        }
        let (first, last) = (column_sums[inside.start], column_sums[inside.end - 1]);
        column_sums[..inside.start].fill(first);
        column_sums[inside.end..].fill(last);

        let mut sums = vec![0.0; self.width];
        for (tap, &weight) in along.iter().enumerate() {
            add_weighted(&mut sums, &column_sums[tap..][..self.width], weight);
        }
        sums
    }
}

fn add_weighted(sums: &mut [f32], values: &[f32], weight: f32) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += weight * value;
    }
}

/// Rows of a picture as planes of Y, Cx and Cz.
struct Opponent([Plane; 3]);

impl Opponent {
    fn new(picture: &RgbImage, rows: Range<usize>) -> Self {
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let opponent_from_linear = OPPONENT_FROM_RELATIVE_XYZ * RELATIVE_XYZ_FROM_LINEAR;
        let linear_from_srgb: [f32; 256] =
            std::array::from_fn(|level| linear_from_srgb(level as f32 / 255.0));

        let mut channels = [(); 3].map(|()| Vec::with_capacity(width * rows.len()));
        let levels = &picture.as_raw()[3 * width * rows.start..3 * width * rows.end];
        for pixel in levels.as_chunks::<3>().0 {
            let linear = Vec3::from(pixel.map(|level| linear_from_srgb[usize::from(level)]));
            let opponent = (opponent_from_linear * linear).to_array();
            for (channel, value) in channels.iter_mut().zip(opponent) {
                channel.push(value);
            }
        }
        let top = rows.start;
        Self(channels.map(|values| Plane { width, height, top, values }))
    }
}

/// Kernels and constants that depend on the viewing distance and the colour space, shared by all
/// pixels.
struct Observer {
    /// Kernels per opponent channel whose separable filters add up to its contrast sensitivity.
    contrast: [Vec<Kernel>; 3],
    /// The Gaussian and its first and second derivatives.
    gaussian: Kernel,
    edge: Kernel,
    point: Kernel,
    linear_from_opponent: Mat3,
    /// Colour error `c_max` between pure green and pure blue, the greatest possible.
    max_colour_error: f32,
}

impl Observer {
    fn new(pixels_per_degree: f64) -> Self {
        let [gaussian, edge, point] = feature_kernels(pixels_per_degree);
        let [green, blue] = [Vec3::Y, Vec3::Z].map(hunt_lab_from_linear);
        let opponent_from_linear = OPPONENT_FROM_RELATIVE_XYZ * RELATIVE_XYZ_FROM_LINEAR;
        Self {
            contrast: contrast_kernels(pixels_per_degree),
            gaussian,
            edge,
            point,
            linear_from_opponent: opponent_from_linear.inverse(),
            max_colour_error: hyab(green, blue).powf(COLOUR_EXPONENT),
        }
    }

    /// Row `y` after contrast filtering, in Hunt-adjusted CIELAB.
    fn colours(&self, picture: &Opponent, y: usize) -> impl Iterator<Item = Vec3> {
        let channel = |index: usize| {
            let mut passes = self.contrast[index]
                .iter()
                .map(|kernel| picture.0[index].filtered_row(y, kernel, kernel));
            let first = passes.next().unwrap_or_default();
            passes.fold(first, |mut sum, pass| {
                add_weighted(&mut sum, &pass, 1.0);
                sum
            })
        };
        let [luminance, red_green, blue_yellow] = [0, 1, 2].map(channel);
        luminance.into_iter().zip(red_green).zip(blue_yellow).map(|((y, cx), cz)| {
            // Blurring channels separately may leave the gamut of the screen.
            let linear = self.linear_from_opponent * Vec3::new(y, cx, cz);
            hunt_lab_from_linear(linear.clamp(Vec3::ZERO, Vec3::ONE))
        })
    }

    /// Edge and point strengths along row `y`.
    fn features(&self, picture: &Opponent, y: usize) -> impl Iterator<Item = Vec2> + use<> {
        let luminance = &picture.0[0];
        let gradient_norms = |derivative: &[f32]| {
            let horizontal = luminance.filtered_row(y, &self.gaussian, derivative);
            let vertical = luminance.filtered_row(y, derivative, &self.gaussian);
            horizontal.into_iter().zip(vertical).map(|(dx, dy)| Vec2::new(dx, dy).length())
        };
        gradient_norms(&self.edge)
            .zip(gradient_norms(&self.point))
            .map(|(edge, point)| Vec2::new(edge, point))
    }

    /// `ΔE_c` in 0..1: the `HyAB` distance of two colours, compressed, with the large errors
    /// remapped to the last twentieth of the range.
    fn colour_difference(&self, reference: Vec3, test: Vec3) -> f32 {
        let error = hyab(reference, test).powf(COLOUR_EXPONENT);
        let knee = KNEE_INPUT * self.max_colour_error;
        if error < knee {
            error * (KNEE_OUTPUT / knee)
        } else {
            let beyond = (error - knee) / (self.max_colour_error - knee);
            KNEE_OUTPUT + (1.0 - KNEE_OUTPUT) * beyond
        }
    }
}

/// `ΔE_f = (max(|Δ edge|, |Δ point|) / √2)^q_f` in 0..1, with `q_f` = 1/2.
///
/// Each derivative is at most 1, so a norm is at most √2; `min` guards against rounding.
fn feature_difference(reference: Vec2, test: Vec2) -> f32 {
    let difference = (reference - test).abs().max_element();
    (FRAC_1_SQRT_2 * difference).sqrt().min(1.0)
}

/// `HyAB` distance of two colours: city block in lightness, Euclidean in chroma.
fn hyab(a: Vec3, b: Vec3) -> f32 {
    let difference = a - b;
    difference.x.abs() + Vec2::new(difference.y, difference.z).length()
}

/// CIELAB with chroma scaled by L*/100: colours look less colourful in the dark (Hunt effect).
fn hunt_lab_from_linear(linear: Vec3) -> Vec3 {
    const DELTA: f32 = 6.0 / 29.0;
    let relative_xyz = RELATIVE_XYZ_FROM_LINEAR * linear;
    let [x, y, z] = relative_xyz.to_array().map(|ratio| {
        if ratio > DELTA.powi(3) {
            ratio.cbrt()
        } else {
            ratio / (3.0 * DELTA * DELTA) + 4.0 / 29.0
        }
    });
    let lightness = 116.0 * y - 16.0;
    Vec3::new(lightness, 5.0 * lightness * (x - y), 2.0 * lightness * (y - z))
}

/// Inverse of the sRGB transfer function, IEC 61966-2-1.
fn linear_from_srgb(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// Kernels `k_i` of each opponent channel such that `Σ k_i ⊗ k_i` is its sensitivity.
fn contrast_kernels(pixels_per_degree: f64) -> [Vec<Kernel>; 3] {
    // exp(−π² d²/b) has the standard deviation √(b / 2π²); three of the widest set the radius.
    let widest = CONTRAST_SENSITIVITY.iter().copied().flatten().map(|term| term.1);
    let sigma = (widest.fold(0.0, f64::max) / 2.0).sqrt() / PI;
    let radius = (3.0 * sigma * pixels_per_degree).ceil() as i32;

    CONTRAST_SENSITIVITY.map(|terms| {
        let kernels: Vec<Vec<f64>> = terms
            .iter()
            .map(|&(a, b)| {
                let peak = (a * (PI / b).sqrt()).sqrt();
                let decay = (PI / pixels_per_degree).powi(2) / b;
                (-radius..=radius).map(|x| peak * (-decay * f64::from(x * x)).exp()).collect()
            })
            .collect();
        // The products k_i ⊗ k_i sum to (Σ k_i)² each, and must together sum to one.
        let norm = kernels.iter().map(|k| k.iter().sum::<f64>().powi(2)).sum::<f64>().sqrt();
        kernels.iter().map(|k| k.iter().map(|weight| (weight / norm) as f32).collect()).collect()
    })
}

/// The Gaussian of the feature detectors and its first and second derivatives.
fn feature_kernels(pixels_per_degree: f64) -> [Kernel; 3] {
    let sigma = 0.5 * FEATURE_WIDTH_IN_DEGREES * pixels_per_degree;
    let radius = (3.0 * sigma).ceil() as i32;
    let kernel = |weight: &dyn Fn(f64) -> f64| -> Kernel {
        let taps = (-radius..=radius).map(f64::from);
        let weights: Vec<f64> =
            taps.map(|x| weight(x) * (-0.5 * (x / sigma).powi(2)).exp()).collect();
        // Positive weights sum to 1 and negative ones to −1, so features are at most 1.
        let positive: f64 = weights.iter().filter(|&&w| w > 0.0).sum();
        let negative: f64 = weights.iter().filter(|&&w| w < 0.0).sum();
        let scale = |w: f64| if w < 0.0 { -w / negative } else { w / positive };
        weights.into_iter().map(|w| scale(w) as f32).collect()
    };
    [kernel(&|_| 1.0), kernel(&|x| -x), kernel(&|x| (x / sigma).powi(2) - 1.0)]
}
