//! Splatting of particles into layers: `shaders/splat/`.
//!
//! Each class of particles has its own layers, fronts and backs. A workgroup has a tile of the picture, and runs
//! through [its list](super::bins) of splats; each texel is written once.

use std::collections::HashMap;

use glam::UVec2;
use wgpu::TextureViewDimension::{D2, D2Array};

use super::bins::Bins;
use super::splat_buffers::{self, SplatBuffers};
use super::{CameraBinding, Layers};
use crate::gpu::{self, Gpu, Span};

/// Draws the splats into their layers.
#[derive(Debug)]
pub struct Splat {
    /// Output: unsmoothed planes of bodies and sheets.
    pub aggregate: Layers,
    /// Output: planes of droplets; one pixel if the frame has none.
    pub splash: Layers,
    /// Output: particle, from 1, and fluid of each front, by class; one pixel unless asked for.
    pub tags: [wgpu::Texture; 2],
    layout: wgpu::BindGroupLayout,
    empty_layout: wgpu::BindGroupLayout,
    pipelines: HashMap<Variant, wgpu::ComputePipeline>,
    /// By whether tags are written and whether the chunk is the last.
    empty: HashMap<[bool; 2], wgpu::ComputePipeline>,
    frame: Frame,
}

/// Layers that a frame draws.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Frame {
    /// Draw backs.
    pub backs: bool,
    /// Planes bear the sizes of their particles.
    pub sizes: bool,
    /// Write the tags.
    pub tags: bool,
}

/// Specialisation: the frame's layers, and whether the chunk is the first and the last.
type Variant = (Frame, [bool; 2]);

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

impl Splat {
    /// Creates the layout; [`Splat::resize`] allocates the layers.
    pub fn new(gpu: &Gpu) -> Self {
        let bindings = [
            gpu::storage_texture(Layers::FORMAT, D2Array),
            gpu::storage_texture(TAGS, D2),
            gpu::state_texture(),
        ];
        let compute = wgpu::ShaderStages::COMPUTE;
        let empty = [&[gpu::storage_of(8)][..], &bindings].concat();
        let one = [(); 2].map(|()| create_layers(gpu, UVec2::ONE, 2, 1));
        let [aggregate, splash] = one;
        Self {
            aggregate,
            splash,
            tags: [(); 2].map(|()| create_tags(gpu, UVec2::ONE)),
            layout: gpu.layout("splat", compute, &bindings),
            empty_layout: gpu.layout("emptied splats", compute, &empty),
            pipelines: HashMap::new(),
            empty: HashMap::new(),
            frame: Frame::default(),
        }
    }

    /// Replaces the layers.
    pub fn resize(&mut self, gpu: &Gpu, extent: Extent) {
        let Extent { size, gaps, levels, splash, tags } = extent;
        let used = |on: bool| if on { size } else { UVec2::ONE };
        let layers = 2 + 2 * gaps;
        self.aggregate = create_layers(gpu, size, layers, levels);
        self.splash = create_layers(gpu, used(splash), layers, if splash { levels } else { 1 });
        self.tags = [tags, tags && splash].map(|on| create_tags(gpu, used(on)));
    }

    /// Takes the textures of another view, which is drawn before and no longer needed then.
    pub fn share(&mut self, other: &Self) {
        (self.aggregate, self.splash) = (other.aggregate.clone(), other.splash.clone());
        self.tags = other.tags.clone();
    }

    /// Sets the frame's layers, and compiles what is missing for its lists.
    pub fn prepare(&mut self, gpu: &Gpu, camera: &CameraBinding, bins: &Bins, frame: Frame) {
        self.frame = frame;
        let on = |on: bool| f64::from(u8::from(on));
        for ends in bins.ends() {
            self.empty.entry([frame.tags, ends[1]]).or_insert_with(|| {
                let own = [("TAGS", on(frame.tags)), ("LAST", on(ends[1]))];
                let constants = [&camera.constants()[..], &own].concat();
                let layouts = [&camera.layout, &self.empty_layout];
                gpu::compute_pipeline(gpu, "splat/empty.wgsl", "empty", &layouts, &constants)
            });
            self.pipelines.entry((frame, ends)).or_insert_with(|| {
                let [first, last] = ends.map(on);
                let own = [
                    ("BACKS", on(frame.backs)),
                    ("SIZES", on(frame.sizes)),
                    ("TAGS", on(frame.tags)),
                    ("FIRST", first),
                    ("LAST", last),
                ];
                let constants = [&camera.constants()[..], &own].concat();
                let splats = splat_buffers::layout(gpu);
                let layouts = [&camera.layout, &splats, bins.read_layout(), &self.layout];
                let entry = "layers_of_tiles";
                gpu::compute_pipeline(gpu, "splat/layers.wgsl", entry, &layouts, &constants)
            });
        }
    }

    /// Records the layers of a class, whose lists are recorded before; requires [`Splat::prepare`].
    pub fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        bins: &Bins,
        (class, splats): (usize, &SplatBuffers),
        span: Span<'_>,
    ) {
        let layers = [&self.aggregate, &self.splash][class];
        let planes = gpu::level_view(&layers.texture, 0, D2Array);
        let tags = self.tags[class].create_view(&Default::default());
        let state = bins.state();
        let resources = [&planes, &tags, &state].map(wgpu::BindingResource::TextureView);
        let group = gpu::bind_group(gpu, "splat", &self.layout, &resources);
        let emptied = bins.emptied(class);
        let resources = [&[emptied.tiles.as_entire_binding()][..], &resources].concat();
        let empty = gpu::bind_group(gpu, "emptied splats", &self.empty_layout, &resources);
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.empty[&[self.frame.tags, !bins.is_divided(class)]]);
            pass.set_bind_group(0, &camera.group, &[]);
            pass.set_bind_group(1, &empty, &[]);
            emptied.dispatch(&mut pass);
        }
        bins.draw(encoder, camera, class, splats, span, |pass, part, tiles| {
            pass.set_pipeline(&self.pipelines[&(self.frame, part.ends())]);
            pass.set_bind_group(3, &group, &[]);
            pass.dispatch_workgroups_indirect(tiles, 0);
        });
    }
}

/// Format of tags, of which two channels are used: OpenGL ES stores none of two.
const TAGS: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

fn create_tags(gpu: &Gpu, size: UVec2) -> wgpu::Texture {
    let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING;
    gpu::texture(gpu, "tags", size, 1, TAGS, usage)
}

fn create_layers(gpu: &Gpu, size: UVec2, layers: u32, levels: u32) -> Layers {
    let usage = wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::COPY_SRC;
    Layers::new(gpu, "splat layers", size, layers, levels, usage)
}
