//! Planes of the opaque fluids' first and last surface: `shaders/opaque.wgsl`. They take the place of the G-buffer.

use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::D2;

use super::view_passes::ViewPasses;
use super::{GBufferImages, Layers};
use crate::gpu::{self, Bound, Gpu, Span};

/// `Params` of `opaque.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Depth of the surface below that of the particles, m.
    pub depth: f32,
}

/// Depth of the surface below that of the particles, in particle radii. The surface of all fluids together differs from that
/// of the opaque ones by less.
const DEPTH: f32 = 0.5;

/// Draws the planes.
#[derive(Debug)]
pub struct OpaquePlanes {
    pipeline: wgpu::ComputePipeline,
    images: Bound,
    /// Workgroups along x and y.
    groups: (u32, u32),
}

impl OpaquePlanes {
    /// Prepares what `view` of the opaque particles, which have `radius`, m, shows in the images of a G-buffer.
    pub fn prepare(gpu: &Gpu, view: &ViewPasses, radius: f32, images: &GBufferImages) -> Self {
        let params = gpu.buffer_with("opaque", gpu::UNIFORM, &[Params { depth: DEPTH * radius }]);
        let splash = view.splash_layers();
        let aggregates = view.aggregate_layers();
        let size = UVec2::new(images.planes.width(), images.planes.height());
        let [planes, backs] =
            [&images.planes, &images.surfaces].map(|texture| gpu::layer_view(texture, 0));
        let bindings = [
            (gpu::uniform::<Params>(), params.as_entire_binding()),
            (gpu.layers(), TextureView(&aggregates.view)),
            (gpu.layers(), TextureView(&splash.unwrap_or(aggregates).view)),
            (gpu::storage_texture(Layers::FORMAT, D2), TextureView(&planes)),
            (gpu::storage_texture(Layers::FORMAT, D2), TextureView(&backs)),
        ];
        let images = gpu.bind("opaque", &bindings);
        let switch = [("SPLASH", f64::from(u8::from(splash.is_some())))];
        let constants = [&switch[..], &view.camera.constants()].concat();
        let layouts = [&view.camera.layout, &images.layout];
        let pipeline = gpu.compute_pipeline("opaque.wgsl", "opaque", &layouts, &constants);
        Self { pipeline, images, groups: gpu::workgroups(size) }
    }

    /// Records the planes.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, view: &ViewPasses, span: Span<'_>) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("opaque"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &view.camera.group, &[]);
        pass.set_bind_group(1, &self.images.group, &[]);
        pass.dispatch_workgroups(self.groups.0, self.groups.1, 1);
    }
}
