//! Peak rates of the adapter, measured: `shaders/report/stream.wgsl`, `arithmetic.wgsl`.

use std::time::Instant;

use serde::Serialize;

use super::shaders::SHADERS;
use limpid::gpu::shader::Words;
use limpid::gpu::{self, Gpu, Timer};
use limpid_io::error::Result;

/// Measured rates of an adapter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rates {
    /// Bytes read and written per second by a buffer copy.
    pub bytes_per_s: f64,
    /// Operations on 32-bit floats per second; a multiply-add counts as two.
    pub operations_per_s: f64,
}

/// Maximum size of a copied buffer, bytes: two of them exceed the largest cache of any adapter, and
/// one stays within WebGPU's default limit.
const BUFFER: u64 = 128 << 20;

/// Threads per workgroup times bytes per thread, as in `stream.wgsl`.
const STREAM: u64 = 256 * 4 * 16;

/// Threads per workgroup and operations per thread, as in `arithmetic.wgsl`: rounds, steps, chains,
/// multiply and add.
const THREADS: u32 = 64;
const OPERATIONS: f64 = 32.0 * 8.0 * 16.0 * 2.0;

/// Minimum duration of a run that is timed, ms.
const LONG: f64 = 2.0;

/// Number of runs; their median is used.
const RUNS: usize = 5;

/// Measures both rates, after a warm-up; `None` if the adapter has no timestamps. Takes less than a
/// second on two cores without a GPU.
///
/// # Errors
/// [`limpid::Error::DeviceLost`].
pub fn measure(gpu: &Gpu) -> Result<Option<Rates>> {
    let limits = gpu.device.limits();
    let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size).min(BUFFER);
    let groups = most / STREAM;
    let buffer = |label: &str, size: u64| {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        })
    };
    let [source, copied] = ["streamed", "copied"].map(|label| buffer(label, groups * STREAM));
    let stream = Kernel::new(
        gpu,
        "report/stream.wgsl",
        "stream",
        &[gpu::storage_of(16), gpu::storage_read_write(16)],
        &[source.as_entire_binding(), copied.as_entire_binding()],
    );
    let result = buffer("result", 16);
    let arithmetic = Kernel::new(
        gpu,
        "report/arithmetic.wgsl",
        "arithmetic",
        &[gpu::storage_read_write(16)],
        &[result.as_entire_binding()],
    );
    let Some(moved) = stream.median(gpu, groups as u32)? else { return Ok(None) };
    // Doubles the workgroups until a run takes long enough.
    let mut groups = 1024;
    while groups < 1 << 15 && arithmetic.run(gpu, groups)?.is_some_and(|ms| ms < LONG) {
        groups *= 2;
    }
    let Some(computed) = arithmetic.median(gpu, groups)? else { return Ok(None) };
    let operations = f64::from(groups) * f64::from(THREADS) * OPERATIONS;
    Ok(Some(Rates {
        bytes_per_s: 2e3 * source.size() as f64 / moved,
        operations_per_s: 1e3 * operations / computed,
    }))
}

struct Kernel {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
}

impl Kernel {
    fn new(
        gpu: &Gpu,
        file: &str,
        entry: &str,
        bindings: &[wgpu::BindingType],
        resources: &[wgpu::BindingResource<'_>],
    ) -> Self {
        let layout = gpu.layout(file, wgpu::ShaderStages::COMPUTE, bindings);
        let pipeline = gpu.pipeline_of(SHADERS, file, Words::default(), entry, &[&layout], &[]);
        Self { pipeline, group: gpu.bind_group(file, &layout, resources) }
    }

    /// Runs once and returns the device time, ms; `None` without timestamps, or below their
    /// resolution.
    ///
    /// Mesa's lavapipe runs a direct dispatch when it is recorded, and takes the timestamps around it
    /// later, both at once: 0.04 ms for 32 MB that took 4 ms. Where the clock tells of a run that is
    /// that much longer, its time counts.
    fn run(&self, gpu: &Gpu, groups: u32) -> Result<Option<f64>> {
        let mut timer = Timer::new(gpu, true, 1);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("rate"),
                timestamp_writes: timer.span("rate").compute(),
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.group, &[]);
            pass.dispatch_workgroups(groups, 1, 1);
        }
        let resolved = timer.resolve(gpu, &mut encoder);
        let begun = Instant::now();
        gpu.queue.submit([encoder.finish()]);
        gpu.check()?;
        let times = timer.read(gpu, resolved.as_ref())?;
        let elapsed = 1e3 * begun.elapsed().as_secs_f64();
        let time = times.first().map(|time| credible(time.ms, elapsed));
        Ok(time.filter(|&ms| ms > 0.0))
    }

    fn median(&self, gpu: &Gpu, groups: u32) -> Result<Option<f64>> {
        self.run(gpu, groups)?;
        let mut times = Vec::new();
        for _ in 0..RUNS {
            let Some(ms) = self.run(gpu, groups)? else { return Ok(None) };
            times.push(ms);
        }
        times.sort_by(f64::total_cmp);
        Ok(Some(times[RUNS / 2]))
    }
}

/// The time of a run by its timestamps, or by the clock if the timestamps cannot be of the same run.
fn credible(timestamps_ms: f64, elapsed_ms: f64) -> f64 {
    /// Longest time from a submission to its answer besides the run itself, ms.
    const LATENCY: f64 = 2.0;
    if elapsed_ms > 10.0 * timestamps_ms + LATENCY { elapsed_ms } else { timestamps_ms }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Timestamps count unless the clock contradicts them by an order of magnitude.
    #[test]
    fn impossible_timestamps_do_not_count() {
        assert_eq!(credible(4.0, 4.3), 4.0);
        assert_eq!(credible(0.08, 0.9), 0.08);
        assert_eq!(credible(0.04, 4.1), 4.1);
    }
}
