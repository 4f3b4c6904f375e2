//! Neighbour search by a k-d tree, for any positions and radii.

use std::num::NonZero;

use glam::{DVec3, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::moments::{EDGE, Moments};
use super::{Cloud, Member, distinct};
use crate::liquid::particles::{Particles, drawable};

/// Estimates the radius for files without radii: half the spacing where the particles are dense.
///
/// The spacing of a particle is the median distance to its six nearest neighbours: exactly 2 r in a cubic
/// lattice, in sheets of one or two lattice layers and in a packing of touching spheres, and on average
/// in SPH at rest, where each particle occupies (2 r)³. The nearest neighbour alone is up to a quarter
/// closer there. The estimate is the 22nd percentile of at most 2,000 particles spread through the file,
/// so that isolated spray particles have no influence and the frames of a sequence agree. For its error
/// see docs/radius.md.
///
/// Returns 0 without two distinct particles, or if the radius is too small or too large to be drawn.
pub fn estimate_radius(particles: &Particles) -> f32 {
    // Any drawable radius: particles without one would be skipped.
    let cloud = Cloud::new(&Particles::from_positions(of_the_bulk(particles)), 1.0);
    // Coincident particles have no spacing, and a tree of very many of them takes minutes.
    let (mut places, _) = distinct(&cloud.members);
    places.sort_unstable_by_key(|member| member.particle);
    let places: Vec<Member> = places.into_iter().copied().collect();
    let tree = Tree::new(&places).tree;
    let step = places.len().div_ceil(2000).max(1);
    let mut distances: Vec<f64> = places
        .iter()
        .step_by(step)
        .filter_map(|member| {
            // Seven, because the nearest is the particle itself.
            let query = tree.query(&member.position);
            let nearest = query.nearest_n::<SquaredEuclidean<f64>>(NonZero::new(7)?).execute();
            let near = nearest.iter().map(|found| found.distance.sqrt());
            let mut near: Vec<f64> = near.filter(|&distance| distance > 0.0).collect();
            near.sort_unstable_by(f64::total_cmp);
            let last = near.len().checked_sub(1)?;
            Some(0.5 * (near[last / 2] + near[last.div_ceil(2)]))
        })
        .collect();
    if distances.is_empty() {
        return 0.0;
    }
    let dense = distances.len() * 22 / 100;
    let radius = (0.5 * *distances.select_nth_unstable_by(dense, f64::total_cmp).1) as f32;
    if drawable(radius) { radius } else { 0.0 }
}

/// Positions of the particles in the bulk: those that wait elsewhere have a spacing of their own.
fn of_the_bulk(particles: &Particles) -> Vec<Vec3> {
    match particles.bulk().filter(|bulk| bulk.outside > 0) {
        Some(bulk) => {
            let all = particles.positions.iter().enumerate();
            all.filter(|&(i, _)| bulk.holds(particles.place(i))).map(|(_, &x)| x).collect()
        }
        None => particles.positions.clone(),
    }
}

/// A k-d tree over the members of a cloud.
pub(super) struct Tree<'a> {
    members: &'a [Member],
    /// Tree of every `stride`-th member.
    tree: ImmutableKdTree<f32, 3>,
    stride: usize,
}

impl<'a> Tree<'a> {
    pub(super) fn new(members: &'a [Member]) -> Self {
        Self { members, tree: tree(members, 1), stride: 1 }
    }

    /// Subsamples the tree if nearly all particles are neighbours of each other. With a radius in the
    /// wrong unit, or a file of coincident particles, the search would otherwise take hours, since
    /// visits grow with the square of the particle count.
    pub(super) fn thinned(mut self, support: f64) -> Self {
        /// Neighbours per particle that are always allowed: SPH has about 30 to 200.
        const MAX_NEIGHBOURS: usize = 4096;
        /// Total visits that take a few seconds.
        const MAX_VISITS: usize = 1 << 31;
        const SAMPLES: usize = 256;
        /// Neighbours that suffice for a shape.
        const TARGET_NEIGHBOURS: usize = 1024;
        const MIN_NEIGHBOURS: usize = 64;
        if self.members.len() <= MAX_NEIGHBOURS {
            return self;
        }
        let (mut count, mut visits) = (0, 0);
        for member in self.members.iter().step_by(self.members.len().div_ceil(SAMPLES)) {
            visits += self.moments(member, support).count as usize;
            count += 1;
            // Fewer samples suffice for a large crowd.
            if visits > MAX_VISITS / 8 {
                break;
            }
        }
        let neighbours = visits / count;
        let too_many_visits = neighbours.saturating_mul(self.members.len()) > MAX_VISITS;
        if neighbours > MAX_NEIGHBOURS && too_many_visits {
            // Fewer neighbours in the largest crowds, to bound the visits.
            let target = TARGET_NEIGHBOURS.min(MAX_VISITS / self.members.len()).max(MIN_NEIGHBOURS);
            self.stride = neighbours / target;
            self.tree = tree(self.members, self.stride);
        }
        self
    }

    /// Whether the tree holds only a subset of the members.
    pub(super) fn is_thinned(&self) -> bool {
        self.stride > 1
    }

    pub(super) fn members(&self) -> &'a [Member] {
        self.members
    }

    /// Calls `act` with the index of each member of the tree within `reach`, m.
    pub(super) fn within(&self, at: Vec3, reach: f64, mut act: impl FnMut(usize)) {
        self.tree
            .query(&at.to_array())
            .within::<SquaredEuclidean<f64>>(reach.powi(2))
            .unsorted()
            .visit(|found| act(found.item as usize * self.stride));
    }

    /// Computes the moments of a particle's neighbourhood, itself included. 64-bit distances have no
    /// measurable cost, and do not overflow for distant stray particles.
    pub(super) fn moments(&self, member: &Member, support: f64) -> Moments {
        let h = support * f64::from(member.radius);
        let per_h = 1.0 / h;
        let centre = member.position().as_dvec3();
        let mut moments = Moments::default();
        self.tree
            .query(&member.position)
            .within::<SquaredEuclidean<f64>>((EDGE * h).powi(2))
            .unsorted()
            .visit(|found| {
                let other = &self.members[found.item as usize * self.stride];
                let volume = f64::from(other.radius / member.radius).powi(3) * self.stride as f64;
                moments.add((other.position().as_dvec3() - centre) * per_h, volume);
            });
        // A member missing from a thinned tree may have no neighbours.
        if moments.count == 0 {
            moments.add(DVec3::ZERO, 1.0);
        }
        moments
    }
}

/// Builds the tree of every `stride`-th member.
fn tree(members: &[Member], stride: usize) -> ImmutableKdTree<f32, 3> {
    let points: Vec<_> = members.iter().step_by(stride).map(|m| m.position).collect();
    ImmutableKdTree::new_from_slice(&points).expect("particle indices fit in 32 bits")
}
