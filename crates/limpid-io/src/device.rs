//! Opening a graphics device.

use std::thread::Builder;

use limpid::gpu::Gpu;

use crate::error::{Error, Result};

/// As [`Gpu::headless`], where the system has as many threads as drivers start.
///
/// # Errors
/// As [`Gpu::headless`]; [`Error::Threads`] if the system starts fewer.
pub fn open() -> Result<Gpu> {
    check_threads()?;
    Ok(Gpu::headless()?)
}

/// Fails where the system does not start as many threads as drivers do: Mesa's software one then waits
/// for ever for those that it did not get.
fn check_threads() -> Result<()> {
    const MORE: usize = 8;
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let threads: Vec<_> = std::iter::repeat_with(|| Builder::new().spawn(std::thread::park))
        .take(cores + MORE)
        .collect();
    // All at once, and none for longer.
    let mut checked = Ok(());
    for thread in threads {
        match thread {
            Ok(thread) => {
                thread.thread().unpark();
                // It has nothing to tell.
                let _ = thread.join();
            }
            Err(error) => checked = Err(Error::Threads(error)),
        }
    }
    checked
}
