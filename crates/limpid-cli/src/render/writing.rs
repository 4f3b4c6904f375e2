//! Writing of pictures beside the drawing of the next.

use std::thread::JoinHandle;

use limpid_io::Error;
use limpid_io::film::Shot;

use super::Args;
use super::output::{DrawnPicture, Output};

/// A picture that is being written, or has been.
pub(super) enum Writing {
    Begun(JoinHandle<limpid_io::Result<u32>>),
    /// The checksum of its pixels.
    Done(u32),
}

/// The most pictures to write at a time. Encoding takes longer than a graphics card draws.
pub(super) fn most(args: &Args, output: &Output) -> usize {
    /// Memory for them, bytes.
    const MEMORY: u64 = 256 << 20;
    // A process holds two claims at most, and a film takes its pictures in order.
    if args.claim || output.pictures().is_none() {
        return 0;
    }
    let images = args.aov.as_ref().map_or(0, Vec::len) + usize::from(output.is_linear());
    let pixel = 4 + 16 * images as u64;
    let picture = pixel * u64::from(args.size.x) * u64::from(args.size.y);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    threads.min((MEMORY / picture.max(1)) as usize)
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
        let write = move || pictures.write(&shot, drawn);
        let thread = std::thread::Builder::new().name("writing".into()).spawn(write);
        thread.map(Self::Begun).map_err(Error::Threads)
    }

    /// Waits for the picture: the checksum of its pixels.
    pub(super) fn wait(self) -> limpid_io::Result<u32> {
        match self {
            Self::Begun(thread) => {
                thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            }
            Self::Done(pixels) => Ok(pixels),
        }
    }
}
