//! The thread that draws: a [`Offscreen`] of its own, the code that `limpid render` runs too.
//!
//! The interface asks and never waits. Of pictures to look at only the newest request counts, older
//! ones are dropped; pictures to save and to measure are all drawn, one after the other.

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

/// A picture: everything that it depends on.
#[derive(Debug, Clone)]
pub struct Pane {
    /// What is around the liquid, and every setting.
    pub scene: Arc<Scene>,
    /// From where.
    pub camera: Camera,
    /// The liquid.
    pub loaded: Arc<Loaded>,
    /// Pixels.
    pub size: UVec2,
}

/// Pictures to look at: one, or two to compare.
#[derive(Debug, Clone)]
pub struct Request {
    /// Tells requests apart.
    pub number: u64,
    /// What to draw.
    pub panes: Vec<Pane>,
    /// How well it is meant to be.
    pub level: Level,
    /// What of it to show.
    pub view: View,
}

/// A request's pictures.
#[derive(Debug)]
pub struct Drawn {
    /// The request's number.
    pub number: u64,
    /// The request's level.
    pub level: Level,
    /// One for each pane.
    pub panes: Vec<Shown>,
}

/// A picture as it is shown.
#[derive(Debug)]
pub struct Shown {
    /// What to show.
    pub image: ColorImage,
    /// What its colours mean.
    pub legend: Legend,
    /// What its colours stand for at each pixel; none for a picture.
    pub values: Option<Values>,
    /// The time of each pass.
    pub passes: Vec<PassTime>,
    /// Time from the request to the picture in memory, ms.
    pub ms: f64,
    /// Pixels.
    pub size: UVec2,
    /// Rays per pixel.
    pub samples: u32,
}

/// Something to do.
#[derive(Debug)]
pub(crate) enum Job {
    /// Opens a device, if there is none: particles are to be classified on it.
    Open,
    /// Draws a picture and writes it, unless that would replace a part of what is open.
    Save(Pane, PathBuf, Option<Arc<Document>>),
    /// Draws a picture and compares it with the truth.
    Measure(Pane, Arc<Truth>),
}

/// How far a picture is from which truth.
#[derive(Debug)]
pub struct Measured {
    pub(crate) truth: Arc<Truth>,
    pub(crate) point: Point,
}

/// What the thread has to say.
#[derive(Debug)]
pub enum Answer {
    /// A device has been opened: its adapter's name.
    Adapter(String),
    /// The device has been lost, for this reason; another is opened for what was asked.
    Lost(String),
    /// A request's pictures.
    Drawn(Drawn),
    /// The request of this number cannot be drawn.
    NotDrawn(u64, Error),
    /// A picture has been written.
    Saved(Result<PathBuf>),
    /// What some settings draw has been compared with the truth.
    Measured(Result<Measured>),
}

/// The thread, while this lives.
#[derive(Debug)]
pub struct DrawThread {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Shared {
    wanted: Mutex<Wanted>,
    come: Condvar,
}

#[derive(Debug, Default)]
struct Wanted {
    newest: Option<Request>,
    jobs: VecDeque<Job>,
    closed: bool,
}

enum Next {
    Request(Request),
    Job(Job),
}

/// Devices that are opened for one thing to do, before it is given up.
const ATTEMPTS: usize = 3;

/// From a loss to the next device: a driver that has been reset takes a moment.
const PAUSE: Duration = Duration::from_millis(100);

impl DrawThread {
    /// Starts the thread. `open` opens a device on it, at the first request and whenever one is lost;
    /// `answer` is called on it.
    pub fn new(
        open: impl FnMut() -> Result<Gpu> + Send + 'static,
        answer: impl Fn(Answer) + Send + 'static,
    ) -> Self {
        let shared = Arc::new(Shared::default());
        let queue = shared.clone();
        let thread = std::thread::spawn(move || {
            let mut worker = Worker { open, answer, offscreen: None };
            while let Some(next) = queue.next() {
                worker.act(next);
            }
        });
        Self { shared, thread: Some(thread) }
    }

    /// Asks for pictures to look at, in place of any that were asked for and not begun.
    pub fn request(&self, request: Request) {
        self.shared.wanted.lock().expect("no panic holds this lock").newest = Some(request);
        self.shared.come.notify_one();
    }

    /// Asks for something that is not dropped.
    pub(crate) fn job(&self, job: Job) {
        self.shared.wanted.lock().expect("no panic holds this lock").jobs.push_back(job);
        self.shared.come.notify_one();
    }
}

impl Drop for DrawThread {
    /// Waits for the picture in hand, for a device is not to be left while it draws, and for those
    /// that are to be saved.
    fn drop(&mut self) {
        self.shared.wanted.lock().expect("no panic holds this lock").closed = true;
        self.shared.come.notify_one();
        if let Some(thread) = self.thread.take() {
            // It has panicked only if the device has; there is nothing left to say then.
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn next(&self) -> Option<Next> {
        let mut wanted = self.wanted.lock().expect("no panic holds this lock");
        loop {
            if wanted.closed {
                // Only what is to stay.
                let mut jobs = std::mem::take(&mut wanted.jobs).into_iter();
                let save = jobs.find(|job| matches!(job, Job::Save(..)));
                wanted.jobs = jobs.collect();
                return save.map(Next::Job);
            }
            // What is looked at comes first.
            if let Some(request) = wanted.newest.take() {
                return Some(Next::Request(request));
            }
            if let Some(job) = wanted.jobs.pop_front() {
                return Some(Next::Job(job));
            }
            wanted = self.come.wait(wanted).expect("no panic holds this lock");
        }
    }
}

/// What the thread works with.
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
                // Why there is none is told when a picture is wanted.
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

    /// Does something in the offscreen; if its device is lost, again in another one.
    fn attempt<T>(&mut self, act: impl Fn(&mut Offscreen) -> Result<T>) -> Result<T> {
        for left in (0..ATTEMPTS).rev() {
            // Whoever waits for an answer must get one, even of a defect.
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

    /// The offscreen, on a device that is opened for it if there is none.
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
    Ok(offscreen.draw(&pane.scene, &pane.camera, &pane.loaded.splats, pane.size)?)
}

fn draw(offscreen: &mut Offscreen, request: &Request) -> Result<Drawn> {
    let &Request { number, ref panes, level, view } = request;
    offscreen.renderer.diagnose = view != View::Picture;
    let panes = panes.iter().map(|pane| {
        let begun = Instant::now();
        let RenderedFrame { picture: shot, passes } = picture(offscreen, pane)?;
        let (image, legend, values) = match view.aov() {
            None => {
                let size = [shot.width() as usize, shot.height() as usize];
                (ColorImage::from_rgb(size, shot.as_raw()), Legend::Picture, None)
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
    let shot = picture(offscreen, pane)?;
    match PictureFormat::of(path)? {
        PictureFormat::Exr => limpid_io::exr::write(path, vec![offscreen.radiance()?]),
        _ => output::write_picture(path, &shot.picture, &[]),
    }
}

fn measure(offscreen: &mut Offscreen, pane: &Pane, truth: &Truth) -> Result<Point> {
    offscreen.renderer.diagnose = false;
    // The first may compile pipelines; it is not counted.
    picture(offscreen, pane)?;
    offscreen.renderer.forget();
    let shot = picture(offscreen, pane)?;
    let ms = shot.passes.iter().map(|pass| pass.ms).sum();
    let flip = flip(&truth.picture, &shot.picture, PIXELS_PER_DEGREE)?.mean();
    Ok(Point::new(&pane.scene.settings, ms, flip))
}
