//! Mip levels of the layers: `shaders/mips/`. Only the intersectors that filter read them.

use wgpu::TextureViewDimension::{self, D2, D2Array};

use super::Layers;
use crate::gpu::{self, Gpu, Span};

/// Most mip levels of a layer, as in `common/layers.wgsl`.
const MIP_LEVELS: u32 = 8;

/// Number of mip levels of a picture of `size` pixels.
pub fn levels(size: glam::UVec2) -> u32 {
    MIP_LEVELS.min(size.max_element().ilog2() + 1)
}

/// Generates mip levels from level 0.
#[derive(Debug)]
pub struct Mips {
    layers: Downsampler,
    planes: Downsampler,
}

/// Downsamples textures of one view dimension.
#[derive(Debug)]
struct Downsampler {
    dimension: TextureViewDimension,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

impl Mips {
    /// Compiles the pipelines.
    pub fn new(gpu: &Gpu) -> Self {
        let downsampler = |file, dimension| {
            let bindings =
                [gpu::sampled(dimension), gpu::storage_texture(Layers::FORMAT, dimension)];
            let layout = gpu.layout("mips", wgpu::ShaderStages::COMPUTE, &bindings);
            let pipeline = gpu::compute_pipeline(gpu, file, "coarsen", &[&layout], &[]);
            Downsampler { dimension, pipeline, layout }
        };
        Self {
            layers: downsampler("mips/layers.wgsl", D2Array),
            planes: downsampler("mips/planes.wgsl", D2),
        }
    }

    /// Records the mip levels of `textures`, with or without layers.
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
            let downsampler =
                if texture.depth_or_array_layers() > 1 { &self.layers } else { &self.planes };
            pass.set_pipeline(&downsampler.pipeline);
            for level in 1..texture.mip_level_count() {
                let [finer, coarser] =
                    [level - 1, level].map(|l| gpu::level_view(texture, l, downsampler.dimension));
                let resources = [&finer, &coarser].map(wgpu::BindingResource::TextureView);
                let group = gpu::bind_group(gpu, "mips", &downsampler.layout, &resources);
                pass.set_bind_group(0, &group, &[]);
                let size = glam::UVec2::new(texture.width(), texture.height());
                let (x, y) = gpu::workgroups((size >> level).max(glam::UVec2::ONE));
                // The sides of gaps are read at level 0 alone.
                pass.dispatch_workgroups(x, y, texture.depth_or_array_layers().min(2));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Guards intersectors against reading mip levels that do not exist.
    #[test]
    fn levels_are_those_of_the_shader() {
        let levels = gpu::shader::constant("common/layers.wgsl", "MIP_LEVELS");
        assert_eq!(levels, f64::from(MIP_LEVELS));
    }
}
