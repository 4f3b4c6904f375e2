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

use super::bins::Bins;
use super::tiles::{Arrange, Sections, TileLists};
use super::{CameraBinding, Layers};
use crate::gpu::{self, Bound, Gpu, Span, TILE};
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

/// The gaps of a view.
#[derive(Debug, Clone)]
pub struct GapImages {
    /// Of each tile the least and the greatest depth of a split, m, of the aggregates and then of the splashes; 0
    /// without any.
    pub tiles: wgpu::Texture,
    /// The tiles with gaps, as their `liquid`.
    pub tile_lists: TileLists,
    size: UVec2,
    /// Occupancy of the cells, by class.
    marks: [wgpu::Buffer; 2],
    /// Splits of the cells, by class.
    splits: [wgpu::Texture; 2],
}

/// Finds and draws the gaps of a view's layers.
#[derive(Debug)]
pub struct Gaps {
    images: GapImages,
    classes: Vec<Class>,
    split: wgpu::ComputePipeline,
    split_images: Bound,
    arrange: Arrange,
}

/// The aggregates or the splashes. Pipelines are by chunk.
#[derive(Debug)]
struct Class {
    mark: Vec<wgpu::ComputePipeline>,
    marks: Bound,
    sides: Vec<wgpu::ComputePipeline>,
    /// By section of the tiles.
    splits: Vec<Bound>,
}

impl GapImages {
    /// Creates the images of a view without gaps.
    pub fn new(gpu: &Gpu, size: UVec2, sections: Sections) -> Self {
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
        let splits = || gpu.texture("gap splits", cells, 1, SPLITS, usage);
        Self {
            tiles: create_tiles(gpu, size),
            tile_lists: TileLists::new(gpu, size, sections),
            size,
            marks: [marks(), marks()],
            splits: [splits(), splits()],
        }
    }
}

impl Gaps {
    /// Prepares the search for `gaps` gaps among particles of `radius`, m, in the layers of the aggregates and, if there
    /// are any, the splashes. `sizes`: planes bear the sizes of their particles.
    pub fn prepare(
        gpu: &Gpu,
        camera: &CameraBinding,
        bins: &Bins,
        layers: &[&Layers],
        images: &GapImages,
        (gaps, sizes): (u32, bool),
        radius: f32,
    ) -> Self {
        let on = |on: bool| f64::from(u8::from(on));
        let class = |(class, layers): (usize, &&Layers)| {
            let marks = images.marks[class].as_entire_binding();
            let marked =
                [(gpu.layers(), texture(&layers.view)), (gpu::storage_read_write(MARKS), marks)];
            let marks = gpu.bind("gap marks", &marked);
            let alone = !bins.is_divided(class);
            let kernel = ("gaps/mark.wgsl", "mark");
            let constants = |_| [("ALONE", on(alone))];
            let mark = bins.pipelines(gpu, camera, class, kernel, &marks.layout, constants);

            let splits = images.splits[class].create_view(&Default::default());
            let planes = gpu::level_view(&layers.texture, 0, D2Array);
            let lists = &images.tile_lists;
            let of_section = |section| {
                let bindings = [
                    (gpu::sampled(D2), texture(&splits)),
                    (gpu::storage_of(8), lists.section(&lists.liquid, section)),
                    (gpu::storage_texture(Layers::FORMAT, D2Array), texture(&planes)),
                    (gpu::state_texture(), texture(bins.state())),
                ];
                gpu.bind("gap sides", &bindings)
            };
            let splits: Vec<_> = lists.sections().map(of_section).collect();
            let kernel = ("gaps/sides.wgsl", "sides");
            let constants = |[first, last]: [bool; 2]| {
                [
                    ("FIRST", on(first)),
                    ("LAST", on(last)),
                    ("GAPS", gaps.into()),
                    ("SIZES", on(sizes)),
                ]
            };
            let sides = bins.pipelines(gpu, camera, class, kernel, &splits[0].layout, constants);
            Class { mark, marks, sides, splits }
        };
        let classes = layers.iter().enumerate().map(class).collect();
        let (first, second) = (layers[0], layers.get(1).unwrap_or(&layers[0]));
        let split_images = bind_splits(gpu, images, [first, second], radius);
        let constants = [("GAPS", gaps.into()), ("SPLASH", on(layers.len() > 1))];
        let layouts = [&split_images.layout];
        let split = gpu.compute_pipeline("gaps/split.wgsl", "split", &layouts, &constants);
        let arrange = Arrange::prepare(gpu, &images.tile_lists, first);
        Self { images: images.clone(), classes, split, split_images, arrange }
    }

    /// Records the search for gaps, and the layers of their sides; the lists of all classes are recorded before.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, bins: &Bins, span: Span<'_>) {
        for (i, class) in self.classes.iter().enumerate() {
            if bins.is_divided(i) {
                encoder.clear_buffer(&self.images.marks[i], 0, None);
            }
            let span = if i == 0 { span.first() } else { Span::default() };
            bins.draw(encoder, i, &class.mark, span, |pass, tiles| {
                pass.set_bind_group(3, &class.marks.group, &[]);
                pass.dispatch_workgroups_indirect(tiles, 0);
            });
        }
        let lists = &self.images.tile_lists;
        lists.clear(encoder);
        self.record_splits(encoder);
        self.arrange.record(encoder);
        for (i, class) in self.classes.iter().enumerate() {
            let is_last = i + 1 == self.classes.len();
            let span = if is_last { span.last() } else { Span::default() };
            bins.draw(encoder, i, &class.sides, span, |pass, _| {
                for (section, splits) in lists.sections().zip(&class.splits) {
                    pass.set_bind_group(3, &splits.group, &[]);
                    let at = lists.dispatch(TileLists::LIQUID, section);
                    pass.dispatch_workgroups_indirect(&lists.dispatches, at);
                }
            });
        }
    }

    /// Records the choice of each cell's gaps, and the list of the tiles that have any.
    fn record_splits(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.split);
        pass.set_bind_group(0, &self.split_images.group, &[]);
        let (x, y) = gpu::workgroups(self.images.size.map(|n| n.div_ceil(TILE)));
        pass.dispatch_workgroups(x, y, 1);
    }
}

/// Group 0 of `gaps/split.wgsl`.
fn bind_splits(gpu: &Gpu, images: &GapImages, layers: [&Layers; 2], radius: f32) -> Bound {
    let params = Params { least: LEAST * radius };
    let params = gpu.buffer_with("gaps", gpu::UNIFORM, &[params]);
    let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
    let splits = images.splits.each_ref().map(view);
    let flags = view(&images.tiles);
    let lists = &images.tile_lists;
    let (marks, written) = (gpu::storage_of(MARKS), gpu::storage_texture(SPLITS, D2));
    let bindings = [
        (gpu::sampled(D2Array), texture(&layers[0].view)),
        (gpu::sampled(D2Array), texture(&layers[1].view)),
        (marks, images.marks[0].as_entire_binding()),
        (marks, images.marks[1].as_entire_binding()),
        (written, texture(&splits[0])),
        (written, texture(&splits[1])),
        (written, texture(&flags)),
        (gpu::storage_read_write(8), lists.liquid.as_entire_binding()),
        (gpu::storage::<Sections>(), lists.sections_buffer().as_entire_binding()),
        (gpu::uniform::<Params>(), params.as_entire_binding()),
    ];
    gpu.bind("gap splits", &bindings)
}

/// Format of splits, by cell and by tile.
const SPLITS: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

fn texture(view: &wgpu::TextureView) -> wgpu::BindingResource<'_> {
    wgpu::BindingResource::TextureView(view)
}

/// Creates the image of the tiles with gaps of a view of `size` pixels: none have.
#[doc(hidden)]
pub fn create_tiles(gpu: &Gpu, size: UVec2) -> wgpu::Texture {
    let tiles = size.map(|n| n.div_ceil(TILE));
    let usage = wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    gpu.texture("gap tiles", tiles, 1, SPLITS, usage)
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
