//! The work on threads.
//!
//! The draw thread ([`draw_thread`]) runs the code of `limpid render`. The workers of a
//! [`limpid_io::frame_cache::FrameCache`] load and classify frames ahead. Other long tasks (opening, simulating,
//! dialogs, ground truth, films) each have a temporary thread.

mod demos;
pub mod draw_thread;
pub(crate) mod filming;
mod truth;

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Instant;

use crate::backend::core::drawing::{Pane, Request};
use crate::backend::core::loading::Loader;
use crate::backend::core::messages::{Message, Post};
use crate::backend::core::opening;
use crate::backend::core::picking::{Sight, pick};
use crate::backend::core::queue::Job;
use crate::backend::core::truth::Truth;
use crate::model::document::{Document, Source};
use draw_thread::DrawThread;
use filming::Script;
use limpid::camera::Camera;
use limpid::gpu::Gpu;
use limpid::scene::Scene;
use limpid_io::bake::{self, Bake};
use limpid_io::camera_path::CameraPath;
use limpid_io::color_by::ColorBy;
use limpid_io::error::Result;
use limpid_io::input::FrameTime;
use limpid_io::output::FileKind;
use limpid_io::shared_classifier::{Processor, SharedClassifier};
use limpid_lab::compare::{PIXELS_PER_DEGREE, flip};

pub(crate) use limpid_io::frame_cache::FrameCache;

/// The threads of a viewer.
#[derive(Debug)]
pub(crate) struct Backend {
    post: Post,
    drawing: DrawThread,
    /// The classifier of the particles.
    classifier: SharedClassifier,
    /// Whether the draw thread has been asked to open a device for them.
    device_asked: bool,
    /// Threads that write files.
    writers: Vec<JoinHandle<()>>,
}

impl Drop for Backend {
    /// Waits for files being written and particles being classified on the device; [`DrawThread`] waits for
    /// its own work.
    fn drop(&mut self) {
        self.classifier.close();
        for writer in self.writers.drain(..) {
            // A panic of the writer can no longer be reported.
            let _ = writer.join();
        }
    }
}

impl Backend {
    /// Starts the draw thread, with devices from `open`: one for the first picture, and another after each loss.
    pub(crate) fn new(post: Post, open: impl FnMut() -> Result<Gpu> + Send + 'static) -> Self {
        let classifier = SharedClassifier::default();
        let open = {
            let (mut open, classifier) = (open, classifier.clone());
            move || {
                // Threads that wait for a device must learn that there is none, even after a panic.
                let opened = catch_unwind(AssertUnwindSafe(&mut open));
                classifier.set(opened.as_ref().ok().and_then(|opened| opened.as_ref().ok()));
                opened.unwrap_or_else(|panic| resume_unwind(panic))
            }
        };
        let drawing = {
            let post = post.clone();
            DrawThread::new(open, move |answer| post.send(Message::Drawing(answer)))
        };
        Self { post, drawing, classifier, device_asked: false, writers: Vec::new() }
    }

    /// Opens a source, and simulates its missing frames until `stop` is set.
    pub(crate) fn open(&self, number: u64, source: &Source, _again: bool, stop: Arc<AtomicBool>) {
        let (post, source) = (self.post.clone(), source.clone());
        std::thread::spawn(move || {
            let document = || Document::open(&source);
            let report = |message| post.send(message);
            let opened =
                opening::open(number, &source, document, report, async |project, reports| {
                    let Some(simulation) = project.source.simulation() else { return Ok(()) };
                    reports.attempt(false);
                    let path = Path::new(&source.input);
                    let name = path.file_stem().unwrap_or_default().to_string_lossy();
                    let folder = bake::folder(path);
                    let solids = &project.scene.solids;
                    let mut bake = Bake::in_folder(simulation, solids, &name, &folder)?;
                    while let Some(progress) = bake.step()? {
                        reports.progressed(progress);
                        if stop.load(Ordering::Relaxed) {
                            break;
                        }
                    }
                    Ok(())
                });
            // Nothing is awaited on a thread: what waits blocks.
            pollster::block_on(opened);
        });
    }

    /// Ends the simulation of an opening, whose frames stay.
    pub(crate) fn halt(&self, _number: u64, stop: &AtomicBool) {
        stop.store(true, Ordering::Relaxed);
    }

    /// Opens the source of an opening again, which has more frames.
    pub(crate) fn grow(&self, number: u64, source: &Source) {
        let (post, source) = (self.post.clone(), source.clone());
        std::thread::spawn(move || {
            post.send(Message::Grown(number, Box::new(Document::open(&source))));
        });
    }

    /// Reads the attributes of a document's first frame.
    pub(crate) fn attributes(&self, number: u64, document: &Document) {
        let (post, input) = (self.post.clone(), document.input.clone());
        std::thread::spawn(move || {
            post.send(Message::Attributes(number, Box::new(input.attributes())));
        });
    }

    /// Finds the particle in a line of sight.
    pub(crate) fn pick(
        &self,
        number: u64,
        (document, by): (&Document, Option<ColorBy>),
        at: FrameTime,
        sight: Sight,
    ) {
        let (post, input) = (self.post.clone(), document.input.clone());
        std::thread::spawn(move || {
            post.send(Message::Picked(number, pick(&input, by, at, &sight)));
        });
    }

    /// A cache that loads frames of a document on threads of its own.
    pub(crate) fn cache(
        &self,
        document: &Document,
        frame_times: &Arc<[FrameTime]>,
        scene: &Scene,
        processor: Processor,
        budget: u64,
    ) -> FrameCache {
        let classifier = (&self.classifier, processor);
        let loader = Loader::new(document, frame_times.clone(), scene.clone(), classifier);
        let workers = std::thread::available_parallelism().map_or(1, |n| n.get());
        let (count, workers) = (frame_times.len(), workers.min(frame_times.len()));
        let load = move |i: usize| pollster::block_on(loader.load(i));
        let post = self.post.clone();
        FrameCache::new(count, budget, workers, load, move |_| post.send(Message::Loaded))
    }

    /// Has a device opened, if frames are to be classified on it. The first picture opens one, but it needs its
    /// particles first.
    pub(crate) fn prepare_device(&mut self, processor: Processor) {
        if processor == Processor::Gpu && !self.device_asked {
            self.device_asked = true;
            if self.classifier.wait_for_device() {
                self.drawing.job(Job::Open);
            }
        }
    }

    /// Requests pictures for the screen, in place of a request that has not begun.
    pub(crate) fn request(&self, request: Request) {
        self.drawing.request(request);
    }

    /// Draws a picture and writes it, unless it would overwrite part of the open document.
    pub(crate) fn save(&self, pane: Pane, path: PathBuf, open: Option<Arc<Document>>) {
        self.drawing.job(Job::Save(pane, path, open));
    }

    /// Draws a picture and compares it with the ground truth.
    pub(crate) fn measure(&self, pane: Pane, truth: Arc<Truth>) {
        let metric = |truth: &_, picture: &_| Ok(flip(truth, picture, PIXELS_PER_DEGREE)?.mean());
        self.drawing.job(Job::Measure(pane, truth, metric));
    }

    /// Traces the ground truth of a view.
    pub(crate) fn trace(
        &self,
        number: u64,
        document: Arc<Document>,
        scene: Scene,
        camera: Camera,
        at: FrameTime,
    ) {
        let post = self.post.clone();
        std::thread::spawn(move || {
            let truth = truth::of(&document, &scene, &camera, at);
            post.send(Message::Traced(number, Box::new(truth)));
        });
    }

    /// Draws and writes a film until `stop` is set, unless it would overwrite part of the open document.
    pub(crate) fn film(
        &mut self,
        script: Script,
        path: PathBuf,
        document: Arc<Document>,
        stop: Arc<AtomicBool>,
    ) {
        let post = self.post.clone();
        self.spawn_writer(move || {
            let checked = document.check_output(&path, FileKind::FILM);
            let written = checked.and_then(|()| {
                filming::write(&script, &path, |done| {
                    post.send(Message::Filmed(done));
                    !stop.load(Ordering::Relaxed)
                })
            });
            post.send(Message::FilmEnded(written.map(|whole| whole.then_some(path))));
        });
    }

    /// Writes a file on its own thread.
    pub(crate) fn write(
        &mut self,
        path: PathBuf,
        write: impl FnOnce(&Path) -> Result<()> + Send + 'static,
    ) {
        let post = self.post.clone();
        self.spawn_writer(move || post.send(Message::Saved(write(&path).map(|()| path))));
    }

    /// Starts a thread that is joined when this is dropped.
    fn spawn_writer(&mut self, write: impl FnOnce() + Send + 'static) {
        self.writers.retain(|writer| !writer.is_finished());
        self.writers.push(std::thread::spawn(write));
    }

    /// Reads a camera path.
    pub(crate) fn load_path(&self, path: PathBuf) {
        let post = self.post.clone();
        std::thread::spawn(move || {
            let keys = CameraPath::load(&path);
            post.send(Message::Path(path, keys));
        });
    }

    /// Shows a dialog of the system.
    pub(crate) fn choose(&self, choose: impl FnOnce() -> Option<PathBuf> + Send + 'static) {
        let post = self.post.clone();
        std::thread::spawn(move || {
            let begun = Instant::now();
            let chosen = choose();
            post.send(Message::Chosen(chosen, begun.elapsed()));
        });
    }
}

/// Runs `work` on a thread of its own.
pub(crate) fn spawn(work: impl FnOnce() + Send + 'static) {
    std::thread::spawn(work);
}

/// Drops a possibly large value on a thread, because that can take too long for the interface.
pub(crate) fn drop_in_background(what: impl Send + 'static) {
    spawn(move || drop(what));
}
