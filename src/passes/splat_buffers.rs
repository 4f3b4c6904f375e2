//! A frame's splats on the device.

use bytemuck::Zeroable;

use crate::gpu::{self, Gpu};
use crate::liquid::blocks;
use crate::liquid::classify::{DeviceSplats, Splat as SplatData};

/// Splats of one binding.
#[derive(Debug)]
pub(super) struct Chunk {
    buffer: wgpu::Buffer,
    /// Group 1 of pipelines that read splats: `count` of them.
    pub(super) group: wgpu::BindGroup,
    pub(super) count: u32,
    /// Whether the buffer is another one's, which is not written.
    is_borrowed: bool,
}

/// One class of a frame's splats on the device; all views can share it.
#[derive(Debug)]
pub struct SplatBuffers {
    layout: wgpu::BindGroupLayout,
    /// Each as large as one binding allows; at least one, which may be empty.
    chunks: Vec<Chunk>,
}

impl SplatBuffers {
    /// Creates an empty list.
    pub fn new(gpu: &Gpu) -> Self {
        let mut new = Self { layout: layout(gpu), chunks: Vec::new() };
        new.upload(gpu, &[]);
        new
    }

    /// The bindings of the splats.
    pub(super) fn chunks(&self) -> impl Iterator<Item = &Chunk> {
        self.chunks.iter()
    }

    /// Binds splats that are on the device.
    pub fn bind(&mut self, gpu: &Gpu, splats: &DeviceSplats) {
        let (buffer, count) = (splats.buffer.clone(), splats.count);
        let bytes = size_of::<SplatData>() as u64 * u64::from(count.max(1));
        let resources = [gpu::first_bytes(&buffer, bytes)];
        let group = gpu.bind_group("splats", &self.layout, &resources);
        self.chunks = vec![Chunk { buffer, group, count, is_borrowed: true }];
    }

    /// Uploads the frame's splats.
    pub fn upload(&mut self, gpu: &Gpu, splats: &[SplatData]) {
        let most = (gpu.most_binding() as usize / size_of::<SplatData>()).max(1);
        // Whole blocks, where one fits.
        let most = if most < blocks::SIZE { most } else { most / blocks::SIZE * blocks::SIZE };
        self.chunks.truncate(splats.len().div_ceil(most).max(1));
        // Something must be bound.
        let nothing = [SplatData::zeroed()];
        let parts: Vec<(&[SplatData], u32)> = match splats {
            [] => vec![(&nothing[..], 0)],
            _ => splats.chunks(most).map(|part| (part, part.len() as u32)).collect(),
        };
        for (i, (splats, count)) in parts.into_iter().enumerate() {
            let bytes = size_of_val(splats) as u64;
            let old = self
                .chunks
                .get(i)
                .filter(|chunk| !chunk.is_borrowed && chunk.buffer.size() >= bytes);
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
            let group = gpu.bind_group("splats", &self.layout, &resources);
            let chunk = Chunk { buffer, group, count, is_borrowed: false };
            match self.chunks.get_mut(i) {
                Some(old) => *old = chunk,
                None => self.chunks.push(chunk),
            }
        }
    }
}

/// Splats that are uploaded at once. Until they are copied they take their memory a second time.
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

/// The layout of group 1 of pipelines that read splats.
pub(super) fn layout(gpu: &Gpu) -> wgpu::BindGroupLayout {
    gpu.layout("splats", wgpu::ShaderStages::COMPUTE, &[gpu::storage::<SplatData>()])
}
