//! `limpid render`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use glam::UVec2;
use indicatif::{ProgressBar, ProgressStyle};
use limpid::aov::{self, Aov};
use limpid::frames::{FrameSpec, Shard};
use limpid::gpu::{Gpu, PassTime};
use limpid::input::{Input, Missing, Moment};
use limpid::output::{self, OutputNames};
use limpid::ring::Ring;
use limpid::scene::Scene;
use limpid::settings::Preset;
use limpid::studio::Studio;
use serde::Serialize;

/// One argument, not one per value as clap would read a `Vec`.
type AovList = Vec<Aov>;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// A scene or recipe (.toml), a particle file, a pattern such as frame_{}.bgeo, or a folder; without
    /// one, the built-in demo.
    input: Option<String>,
    /// Draw the input's particles in this scene.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// The picture; of several frames a name with a place for the number (####, {}, %04d, $F4),
    /// or a folder [default: limpid.png, limpid_####.png].
    #[arg(short, long)]
    output: Option<String>,
    /// Width and height in pixels.
    #[arg(long, default_value = "1024x768", value_parser = parse_size)]
    size: UVec2,
    /// Frames: 1-3,5, 7-20:2, 1-10@b, all [default: the scene's frame, or all].
    #[arg(long, allow_hyphen_values = true)]
    frames: Option<FrameSpec>,
    /// What stands for a frame that is not there: error, empty or hold (the last one before).
    #[arg(long, default_value = "error")]
    missing: Missing,
    /// Memory for frames that are loaded ahead, MiB.
    #[arg(long, default_value = "1024", value_name = "MIB", value_parser = clap::value_parser!(u64).range(..1 << 40))]
    memory: u64,
    /// One share of the frames, I/N with I from 1.
    #[arg(long)]
    shard: Option<Shard>,
    /// Leave frames alone whose picture exists in this size.
    #[arg(long)]
    skip_existing: bool,
    /// Rays per pixel: 1 to look, 4 for final frames.
    #[arg(long)]
    samples: Option<u32>,
    /// Particle radius in metres, where the files have none.
    #[arg(long)]
    radius: Option<f32>,
    /// Draw by a published method: limpid, imai2014, imai2016 or mayer2026. Replaces the scene's
    /// settings, all but the tone mapping; --set comes after.
    #[arg(long, value_name = "NAME")]
    preset: Option<Preset>,
    /// Replace a setting: refract.solver=march.
    #[arg(long, value_name = "PASS.NAME=VALUE")]
    set: Vec<String>,
    /// Write intermediate images beside each picture, as NAME.aov.exr: a list, or all.
    #[arg(long, value_name = "LIST", value_parser = aov::parse_list)]
    aov: Option<AovList>,
    /// Write adapter, counts and milliseconds per pass.
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

#[derive(Serialize)]
struct Stats {
    adapter: String,
    frames: Vec<FrameStats>,
}

#[derive(Serialize)]
struct FrameStats {
    frame: i64,
    particles: usize,
    splashes: usize,
    passes: Vec<PassTime>,
    total_ms: f64,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    // In this order: what comes later holds.
    let mut overrides = Vec::from_iter(args.preset.map(|preset| format!("preset={preset}")));
    overrides.extend_from_slice(&args.set);
    overrides.extend(args.samples.map(|samples| format!("refract.samples={samples}")));
    let mut input = open(args, &overrides)?;
    input.missing = args.missing;
    let (input, scene) = input.settle(&overrides)?;
    scene.check()?;
    let frames = choose(args, &input)?;
    let names = {
        let default = if frames.len() == 1 { "limpid.png" } else { "limpid_####.png" };
        OutputNames::parse(args.output.as_deref().unwrap_or(default), frames.len())?
    };
    let todo: Vec<_> = frames
        .into_iter()
        .filter(|&number| !(args.skip_existing && exists(&names.path(number), args.size)))
        .map(Moment::at)
        .collect();
    let frames = todo.len();
    if todo.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }

    names.create_folder()?;
    let gpu = Gpu::headless()?;
    let mut studio = Studio::new(&gpu);
    studio.renderer.timing = args.stats.is_some();
    studio.renderer.diagnose = args.aov.is_some();
    let mut stats = Stats { adapter: gpu.adapter(), frames: Vec::new() };
    let bar = progress(todo.len());
    let ring = {
        let (input, scene, todo) = (input.clone(), scene.clone(), todo.clone());
        let workers = std::thread::available_parallelism().map_or(1, |n| n.get().min(todo.len()));
        let load = move |i: usize| input.load(todo[i], &scene);
        Ring::new(frames, args.memory << 20, workers, load, |_| ())
    };
    let drawn: limpid::Result<()> = todo.iter().enumerate().try_for_each(|(i, &moment)| {
        let loaded = ring.wait(i)?;
        let camera = scene.camera_for(loaded.bounds);
        let shot = studio.draw(&scene, &camera, &loaded.splats, args.size)?;
        let path = names.path(moment.frame);
        if let Some(chosen) = &args.aov {
            aov::write(&aov_path(&path), studio.images(chosen)?)?;
        }
        // The picture last: where it exists, all that belongs to it does.
        output::write_png(&path, &shot.picture)?;
        stats.frames.push(FrameStats {
            frame: moment.frame,
            particles: loaded.particles,
            splashes: loaded.splats.splashes.len(),
            total_ms: shot.passes.iter().map(|pass| pass.ms).sum(),
            passes: shot.passes,
        });
        bar.inc(1);
        Ok(())
    });
    bar.finish_and_clear();
    if let Some(path) = &args.stats {
        let text = serde_json::to_string_pretty(&stats)?;
        output::write_atomically(path, |file| std::io::Write::write_all(file, text.as_bytes()))?;
    }
    drawn?;
    Ok(ExitCode::SUCCESS)
}

fn open(args: &Args, overrides: &[String]) -> limpid::Result<Input> {
    let mut input = match &args.input {
        Some(input) => Input::open(input, overrides)?,
        None => Input::demo(overrides)?,
    };
    if let Some(scene) = &args.scene {
        input = input.with_scene(Scene::load_with(scene, overrides)?);
    }
    match args.radius {
        Some(radius) => input.with_radius(radius),
        None => Ok(input),
    }
}

fn choose(args: &Args, input: &Input) -> limpid::Result<Vec<i64>> {
    let spec = match (&args.frames, input.frame) {
        (Some(spec), _) => spec.clone(),
        (None, Some(frame)) => FrameSpec::List(vec![frame]),
        (None, None) => FrameSpec::All,
    };
    let frames = spec.numbers(&input.sequence, input.missing)?;
    Ok(args.shard.unwrap_or_default().of(frames).collect())
}

/// Whether the picture is there, whole and in this size.
fn exists(path: &Path, size: UVec2) -> bool {
    limpid::compare::load_picture(path).is_ok_and(|picture| picture.dimensions() == size.into())
}

/// `frame_0020.aov.exr` for `frame_0020.png`; any other ending stays, it may be the number.
fn aov_path(picture: &Path) -> PathBuf {
    let name = picture.to_string_lossy();
    format!("{}.aov.exr", name.strip_suffix(".png").unwrap_or(&name)).into()
}

/// Hidden unless standard error is a terminal.
fn progress(frames: usize) -> ProgressBar {
    let bar = if frames > 1 { ProgressBar::new(frames as u64) } else { ProgressBar::hidden() };
    let template = "{bar:40} {pos}/{len} frames, {per_sec}, {eta} left";
    bar.with_style(ProgressStyle::with_template(template).expect("the template is valid"))
}

fn parse_size(text: &str) -> Result<UVec2, String> {
    let parse = || {
        let (width, height) = text.split_once(['x', 'X'])?;
        Some(UVec2::new(width.parse().ok()?, height.parse().ok()?))
    };
    parse().filter(|size| size.min_element() > 0).ok_or("expected WIDTHxHEIGHT, as 1024x768".into())
}
