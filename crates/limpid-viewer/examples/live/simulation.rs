//! A breaking dam, simulated in buffers of the graphics device.
//!
//! The moving least squares material point method of Y. Hu et al., "A Moving Least Squares Material Point Method with
//! Displacement Discontinuity and Two-Way Rigid Body Coupling", ACM Transactions on Graphics 37(4), 2018, with the equation of
//! state of weakly compressible SPH (M. Becker and M. Teschner, 2007).

use limpid::glam::DVec3;
use limpid::gpu::Gpu;
use limpid::liquid::{Attribute, DeviceParticles};
use limpid::wgpu;

/// Particles in the volume of a cell.
const PER_CELL: f32 = 8.0;
/// Length of the basin, m.
pub(crate) const LENGTH: f32 = 2.0;
/// Share of its length and of its height that the dam takes.
const DAM: [f32; 2] = [0.4, 0.8];

/// Bytes of a particle of the shader.
const PARTICLE: u64 = 80;

/// A breaking dam in a basin.
pub(crate) struct Simulation {
    count: u32,
    /// Cells of the grid, of which two on each side are walls.
    cells: [u32; 3],
    particles: wgpu::Buffer,
    bindings: wgpu::BindGroup,
    steps: Vec<(wgpu::ComputePipeline, u32)>,
    /// Steps in a frame of 1/60 s: sound must not cross a cell in one.
    times: u32,
}

impl Simulation {
    pub(crate) fn new(gpu: &Gpu, count: u32) -> Self {
        let device = &gpu.device;
        // Sized so that the particles fill the dam.
        let side = (count as f32 / (PER_CELL * DAM[0] * DAM[1] * 0.6 * 0.5)).cbrt();
        let [x, y, z] = [1.0, 0.6, 0.5].map(|share| (share * side).ceil() as u32 + 4);
        let cells = x * y * z;
        let buffer = |size: u64| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("simulation"),
                size,
                usage: wgpu::BufferUsages::STORAGE,
                mapped_at_creation: false,
            })
        };
        let (particles, grid) =
            (buffer(PARTICLE * u64::from(count)), buffer(16 * u64::from(cells)));
        let times = (0.65 * x as f32) as u32;
        let constants = format!(
            "const COUNT = {count}u; const CELLS = vec3u({x}u, {y}u, {z}u); const DX = {:?};\n\
             const DT = {:?}; const PER_CELL = {PER_CELL:?}; const DAM = vec2f({:?}, {:?});\n",
            LENGTH / x as f32,
            1.0 / 60.0 / times as f32,
            DAM[1] * (y - 4) as f32,
            (z - 4) as f32,
        );
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("simulation"),
            source: wgpu::ShaderSource::Wgsl((constants + SHADER).into()),
        });
        let entry = |binding| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only: false },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &[entry(0), entry(1)],
        });
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: particles.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: grid.as_entire_binding() },
            ],
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            bind_group_layouts: &[Some(&layout)],
            ..Default::default()
        });
        let kernel = |entry: &str, threads: u32| {
            let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry),
                layout: Some(&layout),
                module: &module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                cache: None,
            });
            (pipeline, threads.div_ceil(64))
        };
        let steps = vec![
            kernel("clear", cells),
            kernel("scatter_mass", count),
            kernel("scatter_pressure", count),
            kernel("move_grid", cells),
            kernel("gather", count),
        ];
        let simulation = Self { count, cells: [x, y, z], times, particles, bindings, steps };
        let mut encoder = device.create_command_encoder(&Default::default());
        simulation.run(&mut encoder, &[kernel("begin", count)], 1);
        gpu.queue.submit([encoder.finish()]);
        simulation
    }

    /// The particles where they are.
    pub(crate) fn particles(&self) -> DeviceParticles<'_> {
        DeviceParticles {
            positions: Attribute { buffer: &self.particles, offset: 0, stride: PARTICLE },
            count: self.count,
            counter: None,
            radius: self.radius(),
            radii: None,
            origin: DVec3::ZERO,
            bounds: self.bounds(),
        }
    }

    /// Half of the distance between particles at rest, m.
    pub(crate) fn radius(&self) -> f32 {
        0.5 * LENGTH / self.cells[0] as f32 / PER_CELL.cbrt()
    }

    /// The inside of the walls, m.
    pub(crate) fn bounds(&self) -> (DVec3, DVec3) {
        let cells = DVec3::from_array(self.cells.map(f64::from));
        let dx = f64::from(LENGTH) / cells.x;
        (DVec3::splat(2.0 * dx), (cells - 3.0) * dx)
    }

    /// Records a frame of 1/60 s.
    pub(crate) fn record(&self, encoder: &mut wgpu::CommandEncoder) {
        self.run(encoder, &self.steps, self.times);
    }

    fn run(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        kernels: &[(wgpu::ComputePipeline, u32)],
        times: u32,
    ) {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_bind_group(0, &self.bindings, &[]);
        for (pipeline, groups) in (0..times).flat_map(|_| kernels) {
            pass.set_pipeline(pipeline);
            pass.dispatch_workgroups(*groups, 1, 1);
        }
    }
}

const SHADER: &str = include_str!("simulation.wgsl");
