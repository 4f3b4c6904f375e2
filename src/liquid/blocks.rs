//! A frame's splats by blocks: a view tests whole blocks before single splats.
//!
//! Files list particles in some order along which neighbours lie near each other, so that most blocks are small boxes. Where
//! they are not, a view looks at more of the splats.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::classify::{DeviceSplats, Extent, Splat, Splats};

/// Splats of a block.
pub const SIZE: usize = 64;

/// Consecutive splats, and bounds that hold for each of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block {
    /// Box of the centres, relative to the splats' origin, m.
    pub min: Vec3,
    /// As `min`.
    pub max: Vec3,
    /// Greatest [`Splat::longest`], m.
    pub longest: f32,
    /// Greatest sum of a row of |A| of a splat, m: another bound on the semi-axes.
    pub reach: f32,
    /// Their mean, m.
    pub mean_reach: f32,
}

/// The blocks of a frame's splats.
#[derive(Debug, Clone, Default)]
pub struct Blocks {
    /// Blocks of the bodies and sheets.
    pub aggregates: Vec<Block>,
    /// Blocks of the droplets.
    pub splashes: Vec<Block>,
    /// Whether there are bodies or sheets of particles of other radii than most.
    pub radii_differ: bool,
}

impl Block {
    fn new(splats: &[Splat]) -> Self {
        let none = Self {
            min: Vec3::INFINITY,
            max: Vec3::NEG_INFINITY,
            longest: 0.0,
            reach: 0.0,
            mean_reach: 0.0,
        };
        splats.iter().fold(none, |block, splat| {
            let centre = Vec3::from_array(splat.centre);
            // Rounded up.
            let longest = splat.longest() as f32 * (1.0 + 2.0 * f32::EPSILON);
            Self {
                min: block.min.min(centre),
                max: block.max.max(centre),
                longest: block.longest.max(longest),
                reach: block.reach.max(splat.reach()),
                mean_reach: block.mean_reach + splat.reach() / splats.len() as f32,
            }
        })
    }

    /// Lower bound on the distance of a place, relative to the splats' origin, from the centres, m.
    pub fn distance(&self, place: DVec3) -> f64 {
        let (min, max) = (self.min.as_dvec3(), self.max.as_dvec3());
        (min - place).max(place - max).max(DVec3::ZERO).length()
    }
}

impl Blocks {
    /// The extent of the splats around their origin, m; `None` without any.
    pub(crate) fn extent(&self, origin: DVec3) -> Option<Extent> {
        let none = (Vec3::INFINITY, Vec3::NEG_INFINITY, 0.0f32);
        let all = self.aggregates.iter().chain(&self.splashes);
        let (min, max, reach) = all.fold(none, |(min, max, reach), block| {
            (min.min(block.min), max.max(block.max), reach.max(block.longest))
        });
        let place = |x: Vec3| origin + x.as_dvec3();
        min.is_finite().then(|| Extent { min: place(min), max: place(max), reach: reach.into() })
    }

    /// The blocks of these splats.
    pub fn new(splats: &Splats) -> Self {
        if let Some(device) = &splats.device {
            return Self::of_device(device);
        }
        let blocks = |splats: &[Splat]| splats.par_chunks(SIZE).map(Block::new).collect();
        let radius = splats.radius;
        let differs = |splat: &Splat| splat.radius != radius;
        Self {
            aggregates: blocks(&splats.aggregates),
            splashes: blocks(&splats.splashes),
            radii_differ: splats.aggregates.par_iter().any(differs),
        }
    }

    /// One block of each class, for splats that the host does not have.
    fn of_device(splats: &DeviceSplats) -> Self {
        let (min, max) = splats.bounds_32();
        let block = Block {
            min,
            max,
            // Of a sphere, by Frobenius' norm.
            longest: 3.0f32.sqrt() * splats.reach,
            reach: splats.reach,
            mean_reach: splats.usual_reach,
        };
        let splashes = if splats.has_splashes { vec![block] } else { Vec::new() };
        Self { aggregates: vec![block], splashes, radii_differ: splats.radii_differ }
    }

    /// The splats of all blocks for which `counts` holds.
    pub fn splats_where<'a>(
        &'a self,
        splats: &'a Splats,
        counts: impl Fn(&Block) -> bool + Copy + 'a,
    ) -> impl Iterator<Item = &'a Splat> {
        let of_class = move |blocks: &'a [Block], splats: &'a [Splat]| {
            let counted = move |(block, _): &(&Block, &[Splat])| counts(block);
            of_blocks(blocks, splats).filter(counted).flat_map(|(_, splats)| splats)
        };
        of_class(&self.aggregates, &splats.aggregates)
            .chain(of_class(&self.splashes, &splats.splashes))
    }
}

/// Each block with its splats.
pub fn of_blocks<'a>(
    blocks: &'a [Block],
    splats: &'a [Splat],
) -> impl Iterator<Item = (&'a Block, &'a [Splat])> {
    blocks.iter().zip(splats.chunks(SIZE))
}
