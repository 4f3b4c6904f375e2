//! Tone mapping of radiance for display: `shaders/tonemap.wgsl`.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use wgpu::TextureViewDimension::D2;

use super::Radiance;
use crate::error::Result;
use crate::gpu::shader::{RENDERER, Words};
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
    /// First row that is drawn.
    pub first_row: u32,
}

/// Encodes linear light, 0 to 1, as 8-bit sRGB (IEC 61966-2-1), clamped and rounded to nearest.
pub fn srgb_byte(c: f64) -> u8 {
    let c = c.clamp(0.0, 1.0);
    let encoded = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8
}

/// A picture in the device's memory: 8-bit sRGB and coverage, red first, rows from the top without padding.
#[derive(Debug)]
pub struct Picture {
    size: UVec2,
    bytes: wgpu::Buffer,
}

impl Picture {
    /// Creates a picture of `size` pixels.
    ///
    /// # Errors
    /// As [`Gpu::check_size`].
    pub fn new(gpu: &Gpu, size: UVec2) -> Result<Self> {
        gpu.check_size(size)?;
        let bytes = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture"),
            size: 4 * u64::from(size.x) * u64::from(size.y),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Ok(Self { size, bytes })
    }

    /// Pixels.
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// Submits a copy of the bytes; the next frame may be drawn into the picture at once.
    pub(crate) fn begin_reading_bytes(&self, gpu: &Gpu) -> gpu::Reading {
        gpu.begin_reading_buffer(&self.bytes)
    }
}

/// Where a frame's picture goes.
#[derive(Debug, Clone, Copy)]
pub enum Target<'a> {
    /// A view of the frame's size. The device encodes sRGB formats, the shader all others but floats, which stay linear.
    View(&'a wgpu::TextureView, wgpu::TextureFormat),
    /// Memory, from which it can be read.
    Picture(&'a Picture),
}

impl<'a> From<&'a Picture> for Target<'a> {
    fn from(picture: &'a Picture) -> Self {
        Self::Picture(picture)
    }
}

/// Tone-maps radiance into a picture or a caller's texture view.
#[derive(Debug)]
pub struct Tonemap {
    /// Blend over the contents of the view, by coverage, instead of replacing them.
    blends: bool,
    views: HashMap<wgpu::TextureFormat, wgpu::RenderPipeline>,
    picture: Option<wgpu::ComputePipeline>,
    layout: wgpu::BindGroupLayout,
    picture_layout: wgpu::BindGroupLayout,
}

/// A target, with the pipeline that draws into it.
#[derive(Debug)]
pub struct Prepared<'a>(Output<'a>);

#[derive(Debug)]
enum Output<'a> {
    /// A view, its pipeline and parameters.
    View(&'a wgpu::TextureView, wgpu::RenderPipeline, wgpu::Buffer),
    /// A picture, its pipeline, and the first row and parameters of each band of rows that one binding holds.
    Picture(&'a Picture, wgpu::ComputePipeline, Vec<(u32, wgpu::Buffer)>),
}

impl Tonemap {
    /// Creates the layouts; a pipeline is compiled for each kind of target on first use.
    pub fn new(gpu: &Gpu, blends: bool) -> Self {
        let bindings = [gpu::sampled(D2), gpu.branching::<Params>()];
        let stages = wgpu::ShaderStages::FRAGMENT | wgpu::ShaderStages::COMPUTE;
        let picture = [gpu::storage_read_write(4)];
        Self {
            blends,
            views: HashMap::new(),
            picture: None,
            layout: gpu.layout("tonemap", stages, &bindings),
            picture_layout: gpu.layout("picture", wgpu::ShaderStages::COMPUTE, &picture),
        }
    }

    /// Writes the parameters and compiles the pipeline for the target if it is new.
    pub fn prepare<'a>(
        &mut self,
        gpu: &Gpu,
        settings: &settings::Tonemap,
        target: Target<'a>,
    ) -> Prepared<'a> {
        let (encode, bounded) = match target {
            Target::View(_, format) => {
                (!format.is_srgb() && !is_linear(format), !is_linear(format))
            }
            Target::Picture(_) => (true, true),
        };
        let params = Params {
            gain: settings.exposure.exp2(),
            curve: match settings.curve {
                Curve::None => 0,
                Curve::Aces => 1,
            },
            encode: u32::from(encode),
            bounded: u32::from(bounded),
            dither: if settings.dither && encode { 1.0 / 255.0 } else { 0.0 },
            first_row: 0,
        };
        let uniform = |params| gpu.buffer_with("tonemap", gpu::UNIFORM, &[params]);
        Prepared(match target {
            Target::View(view, format) => {
                let pipeline = self.views.entry(format).or_insert_with(|| {
                    let blend = self.blends.then_some(wgpu::BlendState::ALPHA_BLENDING);
                    let target = wgpu::ColorTargetState { blend, ..format.into() };
                    view_pipeline(gpu, &self.layout, target)
                });
                Output::View(view, pipeline.clone(), uniform(params))
            }
            Target::Picture(picture) => {
                let layouts = [&self.layout, &self.picture_layout];
                let pipeline = self.picture.get_or_insert_with(|| {
                    gpu.compute_pipeline("tonemap.wgsl", "bytes", &layouts, &[])
                });
                let rows = gpu.band_rows(picture.size.x) as usize;
                let bands = (0..picture.size.y)
                    .step_by(rows)
                    .map(|first_row| (first_row, uniform(Params { first_row, ..params })));
                Output::Picture(picture, pipeline.clone(), bands.collect())
            }
        })
    }

    /// Records the tone mapping of `radiance` into a target of the same size.
    pub fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        radiance: &Radiance,
        target: &Prepared<'_>,
        span: Span<'_>,
    ) {
        let view = radiance.texture.create_view(&Default::default());
        let group = |params: &wgpu::Buffer| {
            let resources = [wgpu::BindingResource::TextureView(&view), params.as_entire_binding()];
            gpu.bind_group("tonemap", &self.layout, &resources)
        };
        match &target.0 {
            Output::View(view, pipeline, params) => {
                self.record_view(encoder, &group(params), view, pipeline, span);
            }
            Output::Picture(picture, pipeline, bands) => {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some("tonemap"),
                    timestamp_writes: span.compute(),
                });
                pass.set_pipeline(pipeline);
                let ends = bands.iter().skip(1).map(|band| band.0).chain([picture.size.y]);
                for ((first_row, params), end) in bands.iter().zip(ends) {
                    let size = UVec2::new(picture.size.x, end - first_row);
                    let row = 4 * u64::from(size.x);
                    let bytes = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                        buffer: &picture.bytes,
                        offset: row * u64::from(*first_row),
                        size: wgpu::BufferSize::new(row * u64::from(size.y)),
                    });
                    let bytes = gpu.bind_group("picture", &self.picture_layout, &[bytes]);
                    pass.set_bind_group(0, &group(params), &[]);
                    pass.set_bind_group(1, &bytes, &[]);
                    let (x, y) = gpu::workgroups(size);
                    pass.dispatch_workgroups(x, y, 1);
                }
            }
        }
    }

    fn record_view(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        group: &wgpu::BindGroup,
        view: &wgpu::TextureView,
        pipeline: &wgpu::RenderPipeline,
        span: Span<'_>,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("tonemap"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
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
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// Whether a format holds linear light without bounds: floats.
fn is_linear(format: wgpu::TextureFormat) -> bool {
    use wgpu::TextureFormat::{Rg11b10Ufloat, Rgba16Float, Rgba32Float};
    matches!(format, Rgba16Float | Rgba32Float | Rg11b10Ufloat)
}

fn view_pipeline(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    target: wgpu::ColorTargetState,
) -> wgpu::RenderPipeline {
    let module = gpu.module(RENDERER, "tonemap.wgsl", Words::default(), &[]);
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
