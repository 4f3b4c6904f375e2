//! Air between liquid and liquid along a pixel's ray: `shaders/gaps/`.
//!
//! The splatted layers reach from the first front to the last back of each pixel, with all that lies
//! between. This pass finds the gaps in them: a coarse grid of rays marks the bins of depth that the
//! ellipsoids touch (F. Zirr and C. Dachsbacher, Memory-Efficient On-The-Fly Voxelization of Particle
//! Data, 2015), runs of empty bins become splits, and the two sides of each split are splatted into
//! further layers, in the tiles that have any.

use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use wgpu::TextureViewDimension::{D2, D2Array};

use super::splat::{DEPTH, Splat};
use super::splat_buffers::{self, SplatBuffers};
use super::splat_lists::{self, Selection, SplatLists};
use super::tiles::{Sections, TileLists, Tiles};
use super::{CameraBinding, Layers};
use crate::gpu::{self, Gpu, Span, TILE};
use crate::liquid::classify::Splats;
use crate::settings;

/// The number of gaps that a view through `interfaces` interfaces distinguishes; none on devices with less than
/// WebGPU's default limits for compute shaders.
pub fn count(gpu: &Gpu, settings: &settings::Layers, interfaces: u32, splats: &Splats) -> u32 {
    // One interface needs fronts alone.
    let needed = interfaces > 1 && !splats.is_hull;
    if needed && splat_lists::are_supported(gpu) { settings.intervals - 1 } else { 0 }
}

/// Side of a cell, pixels: as in `gaps/cells.wgsl`.
pub const CELL: u32 = 4;

/// Words of occupancy per cell, with a bit for each bin.
pub const WORDS: u32 = 2;

/// Bytes of occupancy per cell.
const MARKS: u64 = 4 * WORDS as u64;

/// Shortest gap between swollen ellipsoids, in particle radii.
const LEAST: f32 = 1.0;

/// `Params` of `gaps/split.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Shortest gap between swollen ellipsoids, m.
    pub least: f32,
}

/// Finds and draws the gaps of a view's layers.
#[derive(Debug)]
pub struct Gaps {
    /// Output: of each tile the least and the greatest depth of a split, m, of the aggregates and then of the
    /// splashes; 0 without any.
    pub tiles: wgpu::Texture,
    /// Output: the tiles with gaps, as their `liquid`.
    pub tile_lists: TileLists,
    layouts: Layouts,
    pipelines: Option<Pipelines>,
    params: wgpu::Buffer,
    cells: Cells,
    /// Splats to mark by drawing them, and those of the sides of gaps, by class.
    lists: [ClassLists; 2],
}

#[derive(Debug, Clone)]
struct ClassLists {
    large: SplatLists,
    sides: [SplatLists; 2],
}

#[derive(Debug)]
struct Layouts {
    mark: wgpu::BindGroupLayout,
    split: wgpu::BindGroupLayout,
    select: wgpu::BindGroupLayout,
    clear: wgpu::BindGroupLayout,
    draw: wgpu::BindGroupLayout,
}

#[derive(Debug)]
struct Pipelines {
    mark_small: Selection,
    mark_large: wgpu::RenderPipeline,
    /// Without and with splashes.
    split: [wgpu::ComputePipeline; 2],
    clear: wgpu::ComputePipeline,
    /// By class and side.
    select: [[Selection; 2]; 2],
    /// By gap and side.
    draw: [[wgpu::RenderPipeline; 2]; 2],
    gaps: u32,
    /// Whether planes bear the sizes of their particles.
    sizes: bool,
}

/// Occupancy and splits of each class.
#[derive(Debug, Clone)]
struct Cells {
    size: UVec2,
    marks: [wgpu::Buffer; 2],
    splits: [wgpu::Texture; 2],
    depth: wgpu::TextureView,
}

/// One class of splats, and its layers.
pub(super) type Class<'a> = (&'a SplatBuffers, &'a Splat);

impl Gaps {
    /// Creates the layouts; pipelines are compiled on first use.
    pub fn new(gpu: &Gpu) -> Self {
        let compute = wgpu::ShaderStages::COMPUTE;
        let layers = gpu::sampled(D2Array);
        let marks = gpu::storage_of(MARKS);
        let splits = gpu::storage_texture(wgpu::TextureFormat::Rgba32Float, D2);
        let tiles = gpu::storage_texture(wgpu::TextureFormat::Rgba32Float, D2);
        let planes = gpu::storage_texture(Layers::FORMAT, D2Array);
        let layouts = Layouts {
            mark: gpu.layout(
                "gap marks",
                compute | wgpu::ShaderStages::FRAGMENT,
                &[gpu.layers(), gpu::storage_read_write(MARKS)],
            ),
            split: gpu.layout(
                "gap splits",
                compute,
                &[
                    layers,
                    layers,
                    marks,
                    marks,
                    splits,
                    splits,
                    tiles,
                    gpu::storage_read_write(8),
                    gpu::storage::<Sections>(),
                    gpu::uniform::<Params>(),
                ],
            ),
            clear: gpu.layout("gaps cleared", compute, &[planes, gpu::storage_of(8)]),
            select: gpu.layout("gap tiles", compute, &[gpu::sampled(D2)]),
            draw: gpu.layout("gaps drawn", wgpu::ShaderStages::FRAGMENT, &[gpu::sampled(D2)]),
        };
        let sections = Sections { tiles: 1, words: 2, count: 1 };
        Self {
            tiles: create_tiles(gpu, UVec2::ONE),
            tile_lists: TileLists::new(gpu, UVec2::ONE, sections),
            layouts,
            pipelines: None,
            params: gpu::uniform_buffer::<Params>(gpu, "gaps"),
            cells: Cells::new(gpu, UVec2::ONE),
            lists: [(); 2].map(|()| ClassLists::new(gpu)),
        }
    }

    /// Replaces the textures and the list of tiles.
    pub fn resize(&mut self, gpu: &Gpu, size: UVec2, sections: Sections) {
        self.tiles = create_tiles(gpu, size);
        self.tile_lists = TileLists::new(gpu, size, sections);
        self.cells = Cells::new(gpu, size);
    }

    /// As [`Splat::share`], with the lists of splats.
    pub fn share(&mut self, other: &Self) {
        (self.tiles, self.tile_lists) = (other.tiles.clone(), other.tile_lists.clone());
        (self.cells, self.lists) = (other.cells.clone(), other.lists.clone());
    }

    /// Uploads the parameters for particles of `radius`, m, compiles missing pipelines for `gaps` gaps, and
    /// allocates lists for these splats.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        camera: &CameraBinding,
        gaps: u32,
        radius: f32,
        sizes: bool,
        splats: [&SplatBuffers; 2],
    ) {
        for (lists, splats) in self.lists.iter_mut().zip(splats) {
            lists.prepare(gpu, splats);
        }
        let params = Params { least: LEAST * radius };
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&params));
        let current = self.pipelines.as_ref().map(|pipelines| (pipelines.gaps, pipelines.sizes));
        if current != Some((gaps, sizes)) {
            let lists = &self.lists[0].large;
            self.pipelines = Some(Pipelines::new(gpu, camera, &self.layouts, lists, gaps, sizes));
        }
    }

    /// Records the search for gaps, and the layers of their sides. `classes` are the aggregates and, if there are
    /// any, the splashes.
    pub fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        tiles: &Tiles,
        classes: &[Class<'_>],
        span: Span<'_>,
    ) {
        let Some(pipelines) = &self.pipelines else { return };
        let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        for (i, (splats, splat)) in classes.iter().enumerate() {
            let marks = &self.cells.marks[i];
            encoder.clear_buffer(marks, 0, None);
            let resources = [texture(&splat.layers.view), marks.as_entire_binding()];
            let group = gpu::bind_group(gpu, "gap marks", &self.layouts.mark, &resources);
            let first = if i == 0 { span.first() } else { Span::default() };
            let lists = &self.lists[i].large;
            lists.select(encoder, camera, splats, (&pipelines.mark_small, &group), first);
            let mut pass = depth_pass(encoder, None, &self.cells.depth, 0.0, Span::default());
            pass.set_bind_group(0, &camera.group, &[]);
            pass.set_bind_group(3, &group, &[]);
            pass.set_pipeline(&pipelines.mark_large);
            lists.draw(&mut pass, splats);
        }
        let splash = classes.len() > 1;
        let variant = usize::from(splash);
        let layers = |i: usize| &classes.get(i).unwrap_or(&classes[0]).1.layers;
        self.tile_lists.clear(encoder);
        {
            let splits = [0, 1].map(|i| view(&self.cells.splits[i]));
            let flags = view(&self.tiles);
            let resources = [
                texture(&layers(0).view),
                texture(&layers(1).view),
                self.cells.marks[0].as_entire_binding(),
                self.cells.marks[1].as_entire_binding(),
                texture(&splits[0]),
                texture(&splits[1]),
                texture(&flags),
                self.tile_lists.liquid.as_entire_binding(),
                self.tile_lists.sections_buffer().as_entire_binding(),
                self.params.as_entire_binding(),
            ];
            let group = gpu::bind_group(gpu, "gap splits", &self.layouts.split, &resources);
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipelines.split[variant]);
            pass.set_bind_group(0, &group, &[]);
            let (x, y) = gpu::workgroups(self.cells.size.map(|n| n.div_ceil(TILE)));
            pass.dispatch_workgroups(x, y, 1);
        }
        tiles.arrange(gpu, encoder, &self.tile_lists, layers(0));
        for section in self.tile_lists.sections() {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipelines.clear);
            for class in 0..classes.len() {
                let planes = gpu::level_view(&layers(class).texture, 0, D2Array);
                let tiles = self.tile_lists.section(&self.tile_lists.liquid, section);
                let resources = [texture(&planes), tiles];
                let group = gpu::bind_group(gpu, "gaps cleared", &self.layouts.clear, &resources);
                pass.set_bind_group(0, &group, &[]);
                let at = self.tile_lists.dispatch(TileLists::LIQUID, section);
                pass.dispatch_workgroups_indirect(&self.tile_lists.dispatches, at);
            }
        }
        let flags = view(&self.tiles);
        let with_gaps = gpu::bind_group(gpu, "gap tiles", &self.layouts.select, &[texture(&flags)]);
        let mut left = classes.len() * pipelines.gaps as usize * 2;
        for (i, (splats, splat)) in classes.iter().enumerate() {
            let splits = view(&self.cells.splits[i]);
            let group = gpu::bind_group(gpu, "gaps drawn", &self.layouts.draw, &[texture(&splits)]);
            let lists = &self.lists[i].sides;
            for (lists, selection) in lists.iter().zip(&pipelines.select[i]) {
                let none = Span::default();
                lists.select(encoder, camera, splats, (selection, &with_gaps), none);
            }
            for (gap, sides) in (0..).zip(&pipelines.draw[..pipelines.gaps as usize]) {
                let farthest = [1.0, 0.0];
                for (side, layer) in Layers::gap(gap).into_iter().enumerate() {
                    left -= 1;
                    let span = if left == 0 { span.last() } else { Span::default() };
                    let target = gpu::layer_view(&splat.layers.texture, layer);
                    let depth = splat.depth();
                    let mut pass = depth_pass(encoder, Some(&target), depth, farthest[side], span);
                    pass.set_bind_group(0, &camera.group, &[]);
                    pass.set_bind_group(3, &group, &[]);
                    pass.set_pipeline(&sides[side]);
                    lists[side].draw(&mut pass, splats);
                }
            }
        }
    }
}

fn texture(view: &wgpu::TextureView) -> wgpu::BindingResource<'_> {
    wgpu::BindingResource::TextureView(view)
}

/// Begins a render pass into a layer that keeps what it contains, with a depth buffer that is cleared and
/// not kept.
fn depth_pass<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    target: Option<&wgpu::TextureView>,
    depth: &wgpu::TextureView,
    farthest: f32,
    span: Span<'_>,
) -> wgpu::RenderPass<'a> {
    let color = target.map(|view| wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
    });
    let colors: &[_] = if color.is_some() { &[color] } else { &[] };
    encoder
        .begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("gaps"),
            color_attachments: colors,
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(farthest),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            timestamp_writes: span.render(),
            occlusion_query_set: None,
            multiview_mask: None,
        })
        .forget_lifetime()
}

impl Pipelines {
    fn new(
        gpu: &Gpu,
        camera: &CameraBinding,
        layouts: &Layouts,
        lists: &SplatLists,
        gaps: u32,
        sizes: bool,
    ) -> Self {
        let kernel = |file: &str, entry: &str, layout: &wgpu::BindGroupLayout, splash: &[f64]| {
            let splash = splash.iter().map(|&splash| ("SPLASH", splash));
            let constants: Vec<_> = splash.chain([("GAPS", gaps.into())]).collect();
            gpu::compute_pipeline(gpu, file, entry, &[layout], &constants)
        };
        let raster = |file: &str,
                      entries: [&str; 2],
                      layout: &wgpu::BindGroupLayout,
                      compare: wgpu::CompareFunction,
                      colored: bool,
                      constants: &[(&str, f64)]| {
            let module = gpu::shader::module(gpu, file, gpu::shader::Variant::default());
            let (splats, listed) = (splat_buffers::layout(gpu), splat_lists::layout(gpu));
            let pipeline_layout =
                gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                    label: Some(file),
                    bind_group_layouts: &[
                        Some(&camera.layout),
                        Some(&splats),
                        Some(&listed),
                        Some(layout),
                    ],
                    immediate_size: 0,
                });
            let constants = [&camera.constants()[..], constants].concat();
            let compilation_options =
                wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
            let targets = [Some(Layers::FORMAT.into())];
            gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(file),
                layout: Some(&pipeline_layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(entries[0]),
                    compilation_options: compilation_options.clone(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState {
                    topology: wgpu::PrimitiveTopology::TriangleList,
                    ..Default::default()
                },
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: DEPTH,
                    depth_write_enabled: Some(colored),
                    depth_compare: Some(compare),
                    stencil: Default::default(),
                    bias: Default::default(),
                }),
                multisample: Default::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(entries[1]),
                    compilation_options,
                    targets: if colored { &targets } else { &[] },
                }),
                multiview_mask: None,
                cache: gpu.cache(),
            })
        };
        let select = |class: u32| {
            [Layers::BACK, Layers::FRONT].map(|side| {
                let constants = [("SIDE", f64::from(side)), ("CLASS", f64::from(class))];
                lists.selection(gpu, camera, "gaps/select.wgsl", &layouts.select, &constants)
            })
        };
        let draw = |gap: u32| {
            [
                (wgpu::CompareFunction::Less, Layers::BACK),
                (wgpu::CompareFunction::Greater, Layers::FRONT),
            ]
            .map(|(compare, side)| {
                let sizes = f64::from(u8::from(sizes));
                let constants =
                    [("SIDE", f64::from(side)), ("GAP", f64::from(gap)), ("SIZES", sizes)];
                let entries = ["vertex_gap", "side"];
                raster("gaps/draw.wgsl", entries, &layouts.draw, compare, true, &constants)
            })
        };
        Self {
            mark_small: lists.selection(gpu, camera, "gaps/mark_small.wgsl", &layouts.mark, &[]),
            mark_large: raster(
                "gaps/mark_large.wgsl",
                ["vertex_cells", "mark_large"],
                &layouts.mark,
                wgpu::CompareFunction::Always,
                false,
                &[],
            ),
            split: [0.0, 1.0]
                .map(|splash| kernel("gaps/split.wgsl", "split", &layouts.split, &[splash])),
            clear: kernel("gaps/clear.wgsl", "clear", &layouts.clear, &[]),
            select: [0, 1].map(select),
            draw: [draw(0), draw(1)],
            gaps,
            sizes,
        }
    }
}

impl ClassLists {
    fn new(gpu: &Gpu) -> Self {
        Self { large: SplatLists::new(gpu), sides: [(); 2].map(|()| SplatLists::new(gpu)) }
    }

    fn prepare(&mut self, gpu: &Gpu, splats: &SplatBuffers) {
        for lists in std::iter::once(&mut self.large).chain(&mut self.sides) {
            lists.prepare(gpu, splats);
        }
    }
}

impl Cells {
    fn new(gpu: &Gpu, size: UVec2) -> Self {
        let cells = size.map(|n| n.div_ceil(CELL));
        let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING;
        let marks = || {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("gap marks"),
                size: MARKS * u64::from(cells.element_product()),
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let format = wgpu::TextureFormat::Rgba32Float;
        let splits = || gpu::texture(gpu, "gap splits", cells, 1, format, usage);
        let attached = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let depth = gpu::texture(gpu, "gap cells", cells, 1, DEPTH, attached);
        Self {
            size,
            marks: [marks(), marks()],
            splits: [splits(), splits()],
            depth: depth.create_view(&Default::default()),
        }
    }
}

/// Creates the image of the tiles with gaps of a view of `size` pixels: none have.
#[doc(hidden)]
pub fn create_tiles(gpu: &Gpu, size: UVec2) -> wgpu::Texture {
    let tiles = size.map(|n| n.div_ceil(TILE));
    let usage = wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    gpu::texture(gpu, "gap tiles", tiles, 1, wgpu::TextureFormat::Rgba32Float, usage)
}
