//! Messages from threads, or from the worker of a page, to the interface.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, mpsc};
#[cfg(not(target_arch = "wasm32"))]
use std::time::Duration;

use eframe::egui;

use crate::backend::core::drawing::Answer;
#[cfg(not(target_arch = "wasm32"))]
use crate::backend::core::truth::Truth;
use crate::model::document::Document;
use limpid_io::bake::Progress;
#[cfg(not(target_arch = "wasm32"))]
use limpid_io::camera_path::CameraPath;
use limpid_io::error::{Error, Result};

/// A message from a thread to the interface. Numbers identify the request.
pub(crate) enum Message {
    Opened(u64, Box<Result<Document>>),
    Baked(u64, Progress),
    NotBaked(u64, Error),
    Grown(u64, Box<Result<Document>>),
    Drawing(Answer),
    Loaded,
    #[cfg(not(target_arch = "wasm32"))]
    Chosen(Option<PathBuf>, Duration),
    #[cfg(not(target_arch = "wasm32"))]
    Traced(u64, Box<Result<Truth>>),
    Saved(Result<PathBuf>),
    /// Finished pictures of the film.
    #[cfg(not(target_arch = "wasm32"))]
    Filmed(usize),
    /// The path of the film; `None` if it was stopped.
    #[cfg(not(target_arch = "wasm32"))]
    FilmEnded(Result<Option<PathBuf>>),
    #[cfg(not(target_arch = "wasm32"))]
    Path(PathBuf, Result<CameraPath>),
    /// Something that the user should know.
    #[cfg(target_arch = "wasm32")]
    Said(String),
    /// The worker has ended, for this reason; without one its memory has run out.
    #[cfg(target_arch = "wasm32")]
    Crashed(Option<String>),
}

/// Sends messages from threads to the interface.
#[derive(Clone)]
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
        if self.sender.send(message).is_ok()
            && let Some(context) = self.context()
        {
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
