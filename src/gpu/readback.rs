//! Readback of buffers and textures.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::Gpu;
use crate::error::{Error, Result};

/// Reads a buffer that has `COPY_SRC` usage, waiting for the device.
pub fn read_buffer(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<Vec<u8>> {
    let staging = staging(gpu, buffer.size());
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
    let submission = gpu.queue.submit([encoder.finish()]);
    let row = buffer.size();
    Reading { staging, padded_row: row, row, submission }.wait(gpu)
}

/// A pending readback of the rows of a texture, or of a buffer as one row. Later submissions do not
/// affect it.
#[derive(Debug)]
pub struct Reading {
    staging: wgpu::Buffer,
    padded_row: u64,
    row: u64,
    submission: wgpu::SubmissionIndex,
}

/// Reads one layer of a texture that has `COPY_SRC` usage, as rows without padding.
pub fn read_texture(gpu: &Gpu, texture: &wgpu::Texture, layer: u32) -> Result<Vec<u8>> {
    begin_reading(gpu, texture, layer).wait(gpu)
}

/// Starts [`read_texture`] without waiting for it.
pub fn begin_reading(gpu: &Gpu, texture: &wgpu::Texture, layer: u32) -> Reading {
    let texel = texture.format().block_copy_size(None).expect("colour formats have a texel size");
    let row = u64::from(texture.width()) * u64::from(texel);
    let padded_row = padded(row);
    let staging = staging(gpu, padded_row * u64::from(texture.height()));
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
                bytes_per_row: Some(padded_row as u32),
                rows_per_image: None,
            },
        },
        wgpu::Extent3d {
            width: texture.width(),
            height: texture.height(),
            depth_or_array_layers: 1,
        },
    );
    let submission = gpu.queue.submit([encoder.finish()]);
    Reading { staging, padded_row, row, submission }
}

/// Row pitch that a texture copy requires, bytes.
pub(super) fn padded(row: u64) -> u64 {
    row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT.into())
}

fn staging(gpu: &Gpu, size: u64) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback"),
        size,
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    })
}

/// Maps the first `size` bytes of a buffer that has `MAP_READ` usage and passes them to `act`. Waits only
/// for `submission`, which fills the buffer.
pub fn read_mapped<T>(
    gpu: &Gpu,
    staging: &wgpu::Buffer,
    size: u64,
    submission: wgpu::SubmissionIndex,
    act: impl FnOnce(&[u8]) -> T,
) -> Result<T> {
    // The buffer may not exist after an earlier failure.
    gpu.check()?;
    staging.map_async(wgpu::MapMode::Read, ..size, |_| ());
    let waited =
        gpu.poll(wgpu::PollType::Wait { submission_index: Some(submission), timeout: None });
    gpu.check()?;
    waited?;
    let mapped = staging.get_mapped_range(..size);
    let mapped = mapped.map_err(|e| Error::DeviceLost(e.to_string()))?;
    let result = act(&mapped);
    drop(mapped);
    staging.unmap();
    Ok(result)
}

/// A copy of a buffer by commands that the caller submits, collected without waiting.
#[derive(Debug)]
pub struct Pending {
    staging: wgpu::Buffer,
    /// Set once the buffer is mapped; `None` before it was asked for.
    mapped: Option<Arc<AtomicBool>>,
}

impl Pending {
    /// Records the copy of `size` bytes from `offset` of a buffer that has `COPY_SRC` usage.
    pub fn record(
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        buffer: &wgpu::Buffer,
        offset: u64,
        size: u64,
    ) -> Self {
        let staging = staging(gpu, size);
        encoder.copy_buffer_to_buffer(buffer, offset, &staging, 0, size);
        Self { staging, mapped: None }
    }

    /// The bytes, if the device has finished. To be called only after the commands were submitted; the
    /// caller polls the device, as its frame loop does.
    pub fn collect(&mut self) -> Option<Vec<u8>> {
        let mapped = self.mapped.get_or_insert_with(|| {
            let mapped = Arc::new(AtomicBool::new(false));
            let done = mapped.clone();
            self.staging.map_async(wgpu::MapMode::Read, .., move |result| {
                done.store(result.is_ok(), Ordering::Release);
            });
            mapped
        });
        let bytes = mapped.load(Ordering::Acquire).then(|| self.staging.get_mapped_range(..));
        bytes?.ok().map(|bytes| bytes.to_vec())
    }
}

impl Reading {
    /// Waits for the readback, not for later submissions.
    pub fn wait(self, gpu: &Gpu) -> Result<Vec<u8>> {
        let Self { staging, padded_row, row, submission } = self;
        let bytes = read_mapped(gpu, &staging, staging.size(), submission, |mapped| {
            let rows = mapped.chunks_exact(padded_row as usize);
            let mut bytes = Vec::new();
            bytes.try_reserve_exact(rows.len() * row as usize)?;
            for padded in rows {
                bytes.extend_from_slice(&padded[..row as usize]);
            }
            Ok(bytes)
        })?;
        bytes.map_err(|e: std::collections::TryReserveError| {
            Error::DeviceLost(format!("no memory for a picture: {e}"))
        })
    }
}
