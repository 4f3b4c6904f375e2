//! The command line of limpid.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    match cli::run() {
        Ok(code) => code,
        Err(error) => {
            eprintln!("limpid: {error:#}");
            let code = error.downcast_ref::<limpid::Error>().map_or(2, limpid::Error::exit_code);
            ExitCode::from(code)
        }
    }
}
