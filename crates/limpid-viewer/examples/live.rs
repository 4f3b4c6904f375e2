//! A liquid that lives on the graphics card: simulated, classified and drawn there, so that no particle ever reaches the host.
//!
//! ```sh
//! cargo run --release -p limpid-viewer --example live                          # a window
//! cargo run --release -p limpid-viewer --example live -- live.png 24 60000     # frame 24 of 60,000 particles
//! ```
//!
//! The simulation is the moving least squares material point method of Y. Hu et al., "A Moving Least Squares Material Point
//! Method with Displacement Discontinuity and Two-Way Rigid Body Coupling", ACM Transactions on Graphics 37(4), 2018, with
//! the equation of state of weakly compressible SPH (M. Becker and M. Teschner, 2007). [`Live::draw`] holds all the calls that draw with limpid.

use std::error::Error;

use limpid::camera::Camera;
use limpid::frame::{FrameInput, Picture};
use limpid::glam::{DVec3, UVec2};
use limpid::gpu::Gpu;
use limpid::liquid::classify::Classifier;
use limpid::liquid::{Attribute, DeviceParticles};
use limpid::look::{Body, Look};
use limpid::renderer::Renderer;
use limpid::scene::Scene;
use limpid::wgpu;

/// Particles in the volume of a cell.
const PER_CELL: f32 = 8.0;
/// Length of the basin, m.
const LENGTH: f32 = 2.0;
/// Share of its length and of its height that the dam takes.
const DAM: [f32; 2] = [0.4, 0.8];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let Some(path) = arguments.next() else { return show() };
    let frames: u32 = arguments.next().unwrap_or("60".into()).parse()?;
    let count = arguments.next().unwrap_or("100000".into()).parse()?;
    let gpu = Gpu::headless()?;
    let size = UVec2::new(640, 400);
    let (mut live, picture) = (Live::new(&gpu, count)?, Picture::new(&gpu, size)?);
    for _ in 0..frames {
        live.step();
    }
    live.draw(&picture, size, 0.4)?;
    picture.read(&gpu)?.save(&path)?;
    println!("{path}: frame {frames} of {count} particles");
    Ok(())
}

/// A simulation, and what draws it.
struct Live {
    gpu: Gpu,
    simulation: Simulation,
    classifier: Classifier,
    renderer: Renderer,
    scene: Scene,
}

impl Live {
    fn new(gpu: &Gpu, count: u32) -> limpid::error::Result<Self> {
        let simulation = Simulation::new(gpu, count);
        let (min, max) = simulation.bounds();
        let (classifier, renderer) = (Classifier::new(gpu)?, Renderer::new(gpu));
        let scene = Look::Daylight.scene(&Body::filling(min, max, simulation.radius()));
        Ok(Self { gpu: gpu.clone(), simulation, classifier, renderer, scene })
    }

    /// Simulates a frame.
    fn step(&self) {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.simulation.record(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// Draws the particles where they are.
    fn draw<'a>(
        &mut self,
        target: impl Into<limpid::frame::Target<'a>>,
        size: UVec2,
        turn: f64,
    ) -> limpid::error::Result<()> {
        let (min, max) = self.simulation.bounds();
        let particles = DeviceParticles {
            positions: Attribute {
                buffer: &self.simulation.particles,
                offset: 0,
                stride: PARTICLE,
            },
            count: self.simulation.count,
            counter: None,
            radius: self.simulation.radius(),
            radii: None,
            origin: DVec3::ZERO,
            bounds: (min, max),
        };
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let splats = self.classifier.record(&mut encoder, &particles, &self.scene)?;
        let middle = 0.5 * (min + max);
        let eye = middle + 1.25 * f64::from(LENGTH) * DVec3::new(turn.sin(), 0.45, turn.cos());
        let seen = DVec3::new(middle.x, 0.3 * max.y, middle.z);
        let camera = Camera { eye, target: seen, fov_y: 40.0, ..Camera::fit(min, max) };
        let input = FrameInput::new(&self.scene, &camera, &splats, size);
        let frame = self.renderer.prepare(input)?;
        self.renderer.record(frame, &mut encoder);
        self.renderer.tonemap(&self.scene.settings.tonemap, &mut encoder, target);
        self.gpu.queue.submit([encoder.finish()]);
        Ok(())
    }
}

/// Bytes of a particle of the shader.
const PARTICLE: u64 = 80;

/// A breaking dam in a basin.
struct Simulation {
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
    fn new(gpu: &Gpu, count: u32) -> Self {
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

    /// Half of the distance between particles at rest, m.
    fn radius(&self) -> f32 {
        0.5 * LENGTH / self.cells[0] as f32 / PER_CELL.cbrt()
    }

    /// The inside of the walls, m.
    fn bounds(&self) -> (DVec3, DVec3) {
        let cells = DVec3::from_array(self.cells.map(f64::from));
        let dx = f64::from(LENGTH) / cells.x;
        (DVec3::splat(2.0 * dx), (cells - 3.0) * dx)
    }

    fn record(&self, encoder: &mut wgpu::CommandEncoder) {
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

const SHADER: &str = include_str!("live.wgsl");

/// Shows the simulation in a window.
fn show() -> Result<(), Box<dyn Error>> {
    let create = |creation: &eframe::CreationContext<'_>| {
        let state = creation.wgpu_render_state.clone().ok_or("the window is not drawn by wgpu")?;
        let gpu = Gpu::from_device(state.device.clone(), state.queue.clone());
        let live = Live::new(&gpu, 100_000)?;
        Ok(Box::new(Window { live, state, shown: None }) as Box<dyn eframe::App>)
    };
    eframe::run_native("limpid live", Default::default(), Box::new(create))?;
    Ok(())
}

struct Window {
    live: Live,
    state: eframe::egui_wgpu::RenderState,
    /// The picture in the window, with its number there.
    shown: Option<(wgpu::Texture, eframe::egui::TextureId)>,
}

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut eframe::egui::Ui, _frame: &mut eframe::Frame) {
        let pixels = ui.available_size() * ui.ctx().pixels_per_point();
        let size = UVec2::new(pixels.x as u32, pixels.y as u32).max(UVec2::ONE);
        let format = wgpu::TextureFormat::Rgba8Unorm;
        let fits = |(shown, _): &(wgpu::Texture, _)| (shown.width(), shown.height()) == size.into();
        if let Some((_, id)) = self.shown.take_if(|shown| !fits(shown)) {
            self.state.renderer.write().free_texture(&id);
        }
        let (texture, id) = self.shown.take().unwrap_or_else(|| {
            let texture = self.state.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("picture"),
                size: wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                    | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            });
            let view = texture.create_view(&Default::default());
            let mut renderer = self.state.renderer.write();
            let nearest = wgpu::FilterMode::Nearest;
            let id = renderer.register_native_texture(&self.state.device, &view, nearest);
            (texture, id)
        });
        let view = texture.create_view(&Default::default());
        let turn = 0.1 * ui.input(|input| input.time);
        self.live.step();
        if let Err(e) = self.live.draw(limpid::frame::Target::View(&view, format), size, turn) {
            ui.label(e.to_string());
        }
        ui.image((id, ui.available_size()));
        self.shown = Some((texture, id));
        ui.ctx().request_repaint();
    }
}
