//! The thread that draws: a [`Studio`] of its own, the code that `limpid render` runs too.
//!
//! The interface asks and never waits. Of pictures to look at only the newest request counts, older
//! ones are dropped; pictures to save and to measure are all drawn, one after the other.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;
use std::time::Instant;

use eframe::egui::ColorImage;
use glam::UVec2;
use image::RgbImage;

use super::pace::Level;
use super::views::{Legend, Values, View};
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, PassTime};
use crate::input::Loaded;
use crate::output;
use crate::scene::Scene;
use crate::studio::{Shot, Studio};

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
    /// What was drawn.
    pub pane: Pane,
}

/// Something to do.
#[derive(Debug)]
pub enum Job {
    /// Draws a picture and writes it as PNG.
    Save(Pane, PathBuf),
    /// Draws a picture to compare with the truth.
    Measure(Pane),
}

/// What the thread has to say.
#[derive(Debug)]
pub enum Answer {
    /// A device has been opened: its adapter's name.
    Adapter(String),
    /// A request's pictures.
    Drawn(Result<Drawn>),
    /// A picture has been written.
    Saved(Result<PathBuf>),
    /// A picture to compare with the truth, and the time of its passes.
    Measured(Result<Box<(Pane, RgbImage, f64)>>),
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

impl DrawThread {
    /// Starts the thread; `answer` is called on it. The device is opened at the first request.
    pub fn new(answer: impl Fn(Answer) + Send + 'static) -> Self {
        let shared = Arc::new(Shared::default());
        let queue = shared.clone();
        let thread = std::thread::spawn(move || {
            let mut studio = None;
            while let Some(next) = queue.next() {
                answer(act(&mut studio, &answer, next));
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
    pub fn job(&self, job: Job) {
        self.shared.wanted.lock().expect("no panic holds this lock").jobs.push_back(job);
        self.shared.come.notify_one();
    }
}

impl Drop for DrawThread {
    /// Waits for the picture in hand: a device is not to be left while it draws.
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
                return None;
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

/// The studio; the first time, with a device that is opened for it.
fn open<'a>(studio: &'a mut Option<Studio>, answer: &impl Fn(Answer)) -> Result<&'a mut Studio> {
    if studio.is_none() {
        let gpu = Gpu::headless()?;
        answer(Answer::Adapter(gpu.adapter()));
        *studio = Some(Studio::new(&gpu));
    }
    let studio = studio.as_mut().expect("it has just been made");
    studio.renderer.timing = true;
    Ok(studio)
}

fn act(studio: &mut Option<Studio>, answer: &impl Fn(Answer), next: Next) -> Answer {
    let (given, lost) = match next {
        Next::Request(request) => {
            let drawn = open(studio, answer).and_then(|studio| draw(studio, request));
            let lost = matches!(drawn, Err(Error::DeviceLost(_)));
            (Answer::Drawn(drawn), lost)
        }
        Next::Job(Job::Save(pane, path)) => {
            let saved = open(studio, answer).and_then(|studio| save(studio, &pane, path));
            let lost = matches!(saved, Err(Error::DeviceLost(_)));
            (Answer::Saved(saved), lost)
        }
        Next::Job(Job::Measure(pane)) => {
            let measured = open(studio, answer).and_then(|studio| measure(studio, pane));
            let lost = matches!(measured, Err(Error::DeviceLost(_)));
            (Answer::Measured(measured), lost)
        }
    };
    // The next request opens another device.
    if lost {
        *studio = None;
    }
    given
}

/// Draws a picture as `limpid render` does.
///
/// # Errors
/// As [`Studio::draw`].
pub fn picture(studio: &mut Studio, pane: &Pane) -> Result<Shot> {
    studio.draw(&pane.scene, &pane.camera, &pane.loaded.splats, pane.size)
}

fn draw(studio: &mut Studio, request: Request) -> Result<Drawn> {
    let Request { number, panes, level, view } = request;
    studio.renderer.diagnose = view != View::Picture;
    let panes = panes.into_iter().map(|pane| {
        let begun = Instant::now();
        let Shot { picture: shot, passes } = picture(studio, &pane)?;
        let (image, legend, values) = match view.aov() {
            None => {
                let size = [shot.width() as usize, shot.height() as usize];
                (ColorImage::from_rgb(size, shot.as_raw()), Legend::Picture, None)
            }
            Some(aov) => view.shown(&studio.images(&[aov])?, pane.size),
        };
        let ms = 1e3 * begun.elapsed().as_secs_f64();
        Ok(Shown { image, legend, values, passes, ms, pane })
    });
    Ok(Drawn { number, level, panes: panes.collect::<Result<_>>()? })
}

fn save(studio: &mut Studio, pane: &Pane, path: PathBuf) -> Result<PathBuf> {
    studio.renderer.diagnose = false;
    let shot = picture(studio, pane)?;
    output::write_png(&path, &shot.picture)?;
    Ok(path)
}

fn measure(studio: &mut Studio, pane: Pane) -> Result<Box<(Pane, RgbImage, f64)>> {
    studio.renderer.diagnose = false;
    // The first may compile pipelines; it is not counted.
    picture(studio, &pane)?;
    let shot = picture(studio, &pane)?;
    let ms = shot.passes.iter().map(|pass| pass.ms).sum();
    Ok(Box::new((pane, shot.picture, ms)))
}
