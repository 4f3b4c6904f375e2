//! Classification of particles into splashes and aggregates, and their ellipsoids.
//!
//! Aggregates get the anisotropic kernels of J. Yu and G. Turk, "Reconstructing Surfaces of
//! Particle-Based Fluids Using Anisotropic Kernels", ACM Transactions on Graphics 32(1), 2013;
//! the separation by local density follows T. Imai, Y. Kanamori and J. Mitani, "Real-time
//! screen-space liquid rendering with complex refractions", Computer Animation and Virtual Worlds
//! 27, 2016. Three things differ. Density is relative to that inside a body at rest, so that the
//! threshold does not depend on the support. Neighbours are weighted by volume, for files with
//! particles of different sizes. And by default the *short* axis is fixed
//! ([`Kernel::Fitted`](crate::settings::Kernel::Fitted)): the papers' volume-preserving ellipsoids
//! lower the surface by a particle. Splats at the surface then move onto an iso-surface of the density
//! ([`Classify::iso_surface`]).

pub mod colors;
pub mod device;
mod grid;
mod interior;
mod iso_surface;
mod moments;
mod shape;
mod tree;
mod walls;

use bytemuck::{Pod, Zeroable};
use glam::{DMat3, DVec3, Vec3};
use rayon::iter::Either;
use rayon::prelude::*;

use crate::error::Result;
use crate::liquid::bulk::bounds;
use crate::liquid::ellipsoid::Ellipsoid;
use crate::liquid::particles::{self, Particles, drawable};
use crate::memory;
use crate::settings::Classify;
use colors::Colors;
use grid::Grid;
use iso_surface::Search;
use moments::Moments;
use tree::Tree;

pub use device::{Classifier, DeviceSplats};
pub use tree::estimate_radius;
pub(crate) use walls::{Extent, Eye, seen_past_walls};
pub use walls::{add_closed_wall_contacts, add_wall_contacts};

/// A splat in GPU layout: the ellipsoid { centre + A·s : |s| ≤ 1 }.
///
/// A is symmetric and positive definite: since rotating the unit sphere changes nothing, R·diag(axes)
/// can be multiplied by Rᵀ, and six numbers suffice instead of nine.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Splat {
    /// Centre relative to [`Splats::origin`], in metres.
    pub centre: [f32; 3],
    /// Radius r of the particle, in metres.
    pub radius: f32,
    /// `A_xx, A_yy, A_zz`, in metres.
    pub diagonal: [f32; 3],
    /// Index of the particle in its file.
    pub particle: u32,
    /// `A_xy, A_xz, A_yz`, in metres.
    pub off_diagonal: [f32; 3],
    /// Bit field: index of the fluid, [`Splat::BURIED`], and for a copy on a plane the plane's number.
    pub tags: u32,
}

impl Splat {
    /// Bit of [`Splat::tags`] that marks a particle surrounded by liquid.
    pub const BURIED: u32 = 1 << 16;

    /// Position in [`Splat::tags`] of the ten bits that hold, for a copy that [`add_wall_contacts`] placed on a plane,
    /// the number of that solid, from 1.
    const WALL: u32 = 17;
    /// Bit of [`Splat::tags`] that marks a copy of liquid behind the plane, opposite to its normal.
    const WALL_FROM_BEHIND: u32 = 1 << 27;
    /// Bit of [`Splat::tags`] that marks a sphere around a grid cell deep inside a body, in place of the splats of
    /// its particles.
    pub const INTERIOR: u32 = 1 << 28;
    /// Bit of [`Splat::tags`] that marks a droplet, where the device has classified the particle.
    pub const SPLASH: u32 = 1 << 29;
    /// Bit of [`Splat::tags`] that marks a particle for which another splat stands, where the device has classified it.
    pub const HIDDEN: u32 = 1 << 30;

    /// Whether [`add_wall_contacts`] placed the splat on a plane.
    #[doc(hidden)]
    pub fn is_copy(&self) -> bool {
        self.tags >> Self::WALL & 0x3ff != 0
    }

    /// Whether the splat stands for all particles of a grid cell deep inside a body.
    pub fn is_interior(&self) -> bool {
        self.tags & Self::INTERIOR != 0
    }

    /// The symmetric matrix A, m, which maps the unit sphere to the ellipsoid.
    pub(crate) fn axes(&self) -> DMat3 {
        let ([a, b, c], [d, e, f]) = (self.diagonal, self.off_diagonal);
        DMat3::from_cols_array(&[a, d, e, d, b, f, e, f, c].map(f64::from))
    }

    /// Upper bound on the semi-axes, m: the Frobenius norm of A.
    #[doc(hidden)]
    pub fn longest(&self) -> f64 {
        self.axes().to_cols_array().map(|x| x * x).iter().sum::<f64>().sqrt()
    }

    /// Upper bound on the semi-axes, m: the largest sum of a row of |A|.
    pub(crate) fn reach(&self) -> f32 {
        let ([a, b, c], [d, e, f]) = (self.diagonal.map(f32::abs), self.off_diagonal.map(f32::abs));
        (a + d + e).max(d + b + f).max(e + f + c)
    }

    /// Index of the fluid in the scene.
    pub fn fluid(&self) -> u32 {
        self.tags & (Self::BURIED - 1)
    }

    /// Sets [`Splat::BURIED`] if the particle is surrounded by liquid.
    fn buried(self, surrounded: bool) -> Self {
        let mark = if surrounded { Self::BURIED } else { 0 };
        Self { tags: self.tags | mark, ..self }
    }

    /// Whether the particle is surrounded by liquid.
    pub fn is_buried(&self) -> bool {
        self.tags & Self::BURIED != 0
    }
}

/// The splats of a frame. Both lists are in file order; the [interior](Splat::is_interior) of large bodies and copies
/// made by [`add_wall_contacts`] follow.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Splats {
    /// Ellipsoids of bodies and sheets.
    pub aggregates: Vec<Splat>,
    /// Spheres of droplets.
    pub splashes: Vec<Splat>,
    /// Median particle radius, in metres.
    pub radius: f32,
    /// Origin of the centres in world space, in metres: the origin of the particles, or their centre if
    /// they are far from it, so that 32-bit floats keep their precision.
    pub origin: DVec3,
    /// [`Particles::is_hull`]: each pixel then has one interval of liquid.
    pub is_hull: bool,
    /// The box in world space, m, outside of which splats do not count for the lights' views: the
    /// [bulk](super::Bulk) of the particles, if that is known to leave some out; `None` goes by the splats themselves.
    pub bulk: Option<(DVec3, DVec3)>,
    /// Splats that only the device has, of [`Classifier::record`]; the lists are then empty.
    pub device: Option<DeviceSplats>,
    /// Colours of the particles, which opaque bodies show in place of one colour for all.
    pub colors: Option<Colors>,
    /// The opaque fluids among these particles, classified alone, in their [colours](Self::colors). They are seen through
    /// the others.
    pub opaque: Option<Box<Self>>,
}

impl Splats {
    /// Whether there is nothing to draw, as far as the host knows.
    pub fn is_empty(&self) -> bool {
        self.aggregates.is_empty() && self.splashes.is_empty() && self.device.is_none()
    }

    /// Whether there may be droplets.
    pub(crate) fn has_splashes(&self) -> bool {
        !self.splashes.is_empty() || self.device.as_ref().is_some_and(|device| device.has_splashes)
    }

    /// All splats; for those of the device, spheres around the corners of their box.
    pub(crate) fn outline(&self) -> impl Iterator<Item = Splat> {
        let corners = self.device.iter().flat_map(DeviceSplats::corners);
        self.aggregates.iter().chain(&self.splashes).copied().chain(corners)
    }
}

/// Classifies a frame's particles into splashes and aggregates, and computes their shapes.
///
/// Aggregates with [a shape from the file](Particles::ellipsoids) keep that shape and stay at their
/// particles' positions; splashes are always spheres.
///
/// `default_radius` applies to files without radii. Particles that cannot be drawn are skipped: those
/// with a non-finite position, with a radius that is not positive, or with a radius whose cube is not
/// a normal 32-bit float (10⁻¹³ to 10¹² m are fine). Deep inside bodies of hundreds of thousands of particles, one splat
/// stands for several particles ([`Splat::is_interior`]). The result depends only on the particles and the
/// settings, not on the number of threads. [`Classifier`] does the same on the device.
pub fn classify(particles: &Particles, default_radius: f32, settings: &Classify) -> Splats {
    Cloud::new(particles, default_radius).classify(settings)
}

/// Whether a position relative to the splats' origin is inside a body, between particles included: the
/// aggregates around it reach the density of a body. Positions at or above the topmost centres are
/// outside.
pub(crate) fn is_inside(splats: &Splats, place: DVec3, support: f32) -> bool {
    /// Share of the density at rest.
    const MIN_DENSITY: f64 = 0.75;
    let h = f64::from(support) * f64::from(splats.radius);
    let mut near = Moments::default();
    for splat in &splats.aggregates {
        let offset = (Vec3::from_array(splat.centre).as_dvec3() - place) / h;
        if splat.is_interior() && offset.length() * h <= f64::from(splat.diagonal[0]) {
            return true;
        }
        if offset.length_squared() <= 1.0 {
            near.add(offset, f64::from(splat.radius / splats.radius).powi(3));
        }
    }
    near.weight >= MIN_DENSITY * moments::density_at_rest(support.into())
}

/// A drawable particle.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Member {
    position: [f32; 3],
    radius: f32,
    particle: u32,
    fluid: u32,
}

impl Member {
    fn position(&self) -> Vec3 {
        self.position.into()
    }
}

/// A splash (left), or an aggregate and the mean of its neighbours, in h, if it may be moved to a refined surface.
type Shape = Either<Splat, (Splat, Option<Vec3>)>;

/// The drawable particles of a frame, before classification.
#[derive(Clone, Debug)]
pub struct Cloud {
    members: Vec<Member>,
    /// Shapes from the file, by particle.
    ellipsoids: Option<Vec<Ellipsoid>>,
    /// Median radius, m.
    radius: f32,
    /// Origin of the members in world space, m.
    origin: DVec3,
    /// Origin of the splats relative to that of the members, m.
    shift: DVec3,
    is_hull: bool,
}

impl Cloud {
    /// Collects the drawable particles; see [`classify`].
    pub fn new(particles: &Particles, default_radius: f32) -> Self {
        let radius = |i: usize| particles.radii.as_ref().map_or(default_radius, |radii| radii[i]);
        let fluid = |i: usize| particles.fluids.as_ref().map_or(0, |fluids| fluids[i].into());
        let member = |(i, position): (usize, &Vec3)| Member {
            position: position.to_array(),
            radius: radius(i),
            particle: i as u32,
            fluid: fluid(i),
        };
        let members: Vec<_> = particles
            .positions
            .par_iter()
            .enumerate()
            .map(member)
            .filter(|m| m.position().is_finite() && drawable(m.radius))
            .collect();
        let all = bounds(members.iter().map(|m| m.position().as_dvec3()));
        // In 32 bits, so that the device knows it too.
        let shift =
            all.map_or(DVec3::ZERO, |all| particles::origin_for_box(all).as_vec3().as_dvec3());
        Self {
            radius: common_radius(&members).unwrap_or_else(|| {
                median(members.iter().map(|m| m.radius).collect(), default_radius)
            }),
            members,
            ellipsoids: particles.ellipsoids.clone(),
            origin: particles.origin,
            shift,
            is_hull: particles.is_hull,
        }
    }

    /// Classifies the particles; see [`classify`].
    pub fn classify(&self, settings: &Classify) -> Splats {
        let Some(grid) = self.grid(settings) else { return self.classify_by_tree(settings) };
        let interior = self.has_interior(settings).then(|| grid.interior());
        self.classify_by_grid(grid, interior.as_deref(), settings)
    }

    /// As [`Cloud::classify`], but with a splat of its own for each particle.
    pub fn classify_each(&self, settings: &Classify) -> Splats {
        let Some(grid) = self.grid(settings) else { return self.classify_by_tree(settings) };
        self.classify_by_grid(grid, None, settings)
    }

    /// Classifies the particles outside of the `interior` cells, which get one splat each.
    fn classify_by_grid(
        &self,
        grid: Grid<'_>,
        interior: Option<&[bool]>,
        settings: &Classify,
    ) -> Splats {
        let slots = grid.slots_outside(interior);
        let shaped = grid.map(&slots, self.shaper(settings));
        // Back to file order.
        let ranks = grid.ranks(&slots);
        drop(slots);
        let spheres = interior.map(|cells| self.spheres(&grid, cells)).unwrap_or_default();
        let search = iso_surface::refines(settings).then_some(Search::Grid(grid));
        let ranked = ranks.iter().filter_map(|&rank| shaped.get(rank as usize).copied());
        let mut splats = self.splats(ranked, search.as_ref());
        splats.aggregates.extend(spheres);
        splats
    }

    /// As [`Cloud::classify`], but always with a k-d tree.
    ///
    /// Serves as the reference for the grid, which sums the same neighbours in another order and in 32
    /// bits: centres and axes agree to 10⁻⁵ r, densities to a relative 10⁻⁶. Centres on the iso-surface agree to 10⁻⁴ r,
    /// except for the few where it is only just found or not.
    pub fn classify_by_tree(&self, settings: &Classify) -> Splats {
        let support = settings.support.into();
        let tree = Tree::new(&self.members).thinned(support);
        let shape = self.shaper(settings);
        if !tree.is_thinned() {
            let moments = |m: &Member| tree.moments(m, support);
            let shaped: Vec<_> = self.members.par_iter().map(|m| shape(m, &moments(m))).collect();
            let search = iso_surface::refines(settings).then_some(Search::Tree(tree));
            return self.splats(shaped.into_iter(), search.as_ref());
        }
        // In a crowd, many particles may coincide and share one result.
        let (distinct, which) = distinct(&self.members);
        let found: Vec<_> = distinct.par_iter().map(|m| tree.moments(m, support)).collect();
        let members = self.members.par_iter().zip(&which);
        let shaped: Vec<_> = members.map(|(m, &i)| shape(m, &found[i as usize])).collect();
        self.splats(shaped.into_iter(), None)
    }

    /// Whether neighbours are found by a uniform grid. The tree handles widely differing radii, particles
    /// scattered over a large space, and crowds.
    pub fn has_grid(&self, settings: &Classify) -> bool {
        self.grid(settings).is_some()
    }

    fn grid(&self, settings: &Classify) -> Option<Grid<'_>> {
        let layout = grid::Layout::of(&self.members, self.radius, settings.support)?;
        Grid::new(layout, &self.members, self.radius, settings.support)
    }

    /// Returns the function that turns a member and its neighbourhood into a splash or an aggregate.
    fn shaper(&self, settings: &Classify) -> impl Fn(&Member, &Moments) -> Shape {
        let at_rest = moments::density_at_rest(settings.support.into());
        let threshold = f64::from(settings.splash_density) * at_rest;
        move |member, near| {
            if near.weight < threshold {
                Either::Left(member.splash(settings, self.shift))
            } else {
                let surrounded = near.surrounds(at_rest);
                let (splat, mean) = match self.given(member) {
                    Some(ellipsoid) => (member.given(ellipsoid, self.shift), None),
                    None => (
                        member.aggregate(near, settings, self.shift),
                        iso_surface::movable(near.mean(), near.count, surrounded, settings),
                    ),
                };
                Either::Right((splat.buried(surrounded), mean))
            }
        }
    }

    /// The member's shape from the file, if it is drawable.
    fn given(&self, member: &Member) -> Option<&Ellipsoid> {
        let ellipsoids = self.ellipsoids.as_ref()?;
        ellipsoids.get(member.particle as usize).filter(|ellipsoid| ellipsoid.drawable())
    }

    /// Collects the splats, and refines the surface if there is a search for it.
    fn splats(&self, shaped: impl Iterator<Item = Shape>, search: Option<&Search<'_>>) -> Splats {
        let (mut splashes, mut aggregates, mut means) = (Vec::new(), Vec::new(), Vec::new());
        // Threads would have to copy their lists once more.
        for shape in shaped {
            match shape {
                Either::Left(splash) => splashes.push(splash),
                Either::Right((aggregate, mean)) => {
                    aggregates.push(aggregate);
                    means.push(mean);
                }
            }
        }
        if let Some(search) = search {
            self.refine(&mut aggregates, &means, search);
        }
        self.frame(aggregates, splashes)
    }

    /// The splats of the cloud.
    fn frame(&self, aggregates: Vec<Splat>, splashes: Vec<Splat>) -> Splats {
        Splats {
            aggregates,
            splashes,
            radius: self.radius,
            origin: self.origin + self.shift,
            is_hull: self.is_hull,
            bulk: None,
            device: None,
            colors: None,
            opaque: None,
        }
    }
}

/// Removes duplicates in position and radius. Returns the distinct members, and for each member the index
/// of its representative.
fn distinct(members: &[Member]) -> (Vec<&Member>, Vec<u32>) {
    let bits = |m: &Member| (m.position.map(f32::to_bits), m.radius.to_bits());
    let mut order: Vec<u32> = (0..members.len() as u32).collect();
    order.par_sort_unstable_by_key(|&i| (bits(&members[i as usize]), i));
    let (mut distinct, mut which) = (Vec::<&Member>::new(), vec![0; members.len()]);
    for i in order {
        let member = &members[i as usize];
        if distinct.last().is_none_or(|last| bits(last) != bits(member)) {
            distinct.push(member);
        }
        which[i as usize] = distinct.len() as u32 - 1;
    }
    (distinct, which)
}

fn common_radius(members: &[Member]) -> Option<f32> {
    let first = members.first()?.radius;
    members.iter().all(|m| m.radius == first).then_some(first)
}

fn median(mut radii: Vec<f32>, default: f32) -> f32 {
    let middle = radii.len() / 2;
    if radii.is_empty() { default } else { *radii.select_nth_unstable_by(middle, f32::total_cmp).1 }
}

/// Median radius of the drawable particles, m; `default` if there are no radii.
#[doc(hidden)]
pub fn median_radius(particles: &Particles, default: f32) -> Result<f32> {
    let Some(radii) = &particles.radii else { return Ok(default) };
    let mut drawable_radii = memory::reserve(radii.len(), "radii of particles")?;
    drawable_radii.extend(radii.iter().copied().filter(|&radius| drawable(radius)));
    Ok(median(drawable_radii, default))
}

/// Fails if there is not enough memory to classify this many particles, or to estimate their radius;
/// `what` describes them in the error.
#[doc(hidden)]
pub fn probe_memory(particles: usize, what: &str) -> Result<()> {
    /// Bytes per particle: an estimated maximum of 350, of which 100 are the splats.
    const PER_PARTICLE: usize = 360;
    memory::probe(particles.saturating_mul(PER_PARTICLE), what)
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;

    /// Uniform in −1 to 1, from a linear congruential generator (Knuth's MMIX).
    pub(super) fn noise(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn difference(a: DMat3, b: DMat3) -> f64 {
        (a - b).to_cols_array().into_iter().fold(0.0, |most, x| x.abs().max(most))
    }

    /// Moments of all members by both searches, with the searches' names.
    fn searches(cloud: &Cloud, support: f32) -> [(&'static str, Vec<Moments>); 2] {
        let settings = Classify { support, ..Default::default() };
        let tree = Tree::new(&cloud.members);
        let by_tree = cloud.members.iter().map(|m| tree.moments(m, support.into())).collect();
        let grid = cloud.grid(&settings).expect("an ordinary particle set has a grid");
        let slots = grid.slots_outside(None);
        let found = grid.map(&slots, |_, near| *near);
        let ranks = grid.ranks(&slots);
        let by_grid = ranks.into_iter().map(|rank| found[rank as usize]).collect();
        [("tree", by_tree), ("grid", by_grid)]
    }

    /// Every neighbour is found exactly once, and the one-pass sums equal the two-pass formula over all
    /// pairs, with different radii.
    #[test]
    fn moments_equal_a_brute_force_reference() {
        let mut seed = 2;
        let positions: Vec<_> = (0..500)
            .map(|_| Vec3::from_array([(); 3].map(|()| noise(&mut seed) as f32 + 10.0)))
            .collect();
        let radii: Vec<_> = (0..500).map(|_| 0.1 + 0.05 * noise(&mut seed) as f32).collect();
        let support = 4.0;
        let cloud = Cloud::new(
            &Particles {
                positions: positions.clone(),
                radii: Some(radii.clone()),
                ..Default::default()
            },
            f32::NAN,
        );
        for (search, found) in searches(&cloud, support) {
            for (i, moments) in found.into_iter().enumerate() {
                let r = f64::from(radii[i]);
                let h = f64::from(support) * r;
                let offset = |j: usize| positions[j].as_dvec3() - positions[i].as_dvec3();
                let near: Vec<_> = (0..500).filter(|&j| offset(j).length() <= h).collect();
                let weights: Vec<_> = near
                    .iter()
                    .map(|&j| {
                        let volume = (f64::from(radii[j]) / r).powi(3);
                        volume * (1.0 - (offset(j).length() / h).powi(3))
                    })
                    .collect();
                let total: f64 = weights.iter().sum();
                let mean =
                    near.iter().zip(&weights).map(|(&j, &w)| w * offset(j)).sum::<DVec3>() / total;
                let covariance = near.iter().zip(&weights).fold(DMat3::ZERO, |sum, (&j, &w)| {
                    let d = offset(j) - mean;
                    sum + DMat3::from_cols(d.x * d, d.y * d, d.z * d) * (w / total)
                });

                assert_eq!(moments.count as usize, near.len(), "{search}, {i}");
                // The ratio of radii is computed in 32 bits.
                assert!((moments.weight - total).abs() < 1e-6 * total, "{search}");
                assert!((moments.mean() * h - mean).length() < 1e-6 * h, "{search}");
                let found = moments.covariance() * (h * h);
                assert!(difference(found, covariance) < 1e-6 * h * h, "{search}");
            }
        }
    }

    /// The relative density inside a lattice is 1 for any support, and neighbours at distance h, of which
    /// a lattice has many, are counted regardless of rounding.
    #[test]
    fn density_inside_a_lattice_is_one() {
        for (support, count) in [(2.0, 7), (3.0, 19), (4.0, 33), (5.5, 81)] {
            let r = 0.025f32;
            let cells = || (-3..=3).map(|i| 2.0 * r * i as f32);
            let positions: Vec<_> = cells()
                .flat_map(|x| cells().flat_map(move |y| cells().map(move |z| Vec3::new(x, y, z))))
                .collect();
            let cloud = Cloud::new(&Particles { positions, ..Default::default() }, r);
            for (search, found) in searches(&cloud, support) {
                let middle = found[found.len() / 2];
                let share = middle.weight / moments::density_at_rest(support.into());
                assert!((share - 1.0).abs() < 1e-5, "{share} at support {support}, {search}");
                assert_eq!(middle.count, count, "at support {support}, {search}");
            }
        }
    }
}
