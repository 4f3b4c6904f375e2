//! SPH kernels, normalised to the rest density.

use glam::Vec3;

/// Support radius in particle radii: about 28 neighbours.
const SUPPORT: f32 = 3.8;

/// The spiky kernel for the constraints, and poly6 for reported densities, viscosity and cohesion
/// (Müller, Charypar and Gross, Particle-based fluid simulation for interactive applications, 2003).
///
/// Densities are relative to the rest density, which is a particle's kernel sum over a cubic lattice
/// whose spacing is the particle's diameter. The kernels' integrals would be off by a few percent.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kernel {
    /// Support radius, m.
    pub h: f32,
    /// Distance between neighbours at rest, m.
    pub spacing: f32,
    /// Sum of squared gradients on the rest lattice, 1/m².
    pub stiffness: f32,
    spiky: f32,
    poly6: f32,
    /// Ratio of the lattice sum beyond a wall to the integral, of each kernel.
    spiky_wall: f32,
    poly6_wall: f32,
}

impl Kernel {
    pub(super) fn new(radius: f32) -> Self {
        let (h, spacing) = (SUPPORT * radius, 2.0 * radius);
        let mut kernel = Self {
            h,
            spacing,
            stiffness: 0.0,
            spiky: 1.0,
            poly6: 1.0,
            spiky_wall: 1.0,
            poly6_wall: 1.0,
        };
        let reach = (0.5 * SUPPORT).ceil() as i32;
        let along = || (-reach..=reach).map(|i| i as f32 * spacing);
        let lattice: Vec<Vec3> = along()
            .flat_map(|x| along().flat_map(move |y| along().map(move |z| Vec3::new(x, y, z))))
            .collect();
        kernel.spiky = 1.0 / lattice.iter().map(|x| kernel.share(x.length())).sum::<f32>();
        kernel.poly6 = 1.0 / lattice.iter().map(|x| kernel.weight(x.length_squared())).sum::<f32>();
        let squares = lattice.iter().map(|x| kernel.slope(x.length()).powi(2));
        kernel.stiffness = squares.sum::<f32>() - kernel.slope(0.0).powi(2);
        // The half of the lattice beyond a wall at a distance of one radius.
        let beyond = || lattice.iter().filter(|x| x.y < -0.5 * spacing);
        let missing: f32 = beyond().map(|x| kernel.share(x.length())).sum();
        let reported: f32 = beyond().map(|x| kernel.weight(x.length_squared())).sum();
        kernel.spiky_wall = missing / kernel.wall_share(radius);
        kernel.poly6_wall = reported / kernel.wall_weight(radius);
        kernel
    }

    /// Contribution of a neighbour to the density constraint (spiky).
    #[inline]
    pub(super) fn share(&self, distance: f32) -> f32 {
        let t = (1.0 - distance / self.h).max(0.0);
        self.spiky * t * t * t
    }

    /// Negative derivative of [`Kernel::share`], 1/m.
    #[inline]
    pub(super) fn slope(&self, distance: f32) -> f32 {
        let t = (1.0 - distance / self.h).max(0.0);
        3.0 * self.spiky / self.h * t * t
    }

    /// Contribution of a neighbour to the reported density (poly6), by its squared distance.
    #[inline]
    pub(super) fn weight(&self, square: f32) -> f32 {
        let t = (1.0 - square / (self.h * self.h)).max(0.0);
        self.poly6 * t * t * t
    }

    /// Contribution to the density constraint of liquid at rest beyond a plane at `distance`: the
    /// integral of spiky over a half-space.
    pub(super) fn wall_share(&self, distance: f32) -> f32 {
        let t = 1.0 - (distance / self.h).clamp(0.0, 1.0);
        self.spiky_wall * t.powi(5) * (1.5 - t)
    }

    /// Negative derivative of [`Kernel::wall_share`], 1/m.
    pub(super) fn wall_slope(&self, distance: f32) -> f32 {
        let t = 1.0 - (distance / self.h).clamp(0.0, 1.0);
        self.spiky_wall / self.h * t.powi(4) * (7.5 - 6.0 * t)
    }

    /// As [`Kernel::wall_share`], for the reported density: the integral of poly6.
    pub(super) fn wall_weight(&self, distance: f32) -> f32 {
        let u = (distance / self.h).clamp(0.0, 1.0);
        let u2 = u * u;
        let polynomial = 1.0 - u2 * (4.0 / 3.0 - u2 * (6.0 / 5.0 - u2 * (4.0 / 7.0 - u2 / 9.0)));
        self.poly6_wall * (0.5 - 315.0 / 256.0 * u * polynomial)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rest lattice has density 1, also beside a wall, at any radius, and slopes are derivatives.
    /// Volume conservation and the stillness of a settled tank depend on both.
    #[test]
    fn a_lattice_at_rest_has_density_one() {
        for radius in [0.003, 0.02, 1.0] {
            let kernel = Kernel::new(radius);
            let d = kernel.spacing;
            let sum = |reach: std::ops::RangeInclusive<i32>, add: &dyn Fn(Vec3) -> f32| {
                let mut total = 0.0;
                for x in -3..=3 {
                    for z in -3..=3 {
                        for y in reach.clone() {
                            total += add(d * Vec3::new(x as f32, y as f32, z as f32));
                        }
                    }
                }
                total
            };
            let density = |x: Vec3| kernel.share(x.length());
            let reported = |x: Vec3| kernel.weight(x.length_squared());
            assert!((sum(-3..=3, &density) - 1.0).abs() < 1e-5);
            assert!((sum(-3..=3, &reported) - 1.0).abs() < 1e-5);
            let reported = sum(0..=3, &reported) + kernel.wall_weight(radius);
            assert!((reported - 1.0).abs() < 1e-4, "{reported}");
            let beside_wall = sum(0..=3, &density) + kernel.wall_share(radius);
            assert!((beside_wall - 1.0).abs() < 1e-4, "{beside_wall}");
            // Slopes are derivatives: forces have a potential.
            let step = 1e-2 * radius;
            for at in [0.3 * d, 0.8 * d, 1.5 * d] {
                let fall = kernel.share(at - step) - kernel.share(at + step);
                assert!((fall / (2.0 * step) / kernel.slope(at) - 1.0).abs() < 2e-3);
                let fall = kernel.wall_share(at - step) - kernel.wall_share(at + step);
                assert!((fall / (2.0 * step) / kernel.wall_slope(at) - 1.0).abs() < 5e-3);
            }
            assert_eq!(kernel.wall_share(kernel.h), 0.0);
        }
    }
}
