//! `cargo bench --bench passes`: time of each pass on this machine's adapter, ms, by device
//! timestamps, and of whole frames by the clock; then frame time against the number of particles.
//!
//! Each figure is the median of several frames in one run, with the minimum and the maximum. Scenes
//! are `demo`, `cascade` (40,000 particles), `foam` (`cascade` with 500,000 spheres of foam; only if named), `million` (1,056,000), `ten-million` (the curve with ten million; only if named, for it takes
//! minutes and 4 GiB), and `front` if the reference scenes are available
//! (`LIMPID_REFERENCE`, default `../shared/reference` beside the checkout):
//!
//! ```text
//! cargo bench --bench passes                                all of it
//! cargo bench --bench passes -- cascade front               these scenes
//! cargo bench --bench passes -- curve                       the curve alone
//! cargo bench --bench passes -- my/scene.toml frames=21 size=640x480 refract.samples=4
//! ```

#[path = "support/memory.rs"]
mod memory;
#[path = "support/options.rs"]
mod options;
mod support;

use std::env;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use limpid::camera::Camera;
use limpid::diffuse::Diffuse;
use limpid::frame::FrameInput;
use limpid::glam::Vec3;
use limpid::gpu::Gpu;
use limpid::liquid::classify::{self, Splats};
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::scene::Scene;
use limpid_io::input::Input;

use options::Options;
use support::{COUNTS, Swell, TEN_MILLION};

/// The scenes and the curve, in this order.
const ALL: [&str; 5] = ["demo", "cascade", "front", "million", "curve"];

/// Spheres of `foam`.
const SPHERES: usize = 500_000;

fn main() -> limpid_io::Result<()> {
    let options = Options::parse(&ALL, 5);
    let gpu = Gpu::headless()?;
    let Options { size, frames, .. } = options;
    println!("{}, {}x{}, medians of {frames} frames, ms", gpu.adapter(), size.x, size.y);
    for name in &options.chosen {
        match name.as_str() {
            "curve" => curve(&gpu, &options, &COUNTS)?,
            "ten-million" => curve(&gpu, &options, &[&COUNTS[..], &[TEN_MILLION]].concat())?,
            name => match Subject::named(name, &options.settings)? {
                Some(subject) => passes(&gpu, &subject, &options)?,
                None => println!("\n{name}: its files are not here"),
            },
        }
    }
    Ok(())
}

/// A frame to render.
struct Subject {
    name: String,
    particles: usize,
    scene: Scene,
    camera: Camera,
    splats: Splats,
    foam: Option<Arc<Diffuse>>,
}

impl Subject {
    /// Loads a scene by its name or file; `None` if its files are missing.
    fn named(name: &str, settings: &[String]) -> limpid_io::Result<Option<Self>> {
        let repository = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
        let file = match name {
            "demo" => return Self::of(name, Input::demo()?, settings).map(Some),
            "million" => return Self::swell(COUNTS[3], settings).map(Some),
            "foam" => {
                let subject = Self::named("cascade", settings)?;
                return Ok(subject.map(|subject| subject.under_foam(name)));
            }
            "cascade" => repository.join("sims/cascade.toml"),
            "front" => {
                let folder = env::var_os("LIMPID_REFERENCE").map(PathBuf::from);
                let folder = folder.unwrap_or_else(|| repository.join("../shared/reference"));
                folder.join("scenes/double_dam_break_front.toml")
            }
            file => file.into(),
        };
        if !file.exists() {
            return Ok(None);
        }
        Self::of(name, Input::open(file)?, settings).map(Some)
    }

    fn of(name: &str, input: Input, settings: &[String]) -> limpid_io::Result<Self> {
        let (input, mut project) = input.resolve()?;
        project.set(settings)?;
        let number = input.frame.unwrap_or(input.sequence.frames[0].number);
        let frame = input.sequence.frame(number).unwrap_or(&input.sequence.frames[0]);
        let loaded = input.load(frame, &project.scene)?;
        let camera = project.camera_for(loaded.bulk.bounds);
        let scene = project.scene;
        let (name, particles) = (name.into(), loaded.particles);
        Ok(Self { name, particles, scene, camera, splats: loaded.splats, foam: None })
    }

    fn swell(count: usize, settings: &[String]) -> limpid_io::Result<Self> {
        Self::of_swell(Swell::new(count)?, settings)
    }

    fn of_swell(swell: Swell, settings: &[String]) -> limpid_io::Result<Self> {
        let Swell { mut project, particles, radius } = swell;
        project.set(settings)?;
        let camera = project.camera_for(particles.bounds().unwrap_or_default());
        let scene = project.scene;
        let mut splats = classify::classify(&particles, radius, &scene.settings.classify);
        classify::add_wall_contacts(&mut splats, &scene.solids, scene.settings.classify.wetting);
        let (name, particles) = ("swell".into(), particles.len());
        Ok(Self { name, particles, scene, camera, splats, foam: None })
    }

    /// The subject with spheres of foam, a twentieth as wide as particles and as many around each.
    fn under_foam(self, name: &str) -> Self {
        let centres: Vec<_> = self.splats.aggregates.iter().map(|splat| splat.centre).collect();
        let radius = self.splats.radius;
        // Evenly in a cube (M. Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018).
        let sphere = |i: usize| {
            let share = |step: f64| (i as f64 * step).fract() as f32 - 0.5;
            let beside = Vec3::new(share(0.8191725134), share(0.6710436067), share(0.5497004779));
            Vec3::from(centres[i % centres.len()]) + 4.0 * radius * beside
        };
        let positions = (0..SPHERES).map(sphere).collect();
        let foam = Diffuse::from_positions(positions, 0.05 * radius);
        let foam = Diffuse { origin: self.splats.origin, ..foam };
        Self { name: name.into(), foam: Some(Arc::new(foam)), ..self }
    }
}

/// Times of a subject's frames, ms: per pass, in total on the device, and of the whole frame.
struct Times {
    passes: Vec<(&'static str, Vec<f64>)>,
    /// Sum of the passes.
    device: Vec<f64>,
    /// From the call until the picture is in host memory.
    frame: Vec<f64>,
}

fn measure(gpu: &Gpu, subject: &Subject, options: &Options) -> limpid_io::Result<Times> {
    let Subject { scene, camera, splats, foam, .. } = subject;
    let size = options.size;
    let picture = Picture::new(gpu, size)?;
    let mut renderer = Renderer::new(gpu);
    let mut draw = |timing: bool| {
        let start = Instant::now();
        let input = FrameInput::new(scene, camera, splats, size);
        let input = FrameInput { timing, diffuse: foam.as_ref(), ..input };
        let passes = renderer.render(input, &picture)?;
        picture.read(gpu)?;
        Ok::<_, limpid_io::Error>((passes, start.elapsed().as_secs_f64() * 1e3))
    };
    // The first frame also compiles shaders.
    draw(true)?;
    let mut times = Times { passes: Vec::new(), device: Vec::new(), frame: Vec::new() };
    for _ in 0..options.frames {
        let (passes, _) = draw(true)?;
        times.device.push(passes.iter().map(|pass| pass.ms).sum());
        for (i, pass) in passes.iter().enumerate() {
            if times.passes.len() == i {
                times.passes.push((pass.name, Vec::new()));
            }
            times.passes[i].1.push(pass.ms);
        }
        // Reading timestamps waits for the device, so whole frames are measured without them.
        times.frame.push(draw(false)?.1);
    }
    Ok(times)
}

fn passes(gpu: &Gpu, subject: &Subject, options: &Options) -> limpid_io::Result<()> {
    let times = measure(gpu, subject, options)?;
    println!("\n{}, {} particles", subject.name, subject.particles);
    for (name, ms) in times.passes {
        report(name, &ms);
    }
    report("all passes", &times.device);
    report("frame", &times.frame);
    Ok(())
}

/// Measures one liquid with increasing numbers of particles. The exponent is that of the particle
/// number between two rows: 1 means linear scaling. Memory is the most that the process holds in classification and
/// while it draws, with the device's own where that is the processor.
fn curve(gpu: &Gpu, options: &Options, counts: &[usize]) -> limpid_io::Result<()> {
    println!(
        "\nswell: {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "particles", "splats", "classify", "splat", "device", "frame", "exponent", "MiB"
    );
    let mut last: Option<(f64, f64)> = None;
    for &count in counts {
        let swell = Swell::new(count)?;
        memory::reset_peak();
        let start = Instant::now();
        let subject = Subject::of_swell(swell, &options.settings)?;
        let classification = start.elapsed().as_secs_f64() * 1e3;
        let times = measure(gpu, &subject, options)?;
        let peak = memory::peak().map_or("?".into(), |bytes| (bytes >> 20).to_string());
        let is_splat = |(name, _): &&(&str, Vec<f64>)| name.starts_with("splat");
        let splat: f64 = times.passes.iter().filter(is_splat).map(|(_, ms)| median(ms).1).sum();
        let (device, frame) = (median(&times.device).1, median(&times.frame).1);
        let particles = subject.particles;
        let exponent = last.map_or(String::new(), |(fewer, less)| {
            format!("{:.2}", (frame / less).ln() / (particles as f64 / fewer).ln())
        });
        let splats = subject.splats.aggregates.len() + subject.splats.splashes.len();
        println!(
            "       {particles:>9} {splats:>9} {classification:9.2} {splat:9.2} {device:9.2} {frame:9.2} \
             {exponent:>9} {peak:>9}"
        );
        last = Some((particles as f64, frame));
    }
    Ok(())
}

/// Minimum, median and maximum.
fn median(ms: &[f64]) -> (f64, f64, f64) {
    let mut ms = ms.to_vec();
    ms.sort_by(f64::total_cmp);
    (ms[0], ms[ms.len() / 2], ms[ms.len() - 1])
}

fn report(name: &str, ms: &[f64]) {
    let (least, middle, most) = median(ms);
    println!("{name:>16} {middle:9.2}   {least:.2} to {most:.2}");
}
