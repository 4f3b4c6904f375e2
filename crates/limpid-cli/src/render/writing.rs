//! Writing of pictures beside the drawing of the next.

use std::thread::JoinHandle;

use limpid_io::Error;
use limpid_io::film::Shot;

use super::output::Output;
use super::pictures::DrawnPicture;

/// Memory for pictures that are being written, bytes; a single one may take more.
pub(super) const MEMORY: usize = 256 << 20;

/// A picture that is being written, or has been.
pub(super) enum Writing {
    Begun {
        thread: JoinHandle<limpid_io::Result<u32>>,
        bytes: usize,
    },
    /// The checksum of its pixels.
    Done(u32),
}

/// The most pictures to write at a time, which may be claimed. Encoding takes longer than a graphics card draws.
pub(super) fn most(are_claimed: bool, output: &Output) -> usize {
    // A process holds two claims at most, and a film takes its pictures in order.
    if are_claimed || output.pictures().is_none() {
        return 0;
    }
    std::thread::available_parallelism().map_or(1, usize::from)
}

impl Writing {
    /// Begins to write a picture, on a thread of its own if it is a file of its own.
    pub(super) fn begin(
        output: &mut Output,
        shot: Shot,
        drawn: DrawnPicture,
    ) -> limpid_io::Result<Self> {
        let Some(pictures) = output.pictures().cloned() else {
            return output.write(&shot, drawn).map(Self::Done);
        };
        let bytes = drawn.bytes();
        let write = move || pictures.write(&shot, drawn);
        let thread = std::thread::Builder::new().name("writing".into()).spawn(write);
        Ok(Self::Begun { thread: thread.map_err(Error::Threads)?, bytes })
    }

    /// Memory that it takes.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Begun { bytes, .. } => *bytes,
            Self::Done(_) => 0,
        }
    }

    /// Whether it is written, or has failed.
    pub(super) fn is_done(&self) -> bool {
        match self {
            Self::Begun { thread, .. } => thread.is_finished(),
            Self::Done(_) => true,
        }
    }

    /// Waits for the picture: the checksum of its pixels.
    pub(super) fn wait(self) -> limpid_io::Result<u32> {
        match self {
            Self::Begun { thread, .. } => {
                thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            }
            Self::Done(pixels) => Ok(pixels),
        }
    }
}
