//! Bounds of the liquid's disparity in each tile: `shaders/bounds.wgsl`. The intersector `guarded` reads them.

use glam::UVec2;
use wgpu::TextureViewDimension::D2;

use super::view_passes::ViewPasses;
use super::{CameraBinding, Layers};
use crate::gpu::{self, Gpu, Span, TILE};

/// Finds the bounds.
#[derive(Debug)]
pub struct Bounds {
    /// Output: of each tile the largest disparity of the aggregates' fronts and the smallest of their backs, and
    /// the same of the splashes, 1/m (orthographic: m); 0 without any.
    pub view: wgpu::TextureView,
    size: UVec2,
    layout: wgpu::BindGroupLayout,
    /// Without and with splashes, for perspective and orthographic views; compiled on first use.
    pipelines: [[Option<wgpu::ComputePipeline>; 2]; 2],
}

impl Bounds {
    /// Creates the layout; pipelines are compiled on first use.
    pub fn new(gpu: &Gpu) -> Self {
        let bindings = [
            gpu.layers(),
            gpu.layers(),
            gpu::storage_of(8),
            gpu::storage_of(8),
            gpu::storage_texture(Layers::FORMAT, D2),
        ];
        let layout = gpu.layout("bounds", wgpu::ShaderStages::COMPUTE, &bindings);
        let pipelines = [const { [const { None }; 2] }; 2];
        Self { view: create_view(gpu, UVec2::ONE), size: UVec2::ONE, layout, pipelines }
    }

    /// Replaces the texture to match a picture of `size` pixels, and compiles what is missing.
    pub fn prepare(&mut self, gpu: &Gpu, camera: &CameraBinding, size: UVec2, splash: bool) {
        if self.size != size {
            (self.view, self.size) = (create_view(gpu, size), size);
        }
        let kept = &mut self.pipelines[usize::from(camera.is_orthographic())][usize::from(splash)];
        kept.get_or_insert_with(|| {
            let splash = [("SPLASH", f64::from(u8::from(splash)))];
            let constants = [&camera.constants()[..], &splash].concat();
            let layouts = [&camera.layout, &self.layout];
            gpu::compute_pipeline(gpu, "bounds.wgsl", "bound", &layouts, &constants)
        });
    }

    /// Records the bounds of a view's layers; requires [`Bounds::prepare`].
    pub fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        eye: &ViewPasses,
        span: Span<'_>,
    ) {
        let splash = usize::from(eye.splash_layers().is_some());
        let pipeline = &self.pipelines[usize::from(eye.camera.is_orthographic())][splash];
        let Some(pipeline) = pipeline else { return };
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("bounds"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &eye.camera.group, &[]);
        let tiles = &eye.images.tiles;
        for section in tiles.sections() {
            let resources = [
                wgpu::BindingResource::TextureView(&eye.aggregate_layers().view),
                wgpu::BindingResource::TextureView(&eye.images.splat.splash.view),
                tiles.section(&tiles.liquid, section),
                tiles.section(&tiles.background, section),
                wgpu::BindingResource::TextureView(&self.view),
            ];
            let group = gpu::bind_group(gpu, "bounds", &self.layout, &resources);
            pass.set_bind_group(1, &group, &[]);
            gpu::dispatch(&mut pass, tiles.groups_of_eight());
        }
    }
}

fn create_view(gpu: &Gpu, size: UVec2) -> wgpu::TextureView {
    let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING;
    let tiles = size.map(|n| n.div_ceil(TILE));
    gpu::texture(gpu, "bounds", tiles, 1, Layers::FORMAT, usage).create_view(&Default::default())
}
