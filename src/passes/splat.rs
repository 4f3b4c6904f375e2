//! Splatting of particles into layers: `shaders/splat/`.
//!
//! Each class of particles has its own layers, fronts and backs. A workgroup has a tile of the picture, and runs
//! through [its list](super::bins) of splats; each texel is written once.

use glam::UVec2;
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::{D2, D2Array};

use super::bins::Bins;
use super::{CameraBinding, Layers};
use crate::gpu::{self, Bound, Gpu, Span};

/// The splatted layers of a view.
#[derive(Debug, Clone)]
pub struct SplatImages {
    /// Unsmoothed planes of bodies and sheets.
    pub aggregate: Layers,
    /// Planes of droplets; one pixel if the frame has none.
    pub splash: Layers,
    /// Particle, from 1, and fluid of each front, by class; one pixel unless asked for.
    pub tags: [wgpu::Texture; 2],
}

/// Sizes of a view's layers.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    /// Pixels.
    pub size: UVec2,
    /// Pairs of layers for gaps.
    pub gaps: u32,
    /// Mip levels.
    pub levels: u32,
    /// The frame has splashes.
    pub splash: bool,
    /// Tags are written.
    pub tags: bool,
}

/// Layers that a frame draws.
#[derive(Debug, Clone, Copy)]
pub struct Drawn {
    /// Draw backs.
    pub backs: bool,
    /// Planes bear the sizes of their particles.
    pub sizes: bool,
    /// Write the tags.
    pub tags: bool,
}

/// Draws the splats of a class into their layers.
#[derive(Debug)]
pub struct SplatPass {
    class: usize,
    images: Bound,
    /// By chunk of the class.
    pipelines: Vec<wgpu::ComputePipeline>,
    empty: wgpu::ComputePipeline,
    emptied: Bound,
}

impl SplatImages {
    /// Creates empty layers.
    pub fn new(gpu: &Gpu, extent: Extent) -> Self {
        let Extent { size, gaps, levels, splash, tags } = extent;
        let used = |on: bool| if on { size } else { UVec2::ONE };
        let layers = 2 + 2 * gaps;
        Self {
            aggregate: create_layers(gpu, size, layers, levels),
            splash: create_layers(gpu, used(splash), layers, if splash { levels } else { 1 }),
            tags: [tags, tags && splash].map(|on| create_tags(gpu, used(on))),
        }
    }
}

impl SplatPass {
    /// Prepares the layers of a class.
    pub fn prepare(
        gpu: &Gpu,
        camera: &CameraBinding,
        bins: &Bins,
        class: usize,
        images: &SplatImages,
        drawn: Drawn,
    ) -> Self {
        let layers = [&images.aggregate, &images.splash][class];
        let planes = gpu::level_view(&layers.texture, 0, D2Array);
        let tags = images.tags[class].create_view(&Default::default());
        let bindings = [
            (gpu::storage_texture(Layers::FORMAT, D2Array), TextureView(&planes)),
            (gpu::storage_texture(TAGS, D2), TextureView(&tags)),
            (gpu::state_texture(), TextureView(bins.state())),
        ];
        let images = gpu.bind("splat", &bindings);
        let tiles = (gpu::storage_of(8), bins.emptied(class).tiles.as_entire_binding());
        let emptied = gpu.bind("emptied splats", &[&[tiles][..], &bindings].concat());

        let on = |on: bool| f64::from(u8::from(on));
        let Drawn { backs, sizes, tags } = drawn;
        let kernel = ("splat/layers.wgsl", "layers_of_tiles");
        let constants = |[first, last]: [bool; 2]| {
            [
                ("BACKS", on(backs)),
                ("SIZES", on(sizes)),
                ("TAGS", on(tags)),
                ("FIRST", on(first)),
                ("LAST", on(last)),
            ]
        };
        let pipelines = bins.pipelines(gpu, camera, class, kernel, &images.layout, constants);
        let constants = [("TAGS", on(tags)), ("LAST", on(!bins.is_divided(class)))];
        let constants = [&camera.constants()[..], &constants].concat();
        let layouts = [&camera.layout, &emptied.layout];
        let empty = gpu.compute_pipeline("splat/empty.wgsl", "empty", &layouts, &constants);
        Self { class, images, pipelines, empty, emptied }
    }

    /// Records the layers of the class, whose lists are recorded before.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        bins: &Bins,
        span: Span<'_>,
    ) {
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.empty);
            pass.set_bind_group(0, &camera.group, &[]);
            pass.set_bind_group(1, &self.emptied.group, &[]);
            bins.emptied(self.class).dispatch(&mut pass);
        }
        bins.draw(encoder, self.class, &self.pipelines, span, |pass, tiles| {
            pass.set_bind_group(3, &self.images.group, &[]);
            pass.dispatch_workgroups_indirect(tiles, 0);
        });
    }
}

/// Format of tags, of which two channels are used: OpenGL ES stores none of two.
const TAGS: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

fn create_tags(gpu: &Gpu, size: UVec2) -> wgpu::Texture {
    let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING;
    gpu.texture("tags", size, 1, TAGS, usage)
}

fn create_layers(gpu: &Gpu, size: UVec2, layers: u32, levels: u32) -> Layers {
    let usage = wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    Layers::new(gpu, "splat layers", size, layers, levels, usage)
}
