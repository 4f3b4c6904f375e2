//! A frame's splats on the device.

use crate::gpu::{self, Gpu};
use crate::liquid::classify::Splat as SplatData;

/// Vertices of a splat, as in `splat.wgsl`.
const VERTICES: u32 = 6;

/// Splats of one binding.
#[derive(Debug)]
pub(super) struct Chunk {
    buffer: wgpu::Buffer,
    /// Group 1 of `splat.wgsl`: `count` splats.
    pub(super) group: wgpu::BindGroup,
    pub(super) count: u32,
}

/// One class of a frame's splats on the device; all views can share it.
#[derive(Debug)]
pub struct SplatBuffers {
    layout: wgpu::BindGroupLayout,
    // Each as large as one binding allows; the depth test makes the split irrelevant.
    chunks: Vec<Chunk>,
}

impl SplatBuffers {
    /// Creates an empty list.
    pub fn new(gpu: &Gpu) -> Self {
        Self { layout: layout(gpu), chunks: Vec::new() }
    }

    /// Draws all splats, as group 1, with the current pipeline.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        for chunk in &self.chunks {
            pass.set_bind_group(1, &chunk.group, &[]);
            pass.draw(0..VERTICES * chunk.count, 0..1);
        }
    }

    /// The bindings of the splats.
    pub(super) fn chunks(&self) -> impl Iterator<Item = &Chunk> {
        self.chunks.iter()
    }

    /// Uploads the frame's splats.
    pub fn upload(&mut self, gpu: &Gpu, splats: &[SplatData]) {
        let limits = gpu.device.limits();
        let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let most = (bytes as usize / size_of::<SplatData>()).max(1);
        self.chunks.truncate(splats.len().div_ceil(most));
        for (i, splats) in splats.chunks(most).enumerate() {
            let (count, bytes) = (splats.len() as u32, size_of_val(splats) as u64);
            let old = self.chunks.get(i).filter(|chunk| chunk.buffer.size() >= bytes);
            let buffer = match old {
                Some(chunk) => {
                    write(gpu, &chunk.buffer, splats);
                    if chunk.count == count {
                        continue;
                    }
                    chunk.buffer.clone()
                }
                None => {
                    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                        label: Some("splats"),
                        size: bytes,
                        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                        mapped_at_creation: false,
                    });
                    write(gpu, &buffer, splats);
                    buffer
                }
            };
            let resources = [gpu::first_bytes(&buffer, bytes)];
            let group = gpu::bind_group(gpu, "splats", &self.layout, &resources);
            let chunk = Chunk { buffer, group, count };
            match self.chunks.get_mut(i) {
                Some(old) => *old = chunk,
                None => self.chunks.push(chunk),
            }
        }
    }
}

/// Splats that are uploaded at once. What waits to be copied takes their memory a second time.
const PART: usize = 1 << 19;

/// Uploads splats, many in parts that are submitted by themselves.
fn write(gpu: &Gpu, buffer: &wgpu::Buffer, splats: &[SplatData]) {
    let mut offset = 0;
    for part in splats.chunks(PART) {
        gpu.queue.write_buffer(buffer, offset, bytemuck::cast_slice(part));
        offset += size_of_val(part) as u64;
        if splats.len() > PART {
            gpu.queue.submit([]);
        }
    }
}

/// The layout of group 1 of `splat.wgsl`.
pub(super) fn layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    let stages = wgpu::ShaderStages::VERTEX | wgpu::ShaderStages::COMPUTE;
    gpu.layout("splats", stages, &[gpu::storage::<SplatData>()])
}
