//! The G-buffer of a host's opaque scene, from its depths: `shaders/host.wgsl`. Replaces that of the solids.

use bytemuck::{Pod, Zeroable};
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::D2;

use super::{CameraBinding, GBufferImages, Layers};
use crate::gpu::{self, Bound, Gpu, Span};
use crate::host;

/// `Params` of `host.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Disparity is (depth + offset) × slope.
    pub offset: f32,
    /// Change of disparity with depth.
    pub slope: f32,
    /// Depth where nothing was drawn.
    pub cleared: f32,
}

/// Draws the G-buffer of a host's scene.
#[derive(Debug)]
pub struct HostPass {
    pipeline: wgpu::ComputePipeline,
    images: Bound,
    /// Workgroups along x and y.
    groups: (u32, u32),
}

impl HostPass {
    /// Prepares what the host's depths show in the images of a G-buffer. `far` is the depth of an orthographic view's far
    /// plane, m.
    pub fn prepare(
        gpu: &Gpu,
        camera: &CameraBinding,
        host: &host::Host,
        far: f32,
        images: &GBufferImages,
    ) -> Self {
        let code = host.depth_code();
        let (offset, slope) = code.disparity(f64::from(far));
        let (offset, slope) = (offset as f32, slope as f32);
        let params = Params { offset, slope, cleared: code.cleared() as f32 };
        let params = gpu.buffer_with("host", gpu::UNIFORM, &[params]);
        let GBufferImages { planes, surfaces } = images;
        let size = glam::UVec2::new(planes.width(), planes.height());
        let [planes, surfaces] = [planes, surfaces].map(|texture| gpu::layer_view(texture, 0));
        let normals = host.normals.as_ref();
        let written = gpu::storage_texture(Layers::FORMAT, D2);
        let bindings = [
            (gpu::uniform::<Params>(), params.as_entire_binding()),
            (gpu::sampled(D2), TextureView(&host.depth)),
            (gpu::sampled(D2), TextureView(normals.unwrap_or(&host.color))),
            (written, TextureView(&planes)),
            (written, TextureView(&surfaces)),
        ];
        let images = gpu.bind("host", &bindings);
        let switch = [("NORMALS", f64::from(u8::from(normals.is_some())))];
        let constants = [&switch[..], &camera.constants()].concat();
        let layouts = [&camera.layout, &images.layout];
        let pipeline = gpu.compute_pipeline("host.wgsl", "host", &layouts, &constants);
        Self { pipeline, images, groups: gpu::workgroups(size) }
    }

    /// Records the images.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        span: Span<'_>,
    ) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("host"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &camera.group, &[]);
        pass.set_bind_group(1, &self.images.group, &[]);
        pass.dispatch_workgroups(self.groups.0, self.groups.1, 1);
    }
}
