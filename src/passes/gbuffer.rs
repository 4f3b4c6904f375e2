//! The G-buffer of the opaque scene: `shaders/gbuffer.wgsl`.

use std::collections::HashMap;

use glam::UVec2;
use wgpu::TextureViewDimension::D2;

use super::scene_binding::{SceneBinding, SceneVariant};
use super::{CameraBinding, GBufferImages, Layers};
use crate::gpu::{self, Gpu, Span};

/// Draws the G-buffer.
#[derive(Debug)]
pub struct GBuffer {
    /// Output.
    pub images: GBufferImages,
    pipelines: HashMap<SceneVariant, wgpu::ComputePipeline>,
    layout: wgpu::BindGroupLayout,
}

impl GBuffer {
    /// Creates the layout; pipelines are compiled on first use.
    pub fn new(gpu: &Gpu) -> Self {
        let bindings =
            [gpu::storage_texture(Layers::FORMAT, D2), gpu::storage_texture(Layers::FORMAT, D2)];
        let layout = gpu.layout("gbuffer", wgpu::ShaderStages::COMPUTE, &bindings);
        Self { images: create_images(gpu, UVec2::ONE, 1), pipelines: HashMap::new(), layout }
    }

    /// Compiles the pipeline for the bound scene if it is new.
    pub fn prepare(&mut self, gpu: &Gpu, camera: &CameraBinding, scene: &SceneBinding) {
        let layouts = [&camera.layout, &self.layout, &scene.layout];
        self.pipelines.entry(scene.variant).or_insert_with(|| {
            let constants = [&scene.variant.constants()[..], &camera.constants()].concat();
            gpu::compute_pipeline(gpu, "gbuffer.wgsl", "gbuffer", &layouts, &constants)
        });
    }

    /// Replaces the images; the planes get `levels` mip levels.
    pub fn resize(&mut self, gpu: &Gpu, size: UVec2, levels: u32) {
        self.images = create_images(gpu, size, levels);
    }

    /// As [`super::splat::Splat::share`].
    pub fn share(&mut self, other: &Self) {
        self.images = other.images.clone();
    }

    /// Records the solids as the camera sees them.
    pub fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        scene: &SceneBinding,
        span: Span<'_>,
    ) {
        let views =
            [&self.images.planes, &self.images.surfaces].map(|texture| gpu::layer_view(texture, 0));
        let resources = views.each_ref().map(wgpu::BindingResource::TextureView);
        let group = gpu::bind_group(gpu, "gbuffer", &self.layout, &resources);
        let planes = &self.images.planes;
        let (x, y) = gpu::workgroups(UVec2::new(planes.width(), planes.height()));
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("gbuffer"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.pipelines[&scene.variant]);
        pass.set_bind_group(0, &camera.group, &[]);
        pass.set_bind_group(1, &group, &[]);
        pass.set_bind_group(2, &scene.group, &[]);
        pass.dispatch_workgroups(x, y, 1);
    }
}

fn create_images(gpu: &Gpu, size: UVec2, levels: u32) -> GBufferImages {
    let usage = wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    let new = |label: &str, levels: u32| {
        gpu::mipped_texture(gpu, label, size, 1, levels, Layers::FORMAT, usage)
    };
    GBufferImages { planes: new("gbuffer planes", levels), surfaces: new("gbuffer surfaces", 1) }
}
