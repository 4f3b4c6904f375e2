//! The program `limpid`.

mod bake;
mod calibration_cache;
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
mod scene;
mod settings;
mod shared_args;
mod signals;
mod standard;
mod terminal;
mod view;

use std::process::ExitCode;

use limpid_io::error::Category;

/// Stack size of the main work thread, bytes, independent of the system's limit (`ulimit -s`).
const STACK_BYTES: usize = 8 << 20;

fn main() -> ExitCode {
    disable_mesa_device_select();
    // Window systems require the event loop to run on the process's first thread.
    if std::env::args_os().nth(1).is_some_and(|command| command == "view") {
        return run();
    }
    let thread =
        std::thread::Builder::new().name("limpid".into()).stack_size(STACK_BYTES).spawn(run);
    match thread {
        // The panic hook has printed the message; 101 is the exit code of any panic in Rust.
        Ok(thread) => thread.join().unwrap_or(ExitCode::from(101)),
        Err(error) => report_failure(&limpid_io::Error::Threads(error).into()),
    }
}

fn run() -> ExitCode {
    cli::run().unwrap_or_else(|error| report_failure(&error))
}

/// Prints an error and returns its exit code.
fn report_failure(error: &anyhow::Error) -> ExitCode {
    terminal::warn(error_line(error));
    // An interrupted run ends with the signal's code.
    if let Some(code) = cli::signal() {
        return ExitCode::from(code);
    }
    ExitCode::from(category(error) as u8)
}

/// The line that reports an error.
fn error_line(error: &anyhow::Error) -> String {
    if let Some(error) = error.downcast_ref::<limpid_io::Error>() {
        return remedy::with_remedy(error);
    }
    let render_error = error.downcast_ref::<limpid::Error>();
    render_error.map_or_else(|| error.to_string(), remedy::of_drawing)
}

/// The category of an error; one that comes from no library is an error in the arguments.
fn category(error: &anyhow::Error) -> Category {
    if let Some(error) = error.downcast_ref::<limpid_io::Error>() {
        return error.category();
    }
    error.downcast_ref::<limpid::Error>().map_or(Category::Request, Category::from)
}

/// Disables Mesa's device-select layer, which asks a Wayland or X server for the preferred GPU and
/// prints a warning on standard error if there is none. limpid selects its adapter itself.
#[expect(unsafe_code, reason = "setting a variable is unsound only beside other threads")]
fn disable_mesa_device_select() {
    // SAFETY: `main` calls this first, when no other thread exists.
    unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
}
