//! Environment radiance, seen by rays that hit nothing else.

use std::sync::Arc;

use glam::{UVec2, Vec3};

/// Radiance by direction, linear RGB.
#[derive(Debug, Clone)]
pub enum Environment {
    /// The same in all directions.
    Constant(Vec3),
    /// Linear in the sine of the elevation, from the horizon up and down.
    Gradient {
        /// Radiance straight up.
        zenith: Vec3,
        /// Radiance at the horizon.
        horizon: Vec3,
        /// Radiance straight down.
        nadir: Vec3,
    },
    /// A gradient that is steeper at the horizon, with up to two glows, such as the sun and its aureole.
    Sky {
        /// Radiance straight up, without the glows.
        zenith: Vec3,
        /// Radiance at the horizon, without the glows.
        horizon: Vec3,
        /// Radiance straight down, without the glows.
        nadir: Vec3,
        /// Lobes that are added.
        glows: [Glow; 2],
    },
    /// An equirectangular map: its centre is −z, its top row +y.
    Map {
        /// Width and height, pixels.
        size: UVec2,
        /// Rows from the top, linear RGB with alpha 1.
        pixels: Arc<[[f32; 4]]>,
    },
}

/// A lobe of radiance around a direction: radiance · exp(sharpness · (cos θ − 1)) at the angle θ (a
/// spherical Gaussian: Wang, Ren, Gong, Snyder and Guo, All-Frequency Rendering of Dynamic, Spatially-Varying
/// Reflectance, 2009, equation 3).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glow {
    /// Unit direction towards its centre.
    pub direction: Vec3,
    /// Radiance at its centre.
    pub radiance: Vec3,
    /// 0 to 1e6: uniform at 0; half as bright at about 67°/√sharpness from the centre.
    pub sharpness: f32,
}

impl Glow {
    /// No light.
    pub const NONE: Self = Self { direction: Vec3::Y, radiance: Vec3::ZERO, sharpness: 1.0 };

    /// Mean radiance over all directions.
    fn mean(&self) -> Vec3 {
        let k = f64::from(self.sharpness);
        let share = if k < 1e-6 { 1.0 } else { -(-2.0 * k).exp_m1() / (2.0 * k) };
        share as f32 * self.radiance
    }

    fn is_drawable(&self) -> bool {
        self.direction.is_normalized()
            && is_radiance(self.radiance)
            && (0.0..=1e6).contains(&self.sharpness)
    }
}

/// Transmission of uniform sky light through level liquid as a function of depth: a sum over two
/// paths, each with a share of the light and a length per metre of depth.
///
/// At depth h the transmitted share is ∫₀¹ (1 − F) t(h/μ) ds, where s is the squared sine of the angle
/// in air, F the reflectance at that angle, μ = √(1 − s/n²) the cosine in the liquid and t the
/// transmittance. The paths are the two-point Gaussian quadrature for the weight 1 − F (G. H. Golub and
/// J. H. Welsch, Calculation of Gauss Quadrature Rules, 1969): exact at the surface, and for n from 1.2
/// to 3 within 0.1 % down to two absorption lengths, 0.3 % down to eight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EvenLight {
    /// Share of the incident light that takes each path.
    pub shares: [f32; 2],
    /// Length of each path, metres per metre of depth.
    pub paths: [f32; 2],
}

impl EvenLight {
    /// Computes the paths below the surface of liquid with index `ior` relative to the medium above.
    pub fn below(ior: f32) -> Self {
        /// Integration steps: enough for the paths to be exact to the last bit of a 32-bit float.
        const STEPS: u32 = 512;
        let n2 = f64::from(ior).powi(2);
        // Moments of the weight, integrated over the cosine c in air, in which the reflectance is
        // smooth: s = 1 − c².
        let mut moments = [0.0; 4];
        for step in 0..STEPS {
            let c = (f64::from(step) + 0.5) / f64::from(STEPS);
            let s = 1.0 - c * c;
            if s < n2 {
                let weight = 2.0 * c / f64::from(STEPS) * (1.0 - reflectance(c, n2));
                for (moment, power) in moments.iter_mut().zip([1.0, s, s * s, s * s * s]) {
                    *moment += weight * power;
                }
            }
        }
        // Nodes: the roots of the quadratic that is orthogonal to 1 and s.
        let [m0, m1, m2, m3] = moments;
        let determinant = m0 * m2 - m1 * m1;
        let (half, product) =
            ((m0 * m3 - m1 * m2) / (2.0 * determinant), (m1 * m3 - m2 * m2) / determinant);
        let spread = (half * half - product).sqrt();
        let (near, far) = (half - spread, half + spread);
        let share = (m1 - m0 * near) / (far - near);
        let path = |s: f64| (1.0 - s / n2).sqrt().recip() as f32;
        Self { shares: [(m0 - share) as f32, share as f32], paths: [path(near), path(far)] }
    }
}

/// Unpolarised Fresnel reflectance for light from air, from the cosine and the squared index.
fn reflectance(cos_i: f64, n2: f64) -> f64 {
    let q = (n2 - 1.0 + cos_i * cos_i).sqrt();
    let perpendicular = (cos_i - q) / (cos_i + q);
    let parallel = (n2 * cos_i - q) / (n2 * cos_i + q);
    0.5 * (perpendicular * perpendicular + parallel * parallel)
}

impl PartialEq for Environment {
    /// Compares maps by pointer first, which usually avoids comparing pixels.
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Constant(a), Self::Constant(b)) => a == b,
            (
                Self::Gradient { zenith, horizon, nadir },
                Self::Gradient { zenith: z, horizon: h, nadir: n },
            ) => (zenith, horizon, nadir) == (z, h, n),
            (Self::Map { size, pixels }, Self::Map { size: of_other, pixels: others }) => {
                size == of_other && (Arc::ptr_eq(pixels, others) || pixels == others)
            }
            (
                Self::Sky { zenith, horizon, nadir, glows },
                Self::Sky { zenith: z, horizon: h, nadir: n, glows: g },
            ) => (zenith, horizon, nadir, glows) == (z, h, n, g),
            _ => false,
        }
    }
}

impl Default for Environment {
    fn default() -> Self {
        Self::Constant(Vec3::new(0.55, 0.70, 0.90))
    }
}

/// Largest supported radiance, W/(m² sr) per channel; also the largest irradiance, W/m², and intensity,
/// W/sr. The sun's radiance is 2·10⁷. Sums and products of several such values do not overflow 32-bit
/// floats, even at the highest exposure.
pub const MAX_RADIANCE: f32 = 1e12;

/// Whether each channel is within 0 to [`MAX_RADIANCE`].
#[doc(hidden)]
pub fn is_radiance(c: Vec3) -> bool {
    c.to_array().iter().all(|c| (0.0..=MAX_RADIANCE).contains(c))
}

impl Environment {
    /// Multiplies the radiance by `scale`.
    #[must_use]
    pub fn scaled(self, scale: f32) -> Self {
        if scale == 1.0 {
            return self;
        }
        match self {
            Self::Constant(c) => Self::Constant(scale * c),
            Self::Gradient { zenith, horizon, nadir } => Self::Gradient {
                zenith: scale * zenith,
                horizon: scale * horizon,
                nadir: scale * nadir,
            },
            Self::Sky { zenith, horizon, nadir, glows } => Self::Sky {
                zenith: scale * zenith,
                horizon: scale * horizon,
                nadir: scale * nadir,
                glows: glows.map(|glow| Glow { radiance: scale * glow.radiance, ..glow }),
            },
            Self::Map { size, pixels } => Self::Map {
                size,
                pixels: {
                    // Copies only if shared, which a scene that is being loaded never is.
                    let mut pixels = pixels;
                    for p in Arc::make_mut(&mut pixels) {
                        *p = [scale * p[0], scale * p[1], scale * p[2], 1.0];
                    }
                    pixels
                },
            },
        }
    }

    /// Turns the glows that point in the direction of the first one, the sun, towards `direction`, a unit
    /// vector. Other environments do not change.
    pub fn turn_sun(&mut self, direction: Vec3) {
        if let Self::Sky { glows, .. } = self {
            let sun = glows[0].direction;
            for glow in glows.iter_mut().filter(|glow| glow.direction == sun) {
                glow.direction = direction.normalize_or(sun);
            }
        }
    }

    /// Whether every radiance is within 0 to [`MAX_RADIANCE`], and every glow a lobe.
    pub fn is_drawable(&self) -> bool {
        match self {
            Self::Constant(c) => is_radiance(*c),
            Self::Gradient { zenith, horizon, nadir } => {
                [zenith, horizon, nadir].into_iter().all(|c| is_radiance(*c))
            }
            Self::Sky { zenith, horizon, nadir, glows } => {
                [zenith, horizon, nadir].into_iter().all(|c| is_radiance(*c))
                    && glows.iter().all(Glow::is_drawable)
            }
            // Checked on loading; scanning every pixel in each frame would be slow.
            Self::Map { .. } => true,
        }
    }

    /// Mean radiance over all directions: the irradiance of an evenly lit surface over π.
    pub fn mean(&self) -> Vec3 {
        match self {
            Self::Constant(c) => *c,
            // |sin elevation| is uniform in solid angle, so its mean is 1/2.
            Self::Gradient { zenith, horizon, nadir } => 0.5 * *horizon + 0.25 * (*zenith + *nadir),
            // The mean of s (2 − s) for s uniform in 0 to 1 is 2/3.
            Self::Sky { zenith, horizon, nadir, glows } => {
                let gradient = (*horizon + *zenith + *nadir) / 3.0;
                glows.iter().fold(gradient, |sum, glow| sum + glow.mean())
            }
            Self::Map { size, pixels } => {
                let mut sum = glam::DVec3::ZERO;
                let mut solid_angle = 0.0;
                for (i, row) in pixels.chunks_exact(size.x as usize).enumerate() {
                    let latitude = (i as f64 + 0.5) / f64::from(size.y) * std::f64::consts::PI;
                    for p in row {
                        sum += latitude.sin() * Vec3::new(p[0], p[1], p[2]).as_dvec3();
                        solid_angle += latitude.sin();
                    }
                }
                (sum / solid_angle).as_vec3()
            }
        }
    }
}
