//! Which tiles of the picture liquid covers: `shaders/tiles.wgsl`.
//!
//! Later passes are dispatched over those alone. On a software adapter, which runs both sides of
//! every branch, this is what makes the empty part of a picture cheap.

use glam::UVec2;
use wgpu::TextureViewDimension::D2Array;

use super::Layers;
use crate::gpu::{self, Gpu, Span};

/// Pixels along a tile's side, and threads along a workgroup's.
pub const TILE: u32 = 8;

/// Sorts tiles into those that liquid covers and the rest.
#[derive(Debug)]
pub(crate) struct Tiles {
    /// Output.
    pub(crate) lists: TileLists,
    sort: [wgpu::ComputePipeline; 2],
    arrange: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

/// The tiles, as buffers.
#[derive(Debug, Clone)]
pub(crate) struct TileLists {
    /// Count, then the tiles that liquid covers: x + 65536 y.
    pub(crate) liquid: wgpu::Buffer,
    /// Count, then all others.
    pub(crate) background: wgpu::Buffer,
    /// Arguments of indirect dispatches, at [`TileLists::LIQUID`] and its like.
    pub(crate) dispatches: wgpu::Buffer,
    size: UVec2,
}

impl TileLists {
    /// Dispatch over the liquid's tiles.
    pub(crate) const LIQUID: u64 = 0;
    /// Dispatch over the liquid's tiles, z being front and back.
    pub(crate) const LIQUID_LAYERS: u64 = 16;
    /// Dispatch over the other tiles.
    pub(crate) const BACKGROUND: u64 = 32;
}

impl Tiles {
    /// Compiles the pipelines; [`Tiles::resize`] gives the pass its lists.
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let bindings = [
            gpu::sampled(D2Array),
            gpu::sampled(D2Array),
            gpu::storage_read_write(8),
            gpu::storage_read_write(8),
            gpu::storage_read_write(48),
        ];
        let layout = gpu.layout("tiles", wgpu::ShaderStages::COMPUTE, &bindings);
        let pipeline = |entry: &str, constants: &[(&str, f64)]| {
            gpu::compute_pipeline(gpu, "tiles.wgsl", entry, &[&layout], constants)
        };
        Self {
            lists: sized(gpu, UVec2::ONE),
            sort: [0.0, 1.0].map(|splash| pipeline("sort", &[("SPLASH", splash)])),
            arrange: pipeline("arrange", &[]),
            layout,
        }
    }

    /// Replaces the lists.
    pub(crate) fn resize(&mut self, gpu: &Gpu, size: UVec2) {
        self.lists = sized(gpu, size);
    }

    /// Sorts the tiles by the splatted layers.
    pub(crate) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        aggregate: &Layers,
        splash: Option<&Layers>,
        span: Span<'_>,
    ) {
        let TileLists { liquid, background, dispatches, size } = &self.lists;
        encoder.clear_buffer(liquid, 0, Some(4));
        encoder.clear_buffer(background, 0, Some(4));
        let resources = [
            wgpu::BindingResource::TextureView(&aggregate.view),
            wgpu::BindingResource::TextureView(&splash.unwrap_or(aggregate).view),
            liquid.as_entire_binding(),
            background.as_entire_binding(),
            dispatches.as_entire_binding(),
        ];
        let group = gpu::bind_group(gpu, "tiles", &self.layout, &resources);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("tiles"),
            timestamp_writes: span.compute(),
        });
        pass.set_bind_group(0, &group, &[]);
        pass.set_pipeline(&self.sort[usize::from(splash.is_some())]);
        let (x, y) = gpu::workgroups(size.map(|n| n.div_ceil(TILE)));
        pass.dispatch_workgroups(x, y, 1);
        pass.set_pipeline(&self.arrange);
        pass.dispatch_workgroups(1, 1, 1);
    }
}

fn sized(gpu: &Gpu, size: UVec2) -> TileLists {
    let tiles = u64::from(size.x.div_ceil(TILE)) * u64::from(size.y.div_ceil(TILE));
    let buffer = |label: &str, size: u64, usage: wgpu::BufferUsages| {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage: usage | wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        })
    };
    let list = |label: &str| buffer(label, 4 + 4 * tiles, wgpu::BufferUsages::COPY_DST);
    TileLists {
        liquid: list("liquid tiles"),
        background: list("background tiles"),
        dispatches: buffer("tile dispatches", 48, wgpu::BufferUsages::INDIRECT),
        size,
    }
}
