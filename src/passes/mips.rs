//! Mip levels of layers: `shaders/mips.wgsl`. Only the intersectors that filter read them.

use wgpu::TextureViewDimension::D2Array;

use super::Layers;
use crate::gpu::{self, Gpu, Span};

/// Levels of a layer with mip levels, as `common/layers.wgsl` has them.
const MIP_LEVELS: u32 = 8;

/// Mip levels that a picture of `size` pixels has.
pub(crate) fn levels(size: glam::UVec2) -> u32 {
    MIP_LEVELS.min(size.max_element().ilog2() + 1)
}

/// Fills mip levels from level 0.
#[derive(Debug)]
pub(crate) struct Mips {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl Mips {
    /// Compiles the pipeline.
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let bindings = [gpu::sampled(D2Array), gpu::storage_texture(Layers::FORMAT, D2Array)];
        let layout = gpu.layout("mips", wgpu::ShaderStages::COMPUTE, &bindings);
        let pipeline = gpu::compute_pipeline(gpu, "mips.wgsl", "coarsen", &[&layout], &[]);
        Self { pipeline, layout }
    }

    /// Fills the mip levels of `textures`, arrays or not.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        textures: &[&wgpu::Texture],
        span: Span<'_>,
    ) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("mips"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.pipeline);
        for texture in textures {
            for level in 1..texture.mip_level_count() {
                let [finer, coarser] = [level - 1, level].map(|l| gpu::level_view(texture, l));
                let resources = [&finer, &coarser].map(wgpu::BindingResource::TextureView);
                pass.set_bind_group(
                    0,
                    &gpu::bind_group(gpu, "mips", &self.layout, &resources),
                    &[],
                );
                let size = glam::UVec2::new(texture.width(), texture.height());
                let (x, y) = gpu::workgroups((size >> level).max(glam::UVec2::ONE));
                pass.dispatch_workgroups(x, y, texture.depth_or_array_layers());
            }
        }
    }
}
