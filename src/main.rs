//! The command line of limpid.

mod cli;
mod mesa;
mod pipeline_cache;

use std::process::ExitCode;

fn main() -> ExitCode {
    mesa::leave_window_systems_alone();
    match cli::run() {
        Ok(code) => code,
        Err(error) => {
            cli::complain(&error);
            let code = error.downcast_ref::<limpid::Error>().map_or(2, limpid::Error::exit_code);
            ExitCode::from(code)
        }
    }
}
