//! Helpers of several test programs: a device, random numbers, and shader functions that run on the device over arrays of
//! test cases; below it hand-made frames, hosts, and a device that does nothing.

#![allow(dead_code, reason = "each program uses a part")]

pub(crate) mod frames;
pub(crate) mod hosts;
pub(crate) mod noop;
pub(crate) mod references;
pub(crate) mod view;

use std::env;
use std::sync::OnceLock;

use glam::{DVec2, DVec3, UVec2};
use limpid::gpu::Gpu;
use limpid::gpu::shader;
use limpid::wgpu;

/// A device shared by all tests of a program. Without an adapter, prints the reason and returns `None`.
///
/// # Panics
/// If there is no adapter and `LIMPID_REQUIRE_GPU=1` or `CI=true` requires one.
pub(crate) fn gpu() -> Option<&'static Gpu> {
    static GPU: OnceLock<Result<Gpu, String>> = OnceLock::new();
    match GPU.get_or_init(|| Gpu::headless().map_err(|e| e.to_string())) {
        Ok(gpu) => Some(gpu),
        Err(problem) => {
            let is = |name: &str, value: &str| env::var(name).is_ok_and(|v| v == value);
            let required = is("LIMPID_REQUIRE_GPU", "1") || is("CI", "true");
            assert!(!required, "an adapter is required: {problem}");
            eprintln!("skipped: {problem}");
            None
        }
    }
}

/// A linear congruential generator (Knuth's MMIX): the same cases on every machine.
pub(crate) struct Random(pub u64);

impl Random {
    /// Uniform in 0 to 1.
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in the logarithm.
    pub(crate) fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        self.range(low.ln(), high.ln()).exp()
    }

    /// A random unit vector.
    pub(crate) fn direction(&mut self) -> DVec3 {
        let z = self.range(-1.0, 1.0);
        let (sin, cos) = self.range(0.0, std::f64::consts::TAU).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z)
    }

    pub(crate) fn pixel(&mut self, size: UVec2) -> DVec2 {
        DVec2::new(self.unit(), self.unit()) * size.as_dvec2()
    }
}

/// A test kernel: `fn test(x: array<f32, I>) -> array<f32, O>` in `body`, which may call functions of the
/// files in `imports`.
pub(crate) struct Kernel<'a> {
    pub(crate) imports: &'a [&'a str],
    pub(crate) body: &'a str,
    /// Values of pipeline constants.
    pub(crate) constants: &'a [(&'a str, f64)],
    /// Group, binding and resource of every global that `test` reads.
    pub(crate) resources: &'a [(u32, u32, wgpu::BindingResource<'a>)],
}

/// A bind group without bindings in the shader files.
const OWN_GROUP: u32 = 3;

impl Kernel<'_> {
    /// Runs all cases and returns their results, in order.
    pub(crate) fn run<const I: usize, const O: usize>(
        &self,
        gpu: &Gpu,
        cases: &[[f32; I]],
    ) -> Vec<[f32; O]> {
        use wgpu::util::DeviceExt;
        let pipeline = self.pipeline(gpu, I, O);
        let inputs = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("cases"),
            contents: bytemuck::cast_slice(cases),
            usage: wgpu::BufferUsages::STORAGE,
        });
        let buffer = |label: &str, usage: wgpu::BufferUsages| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: (cases.len() * O * size_of::<f32>()) as u64,
                usage,
                mapped_at_creation: false,
            })
        };
        let outputs = buffer("results", wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let staging =
            buffer("readback", wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ);

        let own = [
            (OWN_GROUP, 0, inputs.as_entire_binding()),
            (OWN_GROUP, 1, outputs.as_entire_binding()),
        ];
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
            for group in 0..=OWN_GROUP {
                let entries: Vec<_> = (self.resources.iter().chain(&own))
                    .filter(|(of, ..)| *of == group)
                    .map(|(_, binding, resource)| wgpu::BindGroupEntry {
                        binding: *binding,
                        resource: resource.clone(),
                    })
                    .collect();
                let group_of_entries = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("test"),
                    layout: &pipeline.get_bind_group_layout(group),
                    entries: &entries,
                });
                pass.set_bind_group(group, &group_of_entries, &[]);
            }
            pass.dispatch_workgroups((cases.len() as u32).div_ceil(64), 1, 1);
        }
        encoder.copy_buffer_to_buffer(&outputs, 0, &staging, 0, outputs.size());
        gpu.queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, .., |_| ());
        gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device answers");
        let bytes = staging.get_mapped_range(..).expect("the results are mapped");
        bytemuck::pod_collect_to_vec(&bytes)
    }

    fn pipeline(&self, gpu: &Gpu, inputs: usize, outputs: usize) -> wgpu::ComputePipeline {
        let imports: String = self.imports.iter().map(|file| format!("#import {file}\n")).collect();
        let body = self.body;
        let root = format!(
            "{imports}
            @group({OWN_GROUP}) @binding(0) var<storage, read> cases: array<array<f32, {inputs}>>;
            @group({OWN_GROUP}) @binding(1)
            var<storage, read_write> results: array<array<f32, {outputs}>>;
            @compute @workgroup_size(64)
            fn run_test(@builtin(global_invocation_id) id: vec3u) {{
                if id.x < arrayLength(&cases) {{
                    results[id.x] = test(cases[id.x]);
                }}
            }}
            {body}"
        );
        let text =
            shader::resolve("test", shader::Words::of("refract/guarded.wgsl"), &mut |path| {
                if path == "test" { Some(&root) } else { shader::RENDERER.file(path) }
            });
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("test"),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("test"),
            layout: None,
            module: &module,
            entry_point: Some("run_test"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: self.constants,
                ..Default::default()
            },
            cache: None,
        })
    }
}

/// A uniform buffer with one value.
pub(crate) fn uniform<T: bytemuck::NoUninit>(gpu: &Gpu, value: &T) -> wgpu::Buffer {
    use wgpu::util::DeviceExt;
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("uniform"),
        contents: bytemuck::bytes_of(value),
        usage: wgpu::BufferUsages::UNIFORM,
    })
}

/// A texture of 32-bit floats, one slice of texels per layer; an array if there are several.
pub(crate) fn texture(gpu: &Gpu, size: UVec2, layers: &[&[[f32; 4]]]) -> wgpu::TextureView {
    use wgpu::util::{DeviceExt, TextureDataOrder};
    let depth_or_array_layers = layers.len() as u32;
    let texture = gpu.device.create_texture_with_data(
        &gpu.queue,
        &wgpu::TextureDescriptor {
            label: Some("test"),
            size: wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        },
        TextureDataOrder::LayerMajor,
        bytemuck::cast_slice(&layers.concat()),
    );
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(match layers.len() {
            1 => wgpu::TextureViewDimension::D2,
            _ => wgpu::TextureViewDimension::D2Array,
        }),
        ..Default::default()
    })
}
