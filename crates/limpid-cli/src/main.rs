//! The command line of limpid.

mod bake;
mod check;
mod cli;
mod compare;
mod convert;
mod fingerprint;
mod info;
mod pipeline_cache;
mod remedy;
mod render;
mod report;
mod shared_args;
mod signals;
mod terminal;
mod view;

use std::process::ExitCode;

use limpid_io::error::Category;

/// Bytes of stack, whatever the system gives the first thread (`ulimit -s`).
const STACK: usize = 8 << 20;

fn main() -> ExitCode {
    leave_window_systems_alone();
    // Windows belong to the first thread of a process.
    if std::env::args_os().nth(1).is_some_and(|command| command == "view") {
        return run();
    }
    let thread = std::thread::Builder::new().name("limpid".into()).stack_size(STACK).spawn(run);
    match thread {
        // It has said itself why it has panicked; the code is that of any panic.
        Ok(thread) => thread.join().unwrap_or(ExitCode::from(101)),
        Err(error) => failed(&limpid_io::Error::Threads(error).into()),
    }
}

fn run() -> ExitCode {
    cli::run().unwrap_or_else(|error| failed(&error))
}

fn failed(error: &anyhow::Error) -> ExitCode {
    terminal::complain(reported(error));
    // What a signal has interrupted did not fail.
    if let Some(code) = cli::signal() {
        return ExitCode::from(code);
    }
    ExitCode::from(category(error) as u8)
}

/// The line that reports an error.
fn reported(error: &anyhow::Error) -> String {
    if let Some(error) = error.downcast_ref::<limpid_io::Error>() {
        return remedy::with_remedy(error);
    }
    let drawing = error.downcast_ref::<limpid::Error>();
    drawing.map_or_else(|| error.to_string(), remedy::of_drawing)
}

/// The kind of an error; what the arguments alone make wrong is no library's.
fn category(error: &anyhow::Error) -> Category {
    if let Some(error) = error.downcast_ref::<limpid_io::Error>() {
        return error.category();
    }
    error.downcast_ref::<limpid::Error>().map_or(Category::Request, Category::from)
}

/// Mesa's device-select layer asks a Wayland or X server which GPU to prefer, and complains on
/// standard error where there is none. limpid chooses its adapter itself.
#[expect(unsafe_code, reason = "setting a variable is unsound only beside other threads")]
fn leave_window_systems_alone() {
    // SAFETY: the first thing that `main` does; no other thread exists yet.
    unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
}
