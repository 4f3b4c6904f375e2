//! The program `limpid`.

use std::process::ExitCode;

fn main() -> ExitCode {
    disable_mesa_device_select();
    ExitCode::from(limpid_cli::run(std::env::args_os().collect()))
}

/// Disables Mesa's device-select layer, which asks a Wayland or X server for the preferred GPU and
/// prints a warning on standard error if there is none. limpid selects its adapter itself.
#[expect(unsafe_code, reason = "setting a variable is unsound only beside other threads")]
fn disable_mesa_device_select() {
    // SAFETY: `main` calls this first, when no other thread exists.
    unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
}
