//! wgpu's no-op device, which validates everything and executes nothing.

use limpid::wgpu;

/// As [`wgpu::Device::noop`], but without the validation of indirect draws, which assumes alignments that the no-op
/// adapter does not have, and panics.
pub(crate) fn noop(descriptor: &wgpu::DeviceDescriptor<'_>) -> (wgpu::Device, wgpu::Queue) {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::NOOP,
        flags: wgpu::InstanceFlags::VALIDATION,
        backend_options: wgpu::BackendOptions {
            noop: wgpu::NoopBackendOptions { enable: true, ..Default::default() },
            ..Default::default()
        },
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()));
    let adapter = adapter.expect("the no-op adapter");
    pollster::block_on(adapter.request_device(descriptor)).expect("within its limits")
}
