//! The draw thread, with its own [`Offscreen`] renderer: the same code as in `limpid render`.
//!
//! The interface sends requests and never blocks. Of pictures for the screen only the newest request
//! counts, and older ones are dropped; pictures to save and to measure are all drawn, in order.

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use eframe::egui::ColorImage;
use glam::UVec2;

use crate::adaptive_resolution::Level;
use crate::document::Document;
use crate::truth::{Point, Truth};
use crate::views::{Legend, Values, View};
use limpid::Error::{Defect, DeviceLost};
use limpid::camera::Camera;
use limpid::gpu::{Gpu, PassTime};
use limpid::offscreen::{Offscreen, RenderedFrame};
use limpid::scene::Scene;
use limpid_io::error::{Error, Result};
use limpid_io::input::Loaded;
use limpid_io::output::{self, FileKind, PictureFormat};
use limpid_lab::compare::{PIXELS_PER_DEGREE, flip};

/// The inputs of a picture.
#[derive(Debug, Clone)]
pub struct Pane {
    /// Everything around the liquid, and all settings.
    pub scene: Arc<Scene>,
    /// The camera.
    pub camera: Camera,
    /// The liquid.
    pub loaded: Arc<Loaded>,
    /// Size in pixels.
    pub size: UVec2,
}

/// A request for the screen: one picture, or two to compare.
#[derive(Debug, Clone)]
pub struct Request {
    /// Identifies the request.
    pub number: u64,
    /// The pictures to draw.
    pub panes: Vec<Pane>,
    /// Their quality.
    pub level: Level,
    /// The view mode.
    pub view: View,
}

/// A request's pictures.
#[derive(Debug)]
pub struct Drawn {
    /// The request's number.
    pub number: u64,
    /// The request's level.
    pub level: Level,
    /// One picture for each pane.
    pub panes: Vec<Shown>,
}

/// A picture ready for the screen.
#[derive(Debug)]
pub struct Shown {
    /// The image to show.
    pub image: ColorImage,
    /// The meaning of its colours.
    pub legend: Legend,
    /// The values behind its colours; `None` for a picture.
    pub values: Option<Values>,
    /// The time of each pass.
    pub passes: Vec<PassTime>,
    /// Time from the request to the picture in memory, ms.
    pub ms: f64,
    /// Size in pixels.
    pub size: UVec2,
    /// Rays per pixel.
    pub samples: u32,
}

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

/// The error of a picture against a ground truth.
#[derive(Debug)]
pub struct Measured {
    pub(crate) truth: Arc<Truth>,
    pub(crate) point: Point,
}

/// A message from the draw thread.
#[derive(Debug)]
pub enum Answer {
    /// A device has been opened: its adapter's name.
    Adapter(String),
    /// The device has been lost, for this reason; another one is opened for the request.
    Lost(String),
    /// A request's pictures.
    Drawn(Drawn),
    /// The request of this number cannot be drawn.
    NotDrawn(u64, Error),
    /// A picture has been written.
    Saved(Result<PathBuf>),
    /// A picture has been compared with the ground truth.
    Measured(Result<Measured>),
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

/// Number of devices to try for one request before it fails.
const ATTEMPTS: usize = 3;

/// Delay between a loss and the next device, while the driver resets.
const PAUSE: Duration = Duration::from_millis(100);

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
            let mut worker = Worker { open, answer, offscreen: None };
            while let Some(next) = worker_shared.next() {
                worker.act(next);
            }
        });
        Self { shared, thread: Some(thread) }
    }

    /// Requests pictures for the screen, in place of a request that has not begun.
    pub fn request(&self, request: Request) {
        self.shared.queue.lock().expect("no thread panics with this lock").newest = Some(request);
        self.shared.changed.notify_one();
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
    open: O,
    answer: A,
    offscreen: Option<Offscreen>,
}

impl<O: FnMut() -> Result<Gpu>, A: Fn(Answer)> Worker<O, A> {
    fn act(&mut self, next: Next) {
        let answer = match next {
            Next::Request(request) => match self.attempt(|offscreen| draw(offscreen, &request)) {
                Ok(drawn) => Answer::Drawn(drawn),
                Err(error) => Answer::NotDrawn(request.number, error),
            },
            Next::Job(Job::Open) => {
                // The next picture reports why there is no device.
                let _ = catch_unwind(AssertUnwindSafe(|| self.offscreen().map(|_| ())));
                return;
            }
            Next::Job(Job::Save(pane, path, open)) => {
                let allowed =
                    open.map_or(Ok(()), |open| open.check_output(&path, FileKind::PICTURE));
                let saved =
                    allowed.and_then(|()| self.attempt(|offscreen| save(offscreen, &pane, &path)));
                Answer::Saved(saved.map(|()| path))
            }
            Next::Job(Job::Measure(pane, truth)) => {
                let point = self.attempt(|offscreen| measure(offscreen, &pane, &truth));
                Answer::Measured(point.map(|point| Measured { truth, point }))
            }
        };
        (self.answer)(answer);
    }

    /// Runs `act` on the offscreen renderer; if its device is lost, again on another one.
    fn attempt<T>(&mut self, act: impl Fn(&mut Offscreen) -> Result<T>) -> Result<T> {
        for left in (0..ATTEMPTS).rev() {
            // Every request must get an answer, even after a panic.
            let done = catch_unwind(AssertUnwindSafe(|| act(self.offscreen()?)));
            let defect = |_| Err(Error::from(Defect("a picture could not be drawn".into())));
            match done.unwrap_or_else(defect) {
                Err(Error::Render(DeviceLost(reason))) if left > 0 => {
                    self.offscreen = None;
                    (self.answer)(Answer::Lost(reason));
                    std::thread::sleep(PAUSE);
                }
                Err(error) => {
                    if matches!(error, Error::Render(DeviceLost(_) | Defect(_))) {
                        self.offscreen = None;
                    }
                    return Err(error);
                }
                done => return done,
            }
        }
        unreachable!("the last attempt returns")
    }

    /// The offscreen renderer; opens a device if there is none.
    fn offscreen(&mut self) -> Result<&mut Offscreen> {
        let offscreen = match self.offscreen.take() {
            Some(offscreen) => offscreen,
            None => {
                let gpu = (self.open)()?;
                (self.answer)(Answer::Adapter(gpu.adapter()));
                Offscreen::new(&gpu)
            }
        };
        let offscreen = self.offscreen.insert(offscreen);
        offscreen.renderer.timing = true;
        offscreen.renderer.reuse = true;
        Ok(offscreen)
    }
}

/// Draws a picture as `limpid render` does.
///
/// # Errors
/// As [`Offscreen::draw`].
pub fn picture(offscreen: &mut Offscreen, pane: &Pane) -> Result<RenderedFrame> {
    Ok(offscreen.draw(
        &pane.loaded.scene(&pane.scene),
        &pane.camera,
        &pane.loaded.splats,
        pane.size,
    )?)
}

fn draw(offscreen: &mut Offscreen, request: &Request) -> Result<Drawn> {
    let &Request { number, ref panes, level, view } = request;
    offscreen.renderer.diagnose = view != View::Picture;
    let panes = panes.iter().map(|pane| {
        let begun = Instant::now();
        let RenderedFrame { picture: rendered, passes, .. } = picture(offscreen, pane)?;
        let (image, legend, values) = match view.aov() {
            None => {
                let size = [rendered.width() as usize, rendered.height() as usize];
                (ColorImage::from_rgb(size, rendered.as_raw()), Legend::Picture, None)
            }
            Some(aov) => view.shown(&offscreen.images(&[aov])?, pane.size),
        };
        let ms = 1e3 * begun.elapsed().as_secs_f64();
        let (size, samples) = (pane.size, pane.scene.settings.refract.samples);
        Ok(Shown { image, legend, values, passes, ms, size, samples })
    });
    Ok(Drawn { number, level, panes: panes.collect::<Result<_>>()? })
}

fn save(offscreen: &mut Offscreen, pane: &Pane, path: &Path) -> Result<()> {
    offscreen.renderer.diagnose = false;
    let rendered = picture(offscreen, pane)?;
    match PictureFormat::of(path)? {
        PictureFormat::Exr => limpid_io::exr::write(path, vec![offscreen.radiance()?]),
        _ => output::write_picture(path, &rendered.into_image(), &[]),
    }
}

fn measure(offscreen: &mut Offscreen, pane: &Pane, truth: &Truth) -> Result<Point> {
    offscreen.renderer.diagnose = false;
    // The first picture may compile pipelines, so it is not timed.
    picture(offscreen, pane)?;
    offscreen.renderer.forget();
    let rendered = picture(offscreen, pane)?;
    let ms = rendered.passes.iter().map(|pass| pass.ms).sum();
    let flip = flip(&truth.picture, &rendered.picture, PIXELS_PER_DEGREE)?.mean();
    Ok(Point::new(&pane.scene.settings, ms, flip))
}
