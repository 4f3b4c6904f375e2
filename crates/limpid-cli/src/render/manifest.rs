//! The outcome of each frame: as lines of JSON in a manifest that several processes may share, and as
//! messages.

use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use crate::fingerprint::Fingerprint;
use crate::remedy;
use indicatif::ProgressBar;
use limpid_io::Error;
use limpid_io::film::Shot;
use limpid_io::output::{FileKind, Stream};
use serde::Serialize;

use super::pictures::Pictures;

#[derive(Clone, Copy, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Status {
    /// Drawn by this process.
    Done,
    /// Existed already.
    Skipped,
    /// Drawn by another process meanwhile.
    Claimed,
    Failed,
}

/// A line of the manifest; `docs/farms.md` describes the fields.
#[derive(Serialize)]
struct Line<'a> {
    frame: i64,
    file: PathBuf,
    status: Status,
    fingerprint: String,
    #[serde(flatten)]
    outcome: Outcome,
    host: &'a str,
    pid: u32,
}

/// The result of a frame that this process has drawn or tried to draw.
#[derive(Default, Serialize)]
pub(super) struct Outcome {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) error: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) code: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) pixels: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) particles: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) ms: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) adapter: Option<String>,
}

/// A manifest, open for appending.
pub(super) struct Manifest {
    file: Stream,
    path: PathBuf,
    host: String,
}

/// Records the outcome of frames.
pub(super) struct Log {
    pub(super) manifest: Option<Manifest>,
    pub(super) pictures: Option<Pictures>,
    /// Shows the number of finished frames.
    pub(super) bar: ProgressBar,
    /// Whether the run continues after a failed frame.
    pub(super) keep_going: bool,
    /// Numbers of the failed frames.
    pub(super) failed: Vec<i64>,
}

impl Manifest {
    /// Opens a manifest for appending.
    pub(super) fn open(path: &Path, host: String) -> limpid_io::Result<Self> {
        let file = Stream::append(path, FileKind::MANIFEST)?;
        Ok(Self { file, path: path.to_owned(), host })
    }
}

impl Log {
    /// Records a frame that this process does not draw.
    pub(super) fn record(
        &mut self,
        shot: &Shot,
        fingerprint: Fingerprint,
        status: Status,
    ) -> limpid_io::Result<()> {
        self.add(shot, fingerprint, status, Outcome::default())
    }

    /// Records a failed frame.
    ///
    /// # Errors
    /// `error`, if it ends the run.
    pub(super) fn fail(
        &mut self,
        shot: &Shot,
        fingerprint: Fingerprint,
        error: Error,
    ) -> limpid_io::Result<()> {
        let problem = format!("frame {}: {}", shot.number, remedy::with_remedy(&error));
        let error = error.of_frame(shot.number);
        let outcome = Outcome {
            error: Some(problem.clone()),
            code: Some(error.category() as u8),
            ..Outcome::default()
        };
        self.add(shot, fingerprint, Status::Failed, outcome)?;
        if !self.keep_going {
            return Err(error);
        }
        self.warn(problem);
        self.failed.push(shot.number);
        self.bar.inc(1);
        Ok(())
    }

    /// Prints a message above the progress bar.
    pub(super) fn warn(&self, message: impl std::fmt::Display) {
        self.bar.suspend(|| crate::terminal::warn(message));
    }

    /// Appends a line to the manifest, if there is one.
    pub(super) fn add(
        &mut self,
        shot: &Shot,
        fingerprint: Fingerprint,
        status: Status,
        outcome: Outcome,
    ) -> limpid_io::Result<()> {
        let (Some(manifest), Some(pictures)) = (&mut self.manifest, &self.pictures) else {
            return Ok(());
        };
        let line = Line {
            frame: shot.number,
            file: pictures.path(shot),
            status,
            fingerprint: fingerprint.to_string(),
            outcome,
            host: &manifest.host,
            pid: std::process::id(),
        };
        append(&mut manifest.file, &line).map_err(|source| write_error(&manifest.path, source))
    }
}

fn write_error(path: &Path, source: io::Error) -> Error {
    Error::Io { path: path.to_owned(), action: "write", source }
}

fn append(stream: &mut Stream, line: &Line<'_>) -> io::Result<()> {
    let mut text = serde_json::to_vec(line)?;
    text.push(b'\n');
    let Stream::File(file) = stream else { return stream.write(text) };
    // NFS appends at the end that it has cached, and taking a lock makes it ask the server. Without
    // locks, a single append to a local file is still atomic.
    let locked = file.lock().is_ok();
    let written = write_line(file, text);
    if locked {
        file.unlock()?;
    }
    written
}

fn write_line(file: &mut File, mut text: Vec<u8>) -> io::Result<()> {
    // Begins a new line after one that was truncated by a full disk.
    let mut last = [b'\n'];
    if file.seek(SeekFrom::End(0))? > 0 {
        file.seek(SeekFrom::End(-1))?;
        file.read_exact(&mut last)?;
    }
    if last != *b"\n" {
        text.insert(0, b'\n');
    }
    file.write_all(&text)
}
