//! Mip levels of the layers: `shaders/mips/`. Only the intersectors that filter read them.

use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::{D2, D2Array};

use super::Layers;
use crate::gpu::{self, Bound, Gpu, Span};

/// Most mip levels of a layer, as in `common/layers.wgsl`.
const MIP_LEVELS: u32 = 8;

/// Number of mip levels of a picture of `size` pixels.
pub fn levels(size: glam::UVec2) -> u32 {
    MIP_LEVELS.min(size.max_element().ilog2() + 1)
}

/// Generates mip levels from level 0.
#[derive(Debug)]
pub struct Mips {
    /// From finer levels to coarser ones.
    steps: Vec<Step>,
}

#[derive(Debug)]
struct Step {
    pipeline: wgpu::ComputePipeline,
    levels: Bound,
    groups: [u32; 3],
}

impl Mips {
    /// Prepares the mip levels of `textures`, with or without layers.
    pub fn prepare(gpu: &Gpu, textures: &[&wgpu::Texture]) -> Self {
        let step = |texture: &wgpu::Texture, level: u32| {
            let (shader, dimension) = match texture.depth_or_array_layers() {
                1 => ("mips/planes.wgsl", D2),
                _ => ("mips/layers.wgsl", D2Array),
            };
            let [finer, coarser] =
                [level - 1, level].map(|level| gpu::level_view(texture, level, dimension));
            let bindings = [
                (gpu::sampled(dimension), TextureView(&finer)),
                (gpu::storage_texture(Layers::FORMAT, dimension), TextureView(&coarser)),
            ];
            let levels = gpu.bind("mips", &bindings);
            let pipeline = gpu.compute_pipeline(shader, "coarsen", &[&levels.layout], &[]);
            let size = glam::UVec2::new(texture.width(), texture.height());
            let (x, y) = gpu::workgroups((size >> level).max(glam::UVec2::ONE));
            // The sides of gaps are read at level 0 alone.
            let groups = [x, y, texture.depth_or_array_layers().min(2)];
            Step { pipeline, levels, groups }
        };
        let mut steps = Vec::new();
        for texture in textures {
            steps.extend((1..texture.mip_level_count()).map(|level| step(texture, level)));
        }
        Self { steps }
    }

    /// Records the mip levels.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, span: Span<'_>) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("mips"),
            timestamp_writes: span.compute(),
        });
        for Step { pipeline, levels, groups: [x, y, z] } in &self.steps {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &levels.group, &[]);
            pass.dispatch_workgroups(*x, *y, *z);
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
