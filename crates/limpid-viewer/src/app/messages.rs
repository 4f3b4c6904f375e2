//! The handling of messages from threads, or from the worker of a page.

use std::path::PathBuf;

use serde_json::json;
use web_time::Instant;

use crate::backend::core::drawing::Answer;
use crate::backend::core::messages::Message;
use crate::model::level::Level;
use crate::{Notice, Viewer};
use limpid_io::error::{Error, Result};

/// Most notices that are kept.
const MOST_NOTICES: usize = 50;

impl Viewer {
    pub(crate) fn handle_messages(&mut self) {
        while let Ok(message) = self.jobs.messages.try_recv() {
            match message {
                Message::Opened(number, document) => self.handle_opened(number, *document),
                Message::Baked(number, progress) => self.take_progress(number, progress),
                Message::NotBaked(number, error) => {
                    if let Some(opening) = self.opening_mut(number) {
                        opening.progress = None;
                        self.fail(&error);
                    }
                }
                Message::Grown(number, document) => self.handle_grown(number, *document),
                Message::Drawing(answer) => self.handle_answer(answer),
                // Each frame queries the cache anyway.
                Message::Loaded => {}
                #[cfg(not(target_arch = "wasm32"))]
                Message::Chosen(path, waited) => self.chosen(path, waited),
                #[cfg(not(target_arch = "wasm32"))]
                Message::Traced(number, truth) => self.take_truth(number, *truth),
                Message::Saved(saved) => self.take_saved(saved),
                #[cfg(not(target_arch = "wasm32"))]
                Message::Filmed(done) => {
                    if let Some(filming) = &mut self.jobs.filming {
                        filming.done = done;
                    }
                }
                #[cfg(not(target_arch = "wasm32"))]
                Message::FilmEnded(written) => self.film_ended(written),
                #[cfg(target_arch = "wasm32")]
                Message::Said(text) => self.show_info(text),
                #[cfg(target_arch = "wasm32")]
                Message::Crashed(reason) => self.restart_worker(reason),
                #[cfg(not(target_arch = "wasm32"))]
                Message::Path(path, loaded) => match loaded {
                    Ok(keys) => {
                        self.show_info(format!("{} keys from {}", keys.keys.len(), path.display()));
                        self.eye.path = keys;
                    }
                    Err(error) => self.fail(&error),
                },
            }
        }
    }

    fn handle_answer(&mut self, answer: Answer) {
        match answer {
            Answer::Adapter(name) => {
                self.jobs.log.event("adapter", json!({ "name": name }));
                self.jobs.adapter = Some(name);
                self.picture.fresh_device = true;
            }
            Answer::Lost(reason) => self.handle_lost_device(&reason),
            Answer::Drawn(drawn) => self.show(drawn),
            Answer::NotDrawn(number, error) => {
                self.picture.answered = self.picture.answered.max(number);
                // Until something changes, do not retry this picture, nor play on to frames that would
                // fail alike.
                if number == self.picture.asked {
                    self.picture.asked_level = Level::Fine;
                    self.picture.undrawn = true;
                    self.playback.playing = false;
                }
                self.fail(&error);
            }
            Answer::Saved(saved) => self.take_saved(saved),
            #[cfg(not(target_arch = "wasm32"))]
            Answer::Measured(measured) => self.take_measure(measured),
        }
    }

    /// Reports a lost device; another one takes over.
    pub(crate) fn handle_lost_device(&mut self, reason: &str) {
        self.jobs.log.event("lost", json!({ "reason": reason }));
        let text = format!("the graphics device failed ({reason}); another one takes over");
        self.notice(text, true);
    }

    pub(crate) fn take_saved(&mut self, saved: Result<PathBuf>) {
        match saved {
            Ok(path) => {
                self.jobs.log.event("saved", json!({ "path": path }));
                self.show_info(format!("saved {}", path.display()));
            }
            Err(error) => self.fail(&error),
        }
    }

    pub(crate) fn fail(&mut self, error: &Error) {
        let text = error.to_string();
        self.jobs.log.event("notice", json!({ "text": text }));
        self.notice(text, true);
    }

    pub(crate) fn show_info(&mut self, text: String) {
        self.jobs.log.event("said", json!({ "text": text }));
        self.notice(text, false);
    }

    fn notice(&mut self, text: String, error: bool) {
        let notice = Notice { text, error, since: Instant::now() };
        match self.interface.notices.last_mut() {
            // Show repeated notices once.
            Some(last) if last.text == notice.text => *last = notice,
            _ => self.interface.notices.push(notice),
        }
        if self.interface.notices.len() > MOST_NOTICES {
            self.interface.notices.remove(0);
        }
    }
}
