//! Weighted sums over a particle's neighbourhood.

use glam::{DMat3, DVec3, Vec3Swizzles as _};

/// Yu and Turk's weight 1 − (d/h)³ of a neighbour, from the square of d/h.
///
/// It serves the density as well. The cubic spline of SPH, peaked as it is, gives a lone particle a
/// third of the density at rest, and three touching ones more than a sheet stretched by half; this
/// weight nearly counts, and keeps the two apart.
pub(super) fn weight(square: f64) -> f64 {
    (1.0 - square * square.sqrt()).max(0.0)
}

/// The summed weight inside a body at rest: a cubic lattice of spacing 2 r.
pub(super) fn density_at_rest(support: f64) -> f64 {
    let reach = (support / 2.0) as i32;
    let cells = || (-reach..=reach).map(f64::from);
    let lattice = cells().flat_map(|x| cells().flat_map(move |y| cells().map(move |z| (x, y, z))));
    lattice
        .map(|(x, y, z)| weight(DVec3::new(x, y, z).length_squared() * 4.0 / support.powi(2)))
        .sum()
}

/// A neighbour's distance may be so many h: on a lattice of particles many are at h itself, where they
/// weigh nothing, and whether they are counted is not to depend on rounding.
pub(super) const EDGE: f64 = 1.0 + 1e-5;

/// Share of the density at rest from which a particle may have liquid all round, and how far off, in h,
/// its neighbours' mean may be.
const DENSITY_AROUND: f64 = 0.85;
const OFFSET_AROUND: f64 = 0.06;

/// Weighted sums over a neighbourhood, relative to the particle and in units of h.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments {
    /// Particles within h, or [`EDGE`] beyond it: itself and its neighbours.
    pub(super) count: u32,
    /// Σ w, times the particles' volumes in that of the one in the middle.
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

    /// Whether neighbours are on all sides, as many as inside a body whose weight is `at_rest`: what
    /// is drawn of the particle lies behind what is drawn of them.
    pub(super) fn surrounds(&self, at_rest: f64) -> bool {
        self.weight >= DENSITY_AROUND * at_rest && self.mean().length() <= OFFSET_AROUND
    }

    /// Where the neighbours are in the mean, in h.
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

/// The symmetric matrix of these entries, xy, xz and yz off its diagonal.
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

    /// Protects what the device takes for the inside of a body: its constants are these.
    #[test]
    fn constants_are_those_of_the_shader() {
        let shader = |name| crate::gpu::shader::constant("classify/shape.wgsl", name);
        assert_eq!(shader("DENSITY_AROUND"), DENSITY_AROUND);
        assert_eq!(shader("OFFSET_AROUND"), OFFSET_AROUND);
    }
}
