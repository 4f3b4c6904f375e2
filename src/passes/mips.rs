//! Mip levels of layers: `shaders/mips/`. Only the intersectors that filter read them.

use wgpu::TextureViewDimension::{self, D2, D2Array};

use super::Layers;
use crate::gpu::{self, Gpu, Span};

/// Levels of a layer with mip levels, as `common/layers.wgsl` has them.
const MIP_LEVELS: u32 = 8;

/// Mip levels that a picture of `size` pixels has.
pub fn levels(size: glam::UVec2) -> u32 {
    MIP_LEVELS.min(size.max_element().ilog2() + 1)
}

/// Fills mip levels from level 0.
#[derive(Debug)]
pub struct Mips {
    layers: Kind,
    planes: Kind,
}

/// What coarsens textures of one kind of view.
#[derive(Debug)]
struct Kind {
    dimension: TextureViewDimension,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl Mips {
    /// Compiles the pipelines.
    pub fn new(gpu: &Gpu) -> Self {
        let kind = |file, dimension| {
            let bindings =
                [gpu::sampled(dimension), gpu::storage_texture(Layers::FORMAT, dimension)];
            let layout = gpu.layout("mips", wgpu::ShaderStages::COMPUTE, &bindings);
            let pipeline = gpu::compute_pipeline(gpu, file, "coarsen", &[&layout], &[]);
            Kind { dimension, pipeline, layout }
        };
        Self { layers: kind("mips/layers.wgsl", D2Array), planes: kind("mips/planes.wgsl", D2) }
    }

    /// Fills the mip levels of `textures`, with layers or without.
    pub fn record(
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
        for texture in textures {
            let kind =
                if texture.depth_or_array_layers() > 1 { &self.layers } else { &self.planes };
            pass.set_pipeline(&kind.pipeline);
            for level in 1..texture.mip_level_count() {
                let [finer, coarser] =
                    [level - 1, level].map(|l| gpu::level_view(texture, l, kind.dimension));
                let resources = [&finer, &coarser].map(wgpu::BindingResource::TextureView);
                let group = gpu::bind_group(gpu, "mips", &kind.layout, &resources);
                pass.set_bind_group(0, &group, &[]);
                let size = glam::UVec2::new(texture.width(), texture.height());
                let (x, y) = gpu::workgroups((size >> level).max(glam::UVec2::ONE));
                pass.dispatch_workgroups(x, y, texture.depth_or_array_layers());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Protects intersectors that read mip levels from those that are not there.
    #[test]
    fn levels_are_those_of_the_shader() {
        let levels = gpu::shader::constant("common/layers.wgsl", "MIP_LEVELS");
        assert_eq!(levels, f64::from(MIP_LEVELS));
    }
}
