//! The command `limpid check`.

use std::path::{Path, PathBuf};

use limpid_io::device;
use limpid_lab::check::{Suite, Verdict};

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
    if args.bless {
        suite.check_blessings(&args.filter)?;
    }
    suite.check_outputs(folder, args.junit.as_deref())?;
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
        report.write_junit(path)?;
    }
    let passed = report.count(Verdict::Passed) == report.outcomes.len();
    // Also replaces the results of an earlier run, which would be mistaken for those of this one.
    if args.out.is_some() || !passed || folder.exists() {
        report.write(folder)?;
    }
    match args.json {
        true => crate::terminal::print(&serde_json::to_string_pretty(&report.json())?)?,
        false => crate::terminal::print(&report.summary((!passed).then_some(folder)))?,
    }
    Ok(report.exit_code())
}
