//! `cargo bench`: milliseconds per pass on this machine's adapter, and of classification.
//!
//! Each figure is the median of several frames in one run, with the least and the greatest beside
//! it; passes are timed by the device's own timestamps, classification by the clock.

use std::time::Instant;

use glam::{UVec2, Vec3};
use limpid::gpu::Gpu;
use limpid::input::Input;
use limpid::particles::Particles;
use limpid::passes::classify;
use limpid::renderer::{Picture, Renderer};
use limpid::settings::Settings;

const SIZE: UVec2 = UVec2::new(1024, 768);
const FRAMES: usize = 9;

fn main() -> limpid::Result<()> {
    let gpu = Gpu::headless()?;
    println!("{}", gpu.adapter());
    for samples in [1, 4] {
        frame_times(&gpu, samples)?;
    }
    classification();
    Ok(())
}

fn frame_times(gpu: &Gpu, samples: u32) -> limpid::Result<()> {
    let input = Input::demo(&[format!("refract.samples={samples}")])?;
    let (input, scene) = input.settle(&[])?;
    let frame = &input.sequence.frames[0];
    let loaded = input.load(frame, &scene)?;
    let camera = scene.camera_for(loaded.bounds);
    let mut renderer = Renderer::new(gpu);
    renderer.timing = true;
    let picture = Picture::new(gpu, SIZE)?;
    let mut draw = || {
        let splats = &loaded.splats;
        renderer.render(&scene, &camera, splats, &picture.view(), Picture::FORMAT, SIZE)
    };
    // The first frame also compiles shaders.
    draw()?;
    let frames = (0..FRAMES).map(|_| draw()).collect::<limpid::Result<Vec<_>>>()?;
    println!("\ndemo, {} particles, {SIZE}, {samples} samples per pixel", loaded.particles);
    for (i, pass) in frames[0].iter().enumerate() {
        report(pass.name, frames.iter().map(|passes| passes[i].ms).collect());
    }
    report("all passes", frames.iter().map(|f| f.iter().map(|pass| pass.ms).sum()).collect());
    Ok(())
}

/// A block of 125,000 particles on a shaken lattice.
fn classification() {
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state as f32 / u32::MAX as f32 - 0.5
    };
    let cell = |i: usize| Vec3::new((i % 50) as f32, (i / 50 % 50) as f32, (i / 2500) as f32);
    let positions = (0..125_000)
        .map(|i| 0.05 * (cell(i) + 0.4 * Vec3::new(random(), random(), random())))
        .collect();
    let particles = Particles::from_positions(positions);
    let settings = Settings::default().classify;
    let times = (0..FRAMES)
        .map(|_| {
            let start = Instant::now();
            std::hint::black_box(classify::classify(&particles, 0.025, &settings));
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    println!("\nclassification, 125,000 particles, {} threads", rayon::current_num_threads());
    report("classify", times);
}

fn report(name: &str, mut ms: Vec<f64>) {
    ms.sort_by(f64::total_cmp);
    let (least, middle, most) = (ms[0], ms[ms.len() / 2], ms[ms.len() - 1]);
    println!("{name:>16} {middle:9.2} ms   {least:.2} to {most:.2}");
}
