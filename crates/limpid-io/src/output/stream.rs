//! What is written to as it is, not replaced by a file: pipes and devices, and files that grow.

use std::fs::File;
use std::io::{self, Write as _};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use super::FileKind;
use crate::error::{Error, Result};

/// How often it is looked whether a wait is to end.
const PATIENCE: Duration = Duration::from_millis(50);

/// Whether nothing waits for the reader of a pipe any more.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Ends all waiting for the readers of pipes, for good: writing to one that nobody empties fails from
/// now on. For a process that is to end soon.
pub fn interrupt() {
    INTERRUPTED.store(true, Ordering::Relaxed);
}

/// A pipe or a device. Both its opening and its writing may last for ever, so a thread of its own
/// does them; whoever waits for it can be interrupted.
#[derive(Debug)]
pub struct Pipe {
    bytes: Sender<Vec<u8>>,
    done: Receiver<io::Result<()>>,
}

impl Pipe {
    /// Opens a pipe, once somebody reads it, or a device.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let (bytes, to_write) = channel::<Vec<u8>>();
        let (tell, done) = channel();
        let path = path.to_owned();
        std::thread::Builder::new().spawn(move || {
            // For writing alone: whoever holds the other end too is never told that it is gone.
            let mut file = match File::options().write(true).open(path) {
                Ok(file) => file,
                Err(e) => return drop(tell.send(Err(e))),
            };
            let mut outcome = Ok(());
            while tell.send(outcome).is_ok()
                && let Ok(bytes) = to_write.recv()
            {
                outcome = file.write_all(&bytes);
            }
        })?;
        let pipe = Self { bytes, done };
        pipe.wait()?;
        Ok(pipe)
    }

    /// Waits until all of it is taken.
    pub(super) fn write(&mut self, bytes: Vec<u8>) -> io::Result<()> {
        // Whoever does not take it says why.
        let _ = self.bytes.send(bytes);
        self.wait()
    }

    fn wait(&self) -> io::Result<()> {
        loop {
            match self.done.recv_timeout(PATIENCE) {
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

/// A file that lines are added to, or a pipe that they are written to.
#[derive(Debug)]
pub enum Stream {
    /// A regular file, open for reading and writing.
    File(File),
    /// Anything else.
    Pipe(Pipe),
}

impl Stream {
    /// Opens it for lines to be added to those that are there.
    ///
    /// # Errors
    /// As [`FileKind::check`]; [`Error::Io`] if it cannot be opened.
    pub fn append(path: &Path, kind: FileKind) -> Result<Self> {
        Self::open(path, kind, File::options().append(true).create(true).read(true))
    }

    /// Opens it to be begun anew.
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

    /// Writes bytes with one call of the system, where it takes them all at once.
    ///
    /// # Errors
    /// Those of the system; of a pipe also that it was interrupted, see [`interrupt`].
    pub fn write(&mut self, bytes: Vec<u8>) -> io::Result<()> {
        match self {
            Self::File(file) => file.write_all(&bytes),
            Self::Pipe(pipe) => pipe.write(bytes),
        }
    }
}
