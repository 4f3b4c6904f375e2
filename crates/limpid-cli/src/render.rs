//! The command `limpid render`.

mod beside;
mod budget;
mod console;
mod loader;
mod manifest;
mod output;
mod pick;
mod plan;
mod queue;
mod writing;

use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::fingerprint::Fingerprints;
use glam::UVec2;
use image::GrayImage;
use limpid::Error::{Defect, DeviceLost};
use limpid::aov::{self, Aov, Part};
use limpid::camera::View;
use limpid::frame::FrameInput;
use limpid::gpu::PassTime;
use limpid::liquid::Up;
use limpid::motion::Motion;
use limpid::offscreen::{Offscreen, PendingFrame};
use limpid::scene::Scene;
use limpid::settings::Preset;
use limpid_io::Error;
use limpid_io::camera_axes::GivenCamera;
use limpid_io::claim::Claims;
use limpid_io::error::Category;
use limpid_io::film::{self, Shot};
use limpid_io::frames::{FrameSpec, Shard};
use limpid_io::input::{FrameTime, Loaded, Missing};
use limpid_io::notice::Notice;
use limpid_io::output::FileKind;
use limpid_io::overlay::Overlay;
use limpid_io::project::overrides;
use limpid_io::shared_classifier::SharedClassifier;
use serde::Serialize;

use crate::pipeline_cache;
use crate::signals;
use budget::{Budget, BudgetStats, total_ms};
use console::Console;
use loader::Loader;
use manifest::{Log, Manifest, Outcome, Status};
use output::Output;
use pick::Picked;
use plan::Plan;
use queue::{Job, Queue};
use writing::{DrawnPicture, Writing};

/// Exit code if some frames failed and others did not.
const FAILED_CODE: u8 = 1;

/// Number of consecutive failures of the device that ends the run.
const DEVICE_FAILURES: u32 = 3;

/// Alias that makes clap read the list as one argument; it would read a `Vec` as one per value.
type AovList = Vec<Aov>;

#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    inputs: crate::shared_args::Inputs,
    /// The input of `inputs`.
    #[arg(skip)]
    input: Option<PathBuf>,
    /// Further ones, with --beside.
    #[arg(skip)]
    others: Vec<PathBuf>,
    /// Render the input's particles in this scene.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// The picture: .png, .jpg, .webp, or .exr for linear radiance; for several frames a name with a
    /// placeholder for the number (####, {}, %04d, $F4), or a folder [default: limpid.png,
    /// limpid_####.png]. Or a film: .mp4 or .webm, which need ffmpeg, .gif or .apng. - writes a PNG to
    /// standard output.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Width and height in pixels.
    #[arg(long, default_value = "1024x768", value_parser = crate::shared_args::parse_size)]
    size: UVec2,
    /// Frames: 1-3,5, 1-10x2 (also 1-10:2), 10-1, -5..-1, 1-10@b, all; of files numbered by steps, those in the
    /// range [default: the scene's frame, or all].
    #[arg(long, allow_hyphen_values = true)]
    frames: Option<FrameSpec>,
    /// A single picture at this time, in frames: 12.25 is a quarter of the way from 12 to 13.
    #[arg(long, allow_hyphen_values = true, value_name = "TIME", value_parser = parse_time)]
    at: Option<f64>,
    /// The camera, in the axes of the particle files, in metres and degrees: `eye=1,2,3 target=0,0,0 fov_y=40`,
    /// optionally up=0,1,0 and near=0.01; `height=METRES` in place of `fov_y` for parallel rays [default: the scene's
    /// camera].
    #[arg(long, allow_hyphen_values = true, conflicts_with = "camera_path")]
    camera: Option<GivenCamera>,
    /// The axis that points up where the camera's numbers count, y or z, whether of --camera, --camera-path or
    /// the scene [default: that of the particle files].
    #[arg(long, value_name = "AXIS", value_parser = crate::shared_args::parse_up)]
    camera_up: Option<Up>,
    /// Treatment of frames that are missing or cannot be read: error, empty, or hold (repeat the frame before).
    #[arg(long, default_value = "error")]
    missing: Missing,
    /// Memory for frames loaded ahead, MiB.
    #[arg(long, default_value = "1024", value_name = "MIB", value_parser = clap::value_parser!(u64).range(..1 << 40))]
    memory: u64,
    #[command(flatten)]
    reading: crate::shared_args::Reading,
    /// Render only share I of N of the frames: I/N, with I from 1.
    #[arg(long)]
    shard: Option<Shard>,
    /// Skip frames whose picture is complete and was made from the same particles with the same
    /// settings, size and version.
    #[arg(long)]
    skip_existing: bool,
    /// Share the frames with all processes started with this option, on any machine that has the
    /// output folder: each renders frames that no other has claimed. Skips existing pictures.
    #[arg(long)]
    claim: bool,
    /// Take over claims that were not renewed for this long: their process has died or lost access.
    #[arg(long, value_name = "SECONDS", default_value = "120", requires = "claim", value_parser = clap::value_parser!(u64).range(1..=1 << 32))]
    claim_timeout: u64,
    /// Continue with the other frames if one fails; the exit code is then 1. A film repeats the picture before.
    #[arg(long)]
    keep_going: bool,
    /// Append a line of JSON for each frame to a file, which several processes may share.
    #[arg(long, value_name = "FILE.jsonl")]
    manifest: Option<PathBuf>,
    /// Pictures per second of a film and of the camera's motion [default: the sequence's frames per
    /// second if the scene has them, or 30].
    #[arg(long, value_name = "F")]
    fps: Option<f64>,
    /// Playback speed: slow motion below 1, fast motion above. Particles are interpolated between
    /// frames by their ids and velocities.
    #[arg(long, value_name = "X")]
    speed: Option<f64>,
    /// Move the camera along the keys in a file; a single frame of particles is shown for their
    /// duration.
    #[arg(long, value_name = "FILE.toml", conflicts_with = "turntable")]
    camera_path: Option<PathBuf>,
    /// Rotate the camera about its target, with this duration of a full turn.
    #[arg(long, value_name = "SECONDS")]
    turntable: Option<f64>,
    /// Draw a frame from each camera of a file, the keys of a camera path, whose times do not count: its particles are
    /// classified once.
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["turntable", "camera_path", "camera"])]
    views: Option<PathBuf>,
    /// Rays per pixel: 1 for previews, 4 for final frames.
    #[arg(long)]
    samples: Option<u32>,
    /// Particle radius in metres, if the files have none.
    #[arg(long)]
    radius: Option<f32>,
    /// Use a published method: limpid, imai2014, imai2016 or mayer2026. Replaces the scene's settings
    /// except caustics and tone mapping; --set is applied afterwards.
    #[arg(long, value_name = "NAME", value_parser = overrides::preset)]
    preset: Option<Preset>,
    #[command(flatten)]
    changes: crate::shared_args::SceneChanges,
    /// Replace a setting (`limpid settings` lists them): refract.solver=march; or the liquid: liquid.ior=1.4,
    /// "liquid.absorption=[1, 0.3, 0.1]", "fluid.2.absorption=[0, 0, 5]".
    #[arg(long, value_name = "PASS.NAME=VALUE")]
    set: Vec<String>,
    /// Pick the fastest intersector whose hits have at most this RMS error in pixels, where a miss
    /// counts as 10; the most accurate of equally fast ones. All other settings stay. What each costs is
    /// measured once for an adapter and a size, and the choice reported. Not for frames shared by
    /// several machines, whose choices may differ.
    #[arg(long, value_name = "PX", value_parser = pick::parse_limit, conflicts_with_all = ["shard", "claim", "skip_existing"])]
    max_error: Option<f64>,
    /// Draw the best picture within this device time per frame, in ms: chooses intersector, rays,
    /// bounces, smoothing and intervals for each frame by the times of those before, and reports
    /// the first choice and how many frames took longer. Not for frames shared by several machines.
    #[arg(long, value_name = "MS", value_parser = pick::parse_limit, conflicts_with_all = ["shard", "claim", "skip_existing"])]
    budget: Option<f64>,
    /// Measure anew what settings cost, for --max-error or --budget.
    #[arg(long)]
    calibrate: bool,
    /// Write coverage as alpha: only liquid and solids cover a pixel, not the environment. For .png,
    /// .webp and .exr.
    #[arg(long)]
    alpha: bool,
    /// Draw several inputs beside each other, with one camera, one scale and one clock, and their names below.
    #[arg(long, conflicts_with_all = ["merge", "shard", "claim", "skip_existing", "keep_going", "manifest", "aov", "max_error", "budget", "calibrate", "stats"])]
    beside: bool,
    /// Draw a bar of a round length, which holds at the depth of the liquid's middle, over the picture.
    #[arg(long)]
    scale_bar: bool,
    /// Draw the directions of the files' axes over the picture.
    #[arg(long)]
    axes: bool,
    /// Write intermediate images beside each picture, as NAME.aov.exr: a list, or all.
    #[arg(long, value_name = "LIST", value_parser = aov::parse_list)]
    aov: Option<AovList>,
    /// Write adapter, counts and milliseconds per pass to a file.
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
}

#[derive(Serialize)]
struct Stats {
    adapter: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    picked: Option<Picked>,
    #[serde(skip_serializing_if = "Option::is_none")]
    budget: Option<BudgetStats>,
    frames: Vec<FrameStats>,
}

#[derive(Serialize)]
struct FrameStats {
    frame: i64,
    /// With a budget, the settings that it was drawn with, in the form that `--set` accepts.
    #[serde(skip_serializing_if = "Option::is_none")]
    set: Option<Vec<String>>,
    particles: usize,
    splashes: usize,
    passes: Vec<PassTime>,
    total_ms: f64,
}

pub(crate) fn run(mut args: Args) -> anyhow::Result<u8> {
    if args.beside {
        return beside::run(args);
    }
    let (input, frames) = args.inputs.resolve()?;
    args.input = input;
    args.frames = args.frames.or(frames);
    let args = &args;
    let mut plan = Plan::new(args)?;
    output::check(args, &plan.shots)?;
    let pick = pick::pick(args, &mut plan)?;
    let (picked, opened, budget) = match pick {
        Some(pick) => (Some(pick.picked), Some(pick.opened), pick.budget),
        None => (None, None, None),
    };
    let Plan { input, scene, frame_times, shots, fps, notices, camera_up, overlay } = plan;
    let stride = input.sequence.stride() as f64;
    let rate = stride * input.fps().unwrap_or(fps);
    let frozen = frame_times.len() == 1 && shots.len() > 1;
    // After a signal the current frame is finished, or the unfinished film removed.
    signals::finish_first();
    let output = Output::open(args, shots.len(), fps)?;
    let pictures = output.pictures().cloned();
    // Computed before loading: a file that changes later must not match the picture.
    let moves = args.aov.iter().flatten().any(|aov| matches!(aov, Aov::Motion)).then_some(rate);
    let fingerprints = Fingerprints::new(&input, &frame_times, &scene, args.size, moves);
    let fingerprints = fingerprints.under(&overlay);
    let host = gethostname::gethostname().to_string_lossy().into_owned();
    let claims = pictures.clone().filter(|_| args.claim).map(|pictures| {
        let version = env!("CARGO_PKG_VERSION");
        let owner = format!("limpid {version} on {host}, process {}\n", std::process::id());
        (Claims::new(owner, Duration::from_secs(args.claim_timeout)), pictures)
    });
    let manifest = args.manifest.as_deref().map(|path| Manifest::open(path, host)).transpose()?;
    let keep_going = args.keep_going;
    let bar = crate::terminal::progress(shots.len());
    let mut console = Console::new(bar.clone());
    notices.iter().for_each(|notice| console.notice(notice));
    if output.is_linear() && overlay != Overlay::default() {
        console.line("--scale-bar and --axes are not drawn in an .exr, which holds light");
    }
    let mut log = Log { manifest, pictures, bar, keep_going, failed: Vec::new() };
    let shots: Vec<_> = args.shard.unwrap_or_default().of(shots).collect();
    let requested = shots.len();
    let mut queue = Queue::new(shots, fingerprints.clone(), claims);
    if args.skip_existing || args.claim {
        queue.skip(&mut log)?;
    }
    if queue.is_empty() && requested == 0 {
        console.line("there are no pictures in this share of the frames");
        return Ok(crate::SUCCESS);
    }
    if queue.is_empty() {
        let existing = requested - log.failed.len();
        console.line(&format!("{existing} of {requested} pictures already exist"));
        return Ok(exit_code(log.failed, requested, ""));
    }
    log.bar.set_length(queue.len() as u64);

    // With claims nothing is loaded ahead, since other processes may draw the next frames.
    let memory = if args.claim { 0 } else { args.memory << 20 };
    let classifier = SharedClassifier::awaited();
    let loader = Loader::new(input, classifier, &scene, &frame_times, queue.pending(), memory);
    // The loader reads particles while the adapter is opened.
    let opened = opened.map_or_else(pipeline_cache::open_adapter, Ok);
    loader.classifier().set(opened.as_ref().ok().map(|(gpu, _)| gpu));
    let (gpu, cache) = opened?;
    let clock = Clock { times: frame_times, rate, stride, frozen };
    let (budget, offscreen) = match budget {
        Some((budget, offscreen)) => (Some(budget), offscreen),
        None => (None, Offscreen::new(&gpu)),
    };
    let mut frame_loop = FrameLoop {
        args,
        scene,
        camera_up,
        offscreen,
        budget,
        fingerprints,
        clock,
        classifier: loader.classifier().clone(),
        most_writing: writing::most(args, &output),
        output,
        writing: VecDeque::new(),
        overlay,
        stats: Stats { adapter: gpu.adapter(), picked, budget: None, frames: Vec::new() },
        console,
        failures: 0,
        since: Instant::now(),
    };
    let drawn = draw_all(&mut frame_loop, &mut queue, &loader, &mut log);
    // After a failure too, files that were begun become whole.
    for Written { picture, .. } in frame_loop.writing.drain(..) {
        drop(picture.and_then(|(_, writing)| writing.wait()));
    }
    log.bar.finish_and_clear();
    if let Some(cache) = cache {
        cache.save();
    }
    frame_loop.stats.budget = frame_loop.budget.as_ref().map(Budget::stats);
    if let Some(path) = &args.stats {
        let text = serde_json::to_string_pretty(&frame_loop.stats)?;
        let write = |file: &mut BufWriter<&File>| file.write_all(text.as_bytes());
        limpid_io::output::write_atomically(path, FileKind::MEASUREMENTS, write)?;
    }
    drawn?;
    if let Some(code) = signals::received().filter(|_| !queue.is_empty()) {
        return Ok(code);
    }
    let FrameLoop { output, stats, console, budget, .. } = frame_loop;
    let failed = log.failed;
    let mut numbers: Vec<i64> = stats.frames.iter().map(|frame| frame.frame).collect();
    let others = requested.saturating_sub(numbers.len() + failed.len());
    let is_film = output.is_film() && !numbers.is_empty();
    if is_film {
        // The film has pictures in their place.
        numbers.extend(&failed);
    }
    let summary = output.summary(&numbers, others);
    output.finish()?;
    console.end();
    console.line(&summary);
    if let Some(remark) = budget.and_then(|budget| budget.remark()) {
        console.line(&remark);
    }
    let all = failed.len() + stats.frames.len();
    Ok(exit_code(
        failed,
        all,
        if is_film { "; the film repeats the pictures before them" } else { "" },
    ))
}

/// The exit code of a run of `all` frames; prints a line on those that failed, with what was done about them.
fn exit_code(failed: Vec<i64>, all: usize, done: &str) -> u8 {
    if failed.is_empty() {
        return crate::SUCCESS;
    }
    crate::terminal::warn(format!(
        "{} of {all} frames failed: {}{done}",
        failed.len(),
        FrameSpec::list(failed)
    ));
    FAILED_CODE
}

/// Draws the pictures of the queue until it is empty or a signal has been received. While the device
/// draws a picture, previous ones are written, and the particles of the next are loaded and uploaded.
fn draw_all(
    frame_loop: &mut FrameLoop<'_>,
    queue: &mut Queue,
    loader: &Loader,
    log: &mut Log,
) -> limpid_io::Result<()> {
    let mut previous = None;
    let mut next = queue.next(log)?;
    while let Some(mut job) = next {
        // The previous picture does not wait for particles that are still being loaded.
        if !loader.has(&job.shot)
            && let Some((job, in_flight)) = previous.take()
        {
            frame_loop.conclude(job, in_flight, log)?;
        }
        let in_flight = loader.wait(&job.shot).map(|loaded| frame_loop.begin(&mut job, loaded));
        if let Some((job, in_flight)) = previous.take() {
            frame_loop.conclude(job, in_flight, log)?;
        }
        // After the previous claim is released: a process holds at most two.
        next = queue.next_free(log)?;
        if let Some(next) = &next {
            loader.aim(&next.shot, &job.shot);
        }
        previous = Some((job, in_flight));
        let interrupted = signals::received().is_some();
        if interrupted || next.is_none() {
            if let Some((job, in_flight)) = previous.take() {
                frame_loop.conclude(job, in_flight, log)?;
            }
            frame_loop.settle(0, log)?;
        }
        if interrupted {
            queue.give_back(next);
            return Ok(());
        }
        if next.is_none() {
            next = queue.next(log)?;
            frame_loop.since = Instant::now();
        }
    }
    Ok(())
}

/// A picture being drawn.
struct FrameInFlight {
    loaded: Arc<Loaded>,
    drawing: limpid_io::Result<Submitted>,
}

/// A submitted frame, and the images read back already.
struct Submitted {
    drawing: PendingFrame,
    /// With a budget, the number of its settings.
    rung: Option<usize>,
    /// Intermediate images.
    images: Vec<Part>,
    /// The linear picture, if it is written.
    radiance: Option<Part>,
}

/// A picture that was drawn and is being written, or why there is none.
struct Written {
    job: Job,
    /// Time from the picture before to this one, ms.
    ms: f64,
    picture: limpid_io::Result<(FrameStats, Writing)>,
}

/// The times at which particles are drawn.
struct Clock {
    times: Vec<FrameTime>,
    /// Frame numbers per second.
    rate: f64,
    /// Frame numbers per frame: a simulator may count its time steps.
    stride: f64,
    /// Several pictures show one frame.
    frozen: bool,
}

/// The state of the render loop.
struct FrameLoop<'a> {
    args: &'a Args,
    scene: Scene,
    /// The axis that points up where the camera was given.
    camera_up: Up,
    offscreen: Offscreen,
    /// Chooses the settings of each picture.
    budget: Option<Budget>,
    /// Those of the pictures with the scene's first settings.
    fingerprints: Fingerprints,
    clock: Clock,
    /// Classifies the particles.
    classifier: SharedClassifier,
    output: Output,
    /// Pictures that are being written, in order, and the most that there may be.
    writing: VecDeque<Written>,
    most_writing: usize,
    /// Scale bar and axes of the pictures.
    overlay: Overlay,
    stats: Stats,
    console: Console,
    /// Number of consecutive failures of the device.
    failures: u32,
    /// End of the last picture, or of the wait for other processes.
    since: Instant,
}

impl FrameLoop<'_> {
    /// Submits the drawing of a picture.
    fn begin(&mut self, job: &mut Job, loaded: Arc<Loaded>) -> FrameInFlight {
        let view = (&job.shot.camera, self.args.size);
        self.console.frame(&loaded, &self.scene, view, self.camera_up, &self.stats.adapter);
        let drawing = self.begin_drawing(job, &loaded);
        FrameInFlight { loaded, drawing }
    }

    fn begin_drawing(&mut self, job: &mut Job, loaded: &Loaded) -> limpid_io::Result<Submitted> {
        let motion = self.motion(job, loaded);
        let at_rest = self.clock.times.len() == 1;
        let Self { args, scene, offscreen, output, console, budget, fingerprints, .. } = self;
        let chosen = args.aov.as_deref().unwrap_or_default();
        let interface =
            |aov: &Aov| aov.is_for_compositing() || matches!(aov, Aov::Depth | Aov::Normal);
        let rung = budget.as_ref().map(Budget::rung);
        if let Some(budget) = budget {
            scene.settings = budget.settings().clone();
            job.fingerprint = budget.fingerprints(fingerprints, scene, args.size).of(&job.shot);
        }
        let scene = loaded.scene(scene);
        let input = FrameInput {
            surface: chosen.iter().any(interface).then_some(&motion),
            diagnose: args.aov.is_some(),
            timing: args.stats.is_some() || args.budget.is_some(),
            // A moving camera around particles at rest does not change the lights' maps.
            reuse: at_rest
                && (args.turntable.is_some() || args.camera_path.is_some() || args.views.is_some()),
            ..FrameInput::new(&scene, &job.shot.camera, &loaded.splats, args.size)
        };
        let drawing = match budget {
            Some(budget) => budget.draw(offscreen, input)?,
            None => offscreen.begin(input)?,
        };
        let straight = offscreen.renderer.lights_without_caustics();
        if !straight.is_empty() {
            console.notice(&Notice::Straight(straight));
        }
        // Read back now, since the next picture overwrites them.
        let images = if chosen.is_empty() { Vec::new() } else { offscreen.images(chosen)? };
        let radiance = output.is_linear().then(|| offscreen.radiance()).transpose()?;
        Ok(Submitted { drawing, rung, images, radiance })
    }

    /// What has moved since the picture before. Before the first of several pictures, particles moved as they
    /// do before the second, and the camera was at rest; before a single picture, they moved for a frame.
    fn motion(&self, job: &Job, loaded: &Loaded) -> Motion {
        let Clock { times, rate, stride, frozen } = &self.clock;
        let Shot { frame, before, .. } = job.shot;
        let since = |now: usize, before: usize| (times[now].time() - times[before].time()).max(0.0);
        let frames = match before {
            Some((before, _)) => since(frame, before),
            None if times.len() > 1 => since(1, 0),
            None if *frozen => 0.0,
            None => *stride,
        };
        let previous = before.map(|(_, camera)| View::from(&camera));
        let seconds = (frames / rate) as f32;
        Motion { velocities: loaded.velocities.clone(), seconds, previous }
    }

    /// Waits for a picture, and begins to write it.
    fn conclude(
        &mut self,
        mut job: Job,
        in_flight: limpid_io::Result<FrameInFlight>,
        log: &mut Log,
    ) -> limpid_io::Result<()> {
        let picture = in_flight.and_then(|in_flight| self.finish(&mut job, in_flight));
        // A failure may end the run.
        let most = if picture.is_ok() { self.most_writing } else { 0 };
        let ms = self.since.elapsed().as_micros() as f64 / 1e3;
        self.since = Instant::now();
        self.writing.push_back(Written { job, ms, picture });
        self.settle(most, log)
    }

    /// Logs the outcomes of pictures until no more than `most` are being written.
    fn settle(&mut self, most: usize, log: &mut Log) -> limpid_io::Result<()> {
        while self.writing.len() > most
            && let Some(Written { job, ms, picture }) = self.writing.pop_front()
        {
            let written = picture.and_then(|(stats, writing)| Ok((stats, writing.wait()?)));
            match written {
                Ok((stats, pixels)) => {
                    self.failures = 0;
                    let outcome = Outcome {
                        pixels: Some(format!("{pixels:08x}")),
                        particles: Some(stats.particles),
                        ms: Some(ms),
                        adapter: Some(self.stats.adapter.clone()),
                        ..Outcome::default()
                    };
                    self.stats.frames.push(stats);
                    log.add(&job.shot, job.fingerprint, Status::Done, outcome)?;
                    log.bar.inc(1);
                }
                Err(error) => {
                    let category = error.category();
                    let temporary = category == Category::Temporary;
                    self.failures = if temporary { self.failures + 1 } else { 0 };
                    log.keep_going &=
                        category != Category::Device && self.failures != DEVICE_FAILURES;
                    log.fail(&job.shot, job.fingerprint, error)?;
                    self.output.replace()?;
                }
            }
        }
        Ok(())
    }

    /// Waits for a picture and begins to write it. With `--keep-going`, a device that has failed or has rejected
    /// commands is reopened, but only once per picture, so that a persistent failure ends.
    fn finish(
        &mut self,
        job: &mut Job,
        in_flight: FrameInFlight,
    ) -> limpid_io::Result<(FrameStats, Writing)> {
        let FrameInFlight { loaded, drawing } = in_flight;
        match drawing.and_then(|drawing| self.write(job, &loaded, drawing)) {
            Err(Error::Render(DeviceLost(_) | Defect(_))) if self.args.keep_going => {
                let gpu = limpid_io::device::open()?;
                self.classifier.set(Some(&gpu));
                self.offscreen = Offscreen::new(&gpu);
                self.stats.adapter = gpu.adapter();
                self.budget.iter_mut().for_each(Budget::renew);
                let drawing = self.begin_drawing(job, &loaded)?;
                self.write(job, &loaded, drawing)
            }
            outcome => outcome,
        }
    }

    /// Waits for the device and begins to write the picture.
    fn write(
        &mut self,
        job: &Job,
        loaded: &Loaded,
        Submitted { drawing, rung, images, radiance }: Submitted,
    ) -> limpid_io::Result<(FrameStats, Writing)> {
        let Self { output, overlay, budget, console, .. } = self;
        let drawn = drawing.wait()?;
        let is_empty = |coverage: &GrayImage| coverage.iter().all(|&alpha| alpha == 0);
        if loaded.particles > 0 && drawn.coverage.as_ref().is_some_and(is_empty) {
            console.uncovered();
        }
        let passes = drawn.passes.clone();
        let stats = FrameStats {
            frame: job.shot.number,
            set: budget.as_ref().zip(rung).map(|(budget, rung)| budget.set(rung).to_vec()),
            particles: loaded.particles,
            splashes: loaded.splats.splashes.len(),
            total_ms: total_ms(&passes),
            passes,
        };
        let mut picture = drawn.into_image();
        overlay.draw(&mut picture, &View::from(&job.shot.camera));
        let drawn = DrawnPicture { picture, radiance, images, fingerprint: job.fingerprint };
        Ok((stats, Writing::begin(output, job.shot, drawn)?))
    }
}

/// The output file, if it is a film.
fn film_path(args: &Args) -> Option<&Path> {
    let path = args.output.as_deref()?;
    film::FilmFormat::of(path).filter(|_| !path.is_dir()).map(|_| path)
}

fn parse_time(text: &str) -> Result<f64, &'static str> {
    let time = text.parse().ok().filter(|time: &f64| time.is_finite());
    time.ok_or("expected a time in frames, as 12 or 12.25")
}
