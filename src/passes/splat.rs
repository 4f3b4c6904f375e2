//! Splatting of particles into layers: `shaders/splat.wgsl`.
//!
//! One instance of the pass draws one class of particles, fronts and backs. Depth is reversed
//! (near / z), so that 32-bit floats resolve far surfaces as well as near ones.

use glam::UVec2;

use super::cull::{Cull, Phase};
use super::splat_buffers::{SplatBuffers, layout};
use super::splat_lists;
use super::{CameraBinding, Layers};
use crate::gpu::shader::{self, EarlyDepth, Variant};
use crate::gpu::{self, Gpu, Span};

/// Format of depth buffers.
pub(super) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Draws one class of splats into its pair of layers.
#[derive(Debug)]
pub struct Splat {
    /// Output: unsmoothed planes.
    pub layers: Layers,
    /// Depth buffers of fronts and backs; one shared buffer unless both are drawn twice.
    depths: Vec<wgpu::TextureView>,
    pipelines: [wgpu::RenderPipeline; 2],
    /// Compiled on first use.
    culled: Option<Culled>,
    /// Whether planes bear the sizes of their particles.
    sizes: bool,
}

/// Culling, and the pipelines that draw the visible splats.
#[derive(Debug)]
struct Culled {
    cull: Cull,
    pipelines: [wgpu::RenderPipeline; 2],
}

impl Splat {
    /// Compiles both pipelines; [`Splat::resize`] allocates the layers.
    pub fn new(gpu: &Gpu, camera: &CameraBinding) -> Self {
        let pipelines = all_pipelines(gpu, camera, false);
        let (layers, depths) = create_layers(gpu, UVec2::ONE, 2, 1, 1);
        Self { layers, depths, pipelines, culled: None, sizes: false }
    }

    /// Creates another instance with the same pipelines and its own layers.
    pub fn with_own_layers(&self, gpu: &Gpu) -> Self {
        let (layers, depths) = create_layers(gpu, UVec2::ONE, 2, 1, 1);
        Self { layers, depths, pipelines: self.pipelines.clone(), culled: None, sizes: self.sizes }
    }

    /// Replaces the layers, with `gaps` pairs of layers for gaps and `levels` mip levels; `culled` adds the
    /// second depth buffer that culling needs.
    pub fn resize(&mut self, gpu: &Gpu, size: UVec2, gaps: u32, levels: u32, culled: bool) {
        let depths = if culled { 2 } else { 1 };
        (self.layers, self.depths) = create_layers(gpu, size, 2 + 2 * gaps, levels, depths);
    }

    /// Takes the textures of another instance, for views that are drawn one after the other.
    pub fn share(&mut self, other: &Self) {
        (self.layers, self.depths) = (other.layers.clone(), other.depths.clone());
    }

    /// A depth buffer that holds nothing between passes.
    pub(super) fn depth(&self) -> &wgpu::TextureView {
        &self.depths[0]
    }

    /// Compiles the pipelines anew if `sizes`, whether planes bear the sizes of their particles, has changed.
    pub fn prepare(&mut self, gpu: &Gpu, camera: &CameraBinding, sizes: bool) {
        if self.sizes != sizes {
            self.pipelines = all_pipelines(gpu, camera, sizes);
            self.culled = None;
            self.sizes = sizes;
        }
    }

    /// Compiles the culling pipelines on first use, and allocates the frame's lists.
    pub fn prepare_culled(&mut self, gpu: &Gpu, camera: &CameraBinding, splats: &SplatBuffers) {
        let sizes = self.sizes;
        let culled = self.culled.get_or_insert_with(|| {
            let listed = splat_lists::layout(gpu);
            let layouts = [Some(&camera.layout), Some(&layout(gpu)), Some(&listed)];
            let pipelines =
                pipelines(gpu, camera, "cull/draw.wgsl", "vertex_listed", &layouts, sizes);
            Culled { cull: Cull::new(gpu, camera), pipelines }
        });
        let size = UVec2::new(self.layers.texture.width(), self.layers.texture.height());
        culled.cull.prepare(gpu, splats, size);
    }

    /// Records both layers: clears them and draws the splats, into the front alone without `backs`.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        splats: &SplatBuffers,
        backs: bool,
        span: Span<'_>,
    ) {
        let spans = [span.first(), span.last()];
        self.sides(encoder, camera, backs, true, spans, |pass, side| {
            pass.set_pipeline(&self.pipelines[side]);
            splats.draw(pass);
        });
    }

    /// As [`Splat::record`], without hidden splats; requires [`Splat::prepare_culled`].
    pub fn record_culled(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        splats: &SplatBuffers,
        backs: bool,
        span: Span<'_>,
    ) {
        let Some(Culled { cull, pipelines }) = &self.culled else { return };
        let draw = |pass: &mut wgpu::RenderPass<'_>, side: usize| {
            pass.set_pipeline(&pipelines[side]);
            cull.draw(pass, splats);
        };
        let none = Span::default();
        cull.select(encoder, camera, splats, Phase::Surface, span.first());
        self.sides(encoder, camera, backs, true, [none, none], draw);
        cull.reduce(gpu, encoder, &self.layers, backs);
        cull.select(encoder, camera, splats, Phase::Surrounded, none);
        self.sides(encoder, camera, backs, false, [none, span.last()], draw);
    }

    /// Records one render pass for the fronts and one for the backs.
    fn sides(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        backs: bool,
        clear: bool,
        spans: [Span<'_>; 2],
        draw: impl Fn(&mut wgpu::RenderPass<'_>, usize),
    ) {
        let sides = [Layers::FRONT, Layers::BACK].into_iter().zip([0.0, 1.0]);
        for ((side, farthest), span) in sides.zip(spans) {
            let depth = self.depths.get(side as usize).unwrap_or(&self.depths[0]);
            // The last depths are not kept.
            let kept = clear && self.depths.len() > 1;
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("splat"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &gpu::layer_view(&self.layers.texture, side),
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: match clear {
                            true => wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                            false => wgpu::LoadOp::Load,
                        },
                        store: wgpu::StoreOp::Store,
                    },
                })],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: depth,
                    depth_ops: Some(wgpu::Operations {
                        load: match clear {
                            true => wgpu::LoadOp::Clear(farthest),
                            false => wgpu::LoadOp::Load,
                        },
                        store: if kept { wgpu::StoreOp::Store } else { wgpu::StoreOp::Discard },
                    }),
                    stencil_ops: None,
                }),
                timestamp_writes: span.render(),
                occlusion_query_set: None,
                multiview_mask: None,
            });
            pass.set_bind_group(0, &camera.group, &[]);
            if side == Layers::FRONT || backs {
                draw(&mut pass, side as usize);
            }
        }
    }
}

/// The pipelines that draw all splats.
fn all_pipelines(gpu: &Gpu, camera: &CameraBinding, sizes: bool) -> [wgpu::RenderPipeline; 2] {
    let layouts = [Some(&camera.layout), Some(&layout(gpu))];
    pipelines(gpu, camera, "splat.wgsl", "vertex", &layouts, sizes)
}

/// The pipelines of fronts and backs, with the file's vertex stage `vertex`.
fn pipelines(
    gpu: &Gpu,
    camera: &CameraBinding,
    file: &str,
    vertex: &str,
    layouts: &[Option<&wgpu::BindGroupLayout>],
    sizes: bool,
) -> [wgpu::RenderPipeline; 2] {
    let module = |back: bool| {
        let side = if back { EarlyDepth::GreaterEqual } else { EarlyDepth::LessEqual };
        let early_depth = gpu.has_early_depth().then_some(side);
        shader::module(gpu, file, Variant { early_depth, ..Variant::default() })
    };
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(file),
        bind_group_layouts: layouts,
        immediate_size: 0,
    });
    let pipeline = |side: u32, nearest: wgpu::CompareFunction| {
        let module = module(side == Layers::BACK);
        let own = [("SIDE", f64::from(side)), ("SIZES", f64::from(u8::from(sizes)))];
        let constants = [&camera.constants()[..], &own].concat();
        let compilation_options =
            wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
        gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(["splat front", "splat back"][side as usize]),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some(vertex),
                compilation_options: compilation_options.clone(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState {
                topology: wgpu::PrimitiveTopology::TriangleList,
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
    [
        pipeline(Layers::FRONT, wgpu::CompareFunction::Greater),
        pipeline(Layers::BACK, wgpu::CompareFunction::Less),
    ]
}

fn create_layers(
    gpu: &Gpu,
    size: UVec2,
    layers: u32,
    levels: u32,
    depths: usize,
) -> (Layers, Vec<wgpu::TextureView>) {
    let usage = wgpu::TextureUsages::RENDER_ATTACHMENT
        | wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    let layers = Layers::new(gpu, "splat layers", size, layers, levels, usage);
    let usage = wgpu::TextureUsages::RENDER_ATTACHMENT;
    let depth = |_| gpu::texture(gpu, "splat depth", size, 1, DEPTH, usage);
    let depths = (0..depths).map(depth).map(|depth| depth.create_view(&Default::default()));
    (layers, depths.collect())
}
