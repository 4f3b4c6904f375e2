//! Motion of foam and spray: `shaders/surface/spheres.wgsl`.

use glam::Vec3;
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::D2;

use super::Before;
use crate::gpu::{self, Bound, Commands, Gpu, Kernel, Span};
use crate::passes::diffuse::{self, DiffuseImages};
use crate::passes::view_passes::ViewPasses;

/// Bytes of a pixel's sum.
const SUM: u64 = 16;

/// Adds the motion of the spheres in the air to their pixels.
#[derive(Debug)]
pub(super) struct SphereMotion {
    /// Of small and of large spheres.
    pipelines: [wgpu::ComputePipeline; 2],
    /// The number of spheres, and groups 1 and 3, by chunk.
    chunks: Vec<(u32, Bound, Bound)>,
    /// Motion times the covered share of the pixel, right and down, and that share.
    pub(super) sums: wgpu::Buffer,
}

impl SphereMotion {
    /// Prepares the motion of spheres since the frame before.
    pub(super) fn prepare(
        gpu: &Gpu,
        eye: &ViewPasses,
        images: &DiffuseImages,
        params: diffuse::Params,
        before: &wgpu::Buffer,
    ) -> Self {
        // New buffers are 0.
        let sums = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("motion of spheres"),
            size: SUM * u64::from(images.size().element_product()),
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        });
        let planes = eye.images.gbuffer.planes.create_view(&Default::default());
        let velocities = images.spheres().diffuse.velocities.as_deref();
        let mut first = 0;
        let chunks = images.covered_chunks(gpu, params).into_iter().map(|(count, covered)| {
            let range = first..first + count as usize;
            first = range.end;
            let of_chunk = velocities.map_or(&[Vec3::ZERO][..], |velocities| &velocities[range]);
            let usage = wgpu::BufferUsages::STORAGE;
            let of_chunk = gpu.buffer_with("velocities of spheres", usage, of_chunk);
            let bindings = [
                (gpu::uniform::<Before>(), before.as_entire_binding()),
                (gpu::storage_of(4), of_chunk.as_entire_binding()),
                (gpu::storage_read_write(SUM), sums.as_entire_binding()),
                (gpu::sampled(D2), TextureView(&planes)),
            ];
            (count, covered, gpu.bind("motion of spheres", &bindings))
        });
        let chunks: Vec<_> = chunks.collect();
        let (_, covered, own) = &chunks[0];
        let layouts = [&eye.camera.layout, &covered.layout, &eye.scene.layout, &own.layout];
        let switch = |on: bool| f64::from(u8::from(on));
        let switches = [
            ("SHOWN", switch(eye.config().host)),
            ("SPHERE_VELOCITIES", switch(velocities.is_some())),
        ];
        let constants = [&switches[..], &eye.camera.constants()].concat();
        let pipeline = |entry: &str| {
            Kernel::new("surface/spheres.wgsl", Default::default(), entry, &layouts, &constants)
        };
        let pipelines = gpu.pipelines([pipeline("add_small"), pipeline("add_large")]);
        Self { pipelines, chunks, sums }
    }

    /// Records the sums.
    pub(super) fn record(&self, commands: &mut Commands<'_>, eye: &ViewPasses, span: Span<'_>) {
        commands.reserve(self.chunks.iter().map(|(count, ..)| u64::from(*count)).sum());
        let mut pass = commands.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("surface"),
            timestamp_writes: span.compute(),
        });
        pass.set_bind_group(0, &eye.camera.group, &[]);
        pass.set_bind_group(2, &eye.scene.group, &[]);
        let [small, large] = &self.pipelines;
        for (count, covered, own) in &self.chunks {
            pass.set_bind_group(1, &covered.group, &[]);
            pass.set_bind_group(3, &own.group, &[]);
            pass.set_pipeline(small);
            gpu::dispatch(&mut pass, count.div_ceil(diffuse::THREADS));
            pass.set_pipeline(large);
            gpu::dispatch(&mut pass, diffuse::LARGE_GROUPS);
        }
    }
}
