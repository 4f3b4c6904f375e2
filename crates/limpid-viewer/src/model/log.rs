//! The event log of `--log FILE`: one JSON object per line, for tests and bug reports.
//!
//! Each object has `t`, seconds since the start, and `event`. Picture events also have `ui_ms`, the
//! longest time that the interface's own work took since the last one.

use std::path::Path;
use std::time::Duration;

use web_time::Instant;

use serde_json::{Value, json};

use limpid_io::error::Result;
use limpid_io::output::{FileKind, Stream};

/// The event log; without a file, it discards all events.
#[derive(Debug)]
pub(crate) struct Log {
    file: Option<Stream>,
    start: Instant,
    /// When the interface last finished its work, if it requested another frame at once.
    pending: Option<Instant>,
    /// Longest work of the interface, and longest wait for a frame that it requested.
    longest: [Duration; 2],
    /// The same since the last call of [`Log::recent`].
    recent: [Duration; 2],
}

impl Log {
    /// Creates the log, with a new file at `path`.
    ///
    /// # Errors
    /// As [`Stream::create`].
    pub(crate) fn new(path: Option<&Path>) -> Result<Self> {
        let create = |path| Stream::create(path, FileKind::LOG);
        Ok(Self {
            file: path.map(create).transpose()?,
            start: Instant::now(),
            pending: None,
            longest: [Duration::ZERO; 2],
            recent: [Duration::ZERO; 2],
        })
    }

    /// Whether events are written.
    pub(crate) fn is_on(&self) -> bool {
        self.file.is_some()
    }

    /// Writes an event with its `fields`, an object.
    pub(crate) fn event(&mut self, event: &str, fields: Value) {
        let Some(file) = &mut self.file else { return };
        let mut line = json!({ "t": self.start.elapsed().as_secs_f64(), "event": event });
        if let (Some(line), Value::Object(fields)) = (line.as_object_mut(), fields) {
            line.extend(fields);
        }
        // A full disk must not stop the viewer.
        let _ = file.write(format!("{line}\n").into_bytes());
    }

    /// Records the interface's work since `begun`; `again` if it requests another frame at once.
    pub(crate) fn record_frame(&mut self, begun: Instant, again: bool) {
        let gap = self.pending.map_or(Duration::ZERO, |ended| begun.duration_since(ended));
        for (i, time) in [begun.elapsed(), gap].into_iter().enumerate() {
            self.longest[i] = self.longest[i].max(time);
            self.recent[i] = self.recent[i].max(time);
        }
        self.pending = again.then(Instant::now);
    }

    /// Longest work and wait since the last call, as fields of an event, ms.
    pub(crate) fn recent(&mut self) -> Value {
        let recent = std::mem::take(&mut self.recent);
        times("", recent)
    }

    /// Writes the last event.
    pub(crate) fn close(&mut self) {
        let longest = times("longest_", self.longest);
        self.event("close", longest);
    }
}

fn times(prefix: &str, [work, gap]: [Duration; 2]) -> Value {
    let ms = |time: Duration| 1e3 * time.as_secs_f64();
    json!({ format!("{prefix}ui_ms"): ms(work), format!("{prefix}gap_ms"): ms(gap) })
}
