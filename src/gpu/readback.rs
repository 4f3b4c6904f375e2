//! From the device back to memory.

use super::Gpu;
use crate::error::{Error, Result};

/// Reads `size` bytes of a buffer that has `COPY_SRC`, waiting for the device.
pub(crate) fn read_buffer(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<Vec<u8>> {
    let staging = staging(gpu, buffer.size());
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
    gpu.queue.submit([encoder.finish()]);
    map(gpu, &staging)
}

/// Reads one layer of a texture that has `COPY_SRC`, rows packed without padding.
pub(crate) fn read_texture(gpu: &Gpu, texture: &wgpu::Texture, layer: u32) -> Result<Vec<u8>> {
    let texel = texture.format().block_copy_size(None).expect("colour formats have a texel size");
    let row = texture.width() * texel;
    let padded_row = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let staging = staging(gpu, u64::from(padded_row) * u64::from(texture.height()));
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.copy_texture_to_buffer(
        wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
            aspect: wgpu::TextureAspect::All,
        },
        wgpu::TexelCopyBufferInfo {
            buffer: &staging,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded_row),
                rows_per_image: None,
            },
        },
        wgpu::Extent3d {
            width: texture.width(),
            height: texture.height(),
            depth_or_array_layers: 1,
        },
    );
    gpu.queue.submit([encoder.finish()]);
    let padded = map(gpu, &staging)?;
    Ok(padded
        .chunks_exact(padded_row as usize)
        .flat_map(|line| &line[..row as usize])
        .copied()
        .collect())
}

fn staging(gpu: &Gpu, size: u64) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback"),
        size,
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    })
}

fn map(gpu: &Gpu, staging: &wgpu::Buffer) -> Result<Vec<u8>> {
    staging.map_async(wgpu::MapMode::Read, .., |_| ());
    let lost = |reason: String| Error::DeviceLost(reason);
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| lost(e.to_string()))?;
    gpu.check()?;
    let bytes = staging.get_mapped_range(..).map_err(|e| lost(e.to_string()))?.to_vec();
    staging.unmap();
    Ok(bytes)
}
