//! The command line of limpid.

mod bake;
mod check;
mod cli;
mod compare;
mod convert;
mod fingerprint;
mod info;
mod mesa;
mod pipeline_cache;
mod render;
mod report;
mod signals;
mod view;

use std::process::ExitCode;

use limpid_io::error::Category;

/// Bytes of stack, whatever the system gives the first thread (`ulimit -s`).
const STACK: usize = 8 << 20;

fn main() -> ExitCode {
    mesa::leave_window_systems_alone();
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
    cli::complain(error);
    // What a signal has interrupted did not fail.
    if let Some(code) = cli::signal() {
        return ExitCode::from(code);
    }
    ExitCode::from(category(error) as u8)
}

/// The kind of an error; what the arguments alone make wrong is no library's.
fn category(error: &anyhow::Error) -> Category {
    if let Some(error) = error.downcast_ref::<limpid_io::Error>() {
        return error.category();
    }
    error.downcast_ref::<limpid::Error>().map_or(Category::Request, Category::from)
}
