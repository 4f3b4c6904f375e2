//! What Ctrl-C and its like do: the process ends at once, without temporary files and claims. A
//! command that has something to finish is given the first signal to do so.

#[cfg(unix)]
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::time::{Duration, Instant};

/// Signals that come so close together are one: `timeout` and job schedulers send theirs to a
/// process and to its group.
const ONE: Duration = Duration::from_millis(100);

/// The signal that has come, or 0.
static RECEIVED: AtomicI32 = AtomicI32::new(0);

/// Whether the first one is waited for.
static GRACE: AtomicBool = AtomicBool::new(false);

/// Begins to listen.
pub(super) fn listen() -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
        // Writing beyond the system's limit on the length of files (`ulimit -f`) ends a process, unless
        // someone listens: then it fails as on a full disk, and what is half-written is removed.
        signal_hook::flag::register(SIGXFSZ, Arc::default())?;
        let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM])?;
        std::thread::spawn(move || {
            let mut first = None;
            signals.forever().for_each(|signal| receive(signal, &mut first));
        });
        Ok(())
    }
    #[cfg(not(unix))]
    {
        let mut first = None;
        ctrlc::set_handler(move || receive(2, &mut first)).map_err(std::io::Error::other)
    }
}

fn receive(signal: i32, first: &mut Option<Instant>) {
    let began = *first.get_or_insert_with(Instant::now);
    let again = RECEIVED.swap(signal, Ordering::Relaxed) != 0;
    if again && began.elapsed() < ONE {
        return;
    }
    if again || !GRACE.load(Ordering::Relaxed) {
        limpid::output::abandon();
        // At once: what would be run at the end expects that nothing else runs.
        #[cfg(unix)]
        signal_hook::low_level::exit(exit_code(signal).into());
        #[cfg(not(unix))]
        std::process::exit(exit_code(signal).into());
    }
}

/// Leaves it to the caller to end soon after the first signal; a second one ends the process still.
pub(super) fn finish_first() {
    GRACE.store(true, Ordering::Relaxed);
}

/// The exit code for the signal that has come, if one has: 130 for Ctrl-C, 143 for `kill`.
pub(super) fn received() -> Option<u8> {
    match RECEIVED.load(Ordering::Relaxed) {
        0 => None,
        signal => Some(exit_code(signal)),
    }
}

/// As shells have it.
fn exit_code(signal: i32) -> u8 {
    128_u8.saturating_add(signal as u8)
}
