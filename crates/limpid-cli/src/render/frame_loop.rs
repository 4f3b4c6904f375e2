//! The pictures of a run, one after another: drawn, read back, written and logged.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use image::GrayImage;
use limpid::Error::{Defect, DeviceLost};
use limpid::aov::{Aov, Part};
use limpid::camera::View;
use limpid::frame::FrameInput;
use limpid::gpu::PassTime;
use limpid::liquid::Up;
use limpid::motion::Motion;
use limpid::offscreen::{Offscreen, PendingFrame};
use limpid::scene::Scene;
use limpid_io::Error;
use limpid_io::error::Category;
use limpid_io::film::Shot;
use limpid_io::input::Loaded;
use limpid_io::notice::Notice;
use limpid_io::output::{FileKind, write_atomically};
use limpid_io::overlay::Overlay;
use limpid_io::shared_classifier::SharedClassifier;
use serde::Serialize;

use super::budget::{Budget, BudgetStats, total_ms};
use super::console::Console;
use super::manifest::{Log, Outcome, Status};
use super::output::Output;
use super::pick::Picked;
use super::pictures::DrawnPicture;
use super::plan::{Clock, Drawing};
use super::queue::Job;
use super::writing::{self, Writing};
use crate::fingerprint::Fingerprints;

/// Number of consecutive failures of the device that ends the run.
const DEVICE_FAILURES: u32 = 3;

#[derive(Serialize)]
pub(super) struct Stats {
    pub(super) adapter: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) picked: Option<Picked>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) budget: Option<BudgetStats>,
    pub(super) frames: Vec<FrameStats>,
}

#[derive(Serialize)]
pub(super) struct FrameStats {
    pub(super) frame: i64,
    /// With a budget, the settings that it was drawn with, in the form that `--set` accepts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) set: Option<Vec<String>>,
    pub(super) particles: usize,
    pub(super) splashes: usize,
    pub(super) passes: Vec<PassTime>,
    pub(super) total_ms: f64,
}

/// A picture being drawn.
pub(super) struct FrameInFlight {
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
pub(super) struct Written {
    job: Job,
    /// Time from the picture before to this one, ms.
    ms: f64,
    /// The adapter that drew it.
    adapter: String,
    picture: limpid_io::Result<(FrameStats, Writing)>,
}

impl Written {
    /// Whether it need not be waited for.
    fn is_written(&self) -> bool {
        self.picture.as_ref().map_or(true, |(_, writing)| writing.is_done())
    }
}

/// The state of the render loop.
pub(super) struct FrameLoop {
    pub(super) drawing: Drawing,
    pub(super) scene: Scene,
    /// The axis that points up where the camera was given.
    pub(super) camera_up: Up,
    pub(super) offscreen: Offscreen,
    /// Chooses the settings of each picture.
    pub(super) budget: Option<Budget>,
    /// Those of the pictures with the scene's first settings.
    pub(super) fingerprints: Fingerprints,
    pub(super) clock: Clock,
    /// Classifies the particles.
    pub(super) classifier: SharedClassifier,
    pub(super) output: Output,
    /// Pictures that are being written, in order, and the most that there may be.
    pub(super) writing: VecDeque<Written>,
    pub(super) most_writing: usize,
    /// Scale bar and axes of the pictures.
    pub(super) overlay: Overlay,
    pub(super) stats: Stats,
    /// The file of `stats`.
    pub(super) stats_path: Option<PathBuf>,
    /// Whether the run continues after a failed frame.
    pub(super) keep_going: bool,
    pub(super) console: Console,
    /// Number of consecutive failures of the device.
    pub(super) failures: u32,
    /// End of the last picture, or of the wait for other processes.
    pub(super) since: Instant,
}

impl FrameLoop {
    /// Submits the drawing of a picture.
    pub(super) fn begin(&mut self, job: &mut Job, loaded: Arc<Loaded>) -> FrameInFlight {
        let view = (&job.shot.camera, self.drawing.size);
        self.console.frame(&loaded, &self.scene, view, self.camera_up, &self.stats.adapter);
        let drawing = self.begin_drawing(job, &loaded);
        FrameInFlight { loaded, drawing }
    }

    fn begin_drawing(&mut self, job: &mut Job, loaded: &Loaded) -> limpid_io::Result<Submitted> {
        let motion = self.motion(job, loaded);
        let Self { drawing, scene, offscreen, console, budget, fingerprints, .. } = self;
        let chosen = drawing.aov.as_deref().unwrap_or_default();
        let interface =
            |aov: &Aov| aov.is_for_compositing() || matches!(aov, Aov::Depth | Aov::Normal);
        let rung = budget.as_ref().map(Budget::rung);
        if let Some(budget) = budget {
            scene.settings = budget.settings().clone();
            job.fingerprint = budget.fingerprints(fingerprints, scene, drawing.size).of(&job.shot);
        }
        let scene = loaded.scene(scene);
        let input = FrameInput {
            surface: chosen.iter().any(interface).then_some(&motion),
            diagnose: drawing.aov.is_some(),
            timing: drawing.timing,
            reuse: drawing.reuse,
            ..loaded.picture(&scene, &job.shot.camera, drawing.size)
        };
        let pending = match budget {
            Some(budget) => budget.draw(offscreen, input)?,
            None => offscreen.begin(input)?,
        };
        let straight = offscreen.renderer.lights_without_caustics();
        if !straight.is_empty() {
            console.notice(&Notice::Straight(straight));
        }
        // Read back now, since the next picture overwrites them.
        let images = if chosen.is_empty() { Vec::new() } else { offscreen.images(chosen)? };
        let radiance = drawing.is_linear.then(|| offscreen.radiance()).transpose()?;
        Ok(Submitted { drawing: pending, rung, images, radiance })
    }

    /// The motion since the picture before. Before the first of several pictures, particles moved as they
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
    pub(super) fn conclude(
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
        let adapter = self.stats.adapter.clone();
        self.writing.push_back(Written { job, ms, adapter, picture });
        self.settle(most, log)
    }

    /// Logs the outcomes of pictures that are written, and waits until no more than `most` are being written.
    pub(super) fn settle(&mut self, most: usize, log: &mut Log) -> limpid_io::Result<()> {
        let bytes = |written: &Written| written.picture.as_ref().map_or(0, |(_, w)| w.bytes());
        while let Some(first) = self.writing.front() {
            let held: usize = self.writing.iter().map(bytes).sum();
            let too_many = self.writing.len() > most || held > writing::MEMORY;
            if !too_many && !first.is_written() {
                break;
            }
            let Some(Written { job, ms, adapter, picture }) = self.writing.pop_front() else {
                break;
            };
            let written = picture.and_then(|(stats, writing)| Ok((stats, writing.wait()?)));
            match written {
                Ok((stats, pixels)) => {
                    self.failures = 0;
                    let outcome = Outcome {
                        pixels: Some(format!("{pixels:08x}")),
                        particles: Some(stats.particles),
                        ms: Some(ms),
                        adapter: Some(adapter),
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

    /// Waits for the pictures that are being written, and logs them: after a failure too, whose error is told.
    pub(super) fn wait(&mut self, log: &mut Log) {
        while !self.writing.is_empty() {
            let _ = self.settle(0, log);
        }
    }

    /// Writes `--stats`.
    pub(super) fn write_stats(&mut self) -> anyhow::Result<()> {
        self.stats.budget = self.budget.as_ref().map(Budget::stats);
        let Some(path) = &self.stats_path else { return Ok(()) };
        let text = serde_json::to_string_pretty(&self.stats)?;
        let write = |file: &mut BufWriter<&File>| file.write_all(text.as_bytes());
        Ok(write_atomically(path, FileKind::MEASUREMENTS, write)?)
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
            Err(Error::Render(DeviceLost(_) | Defect(_))) if self.keep_going => {
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
