//! Colours of a body's surface, from those of the particles: `shaders/color/`.
//!
//! The kernels of the particles are listed by tiles like splats, and each pixel of the first surface sums those around it. Only
//! opaque bodies whose particles have colours need the pass.

use bytemuck::{Pod, Zeroable};
use glam::{UVec2, Vec4};
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::D2;

use super::Layers;
use super::bins::{AGGREGATES, BinBuffers, Bins, Listed};
use super::view_passes::{SplatSet, ViewPasses};
use crate::camera::CameraUniform;
use crate::gpu::{self, Bound, Gpu, Span, TILE};
use crate::liquid::classify::colors::{ColorMap, Colors, MAP_COLORS, SUPPORT};

/// `Coloring` of `color/means.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Coloring {
    /// Inverse support of a particle of the usual radius, 1/m.
    pub per_radius: f32,
    /// Value of the map's first colour, as the particles' are stored.
    pub low: f32,
    /// Inverse of the range of the map.
    pub per_range: f32,
}

/// The colours of a frame's surface, and the particles' on the device.
#[derive(Debug)]
pub struct ColorImages {
    /// Linear albedo, and the place of the value in the map's range, also beyond it; without meaning where there is no
    /// liquid.
    pub texture: wgpu::Texture,
    kernels: SplatSet,
    empty: SplatSet,
    bins: BinBuffers,
    summed: wgpu::Buffer,
    uploaded: Option<Colors>,
}

/// Draws the colours of a frame's surface.
#[derive(Debug)]
pub struct Color {
    bins: Bins,
    images: Bound,
    summed: wgpu::Buffer,
    pipelines: Vec<wgpu::ComputePipeline>,
}

impl ColorImages {
    /// Creates the images of a picture of `size` pixels.
    pub fn new(gpu: &Gpu, size: UVec2) -> Self {
        let usage = wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC;
        let tiles = size.map(|n| n.div_ceil(TILE)).element_product();
        let summed = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("colored tiles"),
            size: 4 * u64::from(tiles),
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Self {
            texture: gpu.texture("colors", size, 1, Layers::FORMAT, usage),
            kernels: SplatSet::new(gpu),
            empty: SplatSet::new(gpu),
            bins: BinBuffers::new(gpu, size),
            summed,
            uploaded: None,
        }
    }

    /// The colours with their map, if they are by value.
    pub fn by_value(&self) -> Option<(wgpu::Texture, ColorMap)> {
        Some((self.texture.clone(), self.uploaded.as_ref()?.map()?.clone()))
    }
}

impl Color {
    /// Prepares the colours of the surface that `eye` shows, which is prepared and uploaded before. Uploads the particles' if
    /// they have changed.
    pub fn prepare(
        gpu: &Gpu,
        eye: &ViewPasses,
        uniform: &CameraUniform,
        colors: &Colors,
        kept: &mut ColorImages,
    ) -> Self {
        if kept.uploaded.as_ref() != Some(colors) {
            kept.kernels.upload(gpu, colors.kernels());
            kept.uploaded = Some(colors.clone());
        }
        let (kernels, camera) = (colors.kernels(), &eye.camera);
        let classes = [
            Listed {
                splats: &kernels.aggregates,
                blocks: &kept.kernels.blocks.aggregates,
                buffers: &kept.kernels.aggregates,
                device: None,
            },
            Listed { splats: &[], blocks: &[], buffers: &kept.empty.aggregates, device: None },
        ];
        let bins = Bins::prepare(gpu, camera, uniform, classes, 1.0, true, &mut kept.bins);
        let [low, range] = Colors::stored_range();
        let coloring = Coloring {
            per_radius: (SUPPORT * kernels.radius).max(f32::MIN_POSITIVE).recip(),
            low,
            per_range: range.recip(),
        };
        let coloring = gpu.buffer_with("coloring", gpu::UNIFORM, &[coloring]);
        let table = colors.map().map_or_else(Vec::new, |map| map.table());
        let mut map = [Vec4::ZERO; MAP_COLORS];
        for (padded, color) in map.iter_mut().zip(table) {
            *padded = color.extend(0.0);
        }
        let map = gpu.buffer_with("color map", gpu::UNIFORM, &map);
        let view = kept.texture.create_view(&Default::default());
        let splash = eye.splash_layers();
        let (aggregates, splashes) =
            (&eye.aggregate_layers().view, &splash.unwrap_or(eye.aggregate_layers()).view);
        let bindings = [
            (gpu::uniform::<Coloring>(), coloring.as_entire_binding()),
            (gpu::uniform::<[Vec4; MAP_COLORS]>(), map.as_entire_binding()),
            (gpu.layers(), TextureView(aggregates)),
            (gpu.layers(), TextureView(splashes)),
            (gpu::storage_texture(Layers::FORMAT, D2), TextureView(&view)),
            (gpu::state_texture(), TextureView(bins.state())),
            (gpu::storage_read_write(4), kept.summed.as_entire_binding()),
        ];
        let images = gpu.bind("colors", &bindings);
        let on = |on: bool| f64::from(u8::from(on));
        let constants =
            |_| [("SPLASHES", on(splash.is_some())), ("VALUES", on(colors.map().is_some()))];
        let kernel = ("color/means.wgsl", "colors_of_tiles");
        let pipelines = bins.pipelines(gpu, camera, AGGREGATES, kernel, &images.layout, constants);
        Self { bins, images, summed: kept.summed.clone(), pipelines }
    }

    /// Records the lists of the particles and their sums.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, span: Span<'_>) {
        encoder.clear_buffer(&self.summed, 0, None);
        self.bins.record(encoder, AGGREGATES, span.first());
        self.bins.draw(encoder, AGGREGATES, &self.pipelines, span.last(), |pass, tiles| {
            pass.set_bind_group(3, &self.images.group, &[]);
            pass.dispatch_workgroups_indirect(tiles, 0);
        });
    }
}
