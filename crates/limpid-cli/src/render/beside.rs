//! Several inputs beside each other: `limpid render A B --beside`. They have one camera, one scale and one clock, and each
//! its name below.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::UVec2;
use image::{DynamicImage, GenericImage as _, Rgb, RgbImage};
use limpid::camera::View;
use limpid::frame::FrameInput;
use limpid::liquid::Up;
use limpid::look::{Body, Framing};
use limpid::offscreen::Offscreen;
use limpid::scene::Scene;
use limpid_io::Error;
use limpid_io::film::{self, Shot};
use limpid_io::frames::check_fps;
use limpid_io::input::{FrameTime, Input, Loaded};
use limpid_io::open::Opened;
use limpid_io::overlay::{self, Overlay};
use limpid_io::shared_classifier::SharedClassifier;

use super::console::Console;
use super::output::{self, DrawnPicture, Output};
use super::{Args, plan};
use crate::fingerprint::{Fingerprint, Fingerprints};
use crate::{pipeline_cache, signals};

/// Largest number of inputs: the pictures of more would be slits, and a shell may have expanded a pattern.
const MOST: usize = 6;

/// Pixels between two pictures.
const GAP: u32 = 2;

/// One of the inputs.
struct Side {
    /// As given.
    source: String,
    input: Input,
    scene: Scene,
    /// Of each picture.
    times: Vec<FrameTime>,
    overlay: Overlay,
    fingerprints: Fingerprints,
    console: Console,
    /// The particles of the last picture, which may be those of the next.
    last: Option<(FrameTime, Arc<Loaded>)>,
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

pub(super) fn run(mut args: Args) -> anyhow::Result<u8> {
    let sources = args.inputs.each().to_vec();
    if !(2..=MOST).contains(&sources.len()) {
        let problem = format!(
            "--beside takes 2 to {MOST} inputs, not {}; name a sequence by its folder or by its pattern in quotes",
            sources.len()
        );
        return Err(Error::Usage(problem).into());
    }
    args.input = sources.first().cloned();
    args.others = sources[1..].to_vec();
    let args = &args;
    let sizes = Sizes::new(args.size, sources.len())?;
    let opened = open(args, &sources, sizes.picture)?;
    let camera = opened[0].project.camera_for(Default::default());
    let ups = (opened[0].camera_up, opened[0].input.up().0);
    let inputs: Vec<&Input> = opened.iter().map(|opened| &opened.input).collect();
    let Clock { times, numbers, fps } = clock(args, &inputs, &sources)?;
    for ((input, times), source) in inputs.iter().zip(&times).zip(&sources) {
        input.check_files(times).map_err(|error| of_input(error, source))?;
    }
    let shots = plan::shots(args, camera, ups.1, &numbers, fps)?;
    output::check(args, &shots)?;
    signals::finish_first();
    let mut output = Output::open(args, shots.len(), fps)?;
    if output.is_linear() {
        let problem = "--beside: names are written over the picture, and an .exr holds light; write .png, .jpg or .webp";
        return Err(Error::Usage(problem.into()).into());
    }
    let (gpu, cache) = pipeline_cache::open_adapter()?;
    let classifier = SharedClassifier::on(&gpu);
    let bar = crate::terminal::progress(shots.len());
    let sides = sources.into_iter().zip(opened).zip(times);
    let mut sides: Vec<Side> = sides
        .map(|((source, opened), times)| {
            let Opened { input, project, .. } = opened;
            let scene = project.scene;
            let overlay = plan::overlay(args, &input);
            let fingerprints = Fingerprints::new(&input, &times, &scene, sizes.picture, None);
            let input = input.classified(classifier.clone());
            let source = source.display().to_string();
            let console = Console::new(bar.clone()).of(&source);
            let remarks = project.solid_files.remarks.into_iter();
            remarks.for_each(|remark| console.line(&remark));
            Side { source, input, scene, times, overlay, fingerprints, console, last: None }
        })
        .collect();
    sides.iter().for_each(Side::tell_whether_held);
    let (mut offscreen, adapter) = (Offscreen::new(&gpu), gpu.adapter());
    for shot in &shots {
        // The unfinished film is removed.
        if let Some(code) = signals::received() {
            return Ok(code);
        }
        let mut picture = sizes.blank(args.size, args.alpha);
        let told = (ups.0, adapter.as_str());
        for (side, left) in sides.iter_mut().zip(sizes.lefts()) {
            let drawn = side.draw(&mut offscreen, shot, &sizes, args.alpha, told);
            let drawn = drawn.map_err(|error| of_input(error, Path::new(&side.source)))?;
            picture.copy_from(&drawn, left, 0).expect("it fits");
        }
        let fingerprint = fingerprint(&sides, shot);
        output.write(
            shot,
            DrawnPicture { picture, radiance: None, images: Vec::new(), fingerprint },
        )?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    if let Some(cache) = cache {
        cache.save();
    }
    let summary = output.summary(&numbers_of(&shots), 0);
    output.finish()?;
    Console::new(bar).line(&summary);
    Ok(crate::SUCCESS)
}

fn numbers_of(shots: &[Shot]) -> Vec<i64> {
    shots.iter().map(|shot| shot.number).collect()
}

/// The fingerprint of the pictures of all sides together.
fn fingerprint(sides: &[Side], shot: &Shot) -> Fingerprint {
    let all: Vec<_> = sides.iter().map(|side| side.fingerprints.of(shot).to_string()).collect();
    sides[0].fingerprints.of(shot).with(&all.join(" "))
}

/// Sizes of what is put together.
struct Sizes {
    /// Of one picture.
    picture: UVec2,
    /// Of one with its name.
    side: UVec2,
    count: u32,
    /// Pixels of one dot of a letter.
    dot: u32,
}

impl Sizes {
    fn new(whole: UVec2, count: usize) -> limpid_io::Result<Self> {
        let count = count as u32;
        let (wide, below) =
            (whole.x.saturating_sub(GAP * (count - 1)) / count, overlay::line_height(whole));
        let picture = UVec2::new(wide, whole.y.saturating_sub(below));
        if picture.min_element() < 16 {
            let problem =
                format!("--size: {}x{} leaves no room for {count} pictures", whole.x, whole.y);
            return Err(Error::Usage(problem));
        }
        let side = UVec2::new(wide, whole.y);
        Ok(Self { picture, side, count, dot: overlay::dot(whole) })
    }

    /// Left borders of the pictures.
    fn lefts(&self) -> impl Iterator<Item = u32> {
        (0..self.count).map(|i| i * (self.side.x + GAP))
    }

    /// Nothing drawn yet: dark, or transparent.
    fn blank(&self, size: UVec2, alpha: bool) -> DynamicImage {
        const DARK: Rgb<u8> = Rgb([24; 3]);
        match alpha {
            true => DynamicImage::new_rgba8(size.x, size.y),
            false => RgbImage::from_pixel(size.x, size.y, DARK).into(),
        }
    }
}

impl Side {
    /// Draws its part of a picture, with its name.
    fn draw(
        &mut self,
        offscreen: &mut Offscreen,
        shot: &Shot,
        sizes: &Sizes,
        alpha: bool,
        (camera_up, adapter): (Up, &str),
    ) -> limpid_io::Result<DynamicImage> {
        let at = self.times[shot.frame];
        let loaded = match self.last.take() {
            Some((time, loaded)) if time == at => loaded,
            _ => Arc::new(
                self.input.load(at, &self.scene).map_err(|error| error.of_frame(at.frame))?,
            ),
        };
        let view = (&shot.camera, sizes.picture);
        self.console.frame(&loaded, &self.scene, view, camera_up, adapter);
        let scene = loaded.scene(&self.scene);
        let input = FrameInput::new(&scene, &shot.camera, &loaded.splats, sizes.picture);
        let drawn = offscreen.draw(input)?;
        let mut picture = drawn.into_image();
        self.overlay.draw(&mut picture, &View::from(&shot.camera));
        let mut side = sizes.blank(sizes.side, alpha);
        side.copy_from(&picture, 0, 0).expect("it fits");
        overlay::name(&mut side, &self.source, sizes.dot);
        self.last = Some((at, loaded));
        Ok(side)
    }

    /// Says that its last frame is shown while others go on.
    fn tell_whether_held(&self) {
        let [.., before, last] = self.times.as_slice() else { return };
        let moves = self.times.iter().any(|time| time != last);
        if before == last && moves {
            self.console.line(&format!("ends before the others: its frame {} is held", last.frame));
        }
    }
}

/// Adds the input to an error that does not name it.
fn of_input(error: Error, input: &Path) -> Error {
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
    let bodies = alone.iter().filter_map(|opened| opened.input.body().cloned());
    match bodies.reduce(Body::with) {
        Some(together) => open(Some(&together)),
        None => Ok(alone),
    }
}

/// One clock for all inputs: by their times, from the first frame of each, if these differ, and else by their frames'
/// numbers. A shorter input holds its last frame, and a single frame stands still.
fn clock(args: &Args, inputs: &[&Input], sources: &[PathBuf]) -> limpid_io::Result<Clock> {
    let frames = inputs.iter().zip(sources).map(|(input, source)| {
        let numbers = plan::spec(args, input).numbers(&input.sequence, input.missing);
        let mut numbers = numbers.map_err(|error| of_input(error, source))?;
        input.check_frames(&numbers)?;
        numbers.sort_unstable();
        Ok(numbers)
    });
    let frames: Vec<Vec<i64>> = frames.collect::<limpid_io::Result<_>>()?;
    let known = inputs.iter().find_map(|input| input.fps());
    let fps = args.fps.or(known).unwrap_or(plan::DEFAULT_FPS);
    check_fps(fps)?;
    if let Some(time) = args.at {
        let times = inputs.iter().zip(&frames).zip(sources).map(|((input, numbers), source)| {
            let ends = numbers.first().zip(numbers.last());
            let held = ends.map_or(time, |(&a, &b)| time.clamp(a as f64, b as f64));
            Ok(vec![input.frame_time(numbers, held).map_err(|error| of_input(error, source))?])
        });
        let times: Vec<Vec<FrameTime>> = times.collect::<limpid_io::Result<_>>()?;
        return Ok(Clock { numbers: vec![times[0][0].frame], times, fps });
    }
    let speed = plan::speed(args)?;
    // Frames per picture, over those at the sequence's own pace.
    let paces: Vec<f64> =
        inputs.iter().map(|input| input.fps().unwrap_or(fps) * speed / fps).collect();
    let moving: Vec<usize> = (0..inputs.len()).filter(|&i| frames[i].len() > 1).collect();
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
    let step = |i: usize| inputs[i].sequence.stride() as f64 * paces[i];
    let lasts = moving.iter().map(|&i| {
        let length = frames[i][frames[i].len() - 1].abs_diff(frames[i][0]) as f64;
        (length / step(i) * (1.0 + 1e-12)).floor()
    });
    let last = lasts.fold(0.0, f64::max);
    if last > film::MAX_SHOTS {
        return Err(Error::Usage(format!("{last:.0} pictures; expected a higher --speed")));
    }
    let times = (0..inputs.len()).map(|i| {
        let at = |picture: i64| FrameTime::after(&frames[i], picture as f64 * step(i));
        (0..=last as i64).map(at).collect()
    });
    Ok(Clock { times: times.collect(), numbers: (1..=last as i64 + 1).collect(), fps })
}
