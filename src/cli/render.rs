//! `limpid render`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::UVec2;
use indicatif::{ProgressBar, ProgressStyle};
use limpid::Error;
use limpid::aov::{self, Aov};
use limpid::camera::Camera;
use limpid::camera_path::CameraPath;
use limpid::film::{self, Film, Motion, Take};
use limpid::frames::{FrameSpec, Shard};
use limpid::gpu::{Gpu, PassTime};
use limpid::input::{Input, Missing, Moment};
use limpid::output::{self, OutputNames};
use limpid::ring::Ring;
use limpid::scene::Scene;
use limpid::settings::Preset;
use limpid::studio::Studio;
use serde::Serialize;

/// The exit code of what Ctrl-C ends, as shells have it.
const INTERRUPTED_CODE: u8 = 130;

/// Set when the user wants a film to end: it must not stay behind half-written.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

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
    /// or a folder [default: limpid.png, limpid_####.png]. A film of them ends in .mp4 or .webm,
    /// which need ffmpeg, or in .gif or .apng.
    #[arg(short, long)]
    output: Option<String>,
    /// Width and height in pixels.
    #[arg(long, default_value = "1024x768", value_parser = parse_size)]
    size: UVec2,
    /// Frames: 1-3,5, 7-20:2, 1-10@b, all [default: the scene's frame, or all].
    #[arg(long, allow_hyphen_values = true)]
    frames: Option<FrameSpec>,
    /// One moment at this time, in frames: 12.25 is a quarter of the way from 12 to 13.
    #[arg(long, allow_hyphen_values = true, value_name = "TIME")]
    at: Option<f64>,
    /// Where it is seen from, m and degrees: `eye=1,2,3 target=0,0,0 fov_y=40`, and where wanted
    /// up=0,1,0 and near=0.01 [default: the scene's camera].
    #[arg(long, allow_hyphen_values = true)]
    camera: Option<Camera>,
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
    /// Pictures per second, of a film and of the camera's movement [default: the sequence's frames
    /// per second if the scene says them, or 30].
    #[arg(long, value_name = "F")]
    fps: Option<f64>,
    /// Slow motion below 1, fast above. Between frames particles are interpolated by their ids and
    /// velocities.
    #[arg(long, value_name = "X")]
    speed: Option<f64>,
    /// Move the camera along the keys of a file; of one frame of particles, for as long as they
    /// last.
    #[arg(long, value_name = "FILE.toml", conflicts_with = "turntable")]
    camera_path: Option<PathBuf>,
    /// Move the camera around its target, a full turn in so many seconds.
    #[arg(long, value_name = "SECONDS")]
    turntable: Option<f64>,
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
    /// Replace a setting: refract.solver=march; or the liquid: liquid.ior=1.4,
    /// "liquid.absorption=[1, 0.3, 0.1]", "fluid.2.absorption=[0, 0, 5]".
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
    let (optics, set): (Vec<_>, Vec<_>) =
        args.set.iter().cloned().partition(|text| Scene::is_optics(text));
    overrides.extend(set);
    overrides.extend(args.samples.map(|samples| format!("refract.samples={samples}")));
    let mut input = open(args, &overrides)?;
    input.missing = args.missing;
    let (input, mut scene) = input.settle(&overrides)?;
    for text in &optics {
        scene.set_optics(text)?;
    }
    scene.camera = args.camera.or(scene.camera);
    scene.check()?;
    let (moments, numbers, fps) = moments(args, &input)?;
    let takes = takes(args, &scene, &numbers, fps)?;
    if film_path(args).is_some() {
        // Who asks twice does not want to wait for the picture that is being drawn.
        ctrlc::set_handler(|| {
            if INTERRUPTED.swap(true, Ordering::Relaxed) {
                std::process::exit(INTERRUPTED_CODE.into());
            }
        })?;
    }
    let mut output = Output::open(args, takes.len(), fps)?;
    let todo: Vec<_> = takes
        .into_iter()
        .filter(|take| !(args.skip_existing && exists(&output.path(take), args.size)))
        .collect();
    if todo.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }

    output.create_folder()?;
    let gpu = Gpu::headless()?;
    let mut studio = Studio::new(&gpu);
    studio.renderer.timing = args.stats.is_some();
    studio.renderer.diagnose = args.aov.is_some();
    let mut stats = Stats { adapter: gpu.adapter(), frames: Vec::new() };
    let bar = progress(todo.len());
    // Pictures of the same particles, one after the other, share their loading.
    let runs: Vec<_> = todo.chunk_by(|a, b| a.frame == b.frame).collect();
    let ring = {
        let loading: Vec<Moment> = runs.iter().map(|run| moments[run[0].frame]).collect();
        let workers = std::thread::available_parallelism().map_or(1, |n| n.get().min(runs.len()));
        let (input, scene) = (input, scene.clone());
        let load = move |i: usize| input.load(loading[i], &scene);
        Ring::new(runs.len(), args.memory << 20, workers, load, |_| ())
    };
    let mut draw = |i: usize, take: &Take| -> limpid::Result<()> {
        let loaded = ring.wait(i)?;
        let shot = studio.draw(&scene, &take.camera, &loaded.splats, args.size)?;
        if let Some(chosen) = &args.aov {
            aov::write(&aov_path(&output.path(take)), studio.images(chosen)?)?;
        }
        // The picture last: where it exists, all that belongs to it does.
        output.write(take, &shot.picture)?;
        stats.frames.push(FrameStats {
            frame: take.number,
            particles: loaded.particles,
            splashes: loaded.splats.splashes.len(),
            total_ms: shot.passes.iter().map(|pass| pass.ms).sum(),
            passes: shot.passes,
        });
        bar.inc(1);
        Ok(())
    };
    let mut drawing = runs.iter().enumerate().flat_map(|(i, run)| run.iter().map(move |t| (i, t)));
    let drawn = drawing.try_for_each(|(i, take)| draw(i, take));
    bar.finish_and_clear();
    if let Some(path) = &args.stats {
        let text = serde_json::to_string_pretty(&stats)?;
        output::write_atomically(path, |file| std::io::Write::write_all(file, text.as_bytes()))?;
    }
    if INTERRUPTED.load(Ordering::Relaxed) {
        return Ok(ExitCode::from(INTERRUPTED_CODE));
    }
    drawn?;
    output.finish()?;
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

/// What is drawn of the particles, how its pictures are numbered, and how many there are a second.
///
/// Frames as they are, unless the film's time is another than the sequence's: then moments at equal
/// steps, which are counted from 1.
fn moments(args: &Args, input: &Input) -> limpid::Result<(Vec<Moment>, Vec<i64>, f64)> {
    let spec = match (&args.frames, input.frame) {
        (Some(spec), _) => spec.clone(),
        (None, Some(frame)) => FrameSpec::List(vec![frame]),
        (None, None) => FrameSpec::All,
    };
    let mut frames = spec.numbers(&input.sequence, input.missing)?;
    let fps = args.fps.or(input.fps()).unwrap_or(30.0);
    if let Some(time) = args.at {
        frames.sort_unstable();
        let moment = input.moment(&frames, time);
        return Ok((vec![moment], vec![moment.frame], fps));
    }
    let speed = args.speed.unwrap_or(1.0);
    if !(1e-3..=1e3).contains(&speed) {
        return Err(Error::Usage(format!("--speed {speed}: 0.001 to 1000 expected")));
    }
    let step = speed * input.fps().unwrap_or(fps) / fps;
    if step == 1.0 || frames.len() == 1 {
        return Ok((frames.iter().copied().map(Moment::at).collect(), frames, fps));
    }
    if !frames.is_sorted() {
        let problem = "--frames: slow and fast motion takes the frames in order, as 1-9 or 1,5,9";
        return Err(Error::Usage(problem.into()));
    }
    let moments = input.moments(&frames, step);
    let numbers = (1..=moments.len() as i64).collect();
    Ok((moments, numbers, fps))
}

/// The pictures to draw: this machine's share, from where the camera is.
fn takes(args: &Args, scene: &Scene, numbers: &[i64], fps: f64) -> limpid::Result<Vec<Take>> {
    let motion = match (&args.camera_path, args.turntable) {
        (Some(path), _) => Motion::Path(CameraPath::load(path)?),
        (None, Some(seconds)) => Motion::Turntable(seconds),
        (None, None) => Motion::Still,
    };
    if (motion != Motion::Still || film_path(args).is_some()) && !numbers.is_sorted() {
        let problem = "a film and a moving camera take the frames in order, as 1-9 or 1,5,9";
        return Err(Error::Usage(format!("--frames: {problem}")));
    }
    let camera = scene.camera.expect("a settled scene has a camera");
    let takes = film::takes(numbers, camera, &motion, fps)?;
    Ok(args.shard.unwrap_or_default().of(takes).collect())
}

/// The file that `-o` names, if it is a film's.
fn film_path(args: &Args) -> Option<&Path> {
    let path = Path::new(args.output.as_ref()?);
    film::Kind::of(path).filter(|_| !path.is_dir()).map(|_| path)
}

/// Where the pictures go.
enum Output {
    Pictures(OutputNames),
    Film(Box<Film>),
}

impl Output {
    fn open(args: &Args, count: usize, fps: f64) -> limpid::Result<Self> {
        let Some(path) = film_path(args) else {
            let default = if count == 1 { "limpid.png" } else { "limpid_####.png" };
            let names = OutputNames::parse(args.output.as_deref().unwrap_or(default), count)?;
            return Ok(Self::Pictures(names));
        };
        let name = path.display();
        let refuse = |problem: &str| Err(Error::Usage(format!("{name}: {problem}")));
        // Only a name with a place for the number is good for two.
        if OutputNames::parse(&name.to_string(), 2).is_ok() {
            return refuse("a film is one file; leave the place for the number out");
        }
        if args.shard.is_some() {
            return refuse("--shard shares pictures out, and a film needs them all; write .png");
        }
        if args.skip_existing {
            return refuse("--skip-existing completes pictures; a film is written whole");
        }
        if args.aov.is_some() {
            return refuse("--aov goes beside pictures; write .png");
        }
        Film::create(path, args.size, fps).map(|film| Self::Film(Box::new(film)))
    }

    fn create_folder(&self) -> limpid::Result<()> {
        match self {
            Self::Pictures(names) => names.create_folder(),
            Self::Film(_) => Ok(()),
        }
    }

    /// The file that shows it.
    fn path(&self, take: &Take) -> PathBuf {
        match self {
            Self::Pictures(names) => names.path(take.number),
            Self::Film(film) => film.path().to_owned(),
        }
    }

    fn write(&mut self, take: &Take, picture: &image::RgbImage) -> limpid::Result<()> {
        match self {
            Self::Pictures(names) => output::write_png(&names.path(take.number), picture),
            Self::Film(_) if INTERRUPTED.load(Ordering::Relaxed) => {
                Err(Error::Usage("interrupted".into()))
            }
            Self::Film(film) => film.push(picture),
        }
    }

    fn finish(self) -> limpid::Result<()> {
        match self {
            Self::Pictures(_) => Ok(()),
            Self::Film(film) => film.finish(),
        }
    }
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
pub(super) fn progress(frames: usize) -> ProgressBar {
    let bar = if frames > 1 { ProgressBar::new(frames as u64) } else { ProgressBar::hidden() };
    let template = "{bar:40} {pos}/{len} frames, {per_sec}, {eta} left";
    bar.with_style(ProgressStyle::with_template(template).expect("the template is valid"))
}

pub(crate) fn parse_size(text: &str) -> Result<UVec2, String> {
    let parse = || {
        let (width, height) = text.split_once(['x', 'X'])?;
        Some(UVec2::new(width.parse().ok()?, height.parse().ok()?))
    };
    parse().filter(|size| size.min_element() > 0).ok_or("expected WIDTHxHEIGHT, as 1024x768".into())
}
