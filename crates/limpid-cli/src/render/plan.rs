//! The plan of a run, from the arguments.

use std::path::PathBuf;
use std::time::Duration;

use glam::UVec2;
use limpid::aov::Aov;
use limpid::camera::Camera;
use limpid::liquid::Up;
use limpid::look::Framing;
use limpid::scene::Scene;
use limpid_io::Error;
use limpid_io::camera_path::{self, CameraPath};
use limpid_io::film::{self, Motion, Shot};
use limpid_io::frames::{FrameSpec, Shard, check_fps};
use limpid_io::input::{FrameTime, Loader};
use limpid_io::notice::{self, Notice};
use limpid_io::open::Request;
use limpid_io::overlay::{Overlay, legend_fits};
use limpid_io::quality::Limits;

use super::Args;
use super::destination::{Destination, film_path};
use super::whitewater;
use crate::standard;

/// Frame rate if neither the arguments nor the scene have one, frames per second.
pub(super) const DEFAULT_FPS: f64 = 30.0;

/// The frames, settings and destination of a run: all that the arguments say, checked before the device is opened.
pub(super) struct Plan {
    pub(super) loader: Loader,
    pub(super) scene: Scene,
    pub(super) clock: Clock,
    /// The pictures of all shares.
    pub(super) shots: Vec<Shot>,
    /// Pictures per second.
    pub(super) fps: f64,
    pub(super) notices: Vec<Notice>,
    /// The axis that points up where the camera was given.
    pub(super) camera_up: Up,
    /// Legend, scale bar and axes of the pictures.
    pub(super) overlay: Overlay,
    pub(super) drawing: Drawing,
    /// Limits that the settings are picked by, if they are.
    pub(super) limits: Option<Limits>,
    /// Whether the costs of settings are measured anew.
    pub(super) calibrate: bool,
    pub(super) destination: Destination,
    pub(super) sharing: Sharing,
    /// Whether the run continues after a failed frame.
    pub(super) keep_going: bool,
    /// The file of the frames' outcomes.
    pub(super) manifest: Option<PathBuf>,
    /// The file of adapter, counts and times.
    pub(super) stats: Option<PathBuf>,
    /// Memory for frames loaded ahead, bytes.
    pub(super) memory: u64,
}

/// The times at which particles are drawn.
pub(super) struct Clock {
    pub(super) times: Vec<FrameTime>,
    /// Frame numbers per second.
    pub(super) rate: f64,
    /// Frame numbers per frame: a simulator may count its time steps.
    pub(super) stride: f64,
    /// Several pictures show one frame.
    pub(super) frozen: bool,
}

/// How each picture is drawn.
pub(super) struct Drawing {
    /// Width and height, pixels.
    pub(super) size: UVec2,
    /// Intermediate images to be written.
    pub(super) aov: Option<Vec<Aov>>,
    /// Whether linear radiance is written.
    pub(super) is_linear: bool,
    /// Whether passes are timed.
    pub(super) timing: bool,
    /// Whether passes whose inputs are those of the picture before are left out.
    pub(super) reuse: bool,
}

/// How the pictures are shared among processes.
pub(super) struct Sharing {
    /// The share of this one.
    pub(super) shard: Shard,
    /// Whether pictures that are complete are not drawn again.
    pub(super) skip_existing: bool,
    /// If pictures are claimed, the time after which a claim that was not renewed is taken over.
    pub(super) claim: Option<Duration>,
}

impl Plan {
    pub(super) fn new(args: &Args) -> limpid_io::Result<Self> {
        let (path, named) = args.inputs.resolve()?;
        let frames = args.frames.as_ref().or(named.as_ref());
        let framing = Framing { all_round: args.turntable.is_some(), ..Framing::of(args.size) };
        let opened = standard::open(&request(args, path.clone(), framing))?;
        let camera = opened.project.camera_for(Default::default());
        let incomplete = opened.project.solid_files.remarks.clone();
        let (mut loader, scene) = (opened.loader, opened.project.scene);
        let camera_up = match &args.camera_path {
            Some(_) => args.camera_up.unwrap_or(loader.up().0),
            None => opened.camera_up,
        };
        loader.with_velocities = args.aov.as_ref().is_some_and(|list| list.contains(&Aov::Motion));
        let overlay = overlay(args, &loader)?;
        let (times, numbers, fps) = frame_times(args, frames, &loader)?;
        if !args.keep_going {
            loader.check_files(&times)?;
        }
        let shots = shots(args, camera, loader.up().0, &numbers, fps)?;
        let mut notices = notices(args, frames, &loader, numbers.len());
        notices.extend(incomplete.into_iter().map(Notice::Incomplete));
        notices.extend(loader.color_scale()?.filter(|scale| scale.automatic).map(Notice::Colors));
        notices.extend(no_legend(&overlay, args.size));
        let destination = Destination::new(args, path.as_slice(), &shots)?;
        if args.whitewater {
            loader = whitewater::beside(loader, &scene, &destination, &times, args.keep_going)?;
        }
        let stride = loader.sequence.stride() as f64;
        let rate = stride * loader.fps().unwrap_or(fps);
        let clock = Clock { rate, stride, frozen: times.len() == 1 && shots.len() > 1, times };
        Ok(Self {
            camera_up,
            overlay,
            drawing: drawing(args, &clock, &destination),
            limits: limits(args)?,
            calibrate: args.calibrate,
            sharing: sharing(args),
            keep_going: args.keep_going,
            manifest: args.manifest.clone(),
            stats: args.stats.clone(),
            memory: args.memory << 20,
            loader,
            scene,
            clock,
            shots,
            fps,
            notices,
            destination,
        })
    }
}

fn drawing(args: &Args, clock: &Clock, destination: &Destination) -> Drawing {
    let moves = args.turntable.is_some() || args.camera_path.is_some() || args.views.is_some();
    Drawing {
        size: args.size,
        aov: args.aov.clone(),
        is_linear: destination.is_linear(),
        timing: args.stats.is_some() || args.budget.is_some(),
        // A moving camera around particles at rest does not change the lights' maps.
        reuse: moves && clock.times.len() == 1,
    }
}

/// The limits that settings are picked by.
fn limits(args: &Args) -> limpid_io::Result<Option<Limits>> {
    let limits = Limits { max_error: args.max_error, budget: args.budget };
    let has_limits = limits != Limits::default();
    if args.calibrate && !has_limits {
        let problem = "--calibrate: measures for --max-error or --budget; give one of them";
        return Err(Error::Usage(problem.into()));
    }
    Ok(Some(limits).filter(|_| has_limits))
}

fn sharing(args: &Args) -> Sharing {
    Sharing {
        shard: args.shard.unwrap_or_default(),
        skip_existing: args.skip_existing || args.claim,
        claim: args.claim.then(|| Duration::from_secs(args.claim_timeout)),
    }
}

/// The request for an input, which may be standard input.
pub(super) fn request(args: &Args, input: Option<PathBuf>, framing: Framing) -> Request {
    // In this order, since later overrides replace earlier ones.
    let mut overrides = Vec::from_iter(args.preset.map(|preset| format!("preset={preset}")));
    overrides.extend(args.set.iter().cloned());
    overrides.extend(args.samples.map(|samples| format!("refract.samples={samples}")));
    overrides.extend(args.alpha.then(|| "refract.transparent=true".to_owned()));
    Request {
        input,
        scene: args.scene.clone(),
        radius: args.radius,
        overrides,
        camera: args.camera,
        camera_up: args.camera_up,
        missing: args.missing,
        options: args.reading.options(),
        adjustments: args.changes.adjustments(None),
        framing,
        measured: args.scale_bar,
        together: None,
    }
}

/// Legend, scale bar and axes of the pictures of an input.
pub(super) fn overlay(args: &Args, loader: &Loader) -> limpid_io::Result<Overlay> {
    let middle = loader.body().map(|body| 0.5 * (body.bounds.0 + body.bounds.1));
    let legend = if args.legend { loader.color_scale()? } else { None };
    if args.legend && legend.is_none() {
        let problem = match loader.color_by() {
            Some(by) => format!("{} has no scale of values", by.attribute),
            None => "no values are shown in colors; name an attribute with --color-by".to_owned(),
        };
        return Err(Error::Usage(format!("--legend: {problem}")));
    }
    let scale_bar = middle.filter(|_| args.scale_bar);
    Ok(Overlay { scale_bar, axes: args.axes.then(|| loader.up().0), legend })
}

/// The notice on a legend that pictures of this size have no room for.
pub(super) fn no_legend(overlay: &Overlay, size: UVec2) -> Option<Notice> {
    let legend = overlay.legend.as_ref().filter(|scale| !legend_fits(size, scale));
    legend.map(|_| Notice::NoLegend(size))
}

/// The frames of an input, of which `asked` are asked for.
pub(super) fn spec(asked: Option<&FrameSpec>, loader: &Loader) -> FrameSpec {
    match (asked, loader.frame) {
        (Some(spec), _) => spec.clone(),
        (None, Some(frame)) => FrameSpec::list([frame]),
        (None, None) => FrameSpec::All,
    }
}

/// The playback speed.
pub(super) fn speed(args: &Args) -> limpid_io::Result<f64> {
    let speed = args.speed.unwrap_or(1.0);
    match (1e-3..=1e3).contains(&speed) {
        true => Ok(speed),
        false => Err(Error::Usage(format!("--speed {speed}: expected 0.001 to 1000"))),
    }
}

/// Frame times of the pictures, their numbers, and their rate per second.
///
/// These are the sequence's frames, unless the film has another time scale: then frame times at equal
/// steps, numbered from 1.
fn frame_times(
    args: &Args,
    asked: Option<&FrameSpec>,
    loader: &Loader,
) -> limpid_io::Result<(Vec<FrameTime>, Vec<i64>, f64)> {
    let mut frames = spec(asked, loader).numbers(&loader.sequence, loader.missing)?;
    loader.check_frames(&frames)?;
    let fps = args.fps.or(loader.fps()).unwrap_or(DEFAULT_FPS);
    check_fps(fps)?;
    if let Some(time) = args.at {
        frames.sort_unstable();
        let frame_time = loader.frame_time(&frames, time)?;
        return Ok((vec![frame_time], vec![frame_time.frame], fps));
    }
    let step = speed(args)? * loader.fps().unwrap_or(fps) / fps;
    if step == 1.0 || frames.len() == 1 {
        return Ok((frames.iter().copied().map(FrameTime::at).collect(), frames, fps));
    }
    if !frames.is_sorted() {
        let problem = "--frames: slow and fast motion takes the frames in order, as 1-9 or 1,5,9";
        return Err(Error::Usage(problem.into()));
    }
    let stride = loader.sequence.stride() as f64;
    let count = frames[frames.len() - 1].abs_diff(frames[0]) as f64 / (stride * step);
    if count > film::MAX_SHOTS {
        return Err(Error::Usage(format!("{count:.0} pictures; expected a higher --speed")));
    }
    let frame_times = loader.frame_times(&frames, step);
    let numbers = (1..=frame_times.len() as i64).collect();
    Ok((frame_times, numbers, fps))
}

/// Notices about the sequence.
fn notices(
    args: &Args,
    asked: Option<&FrameSpec>,
    loader: &Loader,
    pictures: usize,
) -> Vec<Notice> {
    let single = args.at.is_some() || loader.frame.is_some();
    let all = matches!(asked, None | Some(FrameSpec::All)) && !single;
    let gaps = notice::of_sequence(loader).filter(|_| all);
    let steps = asked.filter(|_| !single);
    let steps = steps.and_then(|spec| notice::of_selection(spec, &loader.sequence, pictures));
    let timed = film_path(args).is_some()
        || args.speed.is_some()
        || args.camera_path.is_some()
        || args.turntable.is_some();
    let assumed = timed && pictures > 1 && args.fps.or(loader.fps()).is_none();
    gaps.into_iter().chain(steps).chain(assumed.then_some(Notice::Rate(DEFAULT_FPS))).collect()
}

/// Lists the pictures with their cameras; `camera` is the initial one, and `files` the axis that points up in the files.
pub(super) fn shots(
    args: &Args,
    camera: Camera,
    files: Up,
    numbers: &[i64],
    fps: f64,
) -> limpid_io::Result<Vec<Shot>> {
    let motion = match (&args.camera_path, args.turntable, &args.views) {
        (Some(path), ..) => Motion::Path(CameraPath::load_for(path, files, args.camera_up)?),
        (_, Some(seconds), _) => Motion::Turntable(seconds),
        (.., Some(path)) => Motion::Views(camera_path::load_views(path, files, args.camera_up)?),
        (None, None, None) => Motion::Still,
    };
    if matches!(motion, Motion::Views(_)) && numbers.len() != 1 {
        let problem =
            format!("--views: {} frames; choose one of them with --frames", numbers.len());
        return Err(Error::Usage(problem));
    }
    if (motion != Motion::Still || film_path(args).is_some()) && !numbers.is_sorted() {
        let problem = "a film and a moving camera take the frames in order, as 1-9 or 1,5,9";
        return Err(Error::Usage(format!("--frames: {problem}")));
    }
    film::shots(numbers, camera, &motion, fps)
}
