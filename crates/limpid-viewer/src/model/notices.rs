//! Notices to the user, and their log.

use std::collections::VecDeque;
use std::time::Duration;

use web_time::Instant;

/// Most notices in the log.
const MOST: usize = 200;

/// How long notices other than errors are shown.
const TIME: Duration = Duration::from_secs(6);

/// A notice to the user.
#[derive(Debug, Clone, PartialEq)]
pub struct Notice {
    /// Its text.
    pub text: String,
    /// Whether it is an error, which is shown until it is dismissed.
    pub error: bool,
    /// When it was last given.
    pub(crate) since: Instant,
}

/// The notices to the user, newest last.
#[derive(Debug, Default)]
pub(crate) struct Notices {
    /// Those over the picture.
    shown: Vec<Notice>,
    /// All of them, also those that are not shown any more.
    log: VecDeque<Notice>,
}

impl Notices {
    pub(crate) fn add(&mut self, text: String, error: bool) {
        let notice = Notice { text, error, since: Instant::now() };
        // Show repeated notices once.
        self.shown.retain(|shown| shown.text != notice.text);
        self.shown.push(notice.clone());
        match self.log.back_mut() {
            Some(last) if last.text == notice.text => *last = notice,
            _ => self.log.push_back(notice),
        }
        if self.log.len() > MOST {
            self.log.pop_front();
        }
    }

    /// Drops those that have been shown for long enough. Returns for how long all others are still shown.
    pub(crate) fn expire(&mut self) -> Option<Duration> {
        self.shown.retain(|notice| notice.error || notice.since.elapsed() < TIME);
        let passing = self.shown.iter().filter(|notice| !notice.error);
        passing.map(|notice| TIME.saturating_sub(notice.since.elapsed())).min()
    }

    /// Dismisses the notice of an index in [`Notices::shown`].
    pub(crate) fn dismiss(&mut self, i: usize) {
        self.shown.remove(i);
    }

    /// Dismisses all that are shown.
    pub(crate) fn clear(&mut self) {
        self.shown.clear();
    }

    /// Those over the picture.
    pub(crate) fn shown(&self) -> &[Notice] {
        &self.shown
    }

    /// All of them, also those that are not shown any more.
    pub(crate) fn log(&self) -> impl DoubleEndedIterator<Item = &Notice> + ExactSizeIterator {
        self.log.iter()
    }
}
