//! Foam, spray, bubbles and dust on the device.

use std::ops::Range;
use std::sync::Arc;

use glam::{DVec3, Vec3, Vec4};

use crate::diffuse::Diffuse;
use crate::gpu::Gpu;

/// The spheres of a frame.
#[derive(Debug, Clone)]
pub struct Spheres {
    /// Each as large as one binding allows.
    pub chunks: Vec<SphereChunk>,
    /// On the host.
    pub diffuse: Arc<Diffuse>,
    /// A box of almost all of them relative to their origin, m.
    bounds: [Vec3; 2],
}

/// Consecutive spheres.
#[derive(Debug, Clone)]
pub struct SphereChunk {
    /// Number of spheres.
    pub count: u32,
    /// Centres relative to the particles' origin, and radii, m.
    pub spheres: wgpu::Buffer,
    /// Kind in two bits, opacity in 16.
    pub traits: wgpu::Buffer,
}

impl Spheres {
    /// Uploads spheres, `most` in a chunk.
    pub fn new(gpu: &Gpu, diffuse: &Arc<Diffuse>, most: usize) -> Self {
        let range = |start: usize| start..(start + most).min(diffuse.len());
        let starts = (0..diffuse.len()).step_by(most);
        let chunks = starts.map(|start| SphereChunk::new(gpu, diffuse, range(start))).collect();
        Self { chunks, diffuse: diffuse.clone(), bounds: usual_bounds(diffuse) }
    }

    /// A box in world space, m, of all of them but outliers, for grids that these would widen.
    pub fn extent(&self) -> [DVec3; 2] {
        self.bounds.map(|corner| self.diffuse.origin + corner.as_dvec3())
    }
}

/// Spheres that tell where most are.
const SAMPLE: usize = 4096;
/// Share of them at either end of each axis that may be outliers, and how far from the others one is, in extents of those.
const OUTLYING: f64 = 0.005;
const FAR: f32 = 1.0;

/// The box of the spheres; of outliers it has a margin alone.
fn usual_bounds(diffuse: &Diffuse) -> [Vec3; 2] {
    let spheres = diffuse.positions.iter().zip(&diffuse.radii);
    let all = spheres.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], (&x, &r)| {
        [low.min(x - r), high.max(x + r)]
    });
    // By the golden ratio, lest all be from one side of a lattice.
    let count = diffuse.len().min(SAMPLE);
    let number = |k: usize| ((k as f64 * 0.618_033_988_75).fract() * diffuse.len() as f64) as usize;
    let number = |k: usize| if count == diffuse.len() { k } else { number(k) };
    let largest = diffuse.radii.iter().copied().fold(0.0, f32::max);
    let mut usual = all;
    for axis in 0..3 {
        let mut sample: Vec<f32> = (0..count).map(|k| diffuse.positions[number(k)][axis]).collect();
        sample.sort_by(f32::total_cmp);
        let cut = (OUTLYING * sample.len() as f64) as usize;
        if let [low, .., high] = sample[cut..sample.len() - cut] {
            let margin = FAR * (high - low) + largest;
            usual[0][axis] = all[0][axis].max(low - margin);
            usual[1][axis] = all[1][axis].min(high + margin);
        }
    }
    usual
}

impl SphereChunk {
    fn new(gpu: &Gpu, diffuse: &Diffuse, range: Range<usize>) -> Self {
        let sphere = |i: usize| diffuse.positions[i].extend(diffuse.radii[i]);
        let spheres: Vec<Vec4> = range.clone().map(sphere).collect();
        let traits_of = |i: usize| {
            let opacity = (diffuse.opacity(i) * 65535.0).round() as u32;
            diffuse.kinds[i] as u32 | opacity << 2
        };
        let traits: Vec<u32> = range.clone().map(traits_of).collect();
        Self {
            count: range.len() as u32,
            spheres: gpu.buffer_with("spheres", wgpu::BufferUsages::STORAGE, &spheres),
            traits: gpu.buffer_with("traits", wgpu::BufferUsages::STORAGE, &traits),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One sphere a kilometre away leaves the others their box; it would make cells and columns of shadows 100 times as wide.
    #[test]
    fn outliers_do_not_widen_the_box() {
        let near =
            (0..2000).map(|i| Vec3::new((i % 20) as f32, (i / 20 % 10) as f32, (i / 200) as f32));
        let near: Vec<_> = near.collect();
        let bounds =
            |positions: &[Vec3]| usual_bounds(&Diffuse::from_positions(positions.to_vec(), 0.5));
        assert_eq!(bounds(&near), [Vec3::splat(-0.5), Vec3::new(19.5, 9.5, 9.5)]);
        let far = [&near[..], &[Vec3::new(1000.0, 0.0, -1000.0)]].concat();
        let [low, high] = bounds(&far);
        assert!(low.cmpge(Vec3::splat(-20.0)).all() && high.cmple(Vec3::splat(40.0)).all());
        // Few spheres have no outliers.
        let two = [Vec3::ZERO, Vec3::new(1000.0, 0.0, 0.0)];
        assert_eq!(bounds(&two), [Vec3::splat(-0.5), Vec3::new(1000.5, 0.5, 0.5)]);
    }
}
