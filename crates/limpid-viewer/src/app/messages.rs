//! The handling of messages from the backend.

use std::path::PathBuf;
use std::time::Duration;

use serde_json::json;

use crate::app::Viewer;
use crate::backend::core::drawing::{Answer, Drawn};
use crate::backend::core::messages::Message;
use crate::model::level::Level;
use limpid_io::error::{Error, Result};

impl Viewer {
    pub(crate) fn handle_messages(&mut self) {
        while let Ok(message) = self.messages.try_recv() {
            match message {
                Message::Opened(number, document) => self.handle_opened(number, *document),
                Message::Baked(number, progress) => self.take_progress(number, progress),
                Message::NotBaked(number, error) => {
                    if let Some(opening) = self.opened.opening_mut(number) {
                        opening.progress = None;
                        self.fail(&error);
                    }
                }
                Message::Grown(number, document) => self.handle_grown(number, *document),
                Message::Drawing(answer) => self.handle_answer(answer),
                // Each frame queries the cache anyway.
                Message::Loaded => {}
                Message::Chosen(path, waited) => self.chosen(path, waited),
                Message::Traced(number, truth) => self.take_truth(number, *truth),
                Message::Attributes(number, listed) => self.take_attributes(number, *listed),
                Message::Saved(saved) => self.take_saved(saved),
                Message::Filmed(done) => {
                    if let Some(filming) = &mut self.filming {
                        filming.done = done;
                        let passed = filming.begun.elapsed().as_secs_f64() / done.max(1) as f64;
                        let left = filming.pictures.saturating_sub(done) as f64;
                        filming.left = Some(Duration::from_secs_f64(passed * left));
                    }
                }
                Message::FilmEnded(written) => self.film_ended(written),
                Message::Picked(number, picked) => self.take_picked(number, picked),
                Message::Said(text) => self.show_info(text),
                Message::Path(path, loaded) => match loaded {
                    Ok(keys) => {
                        self.show_info(format!("{} keys from {}", keys.keys.len(), path.display()));
                        self.stage.eye.path = keys;
                    }
                    Err(error) => self.fail(&error),
                },
            }
        }
    }

    fn handle_answer(&mut self, answer: Answer) {
        match answer {
            Answer::Adapter(name) => {
                self.log.event("adapter", json!({ "name": name }));
                self.interface.adapter = Some(name);
                self.picture.fresh_device = true;
            }
            Answer::Lost(reason) => self.handle_lost_device(&reason),
            Answer::Drawn(drawn) => self.take_drawn(drawn),
            Answer::NotDrawn(number, error) => {
                self.picture.answered = self.picture.answered.max(number);
                // It may be of another document or view.
                if self.picture.captions.answered(number).is_none() {
                    return;
                }
                // Until something changes, do not retry this picture, nor play on to frames that would
                // fail alike.
                if number == self.picture.asked {
                    self.picture.asked_level = Level::Fine;
                    self.picture.undrawn = true;
                    self.stage.playback.playing = false;
                }
                self.fail(&error);
            }
            Answer::Saved(saved) => self.take_saved(saved),
            Answer::Measured(measured) => self.take_measure(measured),
        }
    }

    fn take_drawn(&mut self, drawn: Drawn) {
        if let Some(first) = drawn.panes.first()
            && drawn.panes.len() == self.stage.editing.visible().len()
        {
            self.times.push(&first.passes);
        }
        let ctx = self.post.context();
        self.picture.take(drawn, &self.stage, ctx.as_ref(), &mut self.log);
    }

    /// Handles the end of a film: its path, or nothing if it was stopped.
    fn film_ended(&mut self, written: Result<Option<PathBuf>>) {
        self.filming = None;
        match written.transpose() {
            Some(saved) => self.take_saved(saved),
            None => self.show_info("the film was stopped and removed".into()),
        }
    }

    /// Reports a lost device; another one takes over.
    pub(crate) fn handle_lost_device(&mut self, reason: &str) {
        self.log.event("lost", json!({ "reason": reason }));
        let text = format!("the graphics device failed ({reason}); another one takes over");
        self.interface.notices.add(text, true);
    }

    pub(crate) fn take_saved(&mut self, saved: Result<PathBuf>) {
        match saved {
            Ok(path) => {
                self.interface.saving.retain(|saving| saving.path != path);
                self.log.event("saved", json!({ "path": path }));
                self.show_info(format!("saved {}", path.display()));
            }
            Err(error) => {
                self.interface.saving.pop_front();
                self.fail(&error);
            }
        }
    }

    pub(crate) fn fail(&mut self, error: &Error) {
        let text = error.to_string();
        self.log.event("notice", json!({ "text": text }));
        self.interface.notices.add(text, true);
    }

    pub(crate) fn show_info(&mut self, text: String) {
        self.log.event("said", json!({ "text": text }));
        self.interface.notices.add(text, false);
    }
}
