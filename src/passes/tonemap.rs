//! Tone mapping of radiance for display: `shaders/tonemap.wgsl`.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use wgpu::TextureViewDimension::D2;

use super::Radiance;
use crate::gpu::{self, Gpu, Span};
use crate::settings::{self, Curve};

/// `Params` of `tonemap.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Factor on radiance.
    pub gain: f32,
    /// 0 none, 1 filmic.
    pub curve: u32,
    /// 1 if the shader must encode sRGB, because the target's format does not.
    pub encode: u32,
    /// 1 if the target holds no more than 1.
    pub bounded: u32,
    /// Width of the dither: a step of the encoded target, 0 for none.
    pub dither: f32,
}

/// Encodes linear light, 0 to 1, as 8-bit sRGB (IEC 61966-2-1), clamped and rounded to nearest.
pub fn srgb_byte(c: f64) -> u8 {
    let c = c.clamp(0.0, 1.0);
    let encoded = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8
}

/// Tone-maps radiance into a caller's texture view.
#[derive(Debug)]
pub struct Tonemap {
    /// Blend over what the view contains, by coverage, instead of replacing it.
    blends: bool,
    pipelines: HashMap<wgpu::TextureFormat, wgpu::RenderPipeline>,
    params: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
}

impl Tonemap {
    /// Creates the layout; a pipeline is compiled for each target format on first use.
    pub fn new(gpu: &Gpu, blends: bool) -> Self {
        let bindings = [gpu::sampled(D2), gpu.branching::<Params>()];
        Self {
            blends,
            pipelines: HashMap::new(),
            params: gpu::uniform_buffer::<Params>(gpu, "tonemap"),
            layout: gpu.layout("tonemap", wgpu::ShaderStages::FRAGMENT, &bindings),
        }
    }

    /// Writes the parameters and compiles the pipeline for `format` if it is new.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        settings: &settings::Tonemap,
        format: wgpu::TextureFormat,
    ) {
        let encode = !format.is_srgb() && !is_linear(format);
        let params = Params {
            gain: settings.exposure.exp2(),
            curve: match settings.curve {
                Curve::None => 0,
                Curve::Aces => 1,
            },
            encode: u32::from(encode),
            bounded: u32::from(!is_linear(format)),
            dither: if settings.dither && encode { 1.0 / 255.0 } else { 0.0 },
        };
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&params));
        self.pipelines.entry(format).or_insert_with(|| {
            let blend = self.blends.then_some(wgpu::BlendState::ALPHA_BLENDING);
            pipeline(gpu, &self.layout, wgpu::ColorTargetState { blend, ..format.into() })
        });
    }

    /// Records the tone mapping of `radiance` into `target`, a view of the same size in a prepared format.
    pub fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        radiance: &Radiance,
        target: &wgpu::TextureView,
        format: wgpu::TextureFormat,
        span: Span<'_>,
    ) {
        let view = radiance.texture.create_view(&Default::default());
        let resources =
            [wgpu::BindingResource::TextureView(&view), self.params.as_entire_binding()];
        let group = gpu::bind_group(gpu, "tonemap", &self.layout, &resources);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("tonemap"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: match self.blends {
                        true => wgpu::LoadOp::Load,
                        false => wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    },
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: None,
            timestamp_writes: span.render(),
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_pipeline(&self.pipelines[&format]);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// Whether a format holds linear light without bounds: floats.
fn is_linear(format: wgpu::TextureFormat) -> bool {
    use wgpu::TextureFormat::{Rg11b10Ufloat, Rgba16Float, Rgba32Float};
    matches!(format, Rgba16Float | Rgba32Float | Rg11b10Ufloat)
}

fn pipeline(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    target: wgpu::ColorTargetState,
) -> wgpu::RenderPipeline {
    let module = gpu::shader::module(gpu, "tonemap.wgsl", gpu::shader::Variant::default());
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("tonemap"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("tonemap"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: Default::default(),
        depth_stencil: None,
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fragment"),
            compilation_options: Default::default(),
            targets: &[Some(target)],
        }),
        multiview_mask: None,
        cache: gpu.cache(),
    })
}
