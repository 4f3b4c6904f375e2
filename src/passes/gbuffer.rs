//! The G-buffer of the opaque scene: `shaders/gbuffer.wgsl`.

use glam::UVec2;
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::D2;

use super::scene_binding::SceneBinding;
use super::{CameraBinding, GBufferImages, Layers};
use crate::gpu::{self, Bound, Gpu, Span};

/// Draws the G-buffer.
#[derive(Debug)]
pub struct GBuffer {
    images: Bound,
    pipeline: wgpu::ComputePipeline,
    /// Workgroups along x and y.
    groups: (u32, u32),
}

impl GBufferImages {
    /// Creates empty images; the planes get `levels` mip levels.
    pub fn new(gpu: &Gpu, size: UVec2, levels: u32) -> Self {
        let usage = wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC;
        let new = |label: &str, levels: u32| {
            gpu.mipped_texture(label, size, 1, levels, Layers::FORMAT, usage)
        };
        Self { planes: new("gbuffer planes", levels), surfaces: new("gbuffer surfaces", 1) }
    }
}

impl GBuffer {
    /// Prepares the G-buffer of the bound scene.
    pub fn prepare(
        gpu: &Gpu,
        camera: &CameraBinding,
        scene: &SceneBinding,
        images: &GBufferImages,
    ) -> Self {
        let GBufferImages { planes, surfaces } = images;
        let size = UVec2::new(planes.width(), planes.height());
        let written = gpu::storage_texture(Layers::FORMAT, D2);
        let [planes, surfaces] = [planes, surfaces].map(|texture| gpu::layer_view(texture, 0));
        let bindings = [(written, TextureView(&planes)), (written, TextureView(&surfaces))];
        let images = gpu.bind("gbuffer", &bindings);
        let layouts = [&camera.layout, &images.layout, &scene.layout];
        let constants = [&scene.variant.constants()[..], &camera.constants()].concat();
        let pipeline = gpu.compute_pipeline("gbuffer.wgsl", "gbuffer", &layouts, &constants);
        Self { images, pipeline, groups: gpu::workgroups(size) }
    }

    /// Records the solids as the camera sees them.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        scene: &SceneBinding,
        span: Span<'_>,
    ) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("gbuffer"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &camera.group, &[]);
        pass.set_bind_group(1, &self.images.group, &[]);
        pass.set_bind_group(2, &scene.group, &[]);
        pass.dispatch_workgroups(self.groups.0, self.groups.1, 1);
    }
}
