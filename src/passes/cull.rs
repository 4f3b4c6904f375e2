//! Culling of hidden splats: `shaders/cull/`.
//!
//! Nearly all particles of a large body are hidden inside it. The ones at its surface are drawn first;
//! then, of those surrounded by liquid, the ones that the layers drawn so far do not certainly hide
//! (two phases: U. Haar and S. Aaltonen, "GPU-Driven Rendering Pipelines", SIGGRAPH 2015 courses).
//! The layers are the same as if all splats were drawn in that order.

use glam::UVec2;
use rayon::prelude::*;

use super::splat_buffers::SplatBuffers;
use super::splat_lists::{self, Selection, SplatLists};
use super::{CameraBinding, Layers};
use crate::gpu::{self, Gpu, Span, TILE};
use crate::liquid::classify::Splats;

/// Least number of surrounded splats for which culling is faster than drawing them.
pub const LEAST: usize = 1 << 16;

/// The same for software adapters.
const LEAST_IN_SOFTWARE: usize = 1 << 11;

/// Quads along a tile: as in `cull/quads.wgsl`.
const QUADS: u32 = TILE / 4;

/// Whether culling pays for a frame: enough splats are surrounded, and the device supports it.
pub fn is_worthwhile(gpu: &Gpu, splats: &Splats) -> bool {
    if !splat_lists::are_supported(gpu) {
        return false;
    }
    let software = gpu.device.adapter_info().device_type == wgpu::DeviceType::Cpu;
    let least = if software { LEAST_IN_SOFTWARE } else { LEAST };
    // Skip the count if there are too few splats altogether.
    splats.aggregates.len() >= least
        && splats.aggregates.par_iter().filter(|splat| splat.is_buried()).count() >= least
}

/// Which splats are tested.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Splats that liquid does not surround.
    Surface,
    /// Splats that liquid surrounds.
    Surrounded,
}

/// Lists the visible splats of one view.
#[derive(Debug)]
pub struct Cull {
    lists: SplatLists,
    selections: [Selection; 2],
    depths: [wgpu::ComputePipeline; 2],
    depths_layout: wgpu::BindGroupLayout,
    tiles_layout: wgpu::BindGroupLayout,
    /// A pair of depths for each tile, and for each quad of 2×2 pixels.
    tiles: wgpu::Buffer,
    input: wgpu::BindGroup,
    size: UVec2,
}

impl Cull {
    /// Compiles the pipelines; [`Cull::prepare`] allocates a frame's lists.
    pub fn new(gpu: &Gpu, camera: &CameraBinding) -> Self {
        let lists = SplatLists::new(gpu);
        let compute = wgpu::ShaderStages::COMPUTE;
        let bindings = [gpu.layers(), gpu::storage_read_write(8)];
        let depths_layout = gpu.layout("cull depths", compute, &bindings);
        let tiles_layout = gpu.layout("cull", compute, &[gpu::storage::<[f32; 2]>()]);
        let depths = |backs: f64| {
            let constants = [("BACKS", backs)];
            gpu::compute_pipeline(gpu, "cull/depths.wgsl", "reduce", &[&depths_layout], &constants)
        };
        let select = |surrounded| {
            let constants = [("SURROUNDED", surrounded)];
            lists.selection(gpu, camera, "cull/select.wgsl", &tiles_layout, &constants)
        };
        let (tiles, input) = tiles(gpu, UVec2::ONE, &tiles_layout);
        Self {
            selections: [0.0, 1.0].map(select),
            depths: [0.0, 1.0].map(depths),
            tiles,
            input,
            size: UVec2::ONE,
            lists,
            depths_layout,
            tiles_layout,
        }
    }

    /// Allocates the lists for these splats in a view of `size` pixels.
    pub fn prepare(&mut self, gpu: &Gpu, splats: &SplatBuffers, size: UVec2) {
        if self.size != size {
            (self.tiles, self.input) = tiles(gpu, size, &self.tiles_layout);
            self.size = size;
        }
        self.lists.prepare(gpu, splats);
    }

    /// Records the tests of the splats of `phase`, which list the visible ones.
    pub fn select(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        splats: &SplatBuffers,
        phase: Phase,
        span: Span<'_>,
    ) {
        let selection = (&self.selections[phase as usize], &self.input);
        self.lists.select(encoder, camera, splats, selection, span);
    }

    /// Records the reduction of the layers, fronts alone without `backs`, to a pair of depths per tile.
    pub fn reduce(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        layers: &Layers,
        backs: bool,
    ) {
        let resources =
            [wgpu::BindingResource::TextureView(&layers.view), self.tiles.as_entire_binding()];
        let group = gpu::bind_group(gpu, "cull depths", &self.depths_layout, &resources);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("cull depths"),
            timestamp_writes: None,
        });
        pass.set_pipeline(&self.depths[usize::from(backs)]);
        pass.set_bind_group(0, &group, &[]);
        let (x, y) = gpu::workgroups(self.size.map(|n| n.div_ceil(TILE)));
        pass.dispatch_workgroups(x, y, 1);
    }

    /// Draws the splats listed last, with the current pipeline.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, splats: &SplatBuffers) {
        self.lists.draw(pass, splats);
    }
}

fn tiles(
    gpu: &Gpu,
    size: UVec2,
    layout: &wgpu::BindGroupLayout,
) -> (wgpu::Buffer, wgpu::BindGroup) {
    let tiles = u64::from(size.x.div_ceil(TILE)) * u64::from(size.y.div_ceil(TILE));
    let depths = tiles * u64::from(1 + QUADS * QUADS);
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("cull depths"),
        size: 8 * depths,
        usage: wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    });
    let group = gpu::bind_group(gpu, "cull", layout, &[buffer.as_entire_binding()]);
    (buffer, group)
}
