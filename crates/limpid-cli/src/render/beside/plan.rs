//! The plan of a run of several inputs, from the arguments.

use std::path::{Path, PathBuf};

use glam::UVec2;
use limpid::liquid::Up;
use limpid::look::{Body, Framing};
use limpid_io::Error;
use limpid_io::color_by::{ColorBy, ColorScale};
use limpid_io::film::{self, Shot};
use limpid_io::frames::check_fps;
use limpid_io::input::{FrameTime, Loader};
use limpid_io::notice::Notice;
use limpid_io::open::Opened;
use limpid_io::overlay::Overlay;

use super::super::destination::Destination;
use super::super::{Args, plan};
use super::sizes::Sizes;

/// Largest number of inputs: the pictures of more would be slits, and a shell may have expanded a pattern.
const MOST: usize = 6;

/// The inputs of a run, their settings, and the destination of the pictures.
pub(super) struct Plan {
    pub(super) inputs: Vec<Planned>,
    pub(super) sizes: Sizes,
    pub(super) shots: Vec<Shot>,
    /// Pictures per second.
    pub(super) fps: f64,
    /// The axis that points up where the camera was given.
    pub(super) camera_up: Up,
    pub(super) destination: Destination,
    /// The range of their colours, if it is not given.
    pub(super) notices: Vec<Notice>,
}

/// One of the inputs.
pub(super) struct Planned {
    /// As given.
    pub(super) source: PathBuf,
    pub(super) opened: Opened,
    /// Of each picture.
    pub(super) times: Vec<FrameTime>,
    pub(super) overlay: Overlay,
}

/// When the pictures are.
struct Clock {
    /// Of each input, a frame time for each picture.
    times: Vec<Vec<FrameTime>>,
    /// Numbers of the pictures.
    numbers: Vec<i64>,
    /// Pictures per second.
    fps: f64,
}

impl Plan {
    pub(super) fn new(args: &Args) -> limpid_io::Result<Self> {
        let sources = args.inputs.each();
        if !(2..=MOST).contains(&sources.len()) {
            let problem = format!(
                "--beside takes 2 to {MOST} inputs, not {}; name a sequence by its folder or by its pattern in quotes",
                sources.len()
            );
            return Err(Error::Usage(problem));
        }
        let sizes = Sizes::new(args.size, sources.len(), args.alpha)?;
        let mut opened = open(args, sources, sizes.picture)?;
        let colors = share_range(&mut opened)?;
        let camera = opened[0].project.camera_for(Default::default());
        let (camera_up, files) = (opened[0].camera_up, opened[0].loader.up().0);
        let loaders: Vec<&Loader> = opened.iter().map(|opened| &opened.loader).collect();
        let Clock { times, numbers, fps } = clock(args, &loaders, sources)?;
        for ((loader, times), source) in loaders.iter().zip(&times).zip(sources) {
            loader.check_files(times).map_err(|error| of_input(error, source))?;
        }
        let shots = plan::shots(args, camera, files, &numbers, fps)?;
        let destination = Destination::new(args, sources, &shots)?;
        if destination.is_linear() {
            let problem = "--beside: names are written over the picture, and an .exr holds light; write .png, .jpg or .webp";
            return Err(Error::Usage(problem.into()));
        }
        let inputs = sources.iter().zip(opened).zip(times).map(|((source, opened), times)| {
            let overlay = plan::overlay(args, &opened.loader)?;
            Ok(Planned { source: source.clone(), opened, times, overlay })
        });
        let inputs = inputs.collect::<limpid_io::Result<Vec<_>>>()?;
        let legend =
            inputs.first().and_then(|first| plan::no_legend(&first.overlay, sizes.picture));
        let notices = colors.into_iter().chain(legend).collect();
        Ok(Self { inputs, notices, sizes, shots, fps, camera_up, destination })
    }
}

/// Gives the inputs one range of colours, which covers the usual ones of all; returns it, if it is not given.
fn share_range(opened: &mut [Opened]) -> limpid_io::Result<Option<Notice>> {
    let mut shared: Option<ColorScale> = None;
    for opened in opened.iter() {
        let Some(scale) = opened.loader.color_scale()?.filter(|scale| scale.automatic) else {
            continue;
        };
        let [low, high] = shared.as_ref().map_or(scale.range, |shared| shared.range);
        let range = [low.min(scale.range[0]), high.max(scale.range[1])];
        shared = Some(ColorScale { range, ..scale });
    }
    let range = shared.as_ref().map(|shared| shared.range);
    for opened in opened {
        let by = opened.loader.color_by().cloned().filter(|by| by.range.is_none());
        if let (Some(by), Some(_)) = (by, range) {
            let loader = opened.loader.clone();
            opened.loader = loader.colored_by(Some(ColorBy { range, ..by }));
        }
    }
    Ok(shared.map(Notice::Colors))
}

/// Adds the input to an error that does not name it.
pub(super) fn of_input(error: Error, input: &Path) -> Error {
    let input = input.display().to_string();
    match error.to_string().contains(&input) {
        true => error,
        false => Error::Input { input, source: error.into() },
    }
}

/// Opens the inputs in scenes that are made for all of them together.
fn open(args: &Args, sources: &[PathBuf], size: UVec2) -> limpid_io::Result<Vec<Opened>> {
    let framing = Framing { all_round: args.turntable.is_some(), ..Framing::of(size) };
    let open = |together: Option<&Body>| -> limpid_io::Result<Vec<Opened>> {
        let opened = sources.iter().map(|source| {
            let mut request = plan::request(args, Some(source.clone()), framing);
            (request.measured, request.together) = (true, together.cloned());
            request.open().map_err(|error| of_input(error, source))
        });
        opened.collect()
    };
    let alone = open(None)?;
    let bodies = alone.iter().filter_map(|opened| opened.loader.body().cloned());
    match bodies.reduce(Body::with) {
        Some(together) => open(Some(&together)),
        None => Ok(alone),
    }
}

/// One clock for all inputs: by their times, from the first frame of each, if these differ, and else by their frames'
/// numbers. A shorter input holds its last frame, and a single frame stands still.
fn clock(args: &Args, loaders: &[&Loader], sources: &[PathBuf]) -> limpid_io::Result<Clock> {
    let frames = loaders.iter().zip(sources).map(|(loader, source)| {
        let numbers =
            plan::spec(args.frames.as_ref(), loader).numbers(&loader.sequence, loader.missing);
        let mut numbers = numbers.map_err(|error| of_input(error, source))?;
        loader.check_frames(&numbers)?;
        numbers.sort_unstable();
        Ok(numbers)
    });
    let frames: Vec<Vec<i64>> = frames.collect::<limpid_io::Result<_>>()?;
    let known = loaders.iter().find_map(|loader| loader.fps());
    let fps = args.fps.or(known).unwrap_or(plan::DEFAULT_FPS);
    check_fps(fps)?;
    if let Some(time) = args.at {
        let times = loaders.iter().zip(&frames).zip(sources).map(|((loader, numbers), source)| {
            let ends = numbers.first().zip(numbers.last());
            let held = ends.map_or(time, |(&a, &b)| time.clamp(a as f64, b as f64));
            Ok(vec![loader.frame_time(numbers, held).map_err(|error| of_input(error, source))?])
        });
        let times: Vec<Vec<FrameTime>> = times.collect::<limpid_io::Result<_>>()?;
        return Ok(Clock { numbers: vec![times[0][0].frame], times, fps });
    }
    let speed = plan::speed(args)?;
    // Frames per picture, over those at the sequence's own pace.
    let paces: Vec<f64> =
        loaders.iter().map(|loader| loader.fps().unwrap_or(fps) * speed / fps).collect();
    let moving: Vec<usize> = (0..loaders.len()).filter(|&i| frames[i].len() > 1).collect();
    let by_number = moving.iter().all(|&i| paces[i] == 1.0);
    if by_number {
        let mut numbers: Vec<i64> =
            moving.iter().flat_map(|&i| frames[i].iter().copied()).collect();
        numbers.sort_unstable();
        numbers.dedup();
        if numbers.is_empty() {
            numbers = frames[0].clone();
        }
        let shown = |frames: &Vec<i64>| {
            let last = |number: i64| frames.partition_point(|&frame| frame <= number).max(1) - 1;
            numbers.iter().map(|&number| FrameTime::at(frames[last(number)])).collect()
        };
        return Ok(Clock { times: frames.iter().map(shown).collect(), numbers, fps });
    }
    let step = |i: usize| loaders[i].sequence.stride() as f64 * paces[i];
    let lasts = moving.iter().map(|&i| {
        let length = frames[i][frames[i].len() - 1].abs_diff(frames[i][0]) as f64;
        (length / step(i) * (1.0 + 1e-12)).floor()
    });
    let last = lasts.fold(0.0, f64::max);
    if last > film::MAX_SHOTS {
        return Err(Error::Usage(format!("{last:.0} pictures; expected a higher --speed")));
    }
    let times = (0..loaders.len()).map(|i| {
        let at = |picture: i64| FrameTime::after(&frames[i], picture as f64 * step(i));
        (0..=last as i64).map(at).collect()
    });
    Ok(Clock { times: times.collect(), numbers: (1..=last as i64 + 1).collect(), fps })
}
