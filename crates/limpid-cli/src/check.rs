//! `limpid check`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use limpid_io::device;
use limpid_io::output::{self, FileKind};
use limpid_lab::check::{Report, Suite, Verdict};

/// Where results go if nothing else is said; only what failed makes it.
const RESULTS: &str = "limpid-check";

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The suite (.toml): frames, what they must look like, and how nearly.
    suite: PathBuf,
    /// Make what was drawn the expectation of what failed. What passes stays as it is.
    #[arg(long)]
    bless: bool,
    /// Only the entries whose names hold NAME; may be given several times.
    #[arg(long, value_name = "NAME")]
    filter: Vec<String>,
    /// Folder for index.html and the pictures of what failed [default: limpid-check, if anything
    /// did].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the results for a CI system.
    #[arg(long, value_name = "FILE.xml")]
    junit: Option<PathBuf>,
    /// Print machine-readable results.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let suite = Suite::load(&args.suite)?;
    let folder = args.out.as_deref().unwrap_or(Path::new(RESULTS));
    check_outputs(args, &suite, folder)?;
    let gpu = device::open()?;
    // A pipe that is closed ends the listing, not the run.
    let mut listing = Ok(());
    let mut report = suite.run(&gpu, &args.filter, |outcome| {
        if !args.json && listing.is_ok() {
            listing = crate::terminal::print(&outcome.to_string());
        }
    })?;
    listing?;
    if args.bless {
        report.bless()?;
    }
    if let Some(path) = &args.junit {
        let xml = report.junit();
        output::write_atomically(path, FileKind::JUNIT, |file| {
            std::io::Write::write_all(file, xml.as_bytes())
        })?;
    }
    let passed = report.count(Verdict::Passed) == report.outcomes.len();
    // What lies there from an earlier run would pass for this one's.
    if args.out.is_some() || !passed || folder.exists() {
        report.write(folder)?;
    }
    match args.json {
        true => crate::terminal::print(&serde_json::to_string_pretty(&report.json())?)?,
        false => crate::terminal::print(&summary(&report, (!passed).then_some(folder)))?,
    }
    Ok(ExitCode::from(report.exit_code()))
}

/// Before anything is drawn.
fn check_outputs(args: &Args, suite: &Suite, folder: &Path) -> limpid_io::Result<()> {
    if args.bless {
        suite.check_blessings(&args.filter)?;
    }
    let mut files = suite.files();
    if let Some(path) = &args.junit {
        files.writes(path, FileKind::JUNIT)?;
    }
    match folder.exists() {
        true => files.writes(&folder.join("index.html"), FileKind::PAGE),
        false => output::check_folder(folder),
    }
}

fn summary(report: &Report, results: Option<&Path>) -> String {
    let counts = [
        (Verdict::Passed, "passed"),
        (Verdict::Blessed, "blessed"),
        (Verdict::Failed, "failed"),
        (Verdict::Error, "could not be compared"),
    ];
    let counts = counts.into_iter().filter_map(|(verdict, word)| match report.count(verdict) {
        0 => None,
        count => Some(format!("{count} {word}")),
    });
    let counts = counts.collect::<Vec<_>>().join(", ");
    let mut text = format!("\n{counts} in {:.1} s on {}", report.seconds, report.adapter);
    for outcome in report.outcomes.iter().filter(|outcome| outcome.blessed) {
        for (path, _) in &outcome.blessing {
            text += &format!("\nwrote {}", path.display());
        }
    }
    if let Some(folder) = results {
        text += &format!("\nsee {}", folder.join("index.html").display());
    }
    if report.outcomes.iter().any(|o| !o.blessed && !o.blessing.is_empty()) {
        text += &format!("\nto accept what was drawn: {}", report.bless_command());
    }
    text
}
