//! The command `limpid render`.

mod ahead;
mod args;
mod beside;
mod budget;
mod console;
mod destination;
mod frame_loop;
mod manifest;
mod output;
mod pick;
mod pictures;
mod plan;
mod queue;
mod whitewater;
mod writing;

use std::collections::VecDeque;
use std::time::Instant;

use crate::fingerprint::Fingerprints;
use limpid::offscreen::Offscreen;
use limpid::scene::Scene;
use limpid_io::frames::FrameSpec;
use limpid_io::overlay::Overlay;
use limpid_io::shared_classifier::SharedClassifier;

use crate::pipeline_cache;
use crate::signals;
use ahead::Ahead;
pub(crate) use args::Args;
use console::Console;
use frame_loop::{FrameLoop, Stats};
use manifest::{Log, Manifest};
use output::Output;
use pick::Pick;
use plan::Plan;
use queue::Queue;

/// Exit code if some frames failed and others did not.
const FAILED_CODE: u8 = 1;

pub(crate) fn run(args: &Args) -> anyhow::Result<u8> {
    if args.beside {
        return beside::run(args);
    }
    let plan = Plan::new(args)?;
    let pick = pick::pick(&plan)?;
    // After a signal the current frame is finished, or the unfinished film removed.
    signals::finish_first();
    draw(plan, pick)
}

/// Draws a plan's pictures, with the settings that were picked for it.
fn draw(plan: Plan, pick: Option<Pick>) -> anyhow::Result<u8> {
    let Plan { loader, clock, overlay, drawing, sharing, .. } = plan;
    let output = Output::open(plan.destination, drawing.size, plan.fps)?;
    let scene = match &pick {
        Some(pick) => Scene { settings: pick.settings.clone(), ..plan.scene },
        None => plan.scene,
    };
    // Computed before loading: a file that changes later must not match the picture.
    let moves = loader.with_velocities.then_some(clock.rate);
    let fingerprints = Fingerprints::new(&loader, &clock.times, &scene, drawing.size, moves);
    let fingerprints = fingerprints.under(&overlay);
    let claims = sharing.claim.map(crate::sharing::claims);
    let claims = claims.zip(output.pictures().cloned());
    let manifest =
        plan.manifest.map(|path| Manifest::open(&path, crate::sharing::host())).transpose()?;
    let bar = crate::terminal::progress(plan.shots.len());
    let mut console = Console::new(bar.clone());
    plan.notices.iter().for_each(|notice| console.notice(notice));
    if drawing.is_linear && overlay != Overlay::default() {
        console
            .line("--legend, --scale-bar and --axes are not drawn in an .exr, which holds light");
    }
    let pictures = output.pictures().cloned();
    let mut log = Log { manifest, pictures, bar, keep_going: plan.keep_going, failed: Vec::new() };
    let shots: Vec<_> = sharing.shard.of(plan.shots).collect();
    let requested = shots.len();
    let mut queue = Queue::new(shots, fingerprints.clone(), claims);
    if sharing.skip_existing {
        queue.skip(&mut log)?;
    }
    if queue.is_empty() {
        return Ok(nothing_left(&console, log.failed, requested));
    }
    log.bar.set_length(queue.len() as u64);

    // With claims nothing is loaded ahead, since other processes may draw the next frames.
    let memory = if sharing.claim.is_some() { 0 } else { plan.memory };
    let classifier = SharedClassifier::awaited();
    let ahead = Ahead::new(loader, classifier, &scene, &clock.times, queue.pending(), memory);
    let (picked, opened, budget) = match pick {
        Some(pick) => (Some(pick.picked), Ok(pick.opened), pick.budget),
        // Particles are read while the adapter is opened.
        None => (None, pipeline_cache::open_adapter(), None),
    };
    ahead.classifier().set(opened.as_ref().ok().map(|(gpu, _)| gpu));
    let (gpu, cache) = opened?;
    let (budget, offscreen) = match budget {
        Some((budget, offscreen)) => (Some(budget), offscreen),
        None => (None, Offscreen::new(&gpu)),
    };
    let mut frame_loop = FrameLoop {
        scene,
        drawing,
        camera_up: plan.camera_up,
        offscreen,
        budget,
        fingerprints,
        clock,
        classifier: ahead.classifier().clone(),
        most_writing: writing::most(sharing.claim.is_some(), &output),
        output,
        writing: VecDeque::new(),
        overlay,
        stats: Stats { adapter: gpu.adapter(), picked, budget: None, frames: Vec::new() },
        stats_path: plan.stats,
        keep_going: plan.keep_going,
        console,
        failures: 0,
        since: Instant::now(),
    };
    let drawn = draw_all(&mut frame_loop, &mut queue, &ahead, &mut log);
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

/// Says why none of `requested` pictures is drawn, some of which may have failed.
fn nothing_left(console: &Console, failed: Vec<i64>, requested: usize) -> u8 {
    if requested == 0 {
        console.line("there are no pictures in this share of the frames");
        return crate::SUCCESS;
    }
    let existing = requested - failed.len();
    console.line(&format!("{existing} of {requested} pictures already exist"));
    exit_code(failed, requested, "")
}

/// Finishes the output of a run of `requested` frames, and prints what was written.
fn finish(frame_loop: FrameLoop, failed: Vec<i64>, requested: usize) -> limpid_io::Result<u8> {
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
    frame_loop: &mut FrameLoop,
    queue: &mut Queue,
    ahead: &Ahead,
    log: &mut Log,
) -> limpid_io::Result<()> {
    let mut previous = None;
    let mut next = queue.next(log)?;
    while let Some(mut job) = next {
        // The previous picture does not wait for particles that are still being loaded.
        if !ahead.has(&job.shot)
            && let Some((job, in_flight)) = previous.take()
        {
            frame_loop.conclude(job, in_flight, log)?;
        }
        let in_flight = ahead.wait(&job.shot).map(|loaded| frame_loop.begin(&mut job, loaded));
        if let Some((job, in_flight)) = previous.take() {
            frame_loop.conclude(job, in_flight, log)?;
        }
        // After the previous claim is released: a process holds at most two.
        next = queue.next_free(log)?;
        if let Some(next) = &next {
            ahead.aim(&next.shot, &job.shot);
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
