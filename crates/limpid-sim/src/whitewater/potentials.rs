//! The potentials of a frame's particles to make whitewater.

use glam::Vec3;
use rayon::prelude::*;

use super::flow::{Flow, MEAN_WEIGHT, weight};

/// Particles per parallel task. It does not affect results.
const CHUNK: usize = 512;

/// Least asymmetry of the neighbours of a particle at a surface: 0 within liquid, 1/2 on its flat surface.
const SURFACE: f32 = 0.25;

/// Least cosine between velocity and normal where a crest breaks (Ihmsen et al. 2012, equation 7).
const BREAKING: f32 = 0.6;

/// The potentials of one particle of liquid, before they are clamped.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Potentials {
    /// Mean speed at which neighbours meet the particle, m/s: equation 2 of Ihmsen et al. 2012, `v_diff`, divided by the sum
    /// of weights within liquid. Equal opposite streams of speed u that mix have about u.
    pub air: f32,
    /// Curvature of a crest that moves outwards, 0 elsewhere: equations 4 to 7, κ, divided by the same.
    pub crest: f32,
    /// Square of the speed, (m/s)².
    pub square: f32,
    /// Unit normal of the surface, out of the liquid; 0 within it.
    pub normal: Vec3,
    /// Number of neighbours.
    pub neighbours: u32,
}

/// The normal at a particle, if it is on a surface, and the number of its neighbours.
fn normal(flow: &Flow, i: usize, near: &mut Vec<u32>) -> (Vec3, u32) {
    let (x, _) = flow.at(i);
    flow.near(x, i, near);
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for &j in near.iter() {
        let away = x - flow.at(j as usize).0;
        let own = weight(away.length() / flow.support());
        sum += own * away.normalize_or_zero();
        weights += own;
    }
    let at_surface = sum.length() > SURFACE * weights;
    (if at_surface { sum.normalize_or_zero() } else { Vec3::ZERO }, near.len() as u32)
}

impl Potentials {
    /// The potentials of a frame's particles, in the order of the file. `full` is the number of neighbours within liquid.
    pub fn of(flow: &Flow, full: f32) -> Vec<Self> {
        let sorted = Self::sorted(flow, full);
        let mut all = vec![Self::default(); sorted.len()];
        for (i, own) in sorted.into_iter().enumerate() {
            all[flow.number(i) as usize] = own;
        }
        all
    }

    /// As [`Potentials::of`], in the sorted order.
    pub(crate) fn sorted(flow: &Flow, full: f32) -> Vec<Self> {
        let count = flow.len();
        let each = |of: &(dyn Fn(usize, &mut Vec<u32>) -> Self + Sync)| -> Vec<Self> {
            let mut all = vec![Self::default(); count];
            let chunks = all.par_chunks_mut(CHUNK).enumerate();
            chunks.for_each_init(Vec::new, |near, (chunk, all)| {
                for (i, own) in (chunk * CHUNK..).zip(all) {
                    *own = of(i, near);
                }
            });
            all
        };
        let normals = each(&|i, near| {
            let (normal, neighbours) = normal(flow, i, near);
            Self { normal, neighbours, ..Self::default() }
        });
        let whole = (full * MEAN_WEIGHT).max(f32::MIN_POSITIVE);
        each(&|i, near| {
            let Self { normal, neighbours, .. } = normals[i];
            let (x, v) = flow.at(i);
            flow.near(x, i, near);
            let (mut air, mut crest) = (0.0, 0.0);
            let breaks = normal != Vec3::ZERO && v.dot(normal) >= BREAKING * v.length();
            for &j in near.iter() {
                let (at, velocity) = flow.at(j as usize);
                let away = x - at;
                let own = weight(away.length() / flow.support());
                let (apart, meets) = (v - velocity, away.normalize_or_zero());
                // |v_ij| (1 − v̂_ij · x̂_ij)
                air += own * (apart.length() - apart.dot(meets));
                let other = normals[j as usize].normal;
                if breaks && other != Vec3::ZERO && meets.dot(normal) > 0.0 {
                    crest += own * (1.0 - normal.dot(other));
                }
            }
            let (air, crest) = (air / whole, crest / whole);
            Self { air, crest, square: v.length_squared(), normal, neighbours }
        })
    }
}
