//! The graphics device, and helpers for creating its resources.

mod adapters;
mod binding;
mod commands;
mod compiled;
#[doc(hidden)]
pub mod prune;
mod readback;
#[doc(hidden)]
pub mod shader;
mod timer;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use glam::UVec2;

use crate::error::{Error, Limited, Result};

#[doc(hidden)]
pub use binding::{
    sampled, sampled_integers, state_texture, storage, storage_of, storage_read_write,
    storage_texture, uniform,
};
#[doc(hidden)]
pub use commands::Commands;
pub use commands::{MOST_WORK, Piece, pieces};
#[doc(hidden)]
pub use compiled::Bound;
use compiled::Compiled;
pub(crate) use compiled::Kernel;
#[doc(hidden)]
pub use readback::{Pending, Reading, read_mapped};
#[doc(hidden)]
pub use shader::Grain;
pub use timer::{PassTime, SubmittedTimes};
#[doc(hidden)]
pub use timer::{PendingTimes, Span, Timer};

/// A device with its queue, opened by limpid or supplied by the caller.
#[derive(Clone, Debug)]
pub struct Gpu {
    /// The device that owns all resources.
    pub device: wgpu::Device,
    /// The queue that frames are submitted to.
    pub queue: wgpu::Queue,
    /// Failures of a device opened by limpid; a supplied device reports its failures to the caller.
    failure: Option<Arc<Mutex<Failure>>>,
    /// Compiled pipelines of earlier runs, if the caller supplied any.
    cache: Option<wgpu::PipelineCache>,
    /// Shared between all that draw with the device.
    compiled: Arc<Compiled>,
    /// Largest work of one submission.
    most_work: u64,
    /// Set by another thread to end what this handle draws.
    interrupt: Option<Arc<AtomicBool>>,
    /// Chosen instead of the adapter's.
    grain: Option<Grain>,
}

/// The first failure of each kind that a device has reported.
#[derive(Debug, Clone, Default)]
struct Failure {
    /// Reason for a device loss or a failed allocation.
    lost: Option<String>,
    /// Validation error.
    refused: Option<String>,
}

impl Gpu {
    /// Opens an adapter without a window system: a GPU if there is one, otherwise a software adapter
    /// such as Mesa's lavapipe.
    ///
    /// `WGPU_BACKEND` and `WGPU_ADAPTER_NAME` select an adapter, as in other wgpu programs.
    ///
    /// # Errors
    /// [`Error::NoAdapter`] without adapters, [`Error::NoMatchingAdapter`] if these variables match
    /// none, [`Error::Refused`] if the adapter creates no device, [`Error::Memory`] if lack of memory may
    /// be the cause.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn headless() -> Result<Self> {
        pollster::block_on(Self::request())
    }

    /// As `Gpu::headless`, without blocking: for programs whose thread must not wait, as in browsers. These
    /// have one adapter, by WebGPU.
    ///
    /// # Errors
    /// As `Gpu::headless`.
    pub async fn request() -> Result<Self> {
        let wanted = std::env::var("WGPU_ADAPTER_NAME").unwrap_or_default();
        let backends = wgpu::Backends::from_env().unwrap_or(wgpu::Backends::all());
        let set = ["WGPU_BACKEND", "WGPU_ADAPTER_NAME"].into_iter().filter_map(|name| {
            let value = std::env::var(name).ok().filter(|value| !value.is_empty())?;
            Some(format!("{name}={value}"))
        });
        let selected: Vec<String> = set.collect();
        let found = adapters::list(backends, &wanted).await;
        let (device, queue) = adapters::open_first(found, &selected.join(" ")).await?;
        Ok(Self::from_own_device(device, queue))
    }

    /// As [`Gpu::headless`], for an adapter whose name contains `wanted`, in any case; the environment is ignored.
    ///
    /// # Errors
    /// As [`Gpu::headless`]; [`Error::NoMatchingAdapter`] if no adapter has the name.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn named(wanted: &str) -> Result<Self> {
        pollster::block_on(async {
            let found = adapters::list(wgpu::Backends::all(), wanted).await;
            let (device, queue) = adapters::open_first(found, &format!("`{wanted}`")).await?;
            Ok(Self::from_own_device(device, queue))
        })
    }

    /// Wraps a device that limpid opened and records its failures.
    fn from_own_device(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let failure = Arc::<Mutex<Failure>>::default();
        let seen = failure.clone();
        device.set_device_lost_callback(move |_, reason| {
            let reason = if reason.is_empty() { "it was destroyed".into() } else { reason };
            seen.lock().expect("no panic holds this lock").lost.get_or_insert(reason);
        });
        let seen = failure.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let mut failure = seen.lock().expect("no panic holds this lock");
            match error {
                wgpu::Error::Validation { .. } => failure.refused.get_or_insert(error.to_string()),
                error => failure.lost.get_or_insert(error_chain(&error)),
            };
        }));
        Self { failure: Some(failure), ..Self::from_device(device, queue) }
    }

    /// Wraps a caller's device and queue. Pass times require [`wgpu::Features::TIMESTAMP_QUERY`]; no other
    /// feature is used.
    pub fn from_device(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self {
            device,
            queue,
            failure: None,
            cache: None,
            compiled: Arc::default(),
            most_work: MOST_WORK,
            interrupt: None,
            grain: None,
        }
    }

    /// Ends frames that are drawn with this handle early, with [`Error::Interrupted`], once `interrupt` is set: no
    /// part of the frame is submitted any more, and nothing is waited for. Passes that were submitted are still drawn.
    #[must_use]
    pub fn with_interrupt(self, interrupt: Arc<AtomicBool>) -> Self {
        Self { interrupt: Some(interrupt), ..self }
    }

    /// The handle without an interrupt.
    #[cfg(all(feature = "image", not(target_arch = "wasm32")))]
    pub(crate) fn uninterrupted(&self) -> Self {
        Self { interrupt: None, ..self.clone() }
    }

    /// Whether frames must end.
    pub(crate) fn is_interrupted(&self) -> bool {
        self.interrupt.as_ref().is_some_and(|interrupt| interrupt.load(Ordering::Relaxed))
    }

    /// Compiles all later pipelines with `cache`, which receives the missing ones.
    ///
    /// Devices of [`Gpu::headless`] support caches where the adapter does
    /// ([`wgpu::Features::PIPELINE_CACHE`]: Vulkan). Creating a cache from a file's bytes is unsafe: the
    /// caller must trust the file.
    #[must_use]
    pub fn with_pipeline_cache(self, cache: wgpu::PipelineCache) -> Self {
        Self { cache: Some(cache), ..self }
    }

    /// Divides frames into submissions of at most `most_work` layer evaluations, instead of
    /// [`MOST_WORK`]. Pictures do not change.
    #[must_use]
    pub fn with_most_work(self, most_work: u64) -> Self {
        Self { most_work, ..self }
    }

    /// Largest work of one submission.
    #[doc(hidden)]
    pub fn most_work(&self) -> u64 {
        self.most_work
    }

    /// The pipeline cache, if any.
    #[doc(hidden)]
    pub fn cache(&self) -> Option<&wgpu::PipelineCache> {
        self.cache.as_ref()
    }

    /// Whether the driver compiles shaders in this process's memory: a software adapter.
    pub(crate) fn compiles_in_process(&self) -> bool {
        let info = self.device.adapter_info();
        info.device_type == wgpu::DeviceType::Cpu && info.backend != wgpu::Backend::BrowserWebGpu
    }

    /// Whether uniforms that alone decide branches ([`Gpu::branching`]) are bound as
    /// `var<storage, read>`.
    ///
    /// Mesa's software Vulkan before 2025 specialises shaders on the values of uniform buffers that
    /// branches depend on: it recompiles the shader for every submission that binds one and keeps all
    /// versions, 25 to 50 ms and 2 to 9 MiB per frame, forever. It does not do so for storage buffers,
    /// but reads them lane by lane. On a GPU uniform buffers are faster.
    #[doc(hidden)]
    pub fn uniforms_are_stored(&self) -> bool {
        let info = self.device.adapter_info();
        info.device_type == wgpu::DeviceType::Cpu && info.backend == wgpu::Backend::Vulkan
    }

    /// Whether layers ([`Gpu::layers`]) are bound as `texture_storage_2d_array<rgba32float, read>`.
    ///
    /// Software Vulkan looks up the mip level of a sampled texture for each lane, even if there is one, and has no
    /// such work with storage textures: smoothing takes 0.6 of its time. GPUs cache sampled textures at least as
    /// well.
    #[doc(hidden)]
    pub fn layers_are_stored(&self) -> bool {
        self.uniforms_are_stored()
    }

    /// Bytes of the largest storage buffer that a shader can read whole.
    #[doc(hidden)]
    pub fn most_binding(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// How a tile's pixels are divided among threads when splats are drawn.
    #[doc(hidden)]
    pub fn grain(&self) -> Grain {
        let is_software = self.device.adapter_info().device_type == wgpu::DeviceType::Cpu;
        self.grain.unwrap_or(if is_software { Grain::Column } else { Grain::Pixel })
    }

    /// Sets [`Gpu::grain`], for tests: pictures do not change.
    #[doc(hidden)]
    #[must_use]
    pub fn with_grain(self, grain: Grain) -> Self {
        Self { grain: Some(grain), ..self }
    }

    /// Name and driver of the adapter, for reports.
    pub fn adapter(&self) -> String {
        let info = self.device.adapter_info();
        match (info.name.as_str(), info.driver_info.as_str()) {
            // Browsers need not name it.
            ("", _) => "WebGPU".to_owned(),
            (_, "") => info.name,
            (_, driver) => format!("{} ({driver})", info.name),
        }
    }

    /// Fails if the device was lost or ran out of memory since it was opened. Its resources are then
    /// unusable, and a new device must be opened. A caller's device reports such failures to the caller
    /// instead.
    ///
    /// # Errors
    /// [`Error::DeviceLost`] with the driver's reason; [`Error::Defect`] for a validation error, which
    /// is a bug in limpid.
    pub fn check(&self) -> Result<()> {
        if self.is_interrupted() {
            return Err(Error::Interrupted);
        }
        let Some(failure) = &self.failure else { return Ok(()) };
        let failure = || failure.lock().expect("no panic holds this lock").clone();
        // Polling delivers a pending device loss.
        let mut polled = self.poll(wgpu::PollType::Poll);
        let mut seen = failure();
        if seen.lost.is_none() && seen.refused.is_some() {
            // Commands after a loss fail validation, which may be reported before the loss itself:
            // that is reported once the device is idle.
            polled = self.poll(wgpu::PollType::wait_indefinitely());
            seen = failure();
        }
        match (seen.lost, seen.refused) {
            (Some(reason), _) => Err(Error::DeviceLost(reason)),
            (None, Some(reason)) => Err(Error::Defect(reason)),
            (None, None) => polled,
        }
    }

    /// Polls the device. wgpu 30 panics if the device is lost while polling; its locks are free then.
    fn poll(&self, how: wgpu::PollType) -> Result<()> {
        /// How long an interrupt may take to be seen.
        const PATIENCE: Duration = Duration::from_millis(20);
        let how = match how {
            wgpu::PollType::Wait { submission_index, timeout: None }
                if self.interrupt.is_some() =>
            {
                wgpu::PollType::Wait { submission_index, timeout: Some(PATIENCE) }
            }
            how => how,
        };
        let polled = loop {
            let polled = catch_unwind(AssertUnwindSafe(|| self.device.poll(how.clone())));
            let timed_out = matches!(polled, Ok(Err(wgpu::PollError::Timeout)));
            if timed_out && self.is_interrupted() {
                return Err(Error::Interrupted);
            }
            if !timed_out {
                break polled;
            }
        };
        match polled {
            Ok(Ok(_)) => Ok(()),
            Ok(Err(error)) => Err(Error::DeviceLost(error.to_string())),
            Err(_) => Err(Error::DeviceLost("it was lost while it was waited for".into())),
        }
    }

    /// Checks that a picture size is within the adapter's limits.
    ///
    /// Available memory is not checked: adapters do not report it, or not reliably.
    ///
    /// # Errors
    /// [`Error::Empty`] for an empty picture, [`Error::Limit`] naming the limit.
    pub fn check_size(&self, size: UVec2) -> Result<()> {
        if size.min_element() == 0 {
            return Err(Error::Empty { width: size.x, height: size.y });
        }
        self.check_image(size, Limited::Picture)
    }

    /// As [`Gpu::check_size`], for any image that passes use.
    #[doc(hidden)]
    pub fn check_image(&self, size: UVec2, of: Limited) -> Result<()> {
        let limits = self.device.limits();
        // One layer with four floats per texel is also the largest readback buffer.
        let bytes = readback::padded(16 * u64::from(size.x)).saturating_mul(size.y.into());
        let [across, down] = [size.x, size.y].map(|n| u64::from(n.div_ceil(TILE)));
        let tiles = across * down;
        let edge = limits.max_texture_dimension_2d;
        let problem = if size.max_element() > edge {
            format!("holds at most {edge}x{edge} pixels (max_texture_dimension_2d)")
        } else if bytes > limits.max_buffer_size {
            format!(
                "holds at most {} MiB in one buffer (max_buffer_size)",
                limits.max_buffer_size >> 20
            )
        } else if BYTES_PER_TILE * tiles > limits.max_storage_buffer_binding_size {
            let most = limits.max_storage_buffer_binding_size;
            format!("holds at most {most} bytes of tiles (max_storage_buffer_binding_size)")
        } else if matches!(of, Limited::Picture) && self.band_rows(size.x) == 0 {
            let most = limits.max_storage_buffer_binding_size;
            format!(
                "holds at most {most} bytes of a band of rows (max_storage_buffer_binding_size)"
            )
        } else if tiles.min(ROW.into()) > u64::from(limits.max_compute_workgroups_per_dimension) {
            let most = limits.max_compute_workgroups_per_dimension;
            format!(
                "runs at most {most} workgroups in a row (max_compute_workgroups_per_dimension)"
            )
        } else {
            return Ok(());
        };
        let problem = format!("{problem}, asked for {}x{}", size.x, size.y);
        Err(Error::Limit { adapter: self.adapter(), problem, of })
    }
}

/// Rows whose number bands of pictures are multiples of: such a band begins at a multiple of 256 bytes, as bindings must.
const BAND: u32 = 64;

impl Gpu {
    /// Rows of so many pixels of four bytes that one binding holds.
    #[doc(hidden)]
    pub fn band_rows(&self, width: u32) -> u32 {
        let rows =
            self.device.limits().max_storage_buffer_binding_size / (4 * u64::from(width.max(1)));
        rows.min(u32::MAX.into()) as u32 / BAND * BAND
    }
}

/// Size of a tile in the largest buffer that has an entry for each: the marks of `passes/gaps.rs`.
const BYTES_PER_TILE: u64 = 32;

/// Workgroups in one row of a dispatch, as in `common/groups.wgsl`.
pub const ROW: u32 = 32768;

/// Bytes beyond `size` that a buffer gets for frames that grow.
pub(crate) fn spare(size: u64) -> u64 {
    /// Large ones seldom grow, and a card has no room for an eighth more of all of them.
    const MOST: u64 = 32 << 20;
    (size / 8).min(MOST)
}

/// Dispatches `groups` workgroups in rows; shaders number them by `group_index`.
#[doc(hidden)]
pub fn dispatch(pass: &mut wgpu::ComputePass<'_>, groups: u32) {
    pass.dispatch_workgroups(groups.min(ROW), groups.div_ceil(ROW), 1);
}

/// Joins the messages of an error and its causes.
fn error_chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text.trim_end_matches('.').to_owned()
}

/// Helpers that need the device are methods, all others functions.
impl Gpu {
    /// Creates a buffer with `contents`, whose size in bytes must be a multiple of 4.
    #[doc(hidden)]
    pub fn buffer_with<T: bytemuck::NoUninit>(
        &self,
        label: &str,
        usage: wgpu::BufferUsages,
        contents: &[T],
    ) -> wgpu::Buffer {
        let bytes: &[u8] = bytemuck::cast_slice(contents);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes.len() as u64,
            usage,
            mapped_at_creation: true,
        });
        // Mapping fails if the allocation failed, which [`Gpu::check`] reports.
        if let Ok(mut mapped) = buffer.get_mapped_range_mut(..) {
            mapped.copy_from_slice(bytes);
        }
        buffer.unmap();
        buffer
    }

    /// Creates a uniform buffer for one `T`, to be filled by [`wgpu::Queue::write_buffer`].
    #[doc(hidden)]
    pub fn uniform_buffer<T: bytemuck::NoUninit>(&self, label: &str) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: size_of::<T>() as u64,
            usage: UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Creates a texture with `layers` layers.
    #[doc(hidden)]
    pub fn texture(
        &self,
        label: &str,
        size: UVec2,
        layers: u32,
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> wgpu::Texture {
        self.mipped_texture(label, size, layers, 1, format, usage)
    }

    /// As [`Gpu::texture`], with mip levels.
    #[doc(hidden)]
    pub fn mipped_texture(
        &self,
        label: &str,
        size: UVec2,
        layers: u32,
        levels: u32,
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> wgpu::Texture {
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers: layers },
            mip_level_count: levels,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        })
    }

    /// Layer count of a texture that shaders read as an array: at least two on OpenGL, where a texture with
    /// one layer is not an array.
    #[doc(hidden)]
    pub fn array_layers(&self, layers: u32) -> u32 {
        let least = if self.device.adapter_info().backend == wgpu::Backend::Gl { 2 } else { 1 };
        layers.max(least)
    }
}

/// Usages of a buffer that a shader reads as `var<uniform>`; see [`Gpu::uniforms_are_stored`].
#[doc(hidden)]
pub const UNIFORM: wgpu::BufferUsages =
    wgpu::BufferUsages::UNIFORM.union(wgpu::BufferUsages::STORAGE);

/// Binds the first `bytes` of a buffer, which determines the array length in shaders.
#[doc(hidden)]
pub fn first_bytes(buffer: &wgpu::Buffer, bytes: u64) -> wgpu::BindingResource<'_> {
    let size = wgpu::BufferSize::new(bytes);
    wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size })
}

/// Creates the view of all layers of an array texture.
#[doc(hidden)]
pub fn array_view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}

/// Creates the view of one mip level.
#[doc(hidden)]
pub fn level_view(
    texture: &wgpu::Texture,
    level: u32,
    dimension: wgpu::TextureViewDimension,
) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(dimension),
        base_mip_level: level,
        mip_level_count: Some(1),
        ..Default::default()
    })
}

/// Creates the view of one layer of an array texture.
#[doc(hidden)]
pub fn layer_view(texture: &wgpu::Texture, layer: u32) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2),
        base_array_layer: layer,
        array_layer_count: Some(1),
        mip_level_count: Some(1),
        ..Default::default()
    })
}

/// Side of a pixel workgroup in threads and of a tile in pixels.
pub const TILE: u32 = 8;

/// Texture format of plane layers: π in red, green and blue, depth in alpha.
pub const LAYER_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

/// Workgroups along each axis that cover `size` pixels.
#[doc(hidden)]
pub fn workgroups(size: UVec2) -> (u32, u32) {
    (size.x.div_ceil(TILE), size.y.div_ceil(TILE))
}
