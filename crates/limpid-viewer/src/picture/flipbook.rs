//! The flipbook: pictures of a sequence that are kept once they are drawn.
//!
//! Where drawing takes longer than a frame lasts, playback draws each frame at full size once and shows it when it
//! is done; after that it plays from memory, at its own speed. Where drawing is faster, nothing is kept.

use std::collections::BTreeMap;
use std::time::Duration;

use web_time::Instant;

use eframe::egui::{self, Align2, Color32, FontId, Rect, pos2, vec2};
use glam::UVec2;

use crate::Viewer;
use crate::model::views::View;
use crate::picture::viewport::Picture;
use limpid::camera::Camera;
use limpid::scene::Scene;
use limpid_io::camera_path::CameraPath;
use limpid_io::input::FrameTime;
use limpid_io::shared_classifier::Processor;

/// What all pictures of a book have in common.
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
    /// What the newest request draws; `None` if it is not to be kept.
    pub(crate) asked: Option<(Subject, Moment)>,
    /// When a picture was last kept during playback.
    last: Option<Instant>,
    /// Mean time from one to the next, s.
    pace: Option<f64>,
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

    /// Decides whether playback needs kept pictures, from the time to draw one and that of a frame, ms. What is
    /// nearly fast enough does not switch back and forth.
    pub(crate) fn judge(&mut self, full_ms: Option<f64>, frame_ms: f64) {
        let limit = if self.needed { 0.6 * frame_ms } else { frame_ms };
        self.needed = self.book.budget > 0 && full_ms.is_some_and(|ms| ms > limit);
    }

    /// Records that playback has drawn another picture.
    fn tick(&mut self) {
        let now = Instant::now();
        if let Some(last) = self.last.replace(now) {
            let passed = now.duration_since(last).as_secs_f64();
            self.pace = Some(self.pace.map_or(passed, |pace| 0.8 * pace + 0.2 * passed));
        }
    }
}

impl Viewer {
    /// The subject of the current book; `None` if there is nothing to play.
    fn book_subject(&self) -> Option<Subject> {
        let size = self.full_size();
        if self.opened.frame_times.len() < 2 || size.min_element() == 0 {
            return None;
        }
        let follows = self.eye.follow && !self.eye.path.keys.is_empty();
        let viewpoint = match follows {
            true => Viewpoint::Path(self.eye.path.clone()),
            false => Viewpoint::Fixed(self.eye.camera),
        };
        Some(Subject {
            scenes: self.visible().into_iter().map(|i| self.editing.scenes[i].clone()).collect(),
            size,
            view: self.picture.view,
            processor: self.opened.frames.processor,
            viewpoint,
        })
    }

    /// The subject and the moment of the picture that should be shown.
    pub(crate) fn page(&self) -> Option<(Subject, Moment)> {
        Some((self.book_subject()?, self.frame_time()?.into()))
    }

    /// Whether each frame time of playback has kept pictures.
    pub(crate) fn kept(&self) -> Vec<bool> {
        let Some(subject) = self.book_subject() else {
            return vec![false; self.opened.frame_times.len()];
        };
        let moments = self.opened.frame_times.iter().map(|&at| at.into());
        self.flipping.book.holds(&subject, moments).collect()
    }

    /// The first frame time from the current one, in the direction of playback, whose pictures are not kept.
    pub(crate) fn first_missing(&self) -> Option<usize> {
        let (kept, index) = (self.kept(), self.playback.index());
        let ahead = index..kept.len();
        let order: Vec<usize> = match self.playback.backwards {
            false => ahead.chain(0..index).collect(),
            true => (0..=index).rev().chain((index + 1..kept.len()).rev()).collect(),
        };
        order.into_iter().find(|&i| !kept[i])
    }

    /// Shows the kept pictures of the current moment, if there are any.
    pub(crate) fn flip(&mut self) {
        self.flipping.judge(self.picture.resolution.full_ms(), 1e3 * self.playback.duration());
        let page = self.page().filter(|_| self.flipping.needed);
        let shown = page
            .and_then(|(subject, at)| Some((at, self.flipping.book.get(&subject, at)?.clone())));
        let Some((at, pictures)) = shown else {
            self.flipping.shown = None;
            return;
        };
        if self.flipping.shown != Some(at) {
            self.jobs.log.event("flip", serde_json::json!({ "moment": self.playback.index() }));
        }
        self.flipping.shown = Some(at);
        for (i, picture) in self.visible().into_iter().zip(pictures) {
            self.editing.sides[i].picture = picture;
        }
    }

    /// Whether playback draws the current frame at full size, to keep it.
    pub(crate) fn fills_flipbook(&self) -> bool {
        self.playback.playing
            && !self.picture.dragging
            && self.flipping.needed
            && self.book_subject().is_some_and(|subject| !self.flipping.book.is_full(&subject))
    }

    /// Keeps the pictures of the newest request.
    pub(crate) fn keep(&mut self, pictures: Vec<Picture>) {
        let Some((subject, at)) = self.flipping.asked.take().filter(|_| self.flipping.needed)
        else {
            return;
        };
        let bytes = pictures.iter().map(Picture::bytes).sum();
        self.flipping.book.keep(&subject, at, pictures, bytes);
        match self.playback.playing {
            true => self.flipping.tick(),
            false => self.flipping.last = None,
        }
    }

    /// The progress of the flipbook; `None` if it is not needed.
    pub fn flipbook(&self) -> Option<Progress> {
        if !self.flipping.needed {
            return None;
        }
        let subject = self.book_subject()?;
        // Fast motion leaves out frames.
        let kept = self.kept();
        let of_playback = || kept.iter().step_by(self.playback.speed().stride());
        let (drawn, frames) = (of_playback().filter(|kept| **kept).count(), of_playback().count());
        let missing = (frames - drawn) as f64;
        let left = self.flipping.pace.map(|pace| Duration::from_secs_f64(missing * pace));
        Some(Progress { drawn, frames, full: self.flipping.book.is_full(&subject), left })
    }

    /// The progress in words, for the status line.
    pub(crate) fn flipbook_status(&self) -> Option<String> {
        let Progress { drawn, frames, full, left } = self.flipbook()?;
        let mebi = self.flipping.book.bytes() >> 20;
        Some(match left {
            _ if drawn == frames => format!("flipbook complete, {mebi} MiB"),
            _ if full => format!("flipbook full: {drawn} of {frames} frames fit ({mebi} MiB)"),
            Some(left) if self.playback.playing => {
                format!("flipbook {drawn} of {frames}, {:.0} s left", left.as_secs_f64().ceil())
            }
            _ => format!("flipbook {drawn} of {frames}"),
        })
    }

    /// Says on the picture what playback waits for while the flipbook fills.
    pub(crate) fn flipbook_note(&self, ui: &egui::Ui, rect: Rect) {
        let progress = self.flipbook().filter(|_| self.playback.playing);
        let Some(Progress { drawn, frames, full: false, left }) = progress else { return };
        if drawn == frames {
            return;
        }
        let wait =
            left.map_or(String::new(), |left| format!(" in {:.0} s", left.as_secs_f64().ceil()));
        let text =
            format!("Drawing each frame once: {drawn} of {frames}. Plays at its own speed{wait}.");
        let painter = ui.painter().with_clip_rect(rect);
        let font = FontId::proportional(13.0);
        let text = painter.layout_no_wrap(text, font, Color32::from_gray(230));
        let place = pos2(rect.center().x, rect.top() + 12.0);
        let place = Align2::CENTER_TOP.anchor_size(place, text.size());
        let back = place.expand2(vec2(10.0, 7.0));
        painter.rect_filled(back, 5, Color32::from_black_alpha(170));
        let bar =
            Rect::from_min_max(pos2(back.left() + 6.0, back.bottom() - 4.0), back.right_bottom());
        let share = drawn as f32 / frames as f32;
        let bar = Rect::from_min_size(bar.min, vec2(share * (back.width() - 12.0), 2.0));
        painter.rect_filled(bar, 1, crate::panels::style::accent(ui));
        painter.galley(place.min, text, Color32::WHITE);
    }
}
