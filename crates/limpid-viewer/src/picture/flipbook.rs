//! The flipbook: pictures of a sequence that are kept once they are drawn.
//!
//! Where drawing takes longer than a frame lasts, playback draws each frame at full size once and shows it when it
//! is done; after that it plays from memory, at its own speed. Where drawing is faster, nothing is kept.

use std::collections::BTreeMap;
use std::time::Duration;

use web_time::Instant;

use glam::UVec2;

use crate::model::views::View;
use crate::picture::texture::Picture;
use limpid::camera::Camera;
use limpid::scene::Scene;
use limpid_io::camera_path::CameraPath;
use limpid_io::color_by::ColorScale;
use limpid_io::input::FrameTime;
use limpid_io::shared_classifier::Processor;

/// Properties that all pictures of a book share.
#[derive(Debug, Clone, PartialEq)]
pub struct Subject {
    /// The settings on screen, as scenes: one, or two that are compared.
    pub scenes: Vec<Scene>,
    /// Size of each picture, pixels.
    pub size: UVec2,
    /// The view mode.
    pub view: View,
    /// The processor that classifies the particles.
    pub processor: Processor,
    /// The camera.
    pub viewpoint: Viewpoint,
    /// The values that its particles' colours show.
    pub scale: Option<ColorScale>,
}

/// The camera of a book.
#[derive(Debug, Clone, PartialEq)]
pub enum Viewpoint {
    /// One for all frames.
    Fixed(Camera),
    /// A path that playback follows.
    Path(CameraPath),
}

/// A frame time, as a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Moment(i64, i64, u64);

impl From<FrameTime> for Moment {
    fn from(at: FrameTime) -> Self {
        Self(at.frame, at.next, at.fraction.to_bits())
    }
}

/// Pictures of type `P` by subject and moment, within a budget of memory.
#[derive(Debug)]
pub struct Flipbook<P> {
    /// The last used first.
    books: Vec<Book<P>>,
    /// Bytes of all pictures.
    bytes: u64,
    budget: u64,
}

#[derive(Debug)]
struct Book<P> {
    subject: Subject,
    pages: BTreeMap<Moment, Page<P>>,
    /// Whether a page did not fit the budget.
    full: bool,
}

#[derive(Debug)]
struct Page<P> {
    pictures: P,
    bytes: u64,
}

impl<P> Flipbook<P> {
    /// A flipbook of at most `budget` bytes; 0 keeps nothing.
    pub fn new(budget: u64) -> Self {
        Self { books: Vec::new(), bytes: 0, budget }
    }

    fn book(&self, subject: &Subject) -> Option<&Book<P>> {
        self.books.iter().find(|book| book.subject == *subject)
    }

    /// The pictures of a moment, if they are kept.
    pub fn get(&self, subject: &Subject, at: Moment) -> Option<&P> {
        self.book(subject)?.pages.get(&at).map(|page| &page.pictures)
    }

    /// Whether each of these moments is kept.
    pub fn holds<'a>(
        &'a self,
        subject: &Subject,
        moments: impl IntoIterator<Item = Moment> + 'a,
    ) -> impl Iterator<Item = bool> + 'a {
        let pages = self.book(subject).map(|book| &book.pages);
        moments.into_iter().map(move |at| pages.is_some_and(|pages| pages.contains_key(&at)))
    }

    /// Whether a picture of this subject did not fit.
    pub fn is_full(&self, subject: &Subject) -> bool {
        self.budget == 0 || self.book(subject).is_some_and(|book| book.full)
    }

    /// Keeps pictures of a moment, in place of older ones. Books of other subjects make room, the one that was
    /// used least recently first. If that is not enough, the pictures are not kept.
    pub fn keep(&mut self, subject: &Subject, at: Moment, pictures: P, bytes: u64) {
        let found = self.books.iter().position(|book| book.subject == *subject);
        let mut book = match found {
            Some(i) => self.books.remove(i),
            None => Book { subject: subject.clone(), pages: BTreeMap::new(), full: false },
        };
        if let Some(old) = book.pages.remove(&at) {
            self.bytes -= old.bytes;
        }
        while self.bytes + bytes > self.budget
            && let Some(oldest) = self.books.pop()
        {
            self.bytes -= oldest.pages.values().map(|page| page.bytes).sum::<u64>();
        }
        if self.bytes + bytes <= self.budget {
            self.bytes += bytes;
            book.pages.insert(at, Page { pictures, bytes });
        } else {
            book.full = true;
        }
        self.books.insert(0, book);
    }

    /// Bytes of all pictures.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Drops all pictures.
    pub fn clear(&mut self) {
        self.books.clear();
        self.bytes = 0;
    }
}

/// The progress of a flipbook.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Frames that are drawn.
    pub drawn: usize,
    /// Frames that playback shows.
    pub frames: usize,
    /// Whether no further frame fits the memory.
    pub full: bool,
    /// Expected time until all are drawn; `None` if unknown.
    pub left: Option<Duration>,
}

/// The flipbook of the viewer, and its pace.
#[derive(Debug)]
pub(crate) struct Flipping {
    pub(crate) book: Flipbook<Vec<Picture>>,
    /// Whether drawing takes longer than a frame lasts.
    pub(crate) needed: bool,
    /// The moment whose kept pictures are on screen.
    pub(crate) shown: Option<Moment>,
    /// Picture of the newest request; `None` if it is not to be kept.
    pub(crate) asked: Option<(Subject, Moment)>,
    /// When a picture was last kept during playback.
    pub(crate) last: Option<Instant>,
    /// Mean time from one to the next, s.
    pub(crate) pace: Option<f64>,
}

impl Flipping {
    pub(crate) fn new(budget: u64) -> Self {
        Self {
            book: Flipbook::new(budget),
            needed: false,
            shown: None,
            asked: None,
            last: None,
            pace: None,
        }
    }

    /// Forgets all pictures, for another document or another window.
    pub(crate) fn clear(&mut self) {
        let budget = self.book.budget;
        *self = Self::new(budget);
    }

    /// Decides whether playback needs kept pictures, from the time to draw one and that of a frame, ms. Playback
    /// that is nearly fast enough does not switch back and forth.
    pub(crate) fn judge(&mut self, full_ms: Option<f64>, frame_ms: f64) {
        let limit = if self.needed { 0.6 * frame_ms } else { frame_ms };
        self.needed = self.book.budget > 0 && full_ms.is_some_and(|ms| ms > limit);
    }

    /// Records that playback has drawn another picture.
    pub(crate) fn tick(&mut self) {
        let now = Instant::now();
        if let Some(last) = self.last.replace(now) {
            let passed = now.duration_since(last).as_secs_f64();
            self.pace = Some(self.pace.map_or(passed, |pace| 0.8 * pace + 0.2 * passed));
        }
    }
}
