//! Arguments, and what each command does with them.

mod bake;
mod compare;
mod convert;
mod info;
mod render;
mod report;
mod view;

use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{Parser, Subcommand};

/// Draws clear liquid straight from particles.
///
/// Exit codes: 0 done, 1 the pictures differ, 2 usage, 3 size or format mismatch,
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
    Render(Box<render::Args>),
    /// Simulate the liquid of a scene with a [simulation], into a sequence of BGEO files.
    Bake(bake::Args),
    /// Look at it in a window: play, orbit, tune, save.
    View(view::Args),
    /// Say what a particle file or sequence holds.
    Info(info::Args),
    /// Write particle files in another format.
    Convert(convert::Args),
    /// Say how far one picture is from another.
    Compare(compare::Args),
    /// Measure how fast and how wrong every method is, against ground truth.
    Report(report::Args),
}

pub(crate) fn run() -> anyhow::Result<ExitCode> {
    match parse()?.command {
        Command::Render(args) => render::run(&args),
        Command::Bake(args) => bake::run(&args),
        Command::View(args) => view::run(args),
        Command::Info(args) => info::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Report(args) => report::run(&args),
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

/// As clap parses, but with every error on one line like all others.
fn parse() -> anyhow::Result<Cli> {
    Cli::try_parse().map_err(|error| match error.kind() {
        ErrorKind::DisplayHelp
        | ErrorKind::DisplayVersion
        | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => error.exit(),
        _ => anyhow::anyhow!(one_line(&error.to_string())),
    })
}

/// The problem and the hint of clap's message, without its usage and its pointer to the help.
fn one_line(message: &str) -> String {
    let message = message.strip_prefix("error: ").unwrap_or(message);
    let lines = message.lines().map(str::trim).filter(|line| !line.is_empty());
    let told = |line: &&str| !line.starts_with("Usage:") && !line.starts_with("For more");
    lines.take_while(told).fold(String::new(), |text, line| {
        let between = if text.is_empty() || text.ends_with(':') { " " } else { "; " };
        (text + between + line).trim_start().to_owned()
    })
}
