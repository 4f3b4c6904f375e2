//! Parsing of the command line, and dispatch to the commands.

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

use clap::error::{ContextKind, ContextValue, ErrorKind as Usage};
use clap::{CommandFactory as _, Parser, Subcommand};
use limpid_io::output::{self, FileKind};

use crate::terminal;
use crate::{
    bake, check, compare, convert, info, render, report, scene, settings, signals, view, web,
    whitewater,
};

/// Renders clear liquid directly from particles.
///
/// Exit codes: 0 success, 1 pictures differ, errors have increased or frames failed, 2 usage, 3 size
/// or format mismatch, 4 missing or unreadable file, 5 no graphics adapter, 6 device lost, or out of
/// memory or threads (try again).
#[derive(Parser)]
#[command(name = "limpid", about, long_about, arg_required_else_help = true)]
struct Cli {
    /// Print the version.
    #[arg(short = 'V', long)]
    version: bool,
    /// With --version: also the commit, the adapter and its driver.
    #[arg(long, requires = "version")]
    verbose: bool,
    /// Print nothing but results, errors and waits for other processes: no remarks and no progress.
    #[arg(short, long, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// Render frames to pictures or a film, without a window.
    #[command(after_help = RENDER_EXAMPLES)]
    Render(Box<render::Args>),
    /// Simulate a scene with a [simulation] and write a sequence of BGEO files.
    Bake(bake::Args),
    /// Make foam, spray and bubbles of a sequence, and write them as particle files.
    Whitewater(whitewater::Args),
    /// Open a viewer window: play, orbit, adjust settings, save.
    #[command(after_help = VIEW_EXAMPLES)]
    View(Box<view::Args>),
    /// Write a folder that any web server serves: the viewer as a page, with frames and their scene.
    #[command(after_help = WEB_EXAMPLES)]
    Web(Box<web::Args>),
    /// Print the scene of an input as a file to edit, with the automatic parts filled in.
    #[command(after_help = SCENE_EXAMPLES)]
    Scene(Box<scene::Args>),
    /// List all settings with unit, range, default and meaning.
    Settings(settings::Args),
    /// Describe a particle file or sequence.
    Info(info::Args),
    /// Convert particle files to another format.
    Convert(convert::Args),
    /// Measure the difference between two pictures.
    Compare(compare::Args),
    /// Render the frames of a suite and compare each with its expected picture.
    Check(check::Args),
    /// Measure the speed and the error of every method against ground truth.
    Report(report::Args),
    /// Print the completions of a shell.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Write a manual page for each command.
    Man {
        /// The folder for the pages.
        folder: PathBuf,
    },
}

const RENDER_EXAMPLES: &str = "Examples:
  limpid render water.vtu                              one file: limpid.png
  limpid render 'frames/w_{}.bgeo' -o pictures/        a sequence
  limpid render frames/ -o water.mp4 --speed 0.25      a film in slow motion
  limpid render water.csv --look pool --sun 30,50      another look
  limpid render mm.csv --scale 0.001 --up z            millimetres, z up
  limpid render water.vtu --scene scene.toml           in a scene of your own";

const VIEW_EXAMPLES: &str = "Examples:
  limpid view                      a breaking dam
  limpid view frames/              a sequence
  limpid view water.vtu --look night";

const WEB_EXAMPLES: &str = "Examples:
  limpid web frames/ -o site                           all frames of a folder
  limpid web 'frames/w_{}.vtu' --frames 1-79:2 -o site half of them
  limpid web mm.csv --scale 0.001 --up z --look daylight -o site
  limpid web frames/ --scene scene.toml -o site        in a scene of your own

The site opens with its frames. It is served as it is: copy it to a server, or
  python3 -m http.server --directory site              and open http://localhost:8000";

const SCENE_EXAMPLES: &str = "Examples:
  limpid scene 'frames/w_{}.bgeo' > scene.toml         write the automatic scene,
  limpid render scene.toml                             edit it, and draw it
  limpid scene water.vtu --look daylight --sun 200,15 --tint 0.5,0.8,0.7";

pub(crate) fn run(arguments: &[OsString]) -> anyhow::Result<u8> {
    let Cli { version, verbose, quiet, command } = parse(arguments)?;
    let command = match command {
        Some(_) if version => anyhow::bail!("--version takes no command"),
        Some(command) => command,
        None if version => return print_version(verbose),
        None => anyhow::bail!("expected a command; `limpid --help` lists them"),
    };
    if quiet {
        terminal::silence();
    }
    start_workers()?;
    match command {
        Command::Render(args) => render::run(&args),
        Command::Bake(args) => bake::run(&args),
        Command::Whitewater(args) => whitewater::run(&args),
        Command::View(args) => view::run(*args),
        Command::Web(args) => web::run(&args),
        Command::Scene(args) => scene::run(&args),
        Command::Settings(args) => settings::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Check(args) => check::run(&args),
        Command::Report(args) => report::run(&args),
        Command::Completions { shell } => print_completions(shell),
        Command::Man { folder } => write_manual(&folder),
    }
}

fn print_version(verbose: bool) -> anyhow::Result<u8> {
    let mut text = format!("limpid {}", env!("CARGO_PKG_VERSION"));
    if verbose {
        let adapter = match limpid_io::device::open() {
            Ok(gpu) => {
                let info = gpu.device.adapter_info();
                format!("{}, {} {}, {}", info.name, info.driver, info.driver_info, info.backend)
            }
            Err(error) => format!("none: {error}"),
        };
        let window = if cfg!(feature = "viewer") { "yes" } else { "no" };
        let commit = env!("LIMPID_COMMIT");
        text += &format!("\ncommit {commit}\nadapter {adapter}\nwindow {window}");
    }
    terminal::print(&text)?;
    Ok(crate::SUCCESS)
}

fn print_completions(shell: clap_complete::Shell) -> anyhow::Result<u8> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "limpid", &mut text);
    terminal::print(String::from_utf8_lossy(&text).trim_end())?;
    Ok(crate::SUCCESS)
}

/// Writes `limpid.1`, `limpid-render.1` and so on.
fn write_manual(folder: &Path) -> anyhow::Result<u8> {
    std::fs::create_dir_all(folder).map_err(|source| limpid_io::Error::Io {
        path: folder.into(),
        action: "create",
        source,
    })?;
    let mut command = Cli::command();
    command.build();
    let pages = std::iter::once(("limpid".to_owned(), command.clone())).chain(
        command.get_subcommands().map(|sub| (format!("limpid-{}", sub.get_name()), sub.clone())),
    );
    for (name, page) in pages {
        let page = clap_mangen::Man::new(page).title(&name);
        output::write_atomically(&folder.join(format!("{name}.1")), FileKind::MANUAL, |file| {
            page.render(file)
        })?;
    }
    Ok(crate::SUCCESS)
}

/// The exit code for the received signal, if there is one.
pub(crate) fn signal() -> Option<u8> {
    signals::received()
}

/// Starts rayon's global thread pool: one thread per core, or a single one if the system allows no
/// more (`ulimit -u`).
fn start_workers() -> limpid_io::Result<()> {
    // Tested with a pool of its own, since the global one can be built only once.
    let possible = rayon::ThreadPoolBuilder::new().build().is_ok();
    // 0 means one per core, or RAYON_NUM_THREADS.
    let threads = if possible { 0 } else { 1 };
    let started = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    started.map_err(|error| limpid_io::Error::Threads(io::Error::other(error)))
}

/// Parses the arguments; usage errors are put on one line, like all other errors.
fn parse(arguments: &[OsString]) -> anyhow::Result<Cli> {
    Cli::try_parse_from(arguments).map_err(|error| match error.kind() {
        Usage::DisplayHelp
        | Usage::DisplayVersion
        | Usage::DisplayHelpOnMissingArgumentOrSubcommand => error.exit(),
        Usage::InvalidUtf8 => anyhow::anyhow!(not_text(arguments)),
        _ => {
            anyhow::anyhow!(without_command(&error).unwrap_or_else(|| one_line(&error.to_string())))
        }
    })
}

/// The message for an argument that has to be text and is not, which clap does not name: that with which alone the
/// arguments are refused so.
fn not_text(arguments: &[OsString]) -> String {
    let replaced = |argument: &OsString| argument.to_string_lossy().into_owned().into();
    let refused = |&at: &usize| {
        let mut others: Vec<OsString> = arguments.iter().map(replaced).collect();
        others[at].clone_from(&arguments[at]);
        let parsed = Cli::try_parse_from(others);
        parsed.is_err_and(|error| error.kind() == Usage::InvalidUtf8)
    };
    let at = (1..arguments.len()).find(refused).unwrap_or_default();
    let option = at.checked_sub(1).map(|before| arguments[before].to_string_lossy());
    let option = option.filter(|option| option.starts_with('-') && !option.contains('='));
    let option = option.map_or(String::new(), |option| format!("{option} "));
    format!("{option}{}: expected text in UTF-8", arguments[at].to_string_lossy())
}

/// The message for an input where a command is expected.
fn without_command(error: &clap::Error) -> Option<String> {
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand) else {
        return None;
    };
    let is_input = Path::new(word).exists() || word.contains(['.', '{', '*']);
    is_input.then(|| format!("`{word}` is no command; to draw it: limpid render {word}"))
}

/// Extracts problem and hint from clap's message, without the usage and the reference to the help.
fn one_line(message: &str) -> String {
    let message = message.strip_prefix("error: ").unwrap_or(message);
    let lines = message.lines().map(str::trim).filter(|line| !line.is_empty());
    let is_message = |line: &&str| !line.starts_with("Usage:") && !line.starts_with("For more");
    lines.take_while(is_message).fold(String::new(), |text, line| {
        let separator = if text.is_empty() || text.ends_with(':') { " " } else { "; " };
        (text + separator + line).trim_start().to_owned()
    })
}
