//! The graphics device, and the few helpers that keep each pass short.

mod binding;
mod readback;
mod timer;

use std::sync::{Arc, Mutex};

use crate::error::{Error, Result};

pub(crate) use binding::{
    sampled, storage, storage_of, storage_read_write, storage_texture, uniform,
};
pub(crate) use readback::{read_buffer, read_texture};
pub use timer::PassTime;
pub(crate) use timer::{Span, Timer};

/// A device with its queue: limpid's own, or the caller's.
#[derive(Clone, Debug)]
pub struct Gpu {
    /// The device on which everything is created.
    pub device: wgpu::Device,
    /// The queue to which frames are submitted.
    pub queue: wgpu::Queue,
    failure: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens an adapter without any window system: a GPU where there is one, otherwise a
    /// software adapter such as Mesa's lavapipe.
    ///
    /// `WGPU_BACKEND` and `WGPU_ADAPTER_NAME` select one, as in other wgpu programs.
    ///
    /// # Errors
    /// [`Error::NoAdapter`] if there is none, [`Error::Adapter`] if it refuses a device.
    pub fn headless() -> Result<Self> {
        // The best adapter that gives a device: a broken driver should not hide a working one.
        let mut refusal = Error::NoAdapter;
        for adapter in pollster::block_on(adapters()) {
            match pollster::block_on(open(&adapter)) {
                Ok((device, queue)) => return Ok(Self::own(device, queue)),
                Err(problem) => {
                    let name = adapter.get_info().name;
                    refusal = Error::Adapter { adapter: name, problem };
                }
            }
        }
        Err(refusal)
    }

    /// Wraps a device that limpid opened, and watches it.
    fn own(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let gpu = Self::from_device(device, queue);
        let failure = gpu.failure.clone();
        gpu.device.set_device_lost_callback(move |_, reason| {
            failure.lock().expect("no panic holds this lock").get_or_insert(reason);
        });
        let failure = gpu.failure.clone();
        gpu.device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let mut failure = failure.lock().expect("no panic holds this lock");
            // A validation error is a defect of limpid, never of its input; but what ran out of
            // memory is invalid from then on, and the first failure says why.
            let defect = matches!(error, wgpu::Error::Validation { .. }) && failure.is_none();
            failure.get_or_insert_with(|| error.to_string());
            drop(failure);
            assert!(!defect, "{error}");
        }));
        gpu
    }

    /// Wraps a caller's device and queue. Passes are timed if the device has
    /// [`wgpu::Features::TIMESTAMP_QUERY`]; no other feature is used.
    pub fn from_device(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self { device, queue, failure: Arc::default() }
    }

    /// The adapter's name and driver, as figures should be reported with.
    pub fn adapter(&self) -> String {
        let info = self.device.adapter_info();
        match info.driver_info.as_str() {
            "" => info.name,
            driver => format!("{} ({driver})", info.name),
        }
    }

    /// Fails if the device was lost or ran out of memory since it was opened. A caller's own
    /// device reports such failures to the caller, not here.
    ///
    /// # Errors
    /// [`Error::DeviceLost`] with the driver's reason.
    pub fn check(&self) -> Result<()> {
        match &*self.failure.lock().expect("no panic holds this lock") {
            Some(reason) => Err(Error::DeviceLost(reason.clone())),
            None => Ok(()),
        }
    }

    /// Refuses a picture that the adapter cannot hold.
    ///
    /// # Errors
    /// [`Error::Usage`] for an empty picture, [`Error::Adapter`] naming the limit.
    pub fn check_size(&self, size: glam::UVec2) -> Result<()> {
        let limits = self.device.limits();
        // One layer of four floats per texel is also the largest buffer that is read back.
        let bytes = (u64::from(size.x) * u64::from(size.y)).saturating_mul(16);
        if size.x == 0 || size.y == 0 {
            return Err(Error::Usage(format!("a picture of {}x{} has no pixels", size.x, size.y)));
        }
        let problem = if size.max_element() > limits.max_texture_dimension_2d {
            format!("holds at most {0}x{0} pixels", limits.max_texture_dimension_2d)
        } else if bytes > limits.max_buffer_size {
            format!("holds at most {} MiB in one buffer", limits.max_buffer_size >> 20)
        } else {
            return Ok(());
        };
        Err(Error::Adapter {
            adapter: self.adapter(),
            problem: format!("{problem}, asked for {}x{}; choose a smaller --size", size.x, size.y),
        })
    }
}

/// All adapters: GPUs before integrated ones before software, OpenGL last.
async fn adapters() -> Vec<wgpu::Adapter> {
    let wanted = std::env::var("WGPU_ADAPTER_NAME").unwrap_or_default().to_lowercase();
    let mut all = Vec::new();
    for backends in [wgpu::Backends::PRIMARY, wgpu::Backends::GL] {
        // OpenGL only where there is nothing else: it may look for a window system.
        if !all.is_empty() {
            break;
        }
        let descriptor = wgpu::InstanceDescriptor {
            backends: wgpu::Backends::from_env().unwrap_or(wgpu::Backends::all()) & backends,
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

async fn open(adapter: &wgpu::Adapter) -> Result<(wgpu::Device, wgpu::Queue), String> {
    let flags = adapter.get_downlevel_capabilities().flags;
    if !flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS) {
        return Err("has no compute shaders; install a Vulkan driver".into());
    }
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("limpid"),
        required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
        // Large pictures and particle sets are limited by the adapter, not by a default.
        required_limits: adapter.limits(),
        ..Default::default()
    };
    adapter.request_device(&descriptor).await.map_err(|e| format!("gives no device: {e}"))
}

/// Creates a buffer with `contents`.
pub(crate) fn buffer_with<T: bytemuck::NoUninit>(
    gpu: &Gpu,
    label: &str,
    usage: wgpu::BufferUsages,
    contents: &[T],
) -> wgpu::Buffer {
    use wgpu::util::DeviceExt;
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some(label),
        contents: bytemuck::cast_slice(contents),
        usage,
    })
}

/// Creates a uniform buffer for one `T`, to be written with [`wgpu::Queue::write_buffer`].
pub(crate) fn uniform_buffer<T: bytemuck::NoUninit>(gpu: &Gpu, label: &str) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: size_of::<T>() as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// Creates a texture of `layers` layers and the view of them all.
pub(crate) fn texture(
    gpu: &Gpu,
    label: &str,
    size: glam::UVec2,
    layers: u32,
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    mipped_texture(gpu, label, size, layers, 1, format, usage)
}

/// As [`texture`], with mip levels.
pub(crate) fn mipped_texture(
    gpu: &Gpu,
    label: &str,
    size: glam::UVec2,
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

/// The view of all layers of an array texture.
pub(crate) fn array_view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}

/// The view of one mip level, as an array.
pub(crate) fn level_view(texture: &wgpu::Texture, level: u32) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        base_mip_level: level,
        mip_level_count: Some(1),
        ..Default::default()
    })
}

/// The view of one layer of an array texture.
pub(crate) fn layer_view(texture: &wgpu::Texture, layer: u32) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2),
        base_array_layer: layer,
        array_layer_count: Some(1),
        mip_level_count: Some(1),
        ..Default::default()
    })
}

/// Sets all of a view to 0.
pub(crate) fn clear(encoder: &mut wgpu::CommandEncoder, view: &wgpu::TextureView, span: Span<'_>) {
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
pub(crate) fn bind_group(
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
pub(crate) fn compute_pipeline(
    gpu: &Gpu,
    shader: &str,
    entry_point: &str,
    layouts: &[&wgpu::BindGroupLayout],
    constants: &[(&str, f64)],
) -> wgpu::ComputePipeline {
    let module = crate::shader::module(gpu, shader);
    module_pipeline(gpu, shader, &module, entry_point, layouts, constants)
}

/// As [`compute_pipeline`], of a module that is there.
pub(crate) fn module_pipeline(
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
        cache: None,
    })
}

/// The 8 × 8 workgroups that cover `size` pixels.
pub(crate) fn workgroups(size: glam::UVec2) -> (u32, u32) {
    (size.x.div_ceil(8), size.y.div_ceil(8))
}
