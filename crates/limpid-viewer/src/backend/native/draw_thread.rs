//! The draw thread, with its own [`Offscreen`] renderer: the same code as in `limpid render`.
//!
//! The interface sends requests and never blocks. Of pictures for the screen only the newest request
//! counts, and older ones are dropped; pictures to save and to measure are all drawn, in order.

use std::collections::VecDeque;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;

use crate::backend::core::drawing::{self, DeviceEvent, Drawer};
use crate::backend::core::truth::{Point, Truth};
use crate::model::document::Document;
use limpid::gpu::Gpu;
use limpid::offscreen::Offscreen;
use limpid_io::error::Result;
use limpid_io::output::{self, FileKind};
use limpid_lab::compare::{PIXELS_PER_DEGREE, flip};

pub use crate::backend::core::drawing::{Answer, Drawn, Measured, Pane, Request, Shown};

/// A task that is never replaced by a newer one.
#[derive(Debug)]
pub(crate) enum Job {
    /// Opens a device if there is none, to classify particles on it.
    Open,
    /// Draws a picture and writes it, unless it would overwrite part of the open document.
    Save(Pane, PathBuf, Option<Arc<Document>>),
    /// Draws a picture and compares it with the ground truth.
    Measure(Pane, Arc<Truth>),
}

/// A handle to the thread, which ends when this is dropped.
#[derive(Debug)]
pub struct DrawThread {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Shared {
    queue: Mutex<Queue>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Queue {
    newest: Option<Request>,
    jobs: VecDeque<Job>,
    closed: bool,
}

enum Next {
    Request(Request),
    Job(Job),
}

impl DrawThread {
    /// Starts the thread, which calls `open` for a device at the first request and after each loss, and
    /// `answer` with each message.
    pub fn new(
        open: impl FnMut() -> Result<Gpu> + Send + 'static,
        answer: impl Fn(Answer) + Send + 'static,
    ) -> Self {
        let shared = Arc::new(Shared::default());
        let worker_shared = shared.clone();
        let thread = std::thread::spawn(move || {
            let mut open = open;
            let mut worker = Worker { drawer: Drawer::new(async || open()), answer };
            while let Some(next) = worker_shared.next() {
                // Nothing is awaited on a thread: what waits blocks.
                pollster::block_on(worker.act(next));
            }
        });
        Self { shared, thread: Some(thread) }
    }

    /// Requests pictures for the screen, in place of a request that has not begun.
    pub fn request(&self, request: Request) {
        self.shared.queue.lock().expect("no thread panics with this lock").newest = Some(request);
        self.shared.changed.notify_one();
    }

    /// Opens a device if there is none, to classify particles on it.
    pub(crate) fn open_device(&self) {
        self.job(Job::Open);
    }

    /// Draws a picture and writes it, unless it would overwrite part of the open document.
    pub(crate) fn save(&self, pane: Pane, path: PathBuf, open: Option<Arc<Document>>) {
        self.job(Job::Save(pane, path, open));
    }

    /// Queues a task.
    pub(crate) fn job(&self, job: Job) {
        self.shared.queue.lock().expect("no thread panics with this lock").jobs.push_back(job);
        self.shared.changed.notify_one();
    }
}

impl Drop for DrawThread {
    /// Waits for the current picture, because a device must not be released while it draws, and for
    /// pictures to be saved.
    fn drop(&mut self) {
        self.shared.queue.lock().expect("no thread panics with this lock").closed = true;
        self.shared.changed.notify_one();
        if let Some(thread) = self.thread.take() {
            // The thread panics only if the device does, and then there is nothing to report.
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn next(&self) -> Option<Next> {
        let mut queue = self.queue.lock().expect("no thread panics with this lock");
        loop {
            if queue.closed {
                // Finish the pictures to be saved, and nothing else.
                let mut jobs = std::mem::take(&mut queue.jobs).into_iter();
                let save = jobs.find(|job| matches!(job, Job::Save(..)));
                queue.jobs = jobs.collect();
                return save.map(Next::Job);
            }
            // Pictures for the screen have priority.
            if let Some(request) = queue.newest.take() {
                return Some(Next::Request(request));
            }
            if let Some(job) = queue.jobs.pop_front() {
                return Some(Next::Job(job));
            }
            queue = self.changed.wait(queue).expect("no thread panics with this lock");
        }
    }
}

/// The state of the thread.
struct Worker<O, A> {
    drawer: Drawer<O>,
    answer: A,
}

impl<O: AsyncFnMut() -> Result<Gpu>, A: Fn(Answer)> Worker<O, A> {
    async fn act(&mut self, next: Next) {
        let Self { drawer, answer } = self;
        let told = |event| {
            answer(match event {
                DeviceEvent::Opened(adapter) => Answer::Adapter(adapter),
                DeviceEvent::Lost(reason) => Answer::Lost(reason),
            });
        };
        let answered = match next {
            Next::Request(request) => {
                let draw =
                    async |offscreen: &mut Offscreen| drawing::draw(offscreen, &request).await;
                match drawer.attempt(&told, draw).await {
                    Ok(drawn) => Answer::Drawn(drawn),
                    Err(error) => Answer::NotDrawn(request.number, error),
                }
            }
            Next::Job(Job::Open) => {
                // The next picture reports why there is no device.
                let _ = drawing::caught(drawer.offscreen(&told)).await;
                return;
            }
            Next::Job(Job::Save(pane, path, open)) => {
                let allowed =
                    open.map_or(Ok(()), |open| open.check_output(&path, FileKind::PICTURE));
                let save = async |offscreen: &mut Offscreen| save(offscreen, &pane, &path).await;
                let saved = match allowed {
                    Ok(()) => drawer.attempt(&told, save).await,
                    Err(error) => Err(error),
                };
                Answer::Saved(saved.map(|()| path))
            }
            Next::Job(Job::Measure(pane, truth)) => {
                let measure =
                    async |offscreen: &mut Offscreen| measure(offscreen, &pane, &truth).await;
                let point = drawer.attempt(&told, measure).await;
                Answer::Measured(point.map(|point| Measured { truth, point }))
            }
        };
        answer(answered);
    }
}

async fn save(offscreen: &mut Offscreen, pane: &Pane, path: &Path) -> Result<()> {
    let bytes = drawing::encoded(offscreen, pane, path).await?;
    output::write_atomically(path, FileKind::PICTURE, |file| file.write_all(&bytes))
}

async fn measure(offscreen: &mut Offscreen, pane: &Pane, truth: &Truth) -> Result<Point> {
    // The first picture may compile pipelines, so it is not timed.
    drawing::picture(offscreen, pane, false).await?;
    offscreen.renderer.forget();
    let rendered = drawing::picture(offscreen, pane, false).await?;
    let ms = rendered.passes.iter().map(|pass| pass.ms).sum();
    let flip = flip(&truth.picture, &rendered.picture, PIXELS_PER_DEGREE)?.mean();
    Ok(Point::new(&pane.scene.settings, ms, flip))
}
