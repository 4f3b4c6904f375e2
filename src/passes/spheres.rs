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
    /// Their box relative to their origin, m.
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
        let spheres = diffuse.positions.iter().zip(&diffuse.radii);
        let bounds = spheres.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], (&x, &r)| {
            [low.min(x - r), high.max(x + r)]
        });
        Self { chunks, diffuse: diffuse.clone(), bounds }
    }

    /// Their box in world space, m.
    pub fn extent(&self) -> [DVec3; 2] {
        self.bounds.map(|corner| self.diffuse.origin + corner.as_dvec3())
    }
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
