//! Weighted moments of a particle's neighbourhood.

use glam::{DMat3, DVec3, Vec3Swizzles as _};

/// Yu and Turk's weight 1 − (d/h)³ of a neighbour, from the square of d/h.
///
/// The density uses it too. The cubic spline of SPH is so peaked that it gives a lone particle a third
/// of the density at rest, and three touching particles more than a sheet stretched by half. This
/// flatter weight almost counts neighbours and separates these cases.
pub(super) fn weight(square: f64) -> f64 {
    (1.0 - square * square.sqrt()).max(0.0)
}

/// Summed weight inside a body at rest: a cubic lattice of spacing 2 r.
pub(super) fn density_at_rest(support: f64) -> f64 {
    let reach = (support / 2.0) as i32;
    let cells = || (-reach..=reach).map(f64::from);
    let lattice = cells().flat_map(|x| cells().flat_map(move |y| cells().map(move |z| (x, y, z))));
    lattice
        .map(|(x, y, z)| weight(DVec3::new(x, y, z).length_squared() * 4.0 / support.powi(2)))
        .sum()
}

/// Largest distance of a neighbour, in h. On a lattice many neighbours are at distance h, where their
/// weight is 0; the margin makes their count independent of rounding.
pub(super) const EDGE: f64 = 1.0 + 1e-5;

/// Smallest density, as a share of that at rest, of a particle surrounded by liquid.
const DENSITY_AROUND: f64 = 0.85;
/// Largest offset of the neighbours' mean, in h, of a particle surrounded by liquid.
const OFFSET_AROUND: f64 = 0.06;

/// Weighted sums over a neighbourhood, relative to the particle and in units of h.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments {
    /// Number of particles within [`EDGE`] h, including the central one.
    pub(super) count: u32,
    /// Σ w, where w includes the neighbour's volume relative to the central particle's.
    pub(super) weight: f64,
    /// Σ w x.
    pub(super) first: DVec3,
    /// Σ w x², y², z².
    pub(super) diagonal: DVec3,
    /// Σ w xy, xz, yz.
    pub(super) off_diagonal: DVec3,
}

impl Moments {
    pub(super) fn add(&mut self, offset: DVec3, volume: f64) {
        let w = volume * weight(offset.length_squared());
        self.count += 1;
        self.weight += w;
        self.first += w * offset;
        self.diagonal += w * offset * offset;
        self.off_diagonal += w * offset.xxy() * offset.yzz();
    }

    /// Whether the particle is surrounded by neighbours as inside a body whose weight is `at_rest`, so
    /// that their splats hide its own.
    pub(super) fn surrounds(&self, at_rest: f64) -> bool {
        self.weight >= DENSITY_AROUND * at_rest && self.mean().length() <= OFFSET_AROUND
    }

    /// Mean of the neighbours, in h.
    pub(super) fn mean(&self) -> DVec3 {
        self.first / self.weight
    }

    /// Covariance about the mean, in h².
    pub(super) fn covariance(&self) -> DMat3 {
        let mean = self.mean();
        symmetric(
            self.diagonal / self.weight - mean * mean,
            self.off_diagonal / self.weight - mean.xxy() * mean.yzz(),
        )
    }
}

/// Builds a symmetric matrix from its diagonal and its entries xy, xz and yz.
pub(super) fn symmetric(diagonal: DVec3, off_diagonal: DVec3) -> DMat3 {
    let [xy, xz, yz] = off_diagonal.to_array();
    DMat3::from_cols(
        DVec3::new(diagonal.x, xy, xz),
        DVec3::new(xy, diagonal.y, yz),
        DVec3::new(xz, yz, diagonal.z),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The thresholds for surrounded particles are the same in Rust and WGSL.
    #[test]
    fn constants_match_the_shader() {
        let shader = |name| crate::gpu::shader::constant("classify/shape.wgsl", name);
        assert_eq!(shader("DENSITY_AROUND"), DENSITY_AROUND);
        assert_eq!(shader("OFFSET_AROUND"), OFFSET_AROUND);
    }
}
