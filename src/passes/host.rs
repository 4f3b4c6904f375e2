//! The G-buffer of a host's opaque scene, from its depths: `shaders/host.wgsl`. Replaces that of the solids.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use wgpu::TextureViewDimension::D2;

use super::{CameraBinding, GBufferImages, Layers};
use crate::gpu::{self, Gpu, Span};
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
pub struct Host {
    /// By whether there are normals, and whether the view is orthographic.
    pipelines: HashMap<(bool, bool), wgpu::ComputePipeline>,
    params: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
}

impl Host {
    /// Creates the layout; pipelines are compiled on first use.
    pub fn new(gpu: &Gpu) -> Self {
        let bindings = [
            gpu::uniform::<Params>(),
            gpu::sampled(D2),
            gpu::sampled(D2),
            gpu::storage_texture(Layers::FORMAT, D2),
            gpu::storage_texture(Layers::FORMAT, D2),
        ];
        Self {
            pipelines: HashMap::new(),
            params: gpu::uniform_buffer::<Params>(gpu, "host"),
            layout: gpu.layout("host", wgpu::ShaderStages::COMPUTE, &bindings),
        }
    }

    /// Writes the parameters and compiles the pipeline for the camera if it is new. `far` is the depth of an
    /// orthographic view's far plane, m.
    pub fn prepare(&mut self, gpu: &Gpu, camera: &CameraBinding, host: &host::Host, far: f32) {
        let code = host.depth_code();
        let (offset, slope) = code.disparity(f64::from(far));
        let (offset, slope) = (offset as f32, slope as f32);
        let params = Params { offset, slope, cleared: code.cleared() as f32 };
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&params));
        let normals = host.normals.is_some();
        let layouts = [&camera.layout, &self.layout];
        self.pipelines.entry((normals, camera.is_orthographic())).or_insert_with(|| {
            let switch = [("NORMALS", f64::from(u8::from(normals)))];
            let constants = [&switch[..], &camera.constants()].concat();
            gpu::compute_pipeline(gpu, "host.wgsl", "host", &layouts, &constants)
        });
    }

    /// Records what the host's depths show into the images of a G-buffer.
    pub fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        host: &host::Host,
        images: &GBufferImages,
        span: Span<'_>,
    ) {
        let views = [&images.planes, &images.surfaces].map(|texture| gpu::layer_view(texture, 0));
        let normals = host.normals.as_ref();
        let resources = [
            self.params.as_entire_binding(),
            wgpu::BindingResource::TextureView(&host.depth),
            wgpu::BindingResource::TextureView(normals.unwrap_or(&host.color)),
            wgpu::BindingResource::TextureView(&views[0]),
            wgpu::BindingResource::TextureView(&views[1]),
        ];
        let group = gpu::bind_group(gpu, "host", &self.layout, &resources);
        let size = glam::UVec2::new(images.planes.width(), images.planes.height());
        let (x, y) = gpu::workgroups(size);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("host"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.pipelines[&(normals.is_some(), camera.is_orthographic())]);
        pass.set_bind_group(0, &camera.group, &[]);
        pass.set_bind_group(1, &group, &[]);
        pass.dispatch_workgroups(x, y, 1);
    }
}
