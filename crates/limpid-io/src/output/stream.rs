//! Output written in place: pipes, devices, and files to which lines are appended.

use std::fs::File;
use std::io::{self, Write as _};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use super::FileKind;
use crate::error::{Error, Result};

/// Interval at which a wait checks for an interruption.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Whether waits for the readers of pipes have been ended.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Ends all waits for the readers of pipes, for good: from now on a write that would block fails. For a
/// process that is about to end.
pub fn interrupt() {
    INTERRUPTED.store(true, Ordering::Relaxed);
}

/// A pipe or a device. Opening and writing may block forever, so they run on a thread of their own, and
/// the calling thread's wait can be interrupted.
#[derive(Debug)]
pub struct Pipe {
    bytes: Sender<Vec<u8>>,
    done: Receiver<io::Result<()>>,
}

impl Pipe {
    /// Opens a device, or a pipe once it has a reader.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let (bytes, requests) = channel::<Vec<u8>>();
        let (results, done) = channel();
        let path = path.to_owned();
        std::thread::Builder::new().spawn(move || {
            // Write-only: a process that also holds the read end would never see that the reader is
            // gone.
            let mut file = match File::options().write(true).open(path) {
                Ok(file) => file,
                Err(e) => return drop(results.send(Err(e))),
            };
            let mut outcome = Ok(());
            while results.send(outcome).is_ok()
                && let Ok(bytes) = requests.recv()
            {
                outcome = file.write_all(&bytes);
            }
        })?;
        let pipe = Self { bytes, done };
        pipe.wait()?;
        Ok(pipe)
    }

    /// Writes the bytes and waits until all have been accepted.
    pub(super) fn write(&mut self, bytes: Vec<u8>) -> io::Result<()> {
        // If the thread has ended, `wait` returns its error.
        let _ = self.bytes.send(bytes);
        self.wait()
    }

    fn wait(&self) -> io::Result<()> {
        loop {
            match self.done.recv_timeout(POLL_INTERVAL) {
                Ok(outcome) => return outcome,
                Err(RecvTimeoutError::Disconnected) => return Err(io::ErrorKind::BrokenPipe.into()),
                Err(RecvTimeoutError::Timeout) if INTERRUPTED.load(Ordering::Relaxed) => {
                    return Err(io::Error::other("interrupted, and nobody reads from it"));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }
}

/// A file, pipe or device to which lines are written.
#[derive(Debug)]
pub enum Stream {
    /// A regular file.
    File(File),
    /// A pipe or a device.
    Pipe(Pipe),
}

impl Stream {
    /// Opens `path` to append lines.
    ///
    /// # Errors
    /// As [`FileKind::check`]; [`Error::Io`] if it cannot be opened.
    pub fn append(path: &Path, kind: FileKind) -> Result<Self> {
        Self::open(path, kind, File::options().append(true).create(true).read(true))
    }

    /// Opens `path` and truncates it.
    ///
    /// # Errors
    /// As [`Stream::append`].
    pub fn create(path: &Path, kind: FileKind) -> Result<Self> {
        Self::open(path, kind, File::options().write(true).create(true).truncate(true))
    }

    fn open(path: &Path, kind: FileKind, options: &std::fs::OpenOptions) -> Result<Self> {
        kind.check(path)?;
        let opened = match super::is_device(path) {
            true => Pipe::open(path).map(Self::Pipe),
            false => options.open(path).map(Self::File),
        };
        opened.map_err(|e| Error::io(path, "write", e))
    }

    /// Writes bytes, with a single system call unless that is partial.
    ///
    /// # Errors
    /// Those of the system; for a pipe also an interruption, see [`interrupt`].
    pub fn write(&mut self, bytes: Vec<u8>) -> io::Result<()> {
        match self {
            Self::File(file) => file.write_all(&bytes),
            Self::Pipe(pipe) => pipe.write(bytes),
        }
    }
}
