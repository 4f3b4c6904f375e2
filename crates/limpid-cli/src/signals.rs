//! Signal handling: a signal such as Ctrl-C removes temporary files and claims, and ends the process at
//! once. A command that must finish its work handles the first signal itself, except Ctrl-\.

#[cfg(unix)]
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::time::{Duration, Instant};

#[cfg(unix)]
use limpid_io::error::Category;

/// Signals within this time count as one: `timeout` and job schedulers send theirs to a process and to
/// its group.
const DEBOUNCE: Duration = Duration::from_millis(100);

/// The last signal received, or 0.
static RECEIVED: AtomicI32 = AtomicI32::new(0);

/// Whether the command handles the first signal itself.
static GRACE: AtomicBool = AtomicBool::new(false);

/// Installs the handlers.
pub(super) fn listen() -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGXFSZ};
        // Writing beyond the limit on file sizes (`ulimit -f`) ends the process, unless the signal is
        // handled: then the write fails as on a full disk, and the unfinished file is removed.
        signal_hook::flag::register(SIGXFSZ, Arc::default())?;
        // Signals that `nohup` or a shell's `&` made the process ignore stay ignored.
        let standard =
            [SIGINT, SIGTERM].into_iter().filter(|&signal| is_ignored(signal) != Some(true));
        let optional =
            [SIGHUP, SIGQUIT].into_iter().filter(|&signal| is_ignored(signal) == Some(false));
        let abort = is_memory_limited().then_some(SIGABRT);
        let handled = standard.chain(optional).chain(abort);
        let mut signals = signal_hook::iterator::Signals::new(handled)?;
        if abort.is_some() {
            wait_after_aborts()?;
        }
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

/// Time in which files are removed after an abort.
#[cfg(unix)]
const ABANDONED_WITHIN: Duration = Duration::from_secs(2);

/// Libraries and drivers abort if an allocation fails. With a memory limit (`ulimit -v`) that is an error like any other: the
/// thread that listens removes the files, while the thread that failed waits. Without one, an abort is a defect.
#[cfg(unix)]
#[expect(unsafe_code, reason = "the handler only sleeps, which signals do not disturb")]
fn wait_after_aborts() -> std::io::Result<()> {
    use signal_hook::consts::SIGABRT;
    // SAFETY: a sleep neither allocates nor locks.
    unsafe {
        signal_hook::low_level::register(SIGABRT, || std::thread::sleep(ABANDONED_WITHIN))?;
    }
    // Actions run in the order of their registration: the listener is told, this thread waits, and if the listener fails too,
    // the process ends.
    let code = Category::Temporary as i32;
    signal_hook::flag::register_conditional_shutdown(SIGABRT, code, Arc::new(true.into()))?;
    Ok(())
}

/// Whether the address space of the process is limited.
#[cfg(unix)]
fn is_memory_limited() -> bool {
    let limits = std::fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let space = limits.lines().find_map(|line| line.strip_prefix("Max address space"));
    space.is_some_and(|space| !space.trim_start().starts_with("unlimited"))
}

/// Whether the process was started with a signal ignored; `None` if that is unknown.
#[cfg(unix)]
fn is_ignored(signal: i32) -> Option<bool> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.map(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Handles a signal; `first` is the time of the first one.
fn receive(signal: i32, first: &mut Option<Instant>) {
    #[cfg(unix)]
    if signal == signal_hook::consts::SIGABRT {
        limpid_io::output::abandon();
        signal_hook::low_level::exit(Category::Temporary as i32);
    }
    #[cfg(unix)]
    if signal == signal_hook::consts::SIGQUIT {
        limpid_io::output::abandon();
        // Ends the process at once, with a core dump where the system writes one.
        let _ = signal_hook::low_level::emulate_default_handler(signal);
    }
    let began = *first.get_or_insert_with(Instant::now);
    let again = RECEIVED.swap(signal, Ordering::Relaxed) != 0;
    if again && began.elapsed() < DEBOUNCE {
        return;
    }
    limpid_io::output::interrupt();
    if again || !GRACE.load(Ordering::Relaxed) {
        limpid_io::output::abandon();
        // Without exit handlers, which expect that no other thread runs.
        #[cfg(unix)]
        signal_hook::low_level::exit(exit_code(signal).into());
        #[cfg(not(unix))]
        std::process::exit(exit_code(signal).into());
    }
}

/// Makes the caller responsible for ending soon after the first signal; a second one still ends the
/// process.
pub(super) fn finish_first() {
    GRACE.store(true, Ordering::Relaxed);
}

/// The exit code for the received signal, if there is one: 130 for Ctrl-C, 143 for `kill`, 129 for a
/// closed terminal.
pub(super) fn received() -> Option<u8> {
    match RECEIVED.load(Ordering::Relaxed) {
        0 => None,
        signal => Some(exit_code(signal)),
    }
}

/// The exit code for a signal, by the convention of shells: 128 + its number.
fn exit_code(signal: i32) -> u8 {
    128_u8.saturating_add(signal as u8)
}
