//! What threads tell the interface, and what it makes of that.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

use eframe::egui;
use serde_json::json;

use crate::adaptive_resolution::Level;
use crate::document::Document;
use crate::draw_thread::Answer;
use crate::truth::Truth;
use crate::{Notice, Viewer};
use limpid_io::bake::Progress;
use limpid_io::camera_path::CameraPath;
use limpid_io::error::{Error, Result};

/// Notices that are kept at most.
const MOST_NOTICES: usize = 50;

/// What threads report to the interface. Numbers tell what they were asked for with.
pub(crate) enum Message {
    Opened(u64, Box<Result<Document>>),
    Baked(u64, Progress),
    NotBaked(u64, Error),
    Grown(u64, Box<Result<Document>>),
    Drawing(Answer),
    Loaded,
    Chosen(Option<PathBuf>, Duration),
    Traced(u64, Box<Result<Truth>>),
    Saved(Result<PathBuf>),
    Path(PathBuf, Result<CameraPath>),
}

/// The way to the interface, for threads.
#[derive(Clone)]
pub(crate) struct Post {
    news: mpsc::Sender<Message>,
    // Known from the first frame of the interface on, which looks for news anyway.
    context: Arc<Mutex<Option<egui::Context>>>,
}

impl Post {
    pub(crate) fn new(news: mpsc::Sender<Message>) -> Self {
        Self { news, context: Arc::default() }
    }

    pub(crate) fn send(&self, news: Message) {
        // Once the viewer is gone nobody wants to know.
        if self.news.send(news).is_ok()
            && let Some(context) = self.context()
        {
            context.request_repaint();
        }
    }

    /// The interface is in a window, which news is to wake; whether it has just come there.
    pub(crate) fn enter(&self, context: &egui::Context) -> bool {
        let mut present = self.context.lock().expect("no panic holds this lock");
        let new = present.is_none();
        present.get_or_insert_with(|| context.clone());
        new
    }

    /// That window is gone.
    pub(crate) fn leave(&self) {
        *self.context.lock().expect("no panic holds this lock") = None;
    }

    /// The window's context.
    pub(crate) fn context(&self) -> Option<egui::Context> {
        self.context.lock().expect("no panic holds this lock").clone()
    }
}

impl Viewer {
    pub(crate) fn take_news(&mut self) {
        while let Ok(news) = self.jobs.messages.try_recv() {
            match news {
                Message::Opened(number, document) => self.take_opened(number, *document),
                Message::Baked(number, progress) => self.take_progress(number, progress),
                Message::NotBaked(number, error) => {
                    if let Some(opening) = self.numbered(number) {
                        opening.progress = None;
                        self.fail(&error);
                    }
                }
                Message::Grown(number, document) => self.take_grown(number, *document),
                Message::Drawing(answer) => self.take_answer(answer),
                // The cache is asked in each frame anyway.
                Message::Loaded => {}
                Message::Chosen(path, waited) => self.chosen(path, waited),
                Message::Traced(number, truth) => self.take_truth(number, *truth),
                Message::Saved(saved) => self.take_saved(saved),
                Message::Path(path, loaded) => match loaded {
                    Ok(keys) => {
                        self.say(format!("{} keys from {}", keys.keys.len(), path.display()));
                        self.eye.path = keys;
                    }
                    Err(error) => self.fail(&error),
                },
            }
        }
    }

    fn take_answer(&mut self, answer: Answer) {
        match answer {
            Answer::Adapter(name) => {
                self.jobs.log.event("adapter", json!({ "name": name }));
                self.jobs.adapter = Some(name);
                self.picture.fresh_device = true;
            }
            Answer::Lost(reason) => self.lose(&reason),
            Answer::Drawn(drawn) => self.show(drawn),
            Answer::NotDrawn(number, error) => {
                self.picture.answered = self.picture.answered.max(number);
                // Neither this one again, nor the next of a sequence that would fail alike, until
                // something changes.
                if number == self.picture.asked {
                    self.picture.asked_level = Level::Fine;
                    self.picture.undrawn = true;
                    self.playback.playing = false;
                }
                self.fail(&error);
            }
            Answer::Saved(saved) => self.take_saved(saved),
            Answer::Measured(measured) => self.take_measure(measured),
        }
    }

    /// A device is lost, and another will take its classifier.
    pub(crate) fn lose(&mut self, reason: &str) {
        self.jobs.log.event("lost", json!({ "reason": reason }));
        let text = format!("the graphics device failed ({reason}); another one takes over");
        self.notice(text, true);
    }

    fn take_saved(&mut self, saved: Result<PathBuf>) {
        match saved {
            Ok(path) => {
                self.jobs.log.event("saved", json!({ "path": path }));
                self.say(format!("saved {}", path.display()));
            }
            Err(error) => self.fail(&error),
        }
    }

    pub(crate) fn fail(&mut self, error: &Error) {
        let text = error.to_string();
        self.jobs.log.event("notice", json!({ "text": text }));
        self.notice(text, true);
    }

    pub(crate) fn say(&mut self, text: String) {
        self.jobs.log.event("said", json!({ "text": text }));
        self.notice(text, false);
    }

    fn notice(&mut self, text: String, error: bool) {
        let notice = Notice { text, error, since: Instant::now() };
        match self.interface.notices.last_mut() {
            // Told once, however often it happens.
            Some(last) if last.text == notice.text => *last = notice,
            _ => self.interface.notices.push(notice),
        }
        if self.interface.notices.len() > MOST_NOTICES {
            self.interface.notices.remove(0);
        }
    }
}
