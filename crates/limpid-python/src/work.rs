//! Long work, without the interpreter's lock and open to Ctrl-C.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use pyo3::prelude::*;

use crate::errors;

/// How long a signal may take to be seen.
const PATIENCE: Duration = Duration::from_millis(50);

/// The process that first worked, or 0: threads of rayon and of drivers do not exist in its forked children.
static PROCESS: AtomicU32 = AtomicU32::new(0);

/// Whether the process ends by a signal.
static ABANDONED: AtomicBool = AtomicBool::new(false);

/// Whether the interpreter ends, so that no work begins any more.
static ENDING: AtomicBool = AtomicBool::new(false);

/// The threads at work, each with the flag that ends its work early.
static AT_WORK: Mutex<Vec<Arc<AtomicBool>>> = Mutex::new(Vec::new());

/// Signals that a thread has ended its work.
static ENDED: Condvar = Condvar::new();

/// Does `work` on a thread of its own and waits for it. A signal, such as Ctrl-C, sets the flag that `work` is
/// given and returns at once: with the exception of Python's handler, while the thread ends by itself.
///
/// # Errors
/// That of `work`; `limpid.Error` if it panics, in a forked child of a process that has worked, and while the interpreter
/// ends.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Arc<AtomicBool>) -> limpid_io::Result<T> + Send + 'static,
) -> PyResult<T> {
    run_interruptible(py, Arc::default(), None, work)
}

/// As [`run`], with the flag that `work` watches, and a function of Python that is called again and again meanwhile; its
/// exceptions end the work, too.
pub(crate) fn run_interruptible<T: Send + 'static>(
    py: Python<'_>,
    interrupt: Arc<AtomicBool>,
    tick: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Arc<AtomicBool>) -> limpid_io::Result<T> + Send + 'static,
) -> PyResult<T> {
    check_process()?;
    {
        let mut at_work = locked();
        if ENDING.load(Ordering::Relaxed) {
            return Err(errors::error("the interpreter is ending, and draws nothing any more"));
        }
        at_work.push(interrupt.clone());
    }
    let flag = interrupt.clone();
    let (sender, mut receiver) = channel();
    let spawned = std::thread::Builder::new().name("limpid".into()).spawn(move || {
        let outcome = catch_unwind(AssertUnwindSafe(|| work(&flag)));
        end(&flag);
        let _ = sender.send(outcome);
    });
    if let Err(error) = spawned {
        end(&interrupt);
        return Err(errors::raise(limpid_io::Error::Threads(error)));
    }
    loop {
        let waiting = &mut receiver;
        let outcome = py.detach(move || waiting.recv_timeout(PATIENCE));
        match outcome {
            Ok(Ok(result)) => return result.map_err(errors::raise),
            Ok(Err(_)) | Err(RecvTimeoutError::Disconnected) => return Err(errors::panicked()),
            Err(RecvTimeoutError::Timeout) => {}
        }
        let ticked = || tick.map_or(Ok(()), |tick| tick.call0().map(drop));
        if let Err(exception) = py.check_signals().and_then(|()| ticked()) {
            // Not of work that has ended: others may use its flag by now.
            let at_work = locked();
            if at_work.iter().any(|flag| Arc::ptr_eq(flag, &interrupt)) {
                interrupt.store(true, Ordering::Relaxed);
            }
            return Err(exception);
        }
    }
}

/// Ends all work early. Waits for its threads, since drivers do not tolerate any in exit handlers; unless the process
/// ends by a signal, which runs none: then nothing is closed any more.
#[pyfunction]
pub(crate) fn finish(py: Python<'_>, by_signal: bool) {
    ABANDONED.store(by_signal, Ordering::Relaxed);
    py.detach(|| {
        let mut at_work = locked();
        ENDING.store(true, Ordering::Relaxed);
        at_work.iter().for_each(|flag| flag.store(true, Ordering::Relaxed));
        while !at_work.is_empty() && !must_leak() {
            at_work = ENDED.wait(at_work).unwrap_or_else(PoisonError::into_inner);
        }
    });
}

/// Whether devices must be left as they are, since closing one waits for it: at the end by a signal, and in a forked
/// child of a process that has worked, where it would wait for ever.
pub(crate) fn must_leak() -> bool {
    let forked = ![0, std::process::id()].contains(&PROCESS.load(Ordering::Relaxed));
    forked || ABANDONED.load(Ordering::Relaxed)
}

/// Fails in a forked child of a process that has worked.
pub(crate) fn check_process() -> PyResult<()> {
    let own = std::process::id();
    match PROCESS.compare_exchange(0, own, Ordering::Relaxed, Ordering::Relaxed) {
        Err(other) if other != own => Err(errors::error(
            "this process was forked from one that has used limpid, whose threads and devices do not exist here; \
             start processes with multiprocessing.get_context(\"spawn\"), or use limpid in the children alone",
        )),
        _ => Ok(()),
    }
}

/// Ends the work of this flag, so that nothing sets it any more. Returns false, and does nothing, if it is set: then the
/// interpreter may wait for the end, and what the work holds must be closed before.
pub(crate) fn end_unless_interrupted(flag: &Arc<AtomicBool>) -> bool {
    let mut at_work = locked();
    let ends = !flag.load(Ordering::Relaxed);
    if ends {
        remove(&mut at_work, flag);
    }
    ends
}

fn end(flag: &Arc<AtomicBool>) {
    remove(&mut locked(), flag);
}

fn remove(at_work: &mut Vec<Arc<AtomicBool>>, flag: &Arc<AtomicBool>) {
    at_work.retain(|other| !Arc::ptr_eq(other, flag));
    ENDED.notify_all();
}

fn locked() -> MutexGuard<'static, Vec<Arc<AtomicBool>>> {
    AT_WORK.lock().unwrap_or_else(PoisonError::into_inner)
}
