//! The command `limpid check`.

use std::path::{Path, PathBuf};

use limpid_io::device;
use limpid_io::output::{self, FileKind};
use limpid_lab::check::{Report, Suite, Verdict};

/// Default folder of the results, which only failures create.
const RESULTS: &str = "limpid-check";

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The suite (.toml): frames, their expected pictures, and tolerances.
    suite: PathBuf,
    /// Replace the expected pictures of failed entries with the rendered ones. Passed entries are not
    /// changed.
    #[arg(long)]
    bless: bool,
    /// Check only entries whose names contain NAME; may be given several times.
    #[arg(long, value_name = "NAME")]
    filter: Vec<String>,
    /// Folder for index.html and the pictures of failed entries [default: limpid-check, if any
    /// failed].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the results as XML for a CI system.
    #[arg(long, value_name = "FILE.xml")]
    junit: Option<PathBuf>,
    /// Print machine-readable results.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<u8> {
    let suite = Suite::load(&args.suite)?;
    let folder = args.out.as_deref().unwrap_or(Path::new(RESULTS));
    check_outputs(args, &suite, folder)?;
    let gpu = device::open()?;
    // A closed pipe ends the listing, not the run.
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
    // Also replaces the results of an earlier run, which would be mistaken for those of this one.
    if args.out.is_some() || !passed || folder.exists() {
        report.write(folder)?;
    }
    match args.json {
        true => crate::terminal::print(&serde_json::to_string_pretty(&report.json())?)?,
        false => crate::terminal::print(&summary(&report, (!passed).then_some(folder)))?,
    }
    Ok(report.exit_code())
}

/// Checks the outputs before anything is drawn.
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
