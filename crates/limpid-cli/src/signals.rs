//! What Ctrl-C and its like do: the process ends at once, without temporary files and claims. A
//! command that has something to finish is given the first signal to do so, but for Ctrl-\.

#[cfg(unix)]
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::time::{Duration, Instant};

/// The exit code of what may succeed if tried again.
#[cfg(unix)]
const RETRYABLE: i32 = 6;

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
        use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGXFSZ};
        // Libraries and drivers that get no memory abort. Whoever started the process may try again then,
        // as with any other lack of memory. Without a limit on it (`ulimit -v`), an abort is a defect.
        let limited = Arc::new(AtomicBool::new(is_memory_limited()));
        signal_hook::flag::register_conditional_shutdown(SIGABRT, RETRYABLE, limited)?;
        // Writing beyond the system's limit on the length of files (`ulimit -f`) ends a process, unless
        // someone listens: then it fails as on a full disk, and what is half-written is removed.
        signal_hook::flag::register(SIGXFSZ, Arc::default())?;
        // What `nohup` or a shell's `&` has the process ignore stays ignored.
        let ended_by =
            [SIGINT, SIGTERM].into_iter().filter(|&signal| is_ignored(signal) != Some(true));
        let optional =
            [SIGHUP, SIGQUIT].into_iter().filter(|&signal| is_ignored(signal) == Some(false));
        let heard = ended_by.chain(optional);
        let mut signals = signal_hook::iterator::Signals::new(heard)?;
        let listen = move || {
            let mut first = None;
            signals.forever().for_each(|signal| receive(signal, &mut first));
        };
        std::thread::Builder::new().spawn(listen)?;
        Ok(())
    }
    #[cfg(not(unix))]
    {
        let mut first = None;
        ctrlc::set_handler(move || receive(2, &mut first)).map_err(std::io::Error::other)
    }
}

/// Whether the process may have only so much address space.
#[cfg(unix)]
fn is_memory_limited() -> bool {
    let limits = std::fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let space = limits.lines().find_map(|line| line.strip_prefix("Max address space"));
    space.is_some_and(|space| !space.trim_start().starts_with("unlimited"))
}

/// Whether a signal would not end the process, as it was started; `None` where that is not known.
#[cfg(unix)]
fn is_ignored(signal: i32) -> Option<bool> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.map(|mask| mask >> (signal - 1) & 1 == 1)
}

fn receive(signal: i32, first: &mut Option<Instant>) {
    #[cfg(unix)]
    if signal == signal_hook::consts::SIGQUIT {
        limpid_io::output::abandon();
        // At once, with a memory dump where the system makes one.
        let _ = signal_hook::low_level::emulate_default_handler(signal);
    }
    let began = *first.get_or_insert_with(Instant::now);
    let again = RECEIVED.swap(signal, Ordering::Relaxed) != 0;
    if again && began.elapsed() < ONE {
        return;
    }
    limpid_io::output::interrupt();
    if again || !GRACE.load(Ordering::Relaxed) {
        limpid_io::output::abandon();
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

/// The exit code for the signal that has come, if one has: 130 for Ctrl-C, 143 for `kill`, 129 for a
/// terminal that was closed.
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
