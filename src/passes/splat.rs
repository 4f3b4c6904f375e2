//! Splats into layers: `shaders/splat.wgsl`.
//!
//! One instance of the pass draws one class of particles, front and back. Depth is reversed
//! (near / z), so that 32-bit floats resolve far surfaces as well as near ones.

use glam::UVec2;

use super::{CameraBinding, Layers};
use crate::gpu::{self, Gpu, Span};
use crate::passes::classify::Splat as SplatData;

const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

#[derive(Debug)]
struct Chunk {
    buffer: wgpu::Buffer,
    group: wgpu::BindGroup,
    count: u32,
}

/// One class of a frame's splats, uploaded: every view draws the same.
#[derive(Debug)]
pub(crate) struct SplatBuffers {
    layout: wgpu::BindGroupLayout,
    // As many as one binding holds, then the next: the depth test does not mind.
    chunks: Vec<Chunk>,
}

/// Draws one class of splats into its pair of layers.
#[derive(Debug)]
pub(crate) struct Splat {
    /// Output: unsmoothed planes.
    pub layers: Layers,
    depth: wgpu::TextureView,
    pipelines: [wgpu::RenderPipeline; 2],
}

impl SplatBuffers {
    /// Nothing to draw yet.
    pub(crate) fn new(gpu: &Gpu) -> Self {
        Self { layout: layout(gpu), chunks: Vec::new() }
    }

    /// Draws all of them with the pipeline that is set; they are its group 1.
    pub(crate) fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        for chunk in &self.chunks {
            pass.set_bind_group(1, &chunk.group, &[]);
            pass.draw(0..4, 0..chunk.count);
        }
    }

    /// Uploads the frame's splats.
    pub(crate) fn upload(&mut self, gpu: &Gpu, splats: &[SplatData]) {
        let limits = gpu.device.limits();
        let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let most = (bytes as usize / size_of::<SplatData>()).max(1);
        self.chunks.truncate(splats.len().div_ceil(most));
        for (i, splats) in splats.chunks(most).enumerate() {
            let count = splats.len() as u32;
            match self.chunks.get_mut(i) {
                Some(chunk) if chunk.buffer.size() >= size_of_val(splats) as u64 => {
                    gpu.queue.write_buffer(&chunk.buffer, 0, bytemuck::cast_slice(splats));
                    chunk.count = count;
                }
                old => {
                    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
                    let buffer = gpu::buffer_with(gpu, "splats", usage, splats);
                    let resources = [buffer.as_entire_binding()];
                    let group = gpu::bind_group(gpu, "splats", &self.layout, &resources);
                    let chunk = Chunk { buffer, group, count };
                    match old {
                        Some(old) => *old = chunk,
                        None => self.chunks.push(chunk),
                    }
                }
            }
        }
    }
}

impl Splat {
    /// Compiles both pipelines; [`Splat::resize`] gives the pass its layers.
    pub(crate) fn new(gpu: &Gpu, camera: &CameraBinding) -> Self {
        let layout = layout(gpu);
        let module = crate::shader::module(gpu, "splat.wgsl");
        let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("splat"),
            bind_group_layouts: &[Some(&camera.layout), Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = |side: u32, nearest: wgpu::CompareFunction| {
            let constants = [&camera.constants()[..], &[("SIDE", f64::from(side))]].concat();
            let compilation_options =
                wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
            gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(["splat front", "splat back"][side as usize]),
                layout: Some(&pipeline_layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("vertex"),
                    compilation_options: compilation_options.clone(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState {
                    topology: wgpu::PrimitiveTopology::TriangleStrip,
                    ..Default::default()
                },
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: DEPTH,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(nearest),
                    stencil: Default::default(),
                    bias: Default::default(),
                }),
                multisample: Default::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("fragment"),
                    compilation_options,
                    targets: &[Some(Layers::FORMAT.into())],
                }),
                multiview_mask: None,
                cache: gpu.cache(),
            })
        };
        let pipelines = [
            pipeline(Layers::FRONT, wgpu::CompareFunction::Greater),
            pipeline(Layers::BACK, wgpu::CompareFunction::Less),
        ];
        let (layers, depth) = sized(gpu, UVec2::ONE, 1);
        Self { layers, depth, pipelines }
    }

    /// As this one, with layers of its own: nothing is compiled again.
    pub(crate) fn another(&self, gpu: &Gpu) -> Self {
        let (layers, depth) = sized(gpu, UVec2::ONE, 1);
        Self { layers, depth, pipelines: self.pipelines.clone() }
    }

    /// Replaces the layers by ones of so many mip levels.
    pub(crate) fn resize(&mut self, gpu: &Gpu, size: UVec2, levels: u32) {
        (self.layers, self.depth) = sized(gpu, size, levels);
    }

    /// Clears both layers and draws the splats into them, or into the front alone.
    pub(crate) fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        splats: &SplatBuffers,
        backs: bool,
        span: Span<'_>,
    ) {
        let sides = [(Layers::FRONT, 0.0, span.first()), (Layers::BACK, 1.0, span.last())];
        for (side, farthest, span) in sides {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("splat"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &gpu::layer_view(&self.layers.texture, side),
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &self.depth,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Clear(farthest),
                        store: wgpu::StoreOp::Discard,
                    }),
                    stencil_ops: None,
                }),
                timestamp_writes: span.render(),
                occlusion_query_set: None,
                multiview_mask: None,
            });
            pass.set_pipeline(&self.pipelines[side as usize]);
            pass.set_bind_group(0, &camera.group, &[]);
            if side == Layers::FRONT || backs {
                splats.draw(&mut pass);
            }
        }
    }
}

/// Group 1 of `splat.wgsl`.
pub(super) fn layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    gpu.layout("splats", wgpu::ShaderStages::VERTEX, &[gpu::storage::<SplatData>()])
}

fn sized(gpu: &Gpu, size: UVec2, levels: u32) -> (Layers, wgpu::TextureView) {
    let usage = wgpu::TextureUsages::RENDER_ATTACHMENT
        | wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    let layers = Layers::new(gpu, "splat layers", size, levels, usage);
    let usage = wgpu::TextureUsages::RENDER_ATTACHMENT;
    let depth = gpu::texture(gpu, "splat depth", size, 1, DEPTH, usage);
    (layers, depth.create_view(&Default::default()))
}
