//! Arguments, and what each command does with them.

use std::io;
use std::process::ExitCode;

use clap::error::ErrorKind as Usage;
use clap::{Parser, Subcommand};

use crate::{bake, check, compare, convert, info, render, report, signals, view};

/// Draws clear liquid straight from particles.
///
/// Exit codes: 0 done, 1 the pictures differ, errors have risen or frames failed, 2 usage, 3 size or
/// format mismatch, 4 missing or unreadable file, 5 no graphics adapter, 6 device lost, or memory or threads ran out
/// (try again).
#[derive(Parser)]
#[command(name = "limpid", version, about, long_about)]
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
    /// Draw the frames of a suite and compare each with the picture that it must be.
    Check(check::Args),
    /// Measure how fast and how wrong every method is, against ground truth.
    Report(report::Args),
}

pub(crate) fn run() -> anyhow::Result<ExitCode> {
    let command = parse()?.command;
    signals::listen().map_err(limpid_io::Error::Threads)?;
    start_workers()?;
    match command {
        Command::Render(args) => render::run(&args),
        Command::Bake(args) => bake::run(&args),
        Command::View(args) => view::run(args),
        Command::Info(args) => info::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Check(args) => check::run(&args),
        Command::Report(args) => report::run(&args),
    }
}

/// The exit code for the signal that has come, if one has.
pub(crate) fn signal() -> Option<u8> {
    signals::received()
}

/// Starts the threads that share long loops: as many as there are cores, or one where the system
/// gives no more (`ulimit -u`).
fn start_workers() -> limpid_io::Result<()> {
    // Tried with threads of their own, for those that all share can be asked for once only.
    let possible = rayon::ThreadPoolBuilder::new().build().is_ok();
    // 0 is as many as there are cores, or as RAYON_NUM_THREADS says.
    let threads = if possible { 0 } else { 1 };
    let started = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    started.map_err(|error| limpid_io::Error::Threads(io::Error::other(error)))
}

/// As clap parses, but with every error on one line like all others.
fn parse() -> anyhow::Result<Cli> {
    Cli::try_parse().map_err(|error| match error.kind() {
        Usage::DisplayHelp
        | Usage::DisplayVersion
        | Usage::DisplayHelpOnMissingArgumentOrSubcommand => error.exit(),
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
