//! The graphics device, and the few helpers that keep each pass short.

mod binding;
mod commands;
mod readback;
#[doc(hidden)]
pub mod shader;
mod timer;

use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};

use glam::UVec2;

use crate::error::{Error, Limited, Result, printable};
use crate::memory;

#[doc(hidden)]
pub use binding::{sampled, storage, storage_of, storage_read_write, storage_texture, uniform};
#[doc(hidden)]
pub use commands::Commands;
pub use commands::{MOST_WORK, Piece, pieces};
#[doc(hidden)]
pub use readback::{Reading, begin_reading, read_buffer, read_mapped, read_texture};
pub use timer::PassTime;
#[doc(hidden)]
pub use timer::{Span, Timer};

/// A device with its queue: limpid's own, or the caller's.
#[derive(Clone, Debug)]
pub struct Gpu {
    /// The device on which everything is created.
    pub device: wgpu::Device,
    /// The queue to which frames are submitted.
    pub queue: wgpu::Queue,
    /// Of a device that limpid opened; a caller hears of its own device's failures itself.
    failure: Option<Arc<Mutex<Failure>>>,
    /// Compiled pipelines of earlier runs, if the caller has kept any.
    cache: Option<wgpu::PipelineCache>,
    /// Modules by their text: several pipelines are made of one.
    modules: Arc<Mutex<HashMap<String, wgpu::ShaderModule>>>,
    /// Of one submission.
    most_work: u64,
}

/// Memory that a device may take to open, in bytes: Mesa's software one with its compiler.
const OPENING: usize = 512 << 20;

/// The first of each that a device has reported.
#[derive(Debug, Clone, Default)]
struct Failure {
    /// Why the device, or something on it, is gone.
    lost: Option<String>,
    /// What its validation refused.
    refused: Option<String>,
}

impl Gpu {
    /// Opens an adapter without any window system: a GPU where there is one, otherwise a
    /// software adapter such as Mesa's lavapipe.
    ///
    /// `WGPU_BACKEND` and `WGPU_ADAPTER_NAME` select one, as in other wgpu programs.
    ///
    /// # Errors
    /// [`Error::NoAdapter`] if there is none, [`Error::NoMatchingAdapter`] if these variables select
    /// none, [`Error::Refused`] if it gives no device, [`Error::Memory`] if that may be for want of
    /// memory.
    pub fn headless() -> Result<Self> {
        let wanted = std::env::var("WGPU_ADAPTER_NAME").unwrap_or_default();
        let backends = wgpu::Backends::from_env().unwrap_or(wgpu::Backends::all());
        let adapters = pollster::block_on(adapters(backends, &wanted));
        // The best adapter that gives a device: a broken driver should not hide a working one.
        let mut refusal = Error::NoAdapter;
        if adapters.is_empty() {
            refusal = none_selected(refusal);
        }
        for adapter in adapters {
            match pollster::block_on(open(&adapter)) {
                Ok((device, queue)) => return Ok(Self::own(device, queue)),
                Err(problem) => {
                    let name = adapter.get_info().name;
                    refusal = Error::Refused { adapter: name, problem };
                }
            }
        }
        // For want of memory adapters are refused as well, or not found.
        memory::probe(OPENING, "a graphics device")?;
        Err(refusal)
    }

    /// Wraps a device that limpid opened, and watches it.
    fn own(device: wgpu::Device, queue: wgpu::Queue) -> Self {
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
                error => failure.lost.get_or_insert(reasons(&error)),
            };
        }));
        Self { failure: Some(failure), ..Self::from_device(device, queue) }
    }

    /// Wraps a caller's device and queue. Passes are timed if the device has
    /// [`wgpu::Features::TIMESTAMP_QUERY`], and hidden fragments are left out early if it has
    /// [`wgpu::Features::SHADER_EARLY_DEPTH_TEST`]; no other feature is used.
    pub fn from_device(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self {
            device,
            queue,
            failure: None,
            cache: None,
            modules: Arc::default(),
            most_work: MOST_WORK,
        }
    }

    /// Compiles all pipelines from now on with `cache`, and adds those to it that it has not.
    ///
    /// [`Gpu::headless`] opens a device that can make one where its adapter can
    /// ([`wgpu::Features::PIPELINE_CACHE`]: Vulkan). Making one of a file's bytes is unsafe: who
    /// calls for it answers for the file.
    #[must_use]
    pub fn with_pipeline_cache(self, cache: wgpu::PipelineCache) -> Self {
        Self { cache: Some(cache), ..self }
    }

    /// Divides frames into submissions of at most so much work, in evaluations of a layer, instead of
    /// [`MOST_WORK`]. Pictures are the same.
    #[must_use]
    pub fn with_most_work(self, most_work: u64) -> Self {
        Self { most_work, ..self }
    }

    /// The most work of one submission.
    #[doc(hidden)]
    pub fn most_work(&self) -> u64 {
        self.most_work
    }

    /// What pipelines are compiled with.
    #[doc(hidden)]
    pub fn cache(&self) -> Option<&wgpu::PipelineCache> {
        self.cache.as_ref()
    }

    /// The module of a text, which is parsed once.
    #[doc(hidden)]
    pub fn module(&self, label: &str, text: String) -> wgpu::ShaderModule {
        let mut modules = self.modules.lock().unwrap_or_else(PoisonError::into_inner);
        let create = |text: &String| {
            self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(label),
                source: wgpu::ShaderSource::Wgsl(text.into()),
            })
        };
        modules.entry(text).or_insert_with_key(create).clone()
    }

    /// Whether uniforms that alone decide branches ([`Gpu::branching`]) are bound as
    /// `var<storage, read>`.
    ///
    /// Mesa's software Vulkan before 2025 makes values of uniform buffers that branches depend on
    /// constants, compiles the shader anew for every submission that binds one, and keeps all of
    /// them: 25 to 50 ms and 2 to 9 MiB for each frame, forever. Storage buffers it leaves alone, but
    /// reads them lane by lane. On a graphics card uniform buffers are the faster ones.
    #[doc(hidden)]
    pub fn uniforms_are_stored(&self) -> bool {
        let info = self.device.adapter_info();
        info.device_type == wgpu::DeviceType::Cpu && info.backend == wgpu::Backend::Vulkan
    }

    /// Whether a shader may promise to which side of a depth it writes. OpenGL's promise needs an
    /// extension more.
    #[doc(hidden)]
    pub fn has_early_depth(&self) -> bool {
        self.device.features().contains(wgpu::Features::SHADER_EARLY_DEPTH_TEST)
            && self.device.adapter_info().backend != wgpu::Backend::Gl
    }

    /// The adapter's name and driver, as figures should be reported with.
    pub fn adapter(&self) -> String {
        let info = self.device.adapter_info();
        match info.driver_info.as_str() {
            "" => info.name,
            driver => format!("{} ({driver})", info.name),
        }
    }

    /// Fails if the device was lost or ran out of memory since it was opened: what is on it is
    /// then good for nothing, and another is to be opened. A caller's own device reports such
    /// failures to the caller, not here.
    ///
    /// # Errors
    /// [`Error::DeviceLost`] with the driver's reason; [`Error::Defect`] for commands that limpid
    /// should not have given.
    pub fn check(&self) -> Result<()> {
        let Some(failure) = &self.failure else { return Ok(()) };
        let failure = || failure.lock().expect("no panic holds this lock").clone();
        // A device tells of its loss when it is asked.
        let mut polled = self.poll(wgpu::PollType::Poll);
        let mut seen = failure();
        if seen.lost.is_none() && seen.refused.is_some() {
            // What follows a loss is refused, which may be known before the loss: that is told once
            // the device has no more work.
            polled = self.poll(wgpu::PollType::wait_indefinitely());
            seen = failure();
        }
        match (seen.lost, seen.refused) {
            (Some(reason), _) => Err(Error::DeviceLost(reason)),
            (None, Some(reason)) => Err(Error::Defect(reason)),
            (None, None) => polled,
        }
    }

    /// wgpu 30 panics if a device is lost while it is waited for; its locks are free by then.
    fn poll(&self, how: wgpu::PollType) -> Result<()> {
        let polled = catch_unwind(AssertUnwindSafe(|| self.device.poll(how)));
        match polled {
            Ok(Ok(_)) => Ok(()),
            Ok(Err(error)) => Err(Error::DeviceLost(error.to_string())),
            Err(_) => Err(Error::DeviceLost("it was lost while it was waited for".into())),
        }
    }

    /// Refuses a picture that the adapter cannot hold.
    ///
    /// What the driver's memory holds is not asked: adapters do not say it, or not truly.
    ///
    /// # Errors
    /// [`Error::Empty`] for an empty picture, [`Error::Limit`] naming the limit.
    pub fn check_size(&self, size: UVec2) -> Result<()> {
        if size.min_element() == 0 {
            return Err(Error::Empty { width: size.x, height: size.y });
        }
        self.check_image(size, Limited::Picture)
    }

    /// As [`Gpu::check_size`], for any image that passes work on.
    #[doc(hidden)]
    pub fn check_image(&self, size: UVec2, of: Limited) -> Result<()> {
        let limits = self.device.limits();
        // One layer of four floats per texel is also the largest buffer that is read back.
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
        } else if 4 + 4 * tiles > limits.max_storage_buffer_binding_size {
            let most = limits.max_storage_buffer_binding_size;
            format!("lists at most {most} bytes of tiles (max_storage_buffer_binding_size)")
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

/// Workgroups in a row of a dispatch, as in `common/groups.wgsl`.
pub const ROW: u32 = 32768;

/// Dispatches so many workgroups; shaders number them by `group_index`.
#[doc(hidden)]
pub fn dispatch(pass: &mut wgpu::ComputePass<'_>, groups: u32) {
    pass.dispatch_workgroups(groups.min(ROW), groups.div_ceil(ROW), 1);
}

/// What an error says, and what it says of its cause.
fn reasons(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text.trim_end_matches('.').to_owned()
}

/// Why no adapter is selected: the environment, if there are any without it.
fn none_selected(otherwise: Error) -> Error {
    let set = ["WGPU_BACKEND", "WGPU_ADAPTER_NAME"].into_iter().filter_map(|name| {
        let value = std::env::var(name).ok().filter(|value| !value.is_empty())?;
        Some(format!("{name}={value}"))
    });
    let set: Vec<String> = set.collect();
    if set.is_empty() {
        return otherwise;
    }
    let all = pollster::block_on(adapters(wgpu::Backends::all(), ""));
    let all = all.iter().map(wgpu::Adapter::get_info);
    let there: Vec<String> = all.map(|info| format!("{} ({})", info.name, info.backend)).collect();
    if there.is_empty() {
        return otherwise;
    }
    Error::NoMatchingAdapter { selected: printable(set.join(" ")), found: there.join(", ") }
}

/// All adapters of some backends whose name contains `wanted`: GPUs before integrated ones before
/// software, OpenGL last.
async fn adapters(selected: wgpu::Backends, wanted: &str) -> Vec<wgpu::Adapter> {
    let wanted = wanted.to_lowercase();
    let mut all = Vec::new();
    for backends in [wgpu::Backends::PRIMARY, wgpu::Backends::GL] {
        // OpenGL only where there is nothing else: it may look for a window system.
        if !all.is_empty() {
            break;
        }
        let descriptor = wgpu::InstanceDescriptor {
            backends: selected & backends,
            ..wgpu::InstanceDescriptor::new_without_display_handle_from_env()
        };
        all = wgpu::Instance::new(descriptor).enumerate_adapters(backends).await;
        all.retain(|adapter| adapter.get_info().name.to_lowercase().contains(&wanted));
    }
    all.sort_by_key(|adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    all
}

/// What limpid makes use of where there is such a thing.
const OPTIONAL: wgpu::Features = wgpu::Features::TIMESTAMP_QUERY
    .union(wgpu::Features::PIPELINE_CACHE)
    .union(wgpu::Features::SHADER_EARLY_DEPTH_TEST);

/// What limpid needs of an adapter beside WebGPU's core limits: nothing native-only.
async fn open(adapter: &wgpu::Adapter) -> Result<(wgpu::Device, wgpu::Queue), String> {
    use wgpu::{DownlevelFlags, TextureUsages};
    let lacks = |what: &str| Err(format!("has no {what}; install a Vulkan driver"));
    let flags = adapter.get_downlevel_capabilities().flags;
    if !flags.contains(DownlevelFlags::COMPUTE_SHADERS) {
        return lacks("compute shaders");
    }
    if !flags.contains(DownlevelFlags::VERTEX_STORAGE | DownlevelFlags::INDIRECT_EXECUTION) {
        return lacks("storage buffers in vertex shaders or no indirect dispatch");
    }
    let planes = adapter.get_texture_format_features(LAYER_FORMAT);
    let needed = TextureUsages::RENDER_ATTACHMENT
        | TextureUsages::STORAGE_BINDING
        | TextureUsages::TEXTURE_BINDING;
    if !planes.allowed_usages.contains(needed) {
        return lacks("32-bit floating-point render targets");
    }
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("limpid"),
        required_features: adapter.features() & OPTIONAL,
        // Large pictures and particle sets are limited by the adapter, not by a default.
        required_limits: adapter.limits(),
        ..Default::default()
    };
    adapter.request_device(&descriptor).await.map_err(|e| format!("gives no device: {e}"))
}

/// Creates a buffer with `contents`, of as many bytes as a multiple of 4.
#[doc(hidden)]
pub fn buffer_with<T: bytemuck::NoUninit>(
    gpu: &Gpu,
    label: &str,
    usage: wgpu::BufferUsages,
    contents: &[T],
) -> wgpu::Buffer {
    let bytes: &[u8] = bytemuck::cast_slice(contents);
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes.len() as u64,
        usage,
        mapped_at_creation: true,
    });
    // What did not fit into memory is not mapped; [`Gpu::check`] tells why.
    if let Ok(mut mapped) = buffer.get_mapped_range_mut(..) {
        mapped.copy_from_slice(bytes);
    }
    buffer.unmap();
    buffer
}

/// How buffers are used that a shader reads as `var<uniform>`; see [`Gpu::uniforms_are_stored`].
#[doc(hidden)]
pub const UNIFORM: wgpu::BufferUsages =
    wgpu::BufferUsages::UNIFORM.union(wgpu::BufferUsages::STORAGE);

/// Creates a uniform buffer for one `T`, to be written with [`wgpu::Queue::write_buffer`].
#[doc(hidden)]
pub fn uniform_buffer<T: bytemuck::NoUninit>(gpu: &Gpu, label: &str) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: size_of::<T>() as u64,
        usage: UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// The part of a buffer that is in use: to shaders, an array's length.
#[doc(hidden)]
pub fn first_bytes(buffer: &wgpu::Buffer, bytes: u64) -> wgpu::BindingResource<'_> {
    let size = wgpu::BufferSize::new(bytes);
    wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset: 0, size })
}

/// Creates a texture of `layers` layers and the view of them all.
#[doc(hidden)]
pub fn texture(
    gpu: &Gpu,
    label: &str,
    size: UVec2,
    layers: u32,
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    mipped_texture(gpu, label, size, layers, 1, format, usage)
}

/// As [`texture`], with mip levels.
#[doc(hidden)]
pub fn mipped_texture(
    gpu: &Gpu,
    label: &str,
    size: UVec2,
    layers: u32,
    levels: u32,
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
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

/// How many layers a texture gets that shaders read as an array of `layers`: OpenGL takes a texture
/// of one layer for no array, so there it has two.
#[doc(hidden)]
pub fn array_layers(gpu: &Gpu, layers: u32) -> u32 {
    let least = if gpu.device.adapter_info().backend == wgpu::Backend::Gl { 2 } else { 1 };
    layers.max(least)
}

/// The view of all layers of an array texture.
#[doc(hidden)]
pub fn array_view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}

/// The view of one mip level.
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

/// The view of one layer of an array texture.
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

/// Sets all of a view to 0.
#[doc(hidden)]
pub fn clear(encoder: &mut wgpu::CommandEncoder, view: &wgpu::TextureView, span: Span<'_>) {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("clear"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                store: wgpu::StoreOp::Store,
            },
        })],
        timestamp_writes: span.render(),
        ..Default::default()
    });
}

/// Binds `resources` in order to bindings 0, 1, ….
#[doc(hidden)]
pub fn bind_group(
    gpu: &Gpu,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    resources: &[wgpu::BindingResource<'_>],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0u32..)
        .zip(resources)
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
        .collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some(label),
        layout,
        entries: &entries,
    })
}

/// A compute pipeline of one shader file's entry point, specialised by `constants`.
#[doc(hidden)]
pub fn compute_pipeline(
    gpu: &Gpu,
    shader: &str,
    entry_point: &str,
    layouts: &[&wgpu::BindGroupLayout],
    constants: &[(&str, f64)],
) -> wgpu::ComputePipeline {
    let module = shader::module(gpu, shader, shader::Variant::default());
    module_pipeline(gpu, shader, &module, entry_point, layouts, constants)
}

/// As [`compute_pipeline`], of a module that is there.
#[doc(hidden)]
pub fn module_pipeline(
    gpu: &Gpu,
    shader: &str,
    module: &wgpu::ShaderModule,
    entry_point: &str,
    layouts: &[&wgpu::BindGroupLayout],
    constants: &[(&str, f64)],
) -> wgpu::ComputePipeline {
    let layouts: Vec<_> = layouts.iter().map(|&layout| Some(layout)).collect();
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(shader),
        bind_group_layouts: &layouts,
        immediate_size: 0,
    });
    gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(&format!("{shader} {entry_point}")),
        layout: Some(&layout),
        module,
        entry_point: Some(entry_point),
        compilation_options: wgpu::PipelineCompilationOptions {
            constants,
            // No shader reads workgroup memory that it has not written.
            zero_initialize_workgroup_memory: false,
        },
        cache: gpu.cache(),
    })
}

/// Threads along either side of a workgroup that draws pixels, and pixels along that of a tile.
pub const TILE: u32 = 8;

/// What layers of planes are stored in: π in red, green and blue, depth in alpha.
pub const LAYER_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

/// The workgroups that cover `size` pixels.
#[doc(hidden)]
pub fn workgroups(size: UVec2) -> (u32, u32) {
    (size.x.div_ceil(TILE), size.y.div_ceil(TILE))
}
