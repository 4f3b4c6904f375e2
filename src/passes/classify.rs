//! Splash or aggregate, and the ellipsoid each particle is drawn as.
//!
//! Aggregates get the anisotropic kernels of J. Yu and G. Turk, "Reconstructing Surfaces of
//! Particle-Based Fluids Using Anisotropic Kernels", ACM Transactions on Graphics 32(1), 2013;
//! the separation by local density follows T. Imai, Y. Kanamori and J. Mitani, "Real-time
//! screen-space liquid rendering with complex refractions", Computer Animation and Virtual Worlds
//! 27, 2016. Three things differ. The density is a share of that inside a body at rest, so that
//! the threshold does not depend on the support. Neighbours count by their volume, for files whose
//! particles differ in size. And by default the *short* axis is held ([`Kernel::Fitted`]): the
//! papers' volume-preserving ellipsoids sink the surface by a particle.

use std::num::NonZero;

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3, Vec3, Vec3Swizzles as _};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::iter::Either;
use rayon::prelude::*;

use crate::particles::{self, Ellipsoid, Particles};
use crate::scene::Solid;
use crate::settings::{Classify, Kernel};

/// One splat as the GPU reads it: the ellipsoid { centre + A·s : |s| ≤ 1 }.
///
/// A is symmetric positive definite. A rotation of the unit sphere changes nothing, so R·diag(axes)
/// may be followed by Rᵀ, and six numbers say what nine would.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Splat {
    /// Centre, in metres, from [`Splats::origin`].
    pub centre: [f32; 3],
    /// Radius r of the particle, in metres.
    pub radius: f32,
    /// `A_xx, A_yy, A_zz`, in metres.
    pub diagonal: [f32; 3],
    /// Index of the particle in its file.
    pub particle: u32,
    /// `A_xy, A_xz, A_yz`, in metres.
    pub off_diagonal: [f32; 3],
    /// Which of a scene's fluids it is of, from 0.
    pub fluid: u32,
}

/// What a frame is drawn from. Both lists are in the order of the file; the copies that [`wet`]
/// makes follow.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Splats {
    /// Ellipsoids of the liquid's bodies and sheets.
    pub aggregates: Vec<Splat>,
    /// Spheres of droplets.
    pub splashes: Vec<Splat>,
    /// Median particle radius, in metres.
    pub radius: f32,
    /// The point that centres are counted from, in world space, in metres: that of the particles,
    /// or where these are far from it their middle, so that 32-bit floats keep their digits.
    pub origin: DVec3,
}

/// Separates a frame's particles into splashes and aggregates, and shapes them.
///
/// Aggregates with [a shape of their own](Particles::ellipsoids) are drawn as it says, where the
/// file has them; splashes are spheres all the same.
///
/// `default_radius` serves files without radii. Particles that cannot be drawn are left out: a
/// radius that is not positive, or whose cube a 32-bit float cannot hold (10⁻¹³ to 10¹² m are
/// fine), or a position that is not finite. The result depends on the particles and the settings
/// alone, not on the number of threads.
pub fn classify(particles: &Particles, default_radius: f32, settings: &Classify) -> Splats {
    let cloud = Cloud::new(particles, default_radius);
    let at_rest = density_at_rest(settings.support.into());
    let shift = particles::origin_for(cloud.members.iter().map(|m| m.position.as_dvec3()));
    let given = |member: &Member| {
        let ellipsoids = particles.ellipsoids.as_ref()?;
        ellipsoids.get(member.particle as usize).filter(|ellipsoid| ellipsoid.drawable())
    };
    let (splashes, aggregates) = cloud.members.par_iter().partition_map(|member| {
        let near = cloud.moments(member, settings.support.into());
        if near.weight < f64::from(settings.splash_density) * at_rest {
            Either::Left(member.splash(settings, shift))
        } else if let Some(ellipsoid) = given(member) {
            Either::Right(member.given(ellipsoid, shift))
        } else {
            Either::Right(member.aggregate(&near, settings, shift))
        }
    });
    let origin = particles.origin + shift;
    Splats { aggregates, splashes, radius: cloud.median_radius(default_radius), origin }
}

/// Lets aggregates wet the solids they rest on: a splat whose centre is within `reach` radii of a
/// solid is drawn a second time, moved along the solid's normal onto its surface.
///
/// SPH boundaries hold liquid a particle's spacing off a wall. Without the copies a gap shows
/// between the two, and in it light is totally reflected that in a real tank never meets air.
pub fn wet(splats: &mut Splats, solids: &[Solid], reach: f32) {
    let origin = splats.origin;
    let touching = |splat: &Splat, solid: &Solid| {
        let centre = Vec3::from_array(splat.centre).as_dvec3();
        let (distance, normal) = solid.shape.distance(origin + centre);
        let near = distance > 0.0 && distance <= f64::from(reach * splat.radius);
        let moved = centre - distance * normal;
        near.then(|| Splat { centre: moved.as_vec3().to_array(), ..*splat })
    };
    let aggregates = &splats.aggregates;
    let copies: Vec<_> = aggregates
        .par_iter()
        .flat_map_iter(|splat| solids.iter().filter_map(move |solid| touching(splat, solid)))
        .collect();
    splats.aggregates.extend(copies);
}

/// A radius for files that have none: half the median distance to the nearest neighbour, over at
/// most 2,000 particles spread through the file. 0 without two distinct particles.
pub fn estimate_radius(particles: &Particles) -> f32 {
    // Radii do not matter here, but a particle without a usable one would be left out.
    let cloud = Cloud::new(&Particles::from_positions(particles.positions.clone()), 1.0);
    let step = cloud.members.len().div_ceil(2000).max(1);
    let mut distances: Vec<f64> = cloud
        .members
        .iter()
        .step_by(step)
        .filter_map(|member| {
            let two = NonZero::new(2)?;
            let query = member.position.to_array();
            // The nearest is the particle itself.
            let nearest =
                cloud.tree.query(&query).nearest_n::<SquaredEuclidean<f64>>(two).execute();
            nearest.get(1).map(|found| found.distance.sqrt())
        })
        .filter(|&distance| distance > 0.0)
        .collect();
    if distances.is_empty() {
        return 0.0;
    }
    let middle = distances.len() / 2;
    (0.5 * *distances.select_nth_unstable_by(middle, f64::total_cmp).1) as f32
}

/// A particle that can be drawn.
struct Member {
    position: Vec3,
    radius: f32,
    particle: u32,
    fluid: u32,
}

/// The drawable particles of a frame, and the tree that finds neighbours among them.
struct Cloud {
    members: Vec<Member>,
    tree: ImmutableKdTree<f32, 3>,
}

impl Cloud {
    fn new(particles: &Particles, default_radius: f32) -> Self {
        let radius = |i: usize| particles.radii.as_ref().map_or(default_radius, |radii| radii[i]);
        let fluid = |i: usize| particles.fluids.as_ref().map_or(0, |fluids| fluids[i].into());
        let members: Vec<_> = (0u32..)
            .zip(&particles.positions)
            .map(|(particle, &position)| Member {
                position,
                radius: radius(particle as usize),
                particle,
                fluid: fluid(particle as usize),
            })
            .filter(|m| m.position.is_finite() && m.radius > 0.0 && m.radius.powi(3).is_normal())
            .collect();
        let points: Vec<_> = members.iter().map(|m| m.position.to_array()).collect();
        let tree = ImmutableKdTree::new_from_slice(&points)
            .expect("particles are counted in 32 bits, as the tree's items are");
        Self { members, tree }
    }

    /// Gathers the neighbourhood of a particle, itself included. 64-bit distances take no time that
    /// can be measured, and do not overflow however far a stray particle has flown.
    fn moments(&self, member: &Member, support: f64) -> Moments {
        let h = support * f64::from(member.radius);
        let per_h = 1.0 / h;
        let centre = member.position.as_dvec3();
        let mut moments = Moments::default();
        self.tree
            .query(&member.position.to_array())
            .within::<SquaredEuclidean<f64>>(h * h)
            .unsorted()
            .visit(|found| {
                let other = &self.members[found.item as usize];
                let volume = f64::from(other.radius / member.radius).powi(3);
                moments.add((other.position.as_dvec3() - centre) * per_h, volume);
            });
        moments
    }

    fn median_radius(&self, default: f32) -> f32 {
        let mut radii: Vec<_> = self.members.iter().map(|m| m.radius).collect();
        let middle = radii.len() / 2;
        if radii.is_empty() {
            return default;
        }
        *radii.select_nth_unstable_by(middle, f32::total_cmp).1
    }
}

/// Yu and Turk's weight 1 − (d/h)³ of a neighbour, from the square of d/h.
///
/// It serves the density as well. The cubic spline of SPH, peaked as it is, gives a lone particle a
/// third of the density at rest, and three touching ones more than a sheet stretched by half; this
/// weight nearly counts, and keeps the two apart.
fn weight(square: f64) -> f64 {
    (1.0 - square * square.sqrt()).max(0.0)
}

/// The summed weight inside a body at rest: a cubic lattice of spacing 2 r.
fn density_at_rest(support: f64) -> f64 {
    let reach = (support / 2.0) as i32;
    let cells = || (-reach..=reach).map(f64::from);
    let lattice = cells().flat_map(|x| cells().flat_map(move |y| cells().map(move |z| (x, y, z))));
    lattice
        .map(|(x, y, z)| weight(DVec3::new(x, y, z).length_squared() * 4.0 / support.powi(2)))
        .sum()
}

/// Weighted sums over a neighbourhood, relative to the particle and in units of h.
#[derive(Default)]
struct Moments {
    count: u32,
    weight: f64,
    first: DVec3,
    diagonal: DVec3,
    off_diagonal: DVec3,
}

impl Moments {
    fn add(&mut self, offset: DVec3, volume: f64) {
        let w = volume * weight(offset.length_squared());
        self.count += 1;
        self.weight += w;
        self.first += w * offset;
        self.diagonal += w * offset * offset;
        self.off_diagonal += w * offset.xxy() * offset.yzz();
    }

    fn mean(&self) -> DVec3 {
        self.first / self.weight
    }

    /// Covariance about the mean.
    fn covariance(&self) -> DMat3 {
        let mean = self.mean();
        symmetric(
            self.diagonal / self.weight - mean * mean,
            self.off_diagonal / self.weight - mean.xxy() * mean.yzz(),
        )
    }
}

impl Member {
    fn splash(&self, settings: &Classify, shift: DVec3) -> Splat {
        let radius = f64::from(settings.splash_radius * self.radius);
        self.splat(self.position.as_dvec3() - shift, DMat3::from_diagonal(DVec3::splat(radius)))
    }

    fn aggregate(&self, near: &Moments, settings: &Classify, shift: DVec3) -> Splat {
        let r = f64::from(self.radius);
        let h = f64::from(settings.support) * r;
        let centre = self.position.as_dvec3() + f64::from(settings.smoothing) * h * near.mean();

        let (spread, directions) = eigen(near.covariance());
        let axes = r * semi_axes(spread, near.count - 1, settings);
        let ellipsoid = directions * DMat3::from_diagonal(axes) * directions.transpose();
        self.splat(centre - shift, ellipsoid)
    }

    fn given(&self, ellipsoid: &Ellipsoid, shift: DVec3) -> Splat {
        let ellipsoid = f64::from(self.radius) * ellipsoid.matrix();
        self.splat(self.position.as_dvec3() - shift, ellipsoid)
    }

    fn splat(&self, centre: DVec3, ellipsoid: DMat3) -> Splat {
        let [x, y, z] = [ellipsoid.x_axis, ellipsoid.y_axis, ellipsoid.z_axis];
        Splat {
            centre: centre.as_vec3().to_array(),
            radius: self.radius,
            diagonal: DVec3::new(x.x, y.y, z.z).as_vec3().to_array(),
            particle: self.particle,
            off_diagonal: DVec3::new(y.x, z.x, z.y).as_vec3().to_array(),
            fluid: self.fluid,
        }
    }
}

/// Neighbours spread by less than this, in h, are one point and rounding errors.
const COINCIDENT: f64 = 1e-4;

/// Below this many neighbours the papers draw a sphere.
const FEW_NEIGHBOURS: u32 = 25;

/// Longest semi-axis of a volume-preserving kernel, in r (Imai et al. 2016).
const VOLUME_CAP: f64 = 1.2;

/// Semi-axes in r, from the eigenvalues of the covariance in h².
///
/// The eigenvalues themselves, not their roots, are the relative axes, as in Yu and Turk 2013. The
/// clamp from below is what keeps sheets, lines and points finite.
fn semi_axes(spread: DVec3, neighbours: u32, settings: &Classify) -> DVec3 {
    let longest = spread.max_element();
    let relative = if longest > COINCIDENT * COINCIDENT {
        spread.max(DVec3::splat(longest / f64::from(settings.max_ratio).max(1.0))) / longest
    } else {
        DVec3::ONE
    };
    match settings.kernel {
        Kernel::Fitted => {
            let short = f64::from(settings.short_axis) / relative.min_element();
            (short * relative).min(DVec3::splat(settings.long_axis.into()))
        }
        Kernel::Volume if neighbours < FEW_NEIGHBOURS => DVec3::ONE,
        Kernel::Volume => {
            (relative / relative.element_product().cbrt()).min(DVec3::splat(VOLUME_CAP))
        }
    }
}

fn symmetric(diagonal: DVec3, off_diagonal: DVec3) -> DMat3 {
    let [xy, xz, yz] = off_diagonal.to_array();
    DMat3::from_cols(
        DVec3::new(diagonal.x, xy, xz),
        DVec3::new(xy, diagonal.y, yz),
        DVec3::new(xz, yz, diagonal.z),
    )
}

/// Eigenvalues of a symmetric matrix, unsorted, and the orthonormal eigenvectors as columns.
///
/// Cyclic Jacobi rotations: unlike the closed form through arc cosines they stay exact where
/// eigenvalues coincide, and in liquid nearly all of them do.
fn eigen(matrix: DMat3) -> (DVec3, DMat3) {
    /// Convergence is quadratic, six sweeps suffice for any input; the rest is margin.
    const SWEEPS: usize = 12;

    let mut a = matrix.to_cols_array_2d();
    let mut vectors = DMat3::IDENTITY.to_cols_array_2d();
    for _ in 0..SWEEPS {
        let scale = a[0][0].abs() + a[1][1].abs() + a[2][2].abs();
        if a[0][1].abs() + a[0][2].abs() + a[1][2].abs() <= f64::EPSILON * scale {
            break;
        }
        for (p, q, other) in [(0, 1, 2), (0, 2, 1), (1, 2, 0)] {
            if a[p][q] == 0.0 {
                continue;
            }
            // The smaller of the two angles that make a[p][q] vanish, as its tangent.
            let cotangent = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = cotangent.signum() / (cotangent.abs() + (cotangent * cotangent + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let rotate = |x: f64, y: f64| (c * (x - t * y), c * (t * x + y));

            a[p][p] -= t * a[p][q];
            a[q][q] += t * a[p][q];
            (a[p][q], a[q][p]) = (0.0, 0.0);
            (a[other][p], a[other][q]) = rotate(a[other][p], a[other][q]);
            (a[p][other], a[q][other]) = (a[other][p], a[other][q]);
            let (left, right) = (vectors[p], vectors[q]);
            for i in 0..3 {
                (vectors[p][i], vectors[q][i]) = rotate(left[i], right[i]);
            }
        }
    }
    (DVec3::new(a[0][0], a[1][1], a[2][2]), DMat3::from_cols_array_2d(&vectors))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform in −1 to 1, from a linear congruential generator (Knuth's MMIX).
    fn noise(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn difference(a: DMat3, b: DMat3) -> f64 {
        (a - b).to_cols_array().into_iter().fold(0.0, |most, x| x.abs().max(most))
    }

    /// The shapes rest on it: any symmetric matrix is the product of what `eigen` returns.
    #[test]
    fn eigen_recomposes_symmetric_matrices() {
        let mut seed = 1;
        let mut random = || DVec3::from_array([(); 3].map(|()| noise(&mut seed)));
        let mut matrices: Vec<_> = (0..1000).map(|_| symmetric(random(), random())).collect();
        // Where closed forms lose digits: equal, vanishing and nearly equal eigenvalues.
        for values in [[1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [1.0, 1.0 + 1e-9, 1e-17]]
        {
            let (_, turn) = eigen(symmetric(random(), random()));
            matrices.push(turn * DMat3::from_diagonal(values.into()) * turn.transpose());
            matrices.push(DMat3::from_diagonal(values.into()));
        }
        for matrix in matrices {
            let (values, vectors) = eigen(matrix);
            let recomposed = vectors * DMat3::from_diagonal(values) * vectors.transpose();
            assert!(difference(recomposed, matrix) < 1e-12, "{matrix}");
            assert!(
                difference(vectors.transpose() * vectors, DMat3::IDENTITY) < 1e-12,
                "{vectors}"
            );
        }
    }

    /// Coincident eigenvalues are told apart from a vanishing one to the last digits.
    #[test]
    fn eigenvalues_of_a_sheet_are_exact() {
        let (_, turn) = eigen(symmetric(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.3, 0.2, 0.1)));
        let sheet = turn * DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.0)) * turn.transpose();
        let mut values = eigen(sheet).0.to_array();
        values.sort_by(f64::total_cmp);
        for (value, exact) in values.into_iter().zip([0.0, 1.0, 1.0]) {
            assert!((value - exact).abs() < 1e-14, "{values:?}");
        }
    }

    /// The tree finds every neighbour, once, and the one-pass sums lose nothing: they equal the
    /// textbook's two passes over all pairs, with radii that differ.
    #[test]
    fn moments_equal_a_brute_force_reference() {
        let mut seed = 2;
        let positions: Vec<_> = (0..500)
            .map(|_| Vec3::from_array([(); 3].map(|()| noise(&mut seed) as f32 + 10.0)))
            .collect();
        let radii: Vec<_> = (0..500).map(|_| 0.1 + 0.02 * noise(&mut seed) as f32).collect();
        let support = 4.0;
        let cloud = Cloud::new(
            &Particles {
                positions: positions.clone(),
                radii: Some(radii.clone()),
                ..Default::default()
            },
            f32::NAN,
        );
        for (i, member) in cloud.members.iter().enumerate() {
            let moments = cloud.moments(member, support);
            let r = f64::from(radii[i]);
            let h = support * r;
            let offset = |j: usize| positions[j].as_dvec3() - positions[i].as_dvec3();
            let near: Vec<_> = (0..500).filter(|&j| offset(j).length() <= h).collect();
            let weights: Vec<_> = near
                .iter()
                .map(|&j| {
                    (f64::from(radii[j]) / r).powi(3) * (1.0 - (offset(j).length() / h).powi(3))
                })
                .collect();
            let total: f64 = weights.iter().sum();
            let mean =
                near.iter().zip(&weights).map(|(&j, &w)| w * offset(j)).sum::<DVec3>() / total;
            let covariance = near.iter().zip(&weights).fold(DMat3::ZERO, |sum, (&j, &w)| {
                let d = offset(j) - mean;
                sum + DMat3::from_cols(d.x * d, d.y * d, d.z * d) * (w / total)
            });

            assert_eq!(moments.count as usize, near.len());
            // The ratio of radii is taken in 32 bits.
            assert!((moments.weight - total).abs() < 1e-6 * total);
            assert!((moments.mean() * h - mean).length() < 1e-6 * h);
            assert!(difference(moments.covariance() * (h * h), covariance) < 1e-6 * h * h);
        }
    }

    /// The threshold is a share of the density at rest, for any support.
    #[test]
    fn density_inside_a_lattice_is_one() {
        for support in [2.0, 3.0, 4.0, 5.5] {
            let r = 0.025f32;
            let cells = || (-3..=3).map(|i| 2.0 * r * i as f32);
            let positions: Vec<_> = cells()
                .flat_map(|x| cells().flat_map(move |y| cells().map(move |z| Vec3::new(x, y, z))))
                .collect();
            let cloud = Cloud::new(&Particles { positions, ..Default::default() }, r);
            let middle = &cloud.members[cloud.members.len() / 2];
            let share = cloud.moments(middle, support).weight / density_at_rest(support);
            assert!((share - 1.0).abs() < 1e-5, "{share} at support {support}");
        }
    }
}
