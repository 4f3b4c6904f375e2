//! Opening a graphics device.

use std::thread::Builder;

use limpid::gpu::Gpu;

use crate::error::{Error, Result};

/// As [`Gpu::headless`], after checking that the system can start the threads of a driver.
///
/// # Errors
/// As [`Gpu::headless`]; [`Error::Threads`] if the system starts fewer.
pub fn open() -> Result<Gpu> {
    check_threads()?;
    Ok(Gpu::headless()?)
}

/// As [`Gpu::named`], after checking that the system can start the threads of a driver.
///
/// # Errors
/// As [`Gpu::named`]; [`Error::Threads`] if the system starts fewer.
pub fn open_named(wanted: &str) -> Result<Gpu> {
    check_threads()?;
    Ok(Gpu::named(wanted)?)
}

/// Fails if the system cannot start as many threads as a driver does: Mesa's software driver would wait
/// for ever for those that it could not start.
fn check_threads() -> Result<()> {
    /// Number of threads beyond one per core.
    const ADDITIONAL: usize = 8;
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let threads: Vec<_> = std::iter::repeat_with(|| Builder::new().spawn(std::thread::park))
        .take(cores + ADDITIONAL)
        .collect();
    // All threads existed at once; now they end.
    let mut result = Ok(());
    for thread in threads {
        match thread {
            Ok(thread) => {
                thread.thread().unpark();
                let _ = thread.join();
            }
            Err(error) => result = Err(Error::Threads(error)),
        }
    }
    result
}
