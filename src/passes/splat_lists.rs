//! Lists of splats, made on the device: `shaders/splat_lists.wgsl`.
//!
//! A selection tests each splat; the list of those that pass keeps their order, and is drawn indirectly.

use super::CameraBinding;
use super::splat_buffers::{self, SplatBuffers};
use crate::gpu::{self, Gpu, Span};

/// Splats per workgroup.
pub const BLOCK: u32 = 256;

/// 32-bit words of a block's mask.
const WORDS: u32 = BLOCK / 32;

/// Pipelines of one selection.
#[derive(Debug)]
pub(super) struct Selection {
    mark: wgpu::ComputePipeline,
    arrange: wgpu::ComputePipeline,
    list: wgpu::ComputePipeline,
}

/// A list for each chunk of a class of splats.
#[derive(Debug, Clone)]
pub(super) struct SplatLists {
    select: wgpu::BindGroupLayout,
    drawn: wgpu::BindGroupLayout,
    lists: Vec<List>,
}

/// The list of one chunk.
#[derive(Debug, Clone)]
struct List {
    splats: u32,
    /// Masks, counts and list, with room for at least `splats`.
    buffers: [wgpu::Buffer; 3],
    draw: wgpu::Buffer,
    select: wgpu::BindGroup,
    drawn: wgpu::BindGroup,
}

/// Whether the device can make lists.
pub(super) fn are_supported(gpu: &Gpu) -> bool {
    let limits = gpu.device.limits();
    limits.max_storage_buffers_per_shader_stage >= 8
        && limits.max_compute_invocations_per_workgroup >= BLOCK
}

/// The layout of a list in the vertex shaders that draw it.
pub(super) fn layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    gpu.layout("listed splats", wgpu::ShaderStages::VERTEX, &[gpu::storage::<u32>()])
}

impl SplatLists {
    /// Creates the layouts.
    pub(super) fn new(gpu: &Gpu) -> Self {
        let bindings = [
            gpu::storage_read_write(4 * u64::from(WORDS)),
            gpu::storage_read_write(4),
            gpu::storage_read_write(4),
            gpu::storage_read_write(16),
        ];
        let select = gpu.layout("splat lists", wgpu::ShaderStages::COMPUTE, &bindings);
        Self { select, drawn: layout(gpu), lists: Vec::new() }
    }

    /// Compiles the selection of a root that imports `splat_lists.wgsl` and reads `input` as group 3.
    pub(super) fn selection(
        &self,
        gpu: &Gpu,
        camera: &CameraBinding,
        file: &str,
        input: &wgpu::BindGroupLayout,
        constants: &[(&'static str, f64)],
    ) -> Selection {
        let splats = splat_buffers::layout(gpu);
        let constants = [&camera.constants()[..], constants].concat();
        let pipeline = |entry: &str| {
            let layouts = [&camera.layout, &splats, &self.select, input];
            gpu::compute_pipeline(gpu, file, entry, &layouts, &constants)
        };
        Selection { mark: pipeline("mark"), arrange: pipeline("arrange"), list: pipeline("list") }
    }

    /// Allocates the lists for these splats.
    pub(super) fn prepare(&mut self, gpu: &Gpu, splats: &SplatBuffers) {
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
                let buffers = room.map(|words| buffer(gpu, 4 * words, storage));
                (buffers, buffer(gpu, 16, storage | wgpu::BufferUsages::INDIRECT))
            }
        };
        let binding = |i: usize| gpu::first_bytes(&buffers[i], bytes[i]);
        let [masks, counts, listed] = [0, 1, 2].map(binding);
        let resources = [masks, counts, listed.clone(), draw.as_entire_binding()];
        let select = gpu::bind_group(gpu, "splat lists", &self.select, &resources);
        let drawn = gpu::bind_group(gpu, "listed splats", &self.drawn, &[listed]);
        List { splats, buffers, draw, select, drawn }
    }

    /// Records a selection, given its `input`, which replaces the lists.
    pub(super) fn select(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &CameraBinding,
        splats: &SplatBuffers,
        (selection, input): (&Selection, &wgpu::BindGroup),
        span: Span<'_>,
    ) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("splat lists"),
            timestamp_writes: span.compute(),
        });
        pass.set_bind_group(0, &camera.group, &[]);
        pass.set_bind_group(3, input, &[]);
        for (chunk, list) in splats.chunks().zip(&self.lists) {
            pass.set_bind_group(1, &chunk.group, &[]);
            pass.set_bind_group(2, &list.select, &[]);
            let blocks = list.splats.div_ceil(BLOCK);
            pass.set_pipeline(&selection.mark);
            gpu::dispatch(&mut pass, blocks);
            pass.set_pipeline(&selection.arrange);
            pass.dispatch_workgroups(1, 1, 1);
            pass.set_pipeline(&selection.list);
            gpu::dispatch(&mut pass, blocks);
        }
    }

    /// Draws the listed splats, as groups 1 and 2, with the current pipeline.
    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass<'_>, splats: &SplatBuffers) {
        for (chunk, list) in splats.chunks().zip(&self.lists) {
            pass.set_bind_group(1, &chunk.group, &[]);
            pass.set_bind_group(2, &list.drawn, &[]);
            pass.draw_indirect(&list.draw, 0);
        }
    }
}

fn buffer(gpu: &Gpu, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("splat lists"),
        size,
        usage,
        mapped_at_creation: false,
    })
}
