//! The progress of a film.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use web_time::Instant;

/// A film that is being written; dropping this stops it.
#[derive(Debug)]
pub(crate) struct Filming {
    /// Pictures that are written.
    pub(crate) done: usize,
    /// All its pictures.
    pub(crate) pictures: usize,
    /// When it was begun.
    pub(crate) begun: Instant,
    /// Expected time until it is whole; `None` before its first picture.
    pub(crate) left: Option<Duration>,
    /// Set to stop it.
    pub(crate) stop: Arc<AtomicBool>,
}

impl Filming {
    /// Stops after the current picture; the film is removed.
    pub(crate) fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl Drop for Filming {
    fn drop(&mut self) {
        self.stop();
    }
}
