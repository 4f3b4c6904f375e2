//! Culling of hidden splats: `shaders/cull/`.
//!
//! Nearly all particles of a large body are hidden inside it. The ones at its surface are drawn first;
//! then, of those surrounded by liquid, the ones that the layers drawn so far do not certainly hide
//! (two phases: U. Haar and S. Aaltonen, "GPU-Driven Rendering Pipelines", SIGGRAPH 2015 courses).
//! The layers are the same as if all splats were drawn in that order.

use glam::UVec2;
use rayon::prelude::*;
use wgpu::TextureViewDimension::D2Array;

use super::splat_buffers::{self, SplatBuffers};
use super::{CameraBinding, Layers};
use crate::gpu::{self, Gpu, Span, TILE};
use crate::liquid::classify::Splats;

/// Splats per workgroup.
pub const BLOCK: u32 = 256;

/// 32-bit words of a block's visibility mask.
const WORDS: u32 = BLOCK / 32;

/// Least number of surrounded splats for which culling is faster than drawing them.
pub const LEAST: usize = 1 << 16;

/// The same for software adapters.
const LEAST_IN_SOFTWARE: usize = 1 << 14;

/// Whether culling pays for a frame: enough splats are surrounded, and the device supports it.
pub fn is_worthwhile(gpu: &Gpu, splats: &Splats) -> bool {
    let limits = gpu.device.limits();
    if limits.max_storage_buffers_per_shader_stage < 8
        || limits.max_compute_invocations_per_workgroup < BLOCK
    {
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
    mark: [wgpu::ComputePipeline; 2],
    arrange: wgpu::ComputePipeline,
    list: wgpu::ComputePipeline,
    depths: [wgpu::ComputePipeline; 2],
    select_layout: wgpu::BindGroupLayout,
    depths_layout: wgpu::BindGroupLayout,
    visible_layout: wgpu::BindGroupLayout,
    /// A pair of depths for each tile.
    tiles: wgpu::Buffer,
    size: UVec2,
    /// One for each chunk of the splats.
    lists: Vec<List>,
}

/// The visible splats of one chunk.
#[derive(Debug)]
struct List {
    splats: u32,
    /// Masks, counts and list, with room for at least `splats`.
    buffers: [wgpu::Buffer; 3],
    draw: wgpu::Buffer,
    select: wgpu::BindGroup,
    drawn: wgpu::BindGroup,
}

/// The layout of group 2 of `cull/draw.wgsl`.
pub(super) fn visible_layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    gpu.layout("visible splats", wgpu::ShaderStages::VERTEX, &[gpu::storage::<u32>()])
}

impl Cull {
    /// Compiles the pipelines; [`Cull::prepare`] allocates a frame's lists.
    pub fn new(gpu: &Gpu, camera: &CameraBinding) -> Self {
        let compute = wgpu::ShaderStages::COMPUTE;
        let bindings = [
            gpu::storage::<[f32; 2]>(),
            gpu::storage_read_write(4 * u64::from(WORDS)),
            gpu::storage_read_write(4),
            gpu::storage_read_write(4),
            gpu::storage_read_write(16),
        ];
        let select_layout = gpu.layout("cull", compute, &bindings);
        let bindings = [gpu::sampled(D2Array), gpu::storage_read_write(8)];
        let depths_layout = gpu.layout("cull depths", compute, &bindings);
        let splats = splat_buffers::layout(gpu);
        let select = |entry: &str, surrounded: f64| {
            let constants = [&camera.constants()[..], &[("SURROUNDED", surrounded)]].concat();
            let layouts = [&camera.layout, &splats, &select_layout];
            gpu::compute_pipeline(gpu, "cull/select.wgsl", entry, &layouts, &constants)
        };
        let depths = |backs: f64| {
            let constants = [("BACKS", backs)];
            gpu::compute_pipeline(gpu, "cull/depths.wgsl", "reduce", &[&depths_layout], &constants)
        };
        Self {
            mark: [0.0, 1.0].map(|surrounded| select("mark", surrounded)),
            arrange: select("arrange", 0.0),
            list: select("list", 0.0),
            depths: [0.0, 1.0].map(depths),
            visible_layout: visible_layout(gpu),
            tiles: tiles(gpu, UVec2::ONE),
            size: UVec2::ONE,
            lists: Vec::new(),
            select_layout,
            depths_layout,
        }
    }

    /// Allocates the lists for these splats in a view of `size` pixels.
    pub fn prepare(&mut self, gpu: &Gpu, splats: &SplatBuffers, size: UVec2) {
        if self.size != size {
            self.tiles = tiles(gpu, size);
            self.size = size;
            self.lists.clear();
        }
        let counts: Vec<u32> = splats.chunks().map(|chunk| chunk.count).collect();
        if !counts.iter().eq(self.lists.iter().map(|list| &list.splats)) {
            let mut old = std::mem::take(&mut self.lists).into_iter();
            self.lists = counts.iter().map(|&count| self.list(gpu, count, old.next())).collect();
        }
    }

    /// Creates a list for `splats` splats, in the buffers of `old` if they are large enough.
    fn list(&self, gpu: &Gpu, splats: u32, old: Option<List>) -> List {
        // Words of the masks, the counts and the list.
        let words = |blocks: u64| [u64::from(WORDS) * blocks, blocks, u64::from(BLOCK) * blocks];
        let blocks = u64::from(splats.div_ceil(BLOCK));
        let bytes = words(blocks).map(|words| 4 * words);
        let fits = |list: &List| list.buffers.iter().zip(bytes).all(|(b, bytes)| b.size() >= bytes);
        let (buffers, draw) = match old.filter(fits) {
            Some(List { buffers, draw, .. }) => (buffers, draw),
            None => {
                let storage = wgpu::BufferUsages::STORAGE;
                // With spare room, for frames that grow.
                let room = words(blocks + blocks / 8);
                let buffers = room.map(|words| buffer(gpu, "cull", 4 * words, storage));
                (buffers, buffer(gpu, "cull draw", 16, storage | wgpu::BufferUsages::INDIRECT))
            }
        };
        let binding = |i: usize| gpu::first_bytes(&buffers[i], bytes[i]);
        let [masks, counts, visible] = [0, 1, 2].map(binding);
        let tiles = self.tiles.as_entire_binding();
        let resources = [tiles, masks, counts, visible.clone(), draw.as_entire_binding()];
        let select = gpu::bind_group(gpu, "cull", &self.select_layout, &resources);
        let drawn = gpu::bind_group(gpu, "visible splats", &self.visible_layout, &[visible]);
        List { splats, buffers, draw, select, drawn }
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
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("cull"),
            timestamp_writes: span.compute(),
        });
        pass.set_bind_group(0, &camera.group, &[]);
        for (chunk, list) in splats.chunks().zip(&self.lists) {
            pass.set_bind_group(1, &chunk.group, &[]);
            pass.set_bind_group(2, &list.select, &[]);
            let blocks = list.splats.div_ceil(BLOCK);
            pass.set_pipeline(&self.mark[phase as usize]);
            gpu::dispatch(&mut pass, blocks);
            pass.set_pipeline(&self.arrange);
            pass.dispatch_workgroups(1, 1, 1);
            pass.set_pipeline(&self.list);
            gpu::dispatch(&mut pass, blocks);
        }
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
        for (chunk, list) in splats.chunks().zip(&self.lists) {
            pass.set_bind_group(1, &chunk.group, &[]);
            pass.set_bind_group(2, &list.drawn, &[]);
            pass.draw_indirect(&list.draw, 0);
        }
    }
}

fn tiles(gpu: &Gpu, size: UVec2) -> wgpu::Buffer {
    let tiles = u64::from(size.x.div_ceil(TILE)) * u64::from(size.y.div_ceil(TILE));
    buffer(gpu, "cull depths", 8 * tiles, wgpu::BufferUsages::STORAGE)
}

fn buffer(gpu: &Gpu, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage,
        mapped_at_creation: false,
    })
}
