//! The command line of limpid.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    leave_window_systems_alone();
    match cli::run() {
        Ok(code) => code,
        Err(error) => {
            eprintln!("limpid: {error}");
            let code = error.downcast_ref::<limpid::Error>().map_or(2, limpid::Error::exit_code);
            ExitCode::from(code)
        }
    }
}

/// Mesa's device-select layer asks a Wayland or X server which GPU to prefer, and complains on
/// standard error where there is none. limpid chooses its adapter itself.
#[expect(unsafe_code, reason = "setting a variable is unsound only beside other threads")]
fn leave_window_systems_alone() {
    // SAFETY: the first thing that `main` does; no other thread exists yet.
    unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
}
