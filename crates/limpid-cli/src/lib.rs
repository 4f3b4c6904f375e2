//! The program `limpid`, as a library: other programs start it by [`run`], or open their device by
//! [`open_adapter`], with the pipelines that earlier runs have compiled.

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
mod sharing;
mod signals;
mod standard;
mod terminal;
mod view;
mod web;
mod whitewater;

use std::ffi::OsString;

use limpid_io::error::Category;

pub use pipeline_cache::{PipelineCache, open_adapter, open_adapter_named};

/// Exit code of a command that has done its work.
const SUCCESS: u8 = 0;

/// Exit code of a panic, whose message the panic hook has printed.
const PANICKED: u8 = 101;

/// Stack size of the main work thread, bytes, independent of the system's limit (`ulimit -s`).
const STACK_BYTES: usize = 8 << 20;

/// Runs the program with its arguments, the first of which is its own name, and returns its exit code. It handles
/// the signals of its process, some of which end it.
///
/// To be called once, from the first thread: window systems require their event loop there.
pub fn run(arguments: Vec<OsString>) -> u8 {
    // First of all, since parsing can exhaust the memory, too.
    if let Err(error) = signals::listen() {
        return report_failure(&limpid_io::Error::Threads(error).into());
    }
    if arguments.get(1).is_some_and(|command| command == "view") {
        return run_here(&arguments);
    }
    let thread = std::thread::Builder::new().name("limpid".into()).stack_size(STACK_BYTES);
    match thread.spawn(move || run_here(&arguments)) {
        Ok(thread) => thread.join().unwrap_or(PANICKED),
        Err(error) => report_failure(&limpid_io::Error::Threads(error).into()),
    }
}

fn run_here(arguments: &[OsString]) -> u8 {
    cli::run(arguments).unwrap_or_else(|error| report_failure(&error))
}

/// Prints an error and returns its exit code.
fn report_failure(error: &anyhow::Error) -> u8 {
    terminal::warn(error_line(error));
    // An interrupted run ends with the signal's code.
    cli::signal().unwrap_or(category(error) as u8)
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
