//! The mixture of fluids at each pixel: `shaders/mixture.wgsl`.
//!
//! Several fluids share the layers, because light is not refracted where they meet. They differ in
//! absorption: this pass sums length, and absorption times length, over all splats along a pixel's ray.
//! Inside the liquid, the mixture absorbs the light: this is exact for unrefracted light, whatever the
//! order of the fluids. Only fluids of different absorption need the pass.

use glam::{UVec2, Vec4};

use super::CameraBinding;
use super::splat_buffers::{self, SplatBuffers};
use crate::gpu::{self, Gpu, Span};
use crate::scene::{MAX_FLUIDS, Scene};

/// Format of the sums over splats: 16-bit floats are the only ones that every adapter can blend, and an
/// error of two thousandths is negligible against the effect of refraction.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

/// Draws the mixture of a view.
#[derive(Debug)]
pub struct Mixture {
    /// Output: absorption times length, as a share of [`strongest`], and length; one pixel if the
    /// fluids do not differ.
    pub view: wgpu::TextureView,
    pipeline: Option<wgpu::RenderPipeline>,
    absorptions: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
    group: wgpu::BindGroup,
    constants: [(&'static str, f64); 1],
}

/// Whether a scene has fluids of different absorption.
pub fn is_mixed(scene: &Scene) -> bool {
    scene.absorptions().windows(2).any(|pair| pair[0] != pair[1])
}

/// The largest component of any fluid's absorption, 1/m.
pub fn strongest(scene: &Scene) -> f32 {
    scene.absorptions().iter().fold(0.0, |most, absorption| most.max(absorption.max_element()))
}

impl Mixture {
    /// Creates the layout; the pipeline is compiled on first use.
    pub fn new(gpu: &Gpu, camera: &CameraBinding) -> Self {
        let binding = gpu::uniform::<[Vec4; MAX_FLUIDS]>();
        let layout = gpu.layout("fluids", wgpu::ShaderStages::FRAGMENT, &[binding]);
        let absorptions = gpu::uniform_buffer::<[Vec4; MAX_FLUIDS]>(gpu, "fluids");
        let group = gpu::bind_group(gpu, "fluids", &layout, &[absorptions.as_entire_binding()]);
        let constants = camera.constants();
        Self {
            view: create_view(gpu, UVec2::ONE),
            pipeline: None,
            absorptions,
            layout,
            group,
            constants,
        }
    }

    /// Replaces the output.
    pub fn resize(&mut self, gpu: &Gpu, size: UVec2) {
        self.view = create_view(gpu, size);
    }

    /// As [`super::splat::Splat::share`].
    pub fn share(&mut self, other: &Self) {
        self.view = other.view.clone();
    }

    /// Uploads the fluids' absorption for particles of `radius` (m), and compiles the pipeline on first use.
    pub fn prepare(&mut self, gpu: &Gpu, camera: &CameraBinding, scene: &Scene, radius: f32) {
        let strongest = strongest(scene).max(f32::MIN_POSITIVE);
        let mut shares = [Vec4::ZERO; MAX_FLUIDS];
        for (share, absorption) in shares.iter_mut().zip(scene.absorptions()) {
            *share = (absorption / strongest).extend(radius.max(f32::MIN_POSITIVE).recip());
        }
        gpu.queue.write_buffer(&self.absorptions, 0, bytemuck::cast_slice(&shares));
        if self.pipeline.is_none() {
            self.pipeline = Some(self.pipeline(gpu, camera));
        }
    }

    fn pipeline(&self, gpu: &Gpu, camera: &CameraBinding) -> wgpu::RenderPipeline {
        let module = gpu::shader::module(gpu, "mixture.wgsl", gpu::shader::Variant::default());
        let splats = splat_buffers::layout(gpu);
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("mixture"),
            bind_group_layouts: &[Some(&camera.layout), Some(&splats), Some(&self.layout)],
            immediate_size: 0,
        });
        let compilation_options =
            wgpu::PipelineCompilationOptions { constants: &self.constants, ..Default::default() };
        let add = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::One,
            dst_factor: wgpu::BlendFactor::One,
            operation: wgpu::BlendOperation::Add,
        };
        gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("mixture"),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: compilation_options.clone(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState {
                topology: wgpu::PrimitiveTopology::TriangleList,
                ..Default::default()
            },
            depth_stencil: None,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("mixture"),
                compilation_options,
                targets: &[Some(wgpu::ColorTargetState {
                    format: FORMAT,
                    blend: Some(wgpu::BlendState { color: add, alpha: add }),
                    write_mask: wgpu::ColorWrites::ALL,
                })],
            }),
            multiview_mask: None,
            cache: gpu.cache(),
        })
    }

    /// Records the sum over all splats; requires [`Mixture::prepare`].
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        classes: [&SplatBuffers; 2],
        span: Span<'_>,
    ) {
        let Some(pipeline) = &self.pipeline else { return };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("mixture"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &self.view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            timestamp_writes: span.render(),
            ..Default::default()
        });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &camera.group, &[]);
        pass.set_bind_group(2, &self.group, &[]);
        for splats in classes {
            splats.draw(&mut pass);
        }
    }
}

fn create_view(gpu: &Gpu, size: UVec2) -> wgpu::TextureView {
    let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
    gpu::texture(gpu, "mixture", size, 1, FORMAT, usage).create_view(&Default::default())
}
