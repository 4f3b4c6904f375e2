//! Readback of buffers and textures.

use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};

use super::Gpu;
use crate::error::{Error, Result};

impl Gpu {
    /// Reads a buffer that has `COPY_SRC` usage, waiting for the device.
    #[cfg(not(target_arch = "wasm32"))]
    #[doc(hidden)]
    pub fn read_buffer(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>> {
        self.begin_reading_buffer(buffer).wait(self)
    }

    /// Starts to read a buffer that has `COPY_SRC` usage.
    #[doc(hidden)]
    pub fn begin_reading_buffer(&self, buffer: &wgpu::Buffer) -> Reading {
        let row = buffer.size();
        let staging = staging(self, row);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, row);
        let submission = self.queue.submit([encoder.finish()]);
        Reading { staging, padded_row: row, row, submission }
    }

    /// Reads one layer of a texture that has `COPY_SRC` usage, as rows without padding, waiting for the device.
    #[cfg(not(target_arch = "wasm32"))]
    #[doc(hidden)]
    pub fn read_texture(&self, texture: &wgpu::Texture, layer: u32) -> Result<Vec<u8>> {
        self.begin_reading(texture, layer).wait(self)
    }

    /// Starts to read one layer of a texture that has `COPY_SRC` usage, as rows without padding.
    #[doc(hidden)]
    pub fn begin_reading(&self, texture: &wgpu::Texture, layer: u32) -> Reading {
        let texel =
            texture.format().block_copy_size(None).expect("colour formats have a texel size");
        let row = u64::from(texture.width()) * u64::from(texel);
        let padded_row = padded(row);
        let staging = staging(self, padded_row * u64::from(texture.height()));
        let mut encoder = self.device.create_command_encoder(&Default::default());
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
        let submission = self.queue.submit([encoder.finish()]);
        Reading { staging, padded_row, row, submission }
    }
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
/// for `submission`, which fills the buffer: in a browser by yielding, elsewhere by blocking, since nothing else
/// may poll the device.
pub async fn read_mapped<T>(
    gpu: &Gpu,
    staging: &wgpu::Buffer,
    size: u64,
    submission: wgpu::SubmissionIndex,
    act: impl FnOnce(&[u8]) -> T,
) -> Result<T> {
    // The buffer may not exist after an earlier failure.
    gpu.check()?;
    let mapping = Mapping::begin(staging, size);
    gpu.finish(submission, mapping).await?;
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
    /// `None` before it was asked for.
    mapping: Option<Mapping>,
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
        Self { staging, mapping: None }
    }

    /// The bytes, if the device has finished. To be called only after the commands were submitted; the
    /// caller polls the device, as its frame loop does.
    pub fn collect(&mut self) -> Option<Vec<u8>> {
        let size = self.staging.size();
        let mapping = self.mapping.get_or_insert_with(|| Mapping::begin(&self.staging, size));
        let bytes = mapping.outcome()?.ok().map(|()| self.staging.get_mapped_range(..));
        bytes?.ok().map(|bytes| bytes.to_vec())
    }

    /// The bytes, after waiting for `submission`, of the commands; as [`read_mapped`].
    pub async fn finish(self, gpu: &Gpu, submission: wgpu::SubmissionIndex) -> Result<Vec<u8>> {
        let size = self.staging.size();
        read_mapped(gpu, &self.staging, size, submission, <[u8]>::to_vec).await
    }
}

/// The mapping of a buffer, done when the device has filled it: a future that the device's poll wakes.
#[derive(Debug, Clone)]
struct Mapping(Arc<Mutex<MappingState>>);

#[derive(Debug, Default)]
struct MappingState {
    outcome: Option<Result<()>>,
    /// Whoever waits for the outcome.
    waker: Option<Waker>,
}

impl Mapping {
    /// Maps the first `size` bytes.
    fn begin(buffer: &wgpu::Buffer, size: u64) -> Self {
        let mapping = Self(Arc::default());
        let done = mapping.clone();
        buffer.map_async(wgpu::MapMode::Read, ..size, move |result| {
            let mut state = done.0.lock().unwrap_or_else(PoisonError::into_inner);
            state.outcome = Some(result.map_err(|e| Error::DeviceLost(e.to_string())));
            if let Some(waker) = state.waker.take() {
                waker.wake();
            }
        });
        mapping
    }

    /// The outcome, once.
    fn outcome(&self) -> Option<Result<()>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).outcome.take()
    }
}

impl Future for Mapping {
    type Output = Result<()>;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match state.outcome.take() {
            Some(outcome) => Poll::Ready(outcome),
            None => {
                state.waker = Some(context.waker().clone());
                Poll::Pending
            }
        }
    }
}

impl Gpu {
    /// Waits for a mapping of a buffer that `submission` fills: see [`read_mapped`].
    async fn finish(&self, submission: wgpu::SubmissionIndex, mapping: Mapping) -> Result<()> {
        #[cfg(not(target_arch = "wasm32"))]
        {
            let submission_index = Some(submission);
            let waited = self.poll(wgpu::PollType::Wait { submission_index, timeout: None });
            self.check()?;
            waited?;
        }
        #[cfg(target_arch = "wasm32")]
        let _ = submission;
        let mapped = mapping.await;
        // A loss, which is the cause of a failed mapping.
        self.check()?;
        mapped
    }
}

impl Reading {
    /// Waits for the readback, not for later submissions.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn wait(self, gpu: &Gpu) -> Result<Vec<u8>> {
        pollster::block_on(self.finish(gpu))
    }

    /// As [`Reading::ready`], for code that browsers and other programs share: in a browser it yields, elsewhere it
    /// blocks, since nothing else may poll the device.
    pub async fn finish(self, gpu: &Gpu) -> Result<Vec<u8>> {
        let Self { staging, padded_row, row, submission } = self;
        let size = staging.size();
        let unpad = |mapped: &[u8]| unpadded(mapped, padded_row, row);
        read_mapped(gpu, &staging, size, submission, unpad).await?
    }

    /// The readback, without blocking. Browsers poll their devices; other programs poll this one,
    /// from another thread or between turns of their executor.
    pub async fn ready(self, gpu: &Gpu) -> Result<Vec<u8>> {
        let Self { staging, padded_row, row, .. } = self;
        gpu.check()?;
        Mapping::begin(&staging, staging.size()).await?;
        let mapped = staging.get_mapped_range(..);
        let mapped = mapped.map_err(|e| Error::DeviceLost(e.to_string()))?;
        unpadded(&mapped, padded_row, row)
    }
}

/// Rows of `row` bytes of which each takes `padded_row`.
fn unpadded(mapped: &[u8], padded_row: u64, row: u64) -> Result<Vec<u8>> {
    let rows = mapped.chunks_exact(padded_row as usize);
    let mut bytes = Vec::new();
    let reserved = bytes.try_reserve_exact(rows.len() * row as usize);
    reserved.map_err(|e| Error::DeviceLost(format!("no memory for a picture: {e}")))?;
    rows.for_each(|padded| bytes.extend_from_slice(&padded[..row as usize]));
    Ok(bytes)
}
