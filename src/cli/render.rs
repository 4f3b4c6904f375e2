//! `limpid render`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use glam::UVec2;
use indicatif::{ProgressBar, ProgressStyle};
use limpid::aov::{self, Aov};
use limpid::frames::{FrameSpec, Shard};
use limpid::gpu::{Gpu, PassTime};
use limpid::input::{Input, Loaded};
use limpid::output::{self, OutputNames};
use limpid::renderer::{Picture, Renderer};
use limpid::scene::Scene;
use limpid::sequence;
use limpid::settings::Preset;
use serde::Serialize;

/// Frames read and classified before they are drawn.
const AHEAD: usize = 2;

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
    let (input, scene) = open(args, &overrides)?.settle(&overrides)?;
    scene.check()?;
    let frames = choose(args, &input)?;
    let names = {
        let default = if frames.len() == 1 { "limpid.png" } else { "limpid_####.png" };
        OutputNames::parse(args.output.as_deref().unwrap_or(default), frames.len())?
    };
    let todo: Vec<_> = frames
        .into_iter()
        .filter(|frame| !(args.skip_existing && exists(&names.path(frame.number), args.size)))
        .collect();
    if todo.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }

    names.create_folder()?;
    let gpu = Gpu::headless()?;
    let mut renderer = Renderer::new(&gpu);
    renderer.timing = args.stats.is_some();
    renderer.diagnose = args.aov.is_some();
    let picture = Picture::new(&gpu, args.size)?;
    let mut stats = Stats { adapter: gpu.adapter(), frames: Vec::new() };
    let bar = progress(todo.len());
    let drawn = input.for_each_loaded(&todo, &scene, AHEAD, |loaded| {
        let times = draw(&mut renderer, &scene, &loaded, &picture, args.size)?;
        let path = names.path(loaded.number);
        if let Some(chosen) = &args.aov {
            aov::write(&aov_path(&path), aov::read(&gpu, &renderer.images(), chosen)?)?;
        }
        // The picture last: where it exists, all that belongs to it does.
        let rgb = image::DynamicImage::ImageRgba8(picture.read(&gpu)?).into_rgb8();
        output::write_png(&path, &rgb)?;
        stats.frames.push(FrameStats {
            frame: loaded.number,
            particles: loaded.particles,
            splashes: loaded.splats.splashes.len(),
            total_ms: times.iter().map(|pass| pass.ms).sum(),
            passes: times,
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

fn choose<'a>(args: &Args, input: &'a Input) -> limpid::Result<Vec<&'a sequence::Frame>> {
    let spec = match (&args.frames, input.frame) {
        (Some(spec), _) => spec.clone(),
        (None, Some(frame)) => FrameSpec::List(vec![frame]),
        (None, None) => FrameSpec::All,
    };
    let frames = spec.select(&input.sequence)?;
    Ok(args.shard.unwrap_or_default().of(frames).collect())
}

fn draw(
    renderer: &mut Renderer,
    scene: &Scene,
    loaded: &Loaded,
    picture: &Picture,
    size: UVec2,
) -> limpid::Result<Vec<PassTime>> {
    let camera = scene.camera_for(loaded.bounds);
    renderer.render(scene, &camera, &loaded.splats, &picture.view(), Picture::FORMAT, size)
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
