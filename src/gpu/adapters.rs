//! Adapters, and the device of one.

use super::LAYER_FORMAT;
use crate::error::{Error, Result, printable};
use crate::memory;

/// Memory that opening a device may take, bytes: that of Mesa's software device with its compiler.
const OPENING_MEMORY: usize = 512 << 20;

/// Opens the device of the first of `adapters` that gives one; `selected` is what they were selected by, if by anything.
pub(super) async fn open_first(
    adapters: Vec<wgpu::Adapter>,
    selected: &str,
) -> Result<(wgpu::Device, wgpu::Queue)> {
    // Tries adapters in order of preference: a broken driver must not hide a working one.
    let mut refusal = Error::NoAdapter;
    if adapters.is_empty() && !selected.is_empty() {
        refusal = no_match_error(selected).await;
    }
    for adapter in adapters {
        match open(&adapter).await {
            Ok(opened) => return Ok(opened),
            Err(problem) => {
                refusal = Error::Refused { adapter: adapter.get_info().name, problem };
            }
        }
    }
    // Lack of memory also makes drivers refuse a device or report no adapter.
    memory::probe(OPENING_MEMORY, "a graphics device")?;
    Err(refusal)
}

/// Error if no adapter matches `selected`: [`Error::NoMatchingAdapter`], or [`Error::NoAdapter`] if there is
/// none at all.
async fn no_match_error(selected: &str) -> Error {
    let all = list(wgpu::Backends::all(), "").await;
    let all = all.iter().map(wgpu::Adapter::get_info);
    let found: Vec<String> = all.map(|info| format!("{} ({})", info.name, info.backend)).collect();
    if found.is_empty() {
        return Error::NoAdapter;
    }
    Error::NoMatchingAdapter { selected: printable(selected.to_owned()), found: found.join(", ") }
}

/// Lines for debuggers take a sixth of the start of an unoptimised program: `WGPU_DEBUG=1` asks for them.
const UNUSED: wgpu::InstanceFlags = wgpu::InstanceFlags::DEBUG;

/// wgpu precedes each indirect dispatch by another that checks its size, with a barrier on either side. The shaders that
/// write the sizes keep to rows of at most 65,535 workgroups, which every adapter supports, so that graphics cards go
/// without. On software adapters it costs little, and without its barriers Mesa's timestamps miss passes.
const CHECKED: wgpu::InstanceFlags = wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL;

/// Lists the adapters of the selected backends whose name contains `wanted`: discrete before integrated
/// GPUs before software adapters; OpenGL only without any other.
pub(super) async fn list(selected: wgpu::Backends, wanted: &str) -> Vec<wgpu::Adapter> {
    let wanted = wanted.to_lowercase();
    let mut all = Vec::new();
    for backends in [wgpu::Backends::PRIMARY, wgpu::Backends::GL] {
        // OpenGL only as a last resort: it may connect to a window system.
        if !all.is_empty() {
            break;
        }
        let with = |flags: wgpu::InstanceFlags| {
            let descriptor = wgpu::InstanceDescriptor {
                backends: selected & backends,
                flags: flags.with_env(),
                ..wgpu::InstanceDescriptor::new_without_display_handle_from_env()
            };
            wgpu::Instance::new(descriptor).enumerate_adapters(backends)
        };
        let flags = wgpu::InstanceFlags::from_build_config() - UNUSED;
        all = with(flags - CHECKED).await;
        let is_software =
            |adapter: &wgpu::Adapter| adapter.get_info().device_type == wgpu::DeviceType::Cpu;
        if all.iter().all(is_software) {
            all = with(flags).await;
        }
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

/// Features that limpid uses where available.
const OPTIONAL: wgpu::Features =
    wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::PIPELINE_CACHE);

/// Opens a device, after checking the requirements beyond WebGPU's core limits: no native-only feature.
async fn open(adapter: &wgpu::Adapter) -> Result<(wgpu::Device, wgpu::Queue), String> {
    use wgpu::{DownlevelFlags, TextureUsages};
    let lacks = |what: &str| Err(format!("has no {what}; install a Vulkan driver"));
    let flags = adapter.get_downlevel_capabilities().flags;
    if !flags.contains(DownlevelFlags::COMPUTE_SHADERS) {
        return lacks("compute shaders");
    }
    if !flags.contains(DownlevelFlags::INDIRECT_EXECUTION) {
        return lacks("indirect dispatch");
    }
    let planes = adapter.get_texture_format_features(LAYER_FORMAT);
    let needed = TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING;
    if !planes.allowed_usages.contains(needed) {
        return lacks("textures of 32-bit floats that shaders write");
    }
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("limpid"),
        required_features: adapter.features() & OPTIONAL,
        // The adapter's own limits, for large pictures and particle sets.
        required_limits: adapter.limits(),
        ..Default::default()
    };
    adapter.request_device(&descriptor).await.map_err(|e| format!("gives no device: {e}"))
}
