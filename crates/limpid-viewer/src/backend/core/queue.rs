//! Queue of pictures to draw, and their delivery.
//!
//! Of pictures for the screen only the newest request counts, and older ones are dropped; pictures to save and to
//! measure are all drawn, in order. Long work is ended early for a newer request: a picture to save or to
//! measure is begun again after that.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use image::RgbImage;

use crate::backend::core::drawing::{self, Answer, DeviceEvent, Drawer, Measured, Pane, Request};
use crate::backend::core::recoloring::Recolored;
use crate::backend::core::truth::{Point, Truth};
use crate::model::document::Document;
use crate::model::level::Level;
use limpid::gpu::Gpu;
use limpid::offscreen::Offscreen;
use limpid_io::error::{Error, Result};
use limpid_io::output::FileKind;

/// The difference between a truth and a picture, 0 to 1.
pub type Metric = fn(&RgbImage, &RgbImage) -> Result<f64>;

/// A task that is never replaced by a newer one.
#[derive(Debug)]
pub enum Job {
    /// Opens a device if there is none, to classify particles on it.
    Open,
    /// Draws a picture and writes it, unless it would overwrite part of the open document.
    Save(Pane, PathBuf, Option<Arc<Document>>),
    /// Draws a picture and compares it with the ground truth.
    Measure(Pane, Arc<Truth>, Metric),
    /// Loses the device, for tests.
    Lose,
}

/// Pictures to draw.
#[derive(Debug, Default)]
pub struct Queue {
    newest: Option<Request>,
    jobs: VecDeque<Job>,
    /// The drawing at work.
    current: Current,
    closed: bool,
}

/// The drawing at work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Current {
    /// Nothing, or a coarse picture: if these were ended early, a camera that moves would show none.
    #[default]
    Draft,
    /// A better picture for the screen.
    Better,
    /// A task.
    Job,
}

/// Picture to draw next.
#[derive(Debug)]
pub(crate) enum Next {
    Request(Request),
    Job(Job),
}

impl Queue {
    /// Requests pictures for the screen, or none, in place of a request that has not begun.
    pub(crate) fn request(&mut self, request: Option<Request>) {
        self.newest = request;
    }

    pub(crate) fn push(&mut self, job: Job) {
        self.jobs.push_back(job);
    }

    /// Puts a task back that was ended early: it is the next one.
    pub fn put_back(&mut self, job: Job) {
        self.jobs.push_front(job);
    }

    /// Whether what is being drawn should end early: for a newer request, or at the end, which waits for tasks alone.
    pub fn interrupts(&self) -> bool {
        match self.current {
            Current::Draft => false,
            Current::Better => self.is_wanted() || self.closed,
            Current::Job => self.is_wanted(),
        }
    }

    /// Drops all but the pictures to be saved.
    pub fn close(&mut self) {
        self.newest = None;
        self.jobs.retain(|job| matches!(job, Job::Save(..)));
        self.closed = true;
    }

    /// Whether nothing more will be added.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Whether pictures for the screen are requested.
    pub fn is_wanted(&self) -> bool {
        self.newest.is_some()
    }

    /// Takes the next picture: those for the screen first.
    pub(crate) fn next(&mut self) -> Option<Next> {
        let request = self.newest.take().map(Next::Request);
        let next = request.or_else(|| self.jobs.pop_front().map(Next::Job));
        self.current = match &next {
            Some(Next::Job(_)) => Current::Job,
            Some(Next::Request(request)) if request.level > Level::Draft => Current::Better,
            _ => Current::Draft,
        };
        next
    }
}

/// Draws the pictures of a queue.
pub(crate) struct Artist<O, A, W> {
    drawer: Drawer<O>,
    recolored: Recolored,
    answer: A,
    write: W,
}

impl<O, A, W> Artist<O, A, W>
where
    O: AsyncFnMut() -> Result<Gpu>,
    A: Fn(Answer),
    W: Fn(&Path, &[u8]) -> Result<()>,
{
    /// `open` opens a device, `answer` is told of each result, and `write` takes encoded pictures.
    pub(crate) fn new(open: O, answer: A, write: W) -> Self {
        Self { drawer: Drawer::new(open), recolored: Recolored::default(), answer, write }
    }

    /// Draws the next picture. Returns a task that was ended early, to be begun again.
    pub(crate) async fn act(&mut self, next: Next) -> Option<Job> {
        let Self { drawer, recolored, answer, write } = self;
        let told = |event| {
            answer(match event {
                DeviceEvent::Opened(adapter) => Answer::Adapter(adapter),
                DeviceEvent::Lost(reason) => Answer::Lost(reason),
            });
        };
        let answered = match next {
            Next::Request(request) => {
                let colors = request.panes.iter().map(|pane| recolored.of(pane));
                let drawn = match colors.collect::<Result<Vec<_>>>() {
                    Ok(colors) => {
                        let draw = async |offscreen: &mut Offscreen| {
                            drawing::draw(offscreen, &request, &colors).await
                        };
                        drawer.attempt(&told, draw).await
                    }
                    Err(error) => Err(error),
                };
                if is_interrupted(&drawn) {
                    // A newer request takes its place.
                    return None;
                }
                drawn.map_or_else(|error| Answer::NotDrawn(request.number, error), Answer::Drawn)
            }
            Next::Job(Job::Open) => {
                // The next picture reports why there is no device.
                let _ = drawing::caught(drawer.offscreen(&told)).await;
                return None;
            }
            Next::Job(Job::Save(pane, path, open)) => {
                let allowed = open
                    .as_ref()
                    .map_or(Ok(()), |open| open.check_output(&path, FileKind::PICTURE));
                let saved = match allowed.and_then(|()| recolored.of(&pane)) {
                    Ok(colors) => {
                        let save = async |offscreen: &mut Offscreen| {
                            let colors = colors.as_ref();
                            write(&path, &drawing::encoded(offscreen, &pane, colors, &path).await?)
                        };
                        drawer.attempt(&told, save).await
                    }
                    Err(error) => Err(error),
                };
                if is_interrupted(&saved) {
                    return Some(Job::Save(pane, path, open));
                }
                Answer::Saved(saved.map(|()| path))
            }
            Next::Job(Job::Measure(pane, truth, metric)) => {
                let measure = async |offscreen: &mut Offscreen| {
                    measure(offscreen, &pane, &truth, metric).await
                };
                let point = drawer.attempt(&told, measure).await;
                if is_interrupted(&point) {
                    return Some(Job::Measure(pane, truth, metric));
                }
                Answer::Measured(point.map(|point| Measured { truth, point }))
            }
            Next::Job(Job::Lose) => {
                if let Ok(offscreen) = drawer.offscreen(&told).await {
                    offscreen.gpu().device.destroy();
                }
                return None;
            }
        };
        answer(answered);
        None
    }
}

/// Whether something was ended early.
fn is_interrupted<T>(drawn: &Result<T>) -> bool {
    matches!(drawn, Err(Error::Render(limpid::Error::Interrupted)))
}

async fn measure(
    offscreen: &mut Offscreen,
    pane: &Pane,
    truth: &Truth,
    metric: Metric,
) -> Result<Point> {
    // The first picture may compile pipelines, so it is not timed.
    drawing::picture(offscreen, pane, None, false).await?;
    offscreen.renderer.forget();
    let rendered = drawing::picture(offscreen, pane, None, false).await?;
    let ms = rendered.passes.iter().map(|pass| pass.ms).sum();
    let flip = metric(&truth.picture, &rendered.picture)?;
    Ok(Point::new(&pane.scene.settings, ms, flip))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::views::View;
    use glam::{DVec3, UVec2};
    use limpid::camera::Camera;

    fn request(number: u64) -> Request {
        Request { number, panes: Vec::new(), level: Level::Draft, view: View::Picture }
    }

    fn better(number: u64) -> Request {
        Request { level: Level::Fine, ..request(number) }
    }

    fn save(name: &str) -> Job {
        let camera = Camera::fit(-DVec3::ONE, DVec3::ONE);
        let (scene, loaded, scale) = Default::default();
        let pane = Pane { scene, camera, loaded, size: UVec2::ONE, scale, legend: false };
        Job::Save(pane, name.into(), None)
    }

    fn done(queue: &mut Queue) -> Vec<String> {
        let next = std::iter::from_fn(|| queue.next());
        next.map(|next| match next {
            Next::Request(request) => format!("request {}", request.number),
            Next::Job(Job::Save(_, path, _)) => format!("save {}", path.display()),
            Next::Job(job) => format!("{job:?}"),
        })
        .collect()
    }

    /// The newest request comes first and replaces older ones; tasks keep their order; a closed queue only saves.
    #[test]
    fn only_tasks_outlast_newer_requests() {
        let filled = || {
            let mut queue = Queue::default();
            queue.push(save("a.png"));
            queue.push(Job::Open);
            queue.request(Some(request(1)));
            queue.request(Some(request(2)));
            queue.push(save("b.png"));
            queue
        };
        let mut queue = filled();
        assert!(queue.is_wanted());
        assert_eq!(done(&mut queue), ["request 2", "save a.png", "Open", "save b.png"]);
        let mut queue = filled();
        queue.close();
        assert_eq!(done(&mut queue), ["save a.png", "save b.png"]);
        assert!(queue.is_closed());
    }

    /// A newer request ends a better picture and a task early, but no coarse picture; the end waits for tasks.
    #[test]
    fn newer_requests_end_what_takes_long() {
        let mut queue = Queue::default();
        queue.request(Some(request(1)));
        queue.next();
        queue.request(Some(better(2)));
        assert!(!queue.interrupts(), "a coarse picture");
        queue.next();
        assert!(!queue.interrupts(), "nothing newer");
        queue.push(save("a.png"));
        assert!(!queue.interrupts(), "tasks wait");
        queue.request(Some(request(3)));
        assert!(queue.interrupts());
        queue.next();
        queue.next();
        queue.request(Some(request(4)));
        assert!(queue.interrupts(), "a task");
        queue.put_back(save("a.png"));
        queue.push(save("b.png"));
        assert_eq!(done(&mut queue), ["request 4", "save a.png", "save b.png"]);
        queue.push(save("c.png"));
        queue.next();
        queue.close();
        assert!(!queue.interrupts(), "it is saved before the end");
    }
}
