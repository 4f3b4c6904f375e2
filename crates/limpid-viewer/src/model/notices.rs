//! Notices to the user.

use std::time::Duration;

use web_time::Instant;

/// Most notices that are kept.
const MOST: usize = 50;

/// How long notices other than errors are shown.
const TIME: Duration = Duration::from_secs(6);

/// A notice to the user.
#[derive(Debug, Clone, PartialEq)]
pub struct Notice {
    /// Its text.
    pub text: String,
    /// Whether it is an error, which stays until it is dismissed.
    pub error: bool,
    since: Instant,
}

/// The notices to the user, newest last.
#[derive(Debug, Default)]
pub(crate) struct Notices(Vec<Notice>);

impl Notices {
    pub(crate) fn add(&mut self, text: String, error: bool) {
        let notice = Notice { text, error, since: Instant::now() };
        match self.0.last_mut() {
            // Show repeated notices once.
            Some(last) if last.text == notice.text => *last = notice,
            _ => self.0.push(notice),
        }
        if self.0.len() > MOST {
            self.0.remove(0);
        }
    }

    /// Drops those that have been shown for long enough. Returns the newest of the others, and for how long that is
    /// still shown, if not until it is dismissed.
    pub(crate) fn newest(&mut self) -> Option<(&Notice, Option<Duration>)> {
        self.0.retain(|notice| notice.error || notice.since.elapsed() < TIME);
        let newest = self.0.last()?;
        let left = (!newest.error).then(|| TIME.saturating_sub(newest.since.elapsed()));
        Some((newest, left))
    }

    pub(crate) fn dismiss(&mut self) {
        self.0.pop();
    }

    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    pub(crate) fn all(&self) -> &[Notice] {
        &self.0
    }
}
