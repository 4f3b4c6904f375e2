//! Bounds of the liquid's disparity in each tile: `shaders/bounds.wgsl`. The intersector `guarded` reads them.

use glam::UVec2;
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::D2;

use super::tiles::TileLists;
use super::{CameraBinding, Layers};
use crate::gpu::{self, Bound, Gpu, Span, TILE};

/// Finds the bounds of a view's layers.
#[derive(Debug)]
pub struct Bounds {
    pipeline: wgpu::ComputePipeline,
    /// By section of the tiles.
    sections: Vec<Bound>,
    /// Workgroups of each section.
    groups: u32,
}

impl Bounds {
    /// Prepares the bounds of these layers in `output`, which [`create_view`] made.
    pub fn prepare(
        gpu: &Gpu,
        camera: &CameraBinding,
        tiles: &TileLists,
        aggregate: &Layers,
        splash: Option<&Layers>,
        output: &wgpu::TextureView,
    ) -> Self {
        let bind = |section| {
            let bindings = [
                (gpu.layers(), TextureView(&aggregate.view)),
                (gpu.layers(), TextureView(&splash.unwrap_or(aggregate).view)),
                (gpu::storage_of(8), tiles.section(&tiles.liquid, section)),
                (gpu::storage_of(8), tiles.section(&tiles.background, section)),
                (gpu::storage_texture(Layers::FORMAT, D2), TextureView(output)),
            ];
            gpu.bind("bounds", &bindings)
        };
        let sections: Vec<_> = tiles.sections().map(bind).collect();
        let splash = [("SPLASH", f64::from(u8::from(splash.is_some())))];
        let constants = [&camera.constants()[..], &splash].concat();
        let layouts = [&camera.layout, &sections[0].layout];
        let pipeline = gpu.compute_pipeline("bounds.wgsl", "bound", &layouts, &constants);
        Self { pipeline, sections, groups: tiles.groups_of_eight() }
    }

    /// Records the bounds.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        span: Span<'_>,
    ) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("bounds"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &camera.group, &[]);
        for bound in &self.sections {
            pass.set_bind_group(1, &bound.group, &[]);
            gpu::dispatch(&mut pass, self.groups);
        }
    }
}

/// Creates the bounds of a view of `size` pixels: of each tile the largest disparity of the aggregates' fronts and the
/// smallest of their backs, and the same of the splashes, 1/m (orthographic: m); 0 without any.
pub fn create_view(gpu: &Gpu, size: UVec2) -> wgpu::TextureView {
    let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING;
    let tiles = size.map(|n| n.div_ceil(TILE));
    gpu.texture("bounds", tiles, 1, Layers::FORMAT, usage).create_view(&Default::default())
}
