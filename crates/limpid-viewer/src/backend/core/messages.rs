//! Messages from threads, or from the worker of a page, to the interface.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;

use eframe::egui;

use crate::backend::core::drawing::Answer;
use crate::backend::core::picking::Picked;
use crate::backend::core::truth::Truth;
use crate::model::document::Document;
use limpid_io::bake::Progress;
use limpid_io::camera_path::CameraPath;
use limpid_io::color_by::AttributeRange;
use limpid_io::error::{Error, Result};

/// A message from whoever works to the interface. Numbers identify the request.
#[derive(Debug)]
pub enum Message {
    /// A source has been opened, or cannot be.
    Opened(u64, Box<Result<Document>>),
    /// A frame of an opening's simulation has been made.
    Baked(u64, Progress),
    /// The simulation of an opening has failed.
    NotBaked(u64, Error),
    /// The source of an opening has been opened again: it has more frames.
    Grown(u64, Box<Result<Document>>),
    /// An answer of whoever draws.
    Drawing(Answer),
    /// A frame has been loaded, which the caches have.
    Loaded,
    /// The path that was chosen in the system's dialog, and for how long that was shown.
    Chosen(Option<PathBuf>, Duration),
    /// The ground truth of a view has been traced.
    Traced(u64, Box<Result<Truth>>),
    /// The attributes of a document's files have been read.
    Attributes(u64, Box<Result<Vec<AttributeRange>>>),
    /// A file has been written.
    Saved(Result<PathBuf>),
    /// Finished pictures of the film.
    Filmed(usize),
    /// The path of the film; `None` if it was stopped.
    FilmEnded(Result<Option<PathBuf>>),
    /// A camera path has been read.
    Path(PathBuf, Result<CameraPath>),
    /// The particle in a line of sight, by the number of the request.
    Picked(u64, Result<Option<Picked>>),
    /// Something that the user should know.
    Said(String),
}

/// Sends messages from threads to the interface.
#[derive(Clone, Debug)]
pub(crate) struct Post {
    sender: mpsc::Sender<Message>,
    // Set in the first frame of the interface, which reads messages anyway.
    context: Arc<Mutex<Option<egui::Context>>>,
}

impl Post {
    pub(crate) fn new(sender: mpsc::Sender<Message>) -> Self {
        Self { sender, context: Arc::default() }
    }

    pub(crate) fn send(&self, message: Message) {
        // Sending fails once the viewer is gone, when messages no longer matter.
        if self.sender.send(message).is_ok() {
            self.wake();
        }
    }

    /// Has the interface show its new state.
    pub(crate) fn wake(&self) {
        if let Some(context) = self.context() {
            context.request_repaint();
        }
    }

    /// Sets the window that messages wake, if there is none; returns whether there was none.
    pub(crate) fn enter(&self, context: &egui::Context) -> bool {
        let mut present = self.context.lock().expect("no thread panics with this lock");
        let new = present.is_none();
        present.get_or_insert_with(|| context.clone());
        new
    }

    /// Clears the window after it has closed.
    pub(crate) fn leave(&self) {
        *self.context.lock().expect("no thread panics with this lock") = None;
    }

    /// The window's context.
    pub(crate) fn context(&self) -> Option<egui::Context> {
        self.context.lock().expect("no thread panics with this lock").clone()
    }
}
