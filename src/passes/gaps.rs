//! Air between liquid and liquid along a pixel's ray: `shaders/gaps/`.
//!
//! The splatted layers reach from the first front to the last back of each pixel, with all that lies
//! between. This pass finds the gaps in them: a coarse grid of rays marks the bins of depth that the
//! ellipsoids touch (F. Zirr and C. Dachsbacher, Memory-Efficient On-The-Fly Voxelization of Particle
//! Data, 2015), runs of empty bins become splits, and the two sides of each split are splatted into
//! further layers, in the tiles that have any.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::UVec2;
use wgpu::TextureViewDimension::{D2, D2Array};

use super::bins::Bins;
use super::splat_buffers::{self, SplatBuffers};
use super::tiles::{Sections, TileLists, Tiles};
use super::{CameraBinding, Layers};
use crate::gpu::{self, Gpu, Span, TILE};
use crate::liquid::classify::Splats;
use crate::settings;

/// The number of gaps that a view through `interfaces` interfaces distinguishes.
pub fn count(settings: &settings::Layers, interfaces: u32, splats: &Splats) -> u32 {
    // One interface needs fronts alone.
    if interfaces > 1 && !splats.is_hull { settings.intervals - 1 } else { 0 }
}

/// Scale of the ellipsoids of which lists are made where there are gaps: as in `gaps/cells.wgsl`.
pub const CLOSING: f32 = 1.3;

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
    pipelines: Pipelines,
    variant: (u32, bool),
    params: wgpu::Buffer,
    cells: Cells,
}

#[derive(Debug)]
struct Layouts {
    mark: wgpu::BindGroupLayout,
    split: wgpu::BindGroupLayout,
    sides: wgpu::BindGroupLayout,
}

/// Compiled on first use.
#[derive(Debug, Default)]
struct Pipelines {
    /// By whether the class has one chunk.
    mark: HashMap<bool, wgpu::ComputePipeline>,
    /// By the number of gaps and whether there are splashes.
    split: HashMap<(u32, bool), wgpu::ComputePipeline>,
    /// By the number of gaps, whether planes bear the sizes of their particles, and whether the chunk is the first and
    /// the last.
    sides: HashMap<(u32, bool, [bool; 2]), wgpu::ComputePipeline>,
}

/// Occupancy and splits of each class.
#[derive(Debug, Clone)]
struct Cells {
    size: UVec2,
    marks: [wgpu::Buffer; 2],
    splits: [wgpu::Texture; 2],
}

/// A class of splats and its layers.
pub(super) type Class<'a> = (&'a SplatBuffers, &'a Layers);

impl Gaps {
    /// Creates the layouts; pipelines are compiled on first use.
    pub fn new(gpu: &Gpu) -> Self {
        let layout = |label: &str, bindings: &[wgpu::BindingType]| {
            gpu.layout(label, wgpu::ShaderStages::COMPUTE, bindings)
        };
        let layers = gpu::sampled(D2Array);
        let marks = gpu::storage_of(MARKS);
        let written = gpu::storage_texture(wgpu::TextureFormat::Rgba32Float, D2);
        let planes = gpu::storage_texture(Layers::FORMAT, D2Array);
        let layouts = Layouts {
            mark: layout("gap marks", &[gpu.layers(), gpu::storage_read_write(MARKS)]),
            split: layout(
                "gap splits",
                &[
                    layers,
                    layers,
                    marks,
                    marks,
                    written,
                    written,
                    written,
                    gpu::storage_read_write(8),
                    gpu::storage::<Sections>(),
                    gpu::uniform::<Params>(),
                ],
            ),
            sides: layout(
                "gap sides",
                &[gpu::sampled(D2), gpu::storage_of(8), planes, gpu::state_texture()],
            ),
        };
        let sections = Sections { tiles: 1, words: 2, count: 1 };
        Self {
            tiles: create_tiles(gpu, UVec2::ONE),
            tile_lists: TileLists::new(gpu, UVec2::ONE, sections),
            layouts,
            pipelines: Pipelines::default(),
            variant: (0, false),
            params: gpu::uniform_buffer::<Params>(gpu, "gaps"),
            cells: Cells::new(gpu, UVec2::ONE),
        }
    }

    /// Replaces the textures and the list of tiles.
    pub fn resize(&mut self, gpu: &Gpu, size: UVec2, sections: Sections) {
        self.tiles = create_tiles(gpu, size);
        self.tile_lists = TileLists::new(gpu, size, sections);
        self.cells = Cells::new(gpu, size);
    }

    /// As [`super::splat::Splat::share`].
    pub fn share(&mut self, other: &Self) {
        (self.tiles, self.tile_lists) = (other.tiles.clone(), other.tile_lists.clone());
        self.cells = other.cells.clone();
    }

    /// Uploads the parameters for particles of `radius`, m, and compiles what is missing for `gaps` gaps and these
    /// lists. `sizes`: planes bear the sizes of their particles.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        camera: &CameraBinding,
        bins: &Bins,
        gaps: u32,
        radius: f32,
        sizes: bool,
    ) {
        let params = Params { least: LEAST * radius };
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(&params));
        self.variant = (gaps, sizes);
        let on = |on: bool| f64::from(u8::from(on));
        for splash in [false, true] {
            self.pipelines.split.entry((gaps, splash)).or_insert_with(|| {
                let constants = [("GAPS", gaps.into()), ("SPLASH", on(splash))];
                let layouts = [&self.layouts.split];
                gpu::compute_pipeline(gpu, "gaps/split.wgsl", "split", &layouts, &constants)
            });
        }
        let splats = splat_buffers::layout(gpu);
        let of_lists = |file: &str, entry: &str, own: &wgpu::BindGroupLayout, constants: &[_]| {
            let layouts = [&camera.layout, &splats, bins.read_layout(), own];
            let constants = [&camera.constants()[..], constants].concat();
            gpu::compute_pipeline(gpu, file, entry, &layouts, &constants)
        };
        for ends in bins.ends() {
            let first = ("FIRST", on(ends[0]));
            let alone = ends == [true, true];
            self.pipelines.mark.entry(alone).or_insert_with(|| {
                let constants = [("ALONE", on(alone))];
                of_lists("gaps/mark.wgsl", "mark", &self.layouts.mark, &constants)
            });
            self.pipelines.sides.entry((gaps, sizes, ends)).or_insert_with(|| {
                let last = ("LAST", on(ends[1]));
                let constants = [first, last, ("GAPS", gaps.into()), ("SIZES", on(sizes))];
                of_lists("gaps/sides.wgsl", "sides", &self.layouts.sides, &constants)
            });
        }
    }

    /// Records the search for gaps, and the layers of their sides. `classes` are the aggregates and, if there are
    /// any, the splashes; their lists are recorded before. Requires [`Gaps::prepare`].
    pub fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        (camera, bins): (&CameraBinding, &Bins),
        tiles: &Tiles,
        classes: &[Class<'_>],
        span: Span<'_>,
    ) {
        for (class, (splats, layers)) in classes.iter().enumerate() {
            let marks = self.cells.marks[class].as_entire_binding();
            let resources = [texture(&layers.view), marks];
            let group = gpu::bind_group(gpu, "gap marks", &self.layouts.mark, &resources);
            let span = if class == 0 { span.first() } else { Span::default() };
            let alone = !bins.is_divided(class);
            if !alone {
                encoder.clear_buffer(&self.cells.marks[class], 0, None);
            }
            bins.draw(encoder, camera, class, splats, span, |pass, _, tiles| {
                pass.set_pipeline(&self.pipelines.mark[&alone]);
                pass.set_bind_group(3, &group, &[]);
                pass.dispatch_workgroups_indirect(tiles, 0);
            });
        }
        let (gaps, sizes) = self.variant;
        let layers = |i: usize| classes.get(i).unwrap_or(&classes[0]).1;
        self.tile_lists.clear(encoder);
        self.record_splits(gpu, encoder, [layers(0), layers(1)], classes.len() > 1);
        tiles.arrange(gpu, encoder, &self.tile_lists, layers(0));
        let state = bins.state();
        for (class, (splats, layers)) in classes.iter().enumerate() {
            let splits = self.cells.splits[class].create_view(&Default::default());
            let planes = gpu::level_view(&layers.texture, 0, D2Array);
            let groups: Vec<_> = self
                .tile_lists
                .sections()
                .map(|section| {
                    let tiles = self.tile_lists.section(&self.tile_lists.liquid, section);
                    let resources = [texture(&splits), tiles, texture(&planes), texture(&state)];
                    gpu::bind_group(gpu, "gap sides", &self.layouts.sides, &resources)
                })
                .collect();
            let span = if class + 1 == classes.len() { span.last() } else { Span::default() };
            bins.draw(encoder, camera, class, splats, span, |pass, part, _| {
                let variant = (gaps, sizes, part.ends());
                pass.set_pipeline(&self.pipelines.sides[&variant]);
                for (section, group) in self.tile_lists.sections().zip(&groups) {
                    pass.set_bind_group(3, group, &[]);
                    let at = self.tile_lists.dispatch(TileLists::LIQUID, section);
                    pass.dispatch_workgroups_indirect(&self.tile_lists.dispatches, at);
                }
            });
        }
    }

    /// Records the choice of each cell's gaps, and the list of the tiles that have any.
    fn record_splits(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        layers: [&Layers; 2],
        splash: bool,
    ) {
        let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        let splits = self.cells.splits.each_ref().map(view);
        let flags = view(&self.tiles);
        let resources = [
            texture(&layers[0].view),
            texture(&layers[1].view),
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
        pass.set_pipeline(&self.pipelines.split[&(self.variant.0, splash)]);
        pass.set_bind_group(0, &group, &[]);
        let (x, y) = gpu::workgroups(self.cells.size.map(|n| n.div_ceil(TILE)));
        pass.dispatch_workgroups(x, y, 1);
    }
}

fn texture(view: &wgpu::TextureView) -> wgpu::BindingResource<'_> {
    wgpu::BindingResource::TextureView(view)
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
        Self { size, marks: [marks(), marks()], splits: [splits(), splits()] }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Lists are made for ellipsoids as large as those that mark cells.
    #[test]
    fn lists_are_as_wide_as_marks() {
        assert_eq!(CLOSING, gpu::shader::constant("gaps/mark.wgsl", "CLOSING") as f32);
    }
}
