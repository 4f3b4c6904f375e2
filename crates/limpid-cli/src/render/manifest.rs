//! What has become of each frame: as lines of JSON that several processes may append to one file, and
//! as messages.

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

use super::output::Pictures;

#[derive(Clone, Copy, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Status {
    /// Drawn by this process.
    Done,
    /// There already.
    Skipped,
    /// Drawn by another process meanwhile.
    Claimed,
    Failed,
}

/// One line; `docs/farms.md` says what is what.
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

/// What is known of a frame that this process has drawn, or tried to draw.
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

/// A file of such lines.
pub(super) struct Manifest {
    file: Stream,
    path: PathBuf,
    host: String,
}

/// Who is told of frames.
pub(super) struct Log {
    pub(super) manifest: Option<Manifest>,
    pub(super) pictures: Option<Pictures>,
    /// Frames that are done, for whoever watches.
    pub(super) bar: ProgressBar,
    /// Whether a frame that fails leaves the others alone.
    pub(super) keep_going: bool,
    /// Numbers of the frames that have failed.
    pub(super) failed: Vec<i64>,
}

impl Manifest {
    /// Opens it for lines to be added.
    pub(super) fn open(path: &Path, host: String) -> limpid_io::Result<Self> {
        let file = Stream::append(path, FileKind::MANIFEST)?;
        Ok(Self { file, path: path.to_owned(), host })
    }
}

impl Log {
    /// A frame that is not this process's to draw.
    pub(super) fn tell(
        &mut self,
        shot: &Shot,
        fingerprint: Fingerprint,
        status: Status,
    ) -> limpid_io::Result<()> {
        self.add(shot, fingerprint, status, Outcome::default())
    }

    /// A frame that has failed.
    ///
    /// # Errors
    /// That error, where it ends the run.
    pub(super) fn fail(
        &mut self,
        shot: &Shot,
        fingerprint: Fingerprint,
        error: Error,
    ) -> limpid_io::Result<()> {
        let error = error.of_frame(shot.number);
        let outcome = Outcome {
            error: Some(remedy::with_remedy(&error)),
            code: Some(error.category() as u8),
            ..Outcome::default()
        };
        self.add(shot, fingerprint, Status::Failed, outcome)?;
        if !self.keep_going {
            return Err(error);
        }
        self.complain(remedy::with_remedy(&error));
        self.failed.push(shot.number);
        self.bar.inc(1);
        Ok(())
    }

    /// Says something on a line of its own.
    pub(super) fn complain(&self, message: impl std::fmt::Display) {
        self.bar.suspend(|| crate::terminal::complain(message));
    }

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
        append(&mut manifest.file, &line).map_err(|source| fail(&manifest.path, source))
    }
}

fn fail(path: &Path, source: io::Error) -> Error {
    Error::Io { path: path.to_owned(), action: "write", source }
}

fn append(stream: &mut Stream, line: &Line<'_>) -> io::Result<()> {
    let mut text = serde_json::to_vec(line)?;
    text.push(b'\n');
    let Stream::File(file) = stream else { return stream.write(text) };
    // NFS appends where it believes the end to be; who holds a lock has asked. Where there are no
    // locks, one write to the end of a local file is whole still.
    let locked = file.lock().is_ok();
    let written = write_line(file, text);
    if locked {
        file.unlock()?;
    }
    written
}

fn write_line(file: &mut File, mut text: Vec<u8>) -> io::Result<()> {
    // What a full disk has cut off stays a line of its own.
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
