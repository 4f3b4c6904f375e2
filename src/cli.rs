//! Arguments, and what each command does with them.

mod compare;
mod info;
mod render;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Draws clear liquid straight from particles.
///
/// Exit codes: 0 done, 1 differs or a frame failed, 2 usage, 3 size or format mismatch,
/// 4 missing or unreadable file, 5 no graphics adapter, 6 device lost or out of memory (try again).
#[derive(Parser)]
#[command(version, about, long_about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Render frames to PNG, without a window.
    Render(render::Args),
    /// Say what a particle file or sequence holds.
    Info(info::Args),
    /// Say how far one picture is from another.
    Compare(compare::Args),
}

pub(crate) fn run() -> anyhow::Result<ExitCode> {
    match Cli::parse().command {
        Command::Render(args) => render::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Compare(args) => compare::run(&args),
    }
}

/// Prints results; a reader that has seen enough (`| head -1`) is not an error.
fn print(text: &str) -> anyhow::Result<()> {
    use std::io::{ErrorKind, Write};
    match writeln!(std::io::stdout(), "{text}") {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(e.into()),
        _ => Ok(()),
    }
}
