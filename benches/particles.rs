//! `cargo bench --bench particles`: time from particles to a picture, ms by the clock, medians with the least and the
//! greatest.
//!
//! - `classification`: particles on the device become splats there, eight times in one submission;
//! - `device to texture`: particles and picture stay on the device;
//! - `host to host`: positions are uploaded and the picture is read back;
//! - `classified by the CPU`: the same by [`classify::classify`], whose splats are uploaded;
//! - `memory`: what the device has allocated by then, MiB;
//! - `views`: pictures of 128×128 pixels from different views, ms for each, with 40,000 particles; `recorded`: what the
//!   host takes to prepare and record them, without tone mapping, submission and reading.
//!
//! ```text
//! cargo bench --bench particles                       40,000 and a million particles, and views
//! cargo bench --bench particles -- ten-million frames=5 size=640x480
//! cargo bench --bench particles -- views refract.samples=1
//! ```

#[path = "support/options.rs"]
mod options;
mod support;

use std::time::Instant;

use limpid::camera::{Camera, View};
use limpid::frame::FrameInput;
use limpid::glam::{DVec3, UVec2};
use limpid::gpu::Gpu;
use limpid::liquid::classify::{self, Classifier, Splats};
use limpid::liquid::{Attribute, DeviceParticles, Particles};
use limpid::offscreen::{Offscreen, Picture};
use limpid::renderer::Renderer;
use limpid::scene::Scene;
use limpid::wgpu;

use options::Options;
use support::{COUNTS, Swell, TEN_MILLION};

/// Classifications in one submission.
const TIMES: u32 = 8;
/// Views of one set of particles, and their size, pixels.
const VIEWS: usize = 200;
const VIEW: UVec2 = UVec2::splat(128);

fn main() -> limpid_io::Result<()> {
    let options = Options::parse(&["40000", "million", "views"], 9);
    let gpu = Gpu::headless()?;
    let Options { size, frames, .. } = options;
    println!("{}, {}x{}, medians of {frames} frames, ms", gpu.adapter(), size.x, size.y);
    for name in &options.chosen {
        match name.as_str() {
            "views" => views(&Subject::new(&gpu, COUNTS[1], &options)?, &options)?,
            "million" => particles(&Subject::new(&gpu, COUNTS[3], &options)?, &options)?,
            "ten-million" => particles(&Subject::new(&gpu, TEN_MILLION, &options)?, &options)?,
            count => {
                let count = count.parse().expect("a number, million, ten-million or views");
                particles(&Subject::new(&gpu, count, &options)?, &options)?;
            }
        }
    }
    Ok(())
}

/// A liquid on the host and on the device.
struct Subject<'a> {
    gpu: &'a Gpu,
    scene: Scene,
    camera: Camera,
    particles: Particles,
    radius: f32,
    bounds: (DVec3, DVec3),
    positions: wgpu::Buffer,
}

impl<'a> Subject<'a> {
    fn new(gpu: &'a Gpu, count: usize, options: &Options) -> limpid_io::Result<Self> {
        let Swell { mut project, particles, radius } = Swell::new(count)?;
        project.set(&options.settings)?;
        let bounds = particles.bounds().unwrap_or_default();
        let camera = project.camera_for(bounds);
        let positions = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("positions"),
            size: 12 * particles.len() as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let subject =
            Self { gpu, scene: project.scene, camera, particles, radius, bounds, positions };
        subject.upload();
        Ok(subject)
    }

    fn upload(&self) {
        let bytes = bytemuck::cast_slice(&self.particles.positions);
        self.gpu.queue.write_buffer(&self.positions, 0, bytes);
    }

    fn classify(&self, classifier: &Classifier, times: u32) -> limpid_io::Result<Splats> {
        let particles = DeviceParticles {
            positions: Attribute { buffer: &self.positions, offset: 0, stride: 12 },
            count: self.particles.len() as u32,
            counter: None,
            radius: self.radius,
            radii: None,
            origin: self.particles.origin,
            bounds: self.bounds,
        };
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let mut splats = Splats::default();
        for _ in 0..times {
            splats = classifier.record(&mut encoder, &particles, &self.scene)?;
        }
        self.gpu.queue.submit([encoder.finish()]);
        Ok(splats)
    }

    fn classify_on_host(&self) -> Splats {
        let Self { scene, particles, radius, .. } = self;
        let mut splats = classify::classify(particles, *radius, &scene.settings.classify);
        let wetting = scene.settings.classify.wetting;
        classify::add_wall_contacts(&mut splats, &scene.solids, wetting);
        splats
    }

    fn input<'b>(&'b self, splats: &'b Splats, size: UVec2) -> FrameInput<'b> {
        FrameInput::new(&self.scene, &self.camera, splats, size)
    }
}

fn particles(subject: &Subject<'_>, options: &Options) -> limpid_io::Result<()> {
    let Subject { gpu, .. } = *subject;
    let Options { size, frames, .. } = *options;
    let (mut renderer, picture) = (Renderer::new(gpu), Picture::new(gpu, size)?);
    let classifier = Classifier::new(gpu)?;
    println!("\n{} particles", subject.particles.len());
    let once = measure(frames, || {
        subject.classify(&classifier, TIMES)?;
        wait(gpu);
        Ok(())
    })?;
    report("classification", once.map(|ms| ms / f64::from(TIMES)));
    let stays = measure(frames, || {
        let splats = subject.classify(&classifier, 1)?;
        renderer.render(subject.input(&splats, size), &picture)?;
        wait(gpu);
        Ok(())
    })?;
    report("device to texture", stays);
    let through = measure(frames, || {
        subject.upload();
        let splats = subject.classify(&classifier, 1)?;
        renderer.render(subject.input(&splats, size), &picture)?;
        picture.read(gpu)?;
        Ok(())
    })?;
    report("host to host", through);
    if let Some(allocated) = gpu.device.generate_allocator_report() {
        println!("{:>22} {:9}", "memory", allocated.total_allocated_bytes >> 20);
    }
    let by_host = measure(frames, || {
        let splats = subject.classify_on_host();
        renderer.render(subject.input(&splats, size), &picture)?;
        picture.read(gpu)?;
        Ok(())
    })?;
    report("classified by the CPU", by_host);
    Ok(())
}

fn views(subject: &Subject<'_>, options: &Options) -> limpid_io::Result<()> {
    let splats = subject.classify(&Classifier::new(subject.gpu)?, 1)?;
    let mut renderer = Offscreen::new(subject.gpu);
    let (min, max) = subject.bounds;
    let moved = |i: usize| {
        let aside = 0.2 * (max - min).length() * i as f64 / VIEWS as f64;
        View::from(&Camera { eye: subject.camera.eye + DVec3::X * aside, ..subject.camera })
    };
    let views: Vec<View> = (0..VIEWS).map(moved).collect();
    let ms = measure(options.frames, || {
        renderer.draw_views(subject.input(&splats, VIEW), &views)?;
        Ok(())
    })?;
    println!("\n{} particles, {VIEWS} pictures of {VIEW}", subject.particles.len());
    report("views", ms.map(|ms| ms / VIEWS as f64));
    let (gpu, renderer) = (subject.gpu, &mut renderer.renderer);
    let ms = measure(options.frames, || {
        for &view in &views {
            let input = FrameInput { view, reuse: true, ..subject.input(&splats, VIEW) };
            let frame = renderer.prepare(input)?;
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            renderer.record(frame, &mut encoder);
            drop(encoder.finish());
        }
        gpu.queue.submit([]);
        wait(gpu);
        Ok(())
    })?;
    report("recorded", ms.map(|ms| ms / VIEWS as f64));
    Ok(())
}

fn wait(gpu: &Gpu) {
    gpu.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
}

/// Median, least and greatest time of a call, ms. The first call, which also compiles shaders, does not count.
fn measure(
    frames: usize,
    mut call: impl FnMut() -> limpid_io::Result<()>,
) -> limpid_io::Result<[f64; 3]> {
    call()?;
    let mut ms = Vec::with_capacity(frames);
    for _ in 0..frames {
        let start = Instant::now();
        call()?;
        ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
    ms.sort_by(f64::total_cmp);
    Ok([ms[frames / 2], ms[0], ms[frames - 1]])
}

fn report(name: &str, [middle, least, most]: [f64; 3]) {
    println!("{name:>22} {middle:9.3}   {least:.3} to {most:.3}");
}
