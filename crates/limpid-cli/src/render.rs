//! The command `limpid render`.

mod args;
mod beside;
mod budget;
mod console;
mod frame_loop;
mod loader;
mod manifest;
mod output;
mod pick;
mod plan;
mod queue;
mod writing;

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use crate::fingerprint::Fingerprints;
use limpid::aov::Aov;
use limpid::offscreen::Offscreen;
use limpid_io::claim::Claims;
use limpid_io::frames::FrameSpec;
use limpid_io::overlay::Overlay;
use limpid_io::shared_classifier::SharedClassifier;

use crate::pipeline_cache;
use crate::signals;
pub(crate) use args::Args;
use console::Console;
use frame_loop::{Clock, FrameLoop, Stats};
use loader::Loader;
use manifest::{Log, Manifest};
use output::Output;
use plan::Plan;
use queue::Queue;

/// Exit code if some frames failed and others did not.
const FAILED_CODE: u8 = 1;

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
    let claims = pictures.clone().filter(|_| args.claim);
    let claims = claims.map(|pictures| (claims_of(args, &host), pictures));
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
    frame_loop.wait(&mut log);
    log.bar.finish_and_clear();
    if let Some(cache) = cache {
        cache.save();
    }
    frame_loop.write_stats()?;
    drawn?;
    if let Some(code) = signals::received().filter(|_| !queue.is_empty()) {
        return Ok(code);
    }
    Ok(finish(frame_loop, log.failed, requested)?)
}

/// Claims in the name of this process.
fn claims_of(args: &Args, host: &str) -> Claims {
    let version = env!("CARGO_PKG_VERSION");
    let owner = format!("limpid {version} on {host}, process {}\n", std::process::id());
    Claims::new(owner, Duration::from_secs(args.claim_timeout))
}

/// Finishes the output of a run of `requested` frames, and prints what was written.
fn finish(frame_loop: FrameLoop<'_>, failed: Vec<i64>, requested: usize) -> limpid_io::Result<u8> {
    let FrameLoop { output, stats, console, budget, .. } = frame_loop;
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
