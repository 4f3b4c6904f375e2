//! Neighbours by a k-d tree: whatever the particles' places and sizes.

use std::num::NonZero;

use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::moments::{EDGE, Moments};
use super::{Cloud, Member, distinct};
use crate::liquid::particles::{Particles, drawable};

/// A radius for files that have none: half the distance of neighbours where the particles are dense.
///
/// A particle's spacing is the median distance to its six nearest neighbours: 2 r exactly in a cubic
/// lattice, in sheets of one or two of its layers and in a packing of spheres that touch, and on
/// average in SPH at rest, where each particle has (2 r)³. The nearest neighbour alone is up to a
/// quarter nearer there. Of at most 2,000 particles spread through the file, 22 % are spaced more
/// closely than the guess and the rest less: so spray, where particles have nobody near, does not
/// matter, and frames of a sequence agree. How far it is off: docs/radius.md.
///
/// 0 without two distinct particles, or if those are so near or far that nothing of that radius
/// can be drawn.
pub fn estimate_radius(particles: &Particles) -> f32 {
    // Radii do not matter here, but a particle without a usable one would be left out.
    let cloud = Cloud::new(&Particles::from_positions(particles.positions.clone()), 1.0);
    // Particles in one place have no distance, and a tree of very many takes minutes.
    let (mut places, _) = distinct(&cloud.members);
    places.sort_unstable_by_key(|member| member.particle);
    let places: Vec<Member> = places.into_iter().copied().collect();
    let tree = Tree::new(&places).tree;
    let step = places.len().div_ceil(2000).max(1);
    let mut distances: Vec<f64> = places
        .iter()
        .step_by(step)
        .filter_map(|member| {
            // The nearest is the particle itself.
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

/// The members of a cloud, and the tree that finds neighbours among them.
pub(super) struct Tree<'a> {
    members: &'a [Member],
    /// Of every `stride`-th member.
    tree: ImmutableKdTree<f32, 3>,
    stride: usize,
}

impl<'a> Tree<'a> {
    pub(super) fn new(members: &'a [Member]) -> Self {
        Self { members, tree: tree(members, 1), stride: 1 }
    }

    /// The same tree; where the particles overlap so much that nearly all are neighbours of each
    /// other, those that stand for the rest. A radius of the wrong unit, or a file of one place over
    /// and over, would otherwise take hours, for the visits grow as the square of the particles.
    pub(super) fn thinned(mut self, support: f64) -> Self {
        /// Neighbours that a particle may have, however many there are: SPH has about 30 to 200.
        const MOST: usize = 4096;
        /// Visits in all that take no more than seconds.
        const FEW: usize = 1 << 31;
        const SAMPLES: usize = 256;
        /// Neighbours that are enough for a shape.
        const ENOUGH: usize = 1024;
        const LEAST: usize = 64;
        if self.members.len() <= MOST {
            return self;
        }
        let (mut count, mut visits) = (0, 0);
        for member in self.members.iter().step_by(self.members.len().div_ceil(SAMPLES)) {
            visits += self.moments(member, support).count as usize;
            count += 1;
            // A few of a large crowd tell as much as all.
            if visits > FEW / 8 {
                break;
            }
        }
        let neighbours = visits / count;
        if neighbours > MOST && neighbours.saturating_mul(self.members.len()) > FEW {
            // Of the largest crowds fewer do, for as few visits.
            let enough = ENOUGH.min(FEW / self.members.len()).max(LEAST);
            self.stride = neighbours / enough;
            self.tree = tree(self.members, self.stride);
        }
        self
    }

    /// Whether some members stand for the rest.
    pub(super) fn is_thinned(&self) -> bool {
        self.stride > 1
    }

    /// Gathers the neighbourhood of a particle, itself included. 64-bit distances take no time that
    /// can be measured, and do not overflow however far a stray particle has flown.
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
        // One that the tree leaves out may have nobody near.
        if moments.count == 0 {
            moments.add(DVec3::ZERO, 1.0);
        }
        moments
    }
}

/// The tree of every `stride`-th member.
fn tree(members: &[Member], stride: usize) -> ImmutableKdTree<f32, 3> {
    let points: Vec<_> = members.iter().step_by(stride).map(|m| m.position).collect();
    ImmutableKdTree::new_from_slice(&points)
        .expect("particles are counted in 32 bits, as the tree's items are")
}
