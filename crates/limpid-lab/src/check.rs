//! Picture tests, as `limpid check` runs them and as Rust tests can: frames are compared with
//! expected pictures.
//!
//! A [`Suite`] is a TOML file that lists inputs, expected pictures and tolerances. A missing
//! expected picture is a failure, never a pass; an expected picture or an input that cannot be read
//! is an error. A failure of one entry does not stop the others.
//!
//! ```no_run
//! use limpid_io::device;
//! use limpid_lab::check::Suite;
//!
//! # fn main() -> limpid_io::Result<()> {
//! let suite = Suite::load("tests/golden.toml".as_ref())?;
//! let report = suite.run(&device::open()?, &[], |outcome| println!("{outcome}"))?;
//! report.write("target/golden".as_ref())?;
//! assert_eq!(report.exit_code(), 0, "see target/golden/index.html");
//! # Ok(())
//! # }
//! ```

mod draw;
mod exhibit;
mod images;
mod judge;
mod junit;
mod page;
mod record;
mod suite;

use std::collections::HashSet;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use limpid::gpu::Gpu;
use limpid::offscreen::Offscreen;
use limpid_io::device;
use limpid_io::error::{Error, Result};
use limpid_io::output::{self, FileKind, Files, folder_of};

pub use exhibit::{Exhibit, Panel};
pub use suite::{AovTolerance, Bake, Content, Entry, Suite, Tolerance};

/// File name suffixes of the pictures that [`Report::write`] writes next to its page.
const ENDINGS: [&str; 5] =
    [".expected.png", ".actual.png", ".difference.png", ".side-by-side.png", ".actual.exr"];

/// The results of a run.
#[derive(Debug)]
pub struct Report {
    /// The suite's file.
    pub suite: PathBuf,
    /// The adapter that rendered the frames.
    pub adapter: Adapter,
    /// The outcomes of the rendered entries, in the suite's order.
    pub outcomes: Vec<Outcome>,
    /// Duration of the run, s.
    pub seconds: f64,
    /// The inputs and expected files of all entries; no result may overwrite them.
    files: Files,
}

/// A graphics adapter.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Adapter {
    /// Its name.
    pub name: String,
    /// Its driver and the driver's version.
    pub driver: String,
    /// `vulkan`, `metal`, `dx12` or `gl`.
    pub backend: String,
}

impl Adapter {
    fn of(gpu: &Gpu) -> Self {
        let info = gpu.device.adapter_info();
        let driver = format!("{} {}", info.driver, info.driver_info).trim().to_owned();
        Self { name: info.name, driver, backend: info.backend.to_string() }
    }
}

impl fmt::Display for Adapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {}, {}", self.name, self.driver, self.backend)
    }
}

/// The outcome of one entry.
#[derive(Debug)]
pub struct Outcome {
    /// The entry's name.
    pub name: String,
    /// The measured differences between the frames and the expected ones.
    pub measures: Vec<Measure>,
    /// The reasons for failure; empty if it did not fail.
    pub problems: Vec<String>,
    /// The first error that prevented a comparison.
    pub error: Option<Error>,
    /// Pictures that show why it failed.
    pub exhibits: Vec<Exhibit>,
    /// The files that [`Report::bless`] would write: the rendered pictures of a failed entry.
    pub blessing: Vec<(PathBuf, Arc<[u8]>)>,
    /// Whether they were written.
    pub blessed: bool,
    /// Duration, s.
    pub seconds: f64,
    /// Further result files, by name.
    files: Vec<(String, Arc<[u8]>)>,
    /// The settings that it was rendered with, for the record.
    drawn: toml::Table,
}

/// A measured value and its limits.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measure {
    /// `mean FLIP`, `depth.aggregate_front differing`, ….
    pub name: String,
    /// The measured value; for the pictures of a sequence, the largest.
    pub value: f64,
    /// The largest value that passes.
    pub at_most: f64,
    /// The smallest value that passes.
    pub at_least: f64,
    /// `m`, `degrees`, …; empty for shares and ratios.
    pub unit: &'static str,
}

impl Measure {
    fn new(name: impl Into<String>, value: f64, at_most: f64, unit: &'static str) -> Self {
        Self { name: name.into(), value, at_most, at_least: 0.0, unit }
    }

    /// Whether the value is within its limits; NaN is not.
    pub fn passes(&self) -> bool {
        (self.at_least..=self.at_most).contains(&self.value)
    }
}

impl fmt::Display for Measure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, value, at_most, at_least, unit } = self;
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        write!(f, "{name} {}{unit}", digits(*value))?;
        match self.passes() {
            true => Ok(()),
            false if value < at_least => write!(f, " (at least {}{unit})", digits(*at_least)),
            false => write!(f, " (at most {}{unit})", digits(*at_most)),
        }
    }
}

/// Formats a number with three significant digits.
fn digits(value: f64) -> String {
    let magnitude = value.abs().log10().floor();
    if value == 0.0 || !magnitude.is_finite() {
        return value.to_string();
    }
    let decimals = (2.0 - magnitude).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// The verdict on an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The frames are as expected.
    Passed,
    /// The frames differ, or an expected picture is missing.
    Failed,
    /// The entry could not be rendered or compared.
    Error,
    /// The entry failed, and the rendered pictures became the expected ones.
    Blessed,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Passed => "passed",
            Self::Failed => "FAILED",
            Self::Error => "ERROR",
            Self::Blessed => "blessed",
        })
    }
}

impl Outcome {
    fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            measures: Vec::new(),
            problems: Vec::new(),
            error: None,
            exhibits: Vec::new(),
            blessing: Vec::new(),
            blessed: false,
            seconds: 0.0,
            files: Vec::new(),
            drawn: toml::Table::new(),
        }
    }

    /// The verdict.
    pub fn verdict(&self) -> Verdict {
        match (self.blessed, &self.error, self.problems.as_slice()) {
            (true, ..) => Verdict::Blessed,
            (_, Some(_), _) => Verdict::Error,
            (_, _, [_, ..]) => Verdict::Failed,
            _ => Verdict::Passed,
        }
    }

    /// The reasons why it did not pass, the error first.
    pub fn reasons(&self) -> Vec<String> {
        let error = self.error.iter().map(Error::to_string);
        error.chain(self.problems.iter().cloned()).collect()
    }

    /// Records a measurement; one outside its limits is a problem.
    fn measured(&mut self, measure: Measure) {
        if !measure.passes() {
            self.problems.push(measure.to_string());
        }
        self.measures.push(measure);
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:7} {} ({:.1} s)", self.verdict(), self.name, self.seconds)?;
        let lines = match self.verdict() {
            Verdict::Passed => vec![],
            _ => self.reasons(),
        };
        lines.iter().try_for_each(|line| write!(f, "\n        {line}"))
    }
}

impl Suite {
    /// Renders and compares the entries whose names contain one of `filter`, or all if it is empty,
    /// and passes each outcome to `each` as soon as it is known.
    ///
    /// # Errors
    /// [`Error::Usage`] if no entry matches. Errors of a single entry are in its outcome; after a
    /// device failure the remaining entries are rendered on a new device.
    pub fn run(
        &self,
        gpu: &Gpu,
        filter: &[String],
        mut each: impl FnMut(&Outcome),
    ) -> Result<Report> {
        let chosen = self.chosen(filter)?;
        let begun = Instant::now();
        let adapter = Adapter::of(gpu);
        let mut offscreen = Offscreen::new(gpu);
        let mut outcomes = Vec::new();
        for entry in chosen {
            let begun = Instant::now();
            // A panic in one entry does not stop the others.
            let judge = || judge::judge(self, entry, &adapter, &mut offscreen);
            let judged = catch_unwind(AssertUnwindSafe(judge));
            let mut outcome = judged.unwrap_or_else(|_| {
                let error = Defect("the entry could not be judged".into());
                Outcome { error: Some(error.into()), ..Outcome::new(&entry.name) }
            });
            use limpid::Error::{Defect, DeviceLost};
            if matches!(outcome.error, Some(Error::Render(DeviceLost(_) | Defect(_)))) {
                // A failed device stays unusable. If no other can be opened, the errors of the
                // remaining entries report it.
                if let Ok(gpu) = device::open() {
                    offscreen = Offscreen::new(&gpu);
                }
            }
            outcome.seconds = begun.elapsed().as_secs_f64();
            each(&outcome);
            outcomes.push(outcome);
        }
        let seconds = begun.elapsed().as_secs_f64();
        let files = self.files();
        Ok(Report { suite: self.path.clone(), adapter, outcomes, seconds, files })
    }
}

impl Suite {
    /// Checks the outputs of a run before anything is drawn: the folder of [`Report::write`], and the file of
    /// [`Report::write_junit`].
    ///
    /// # Errors
    /// As [`Files::writes`] and [`output::check_folder`].
    pub fn check_outputs(&self, folder: &Path, junit: Option<&Path>) -> Result<()> {
        let mut files = self.files();
        if let Some(path) = junit {
            files.writes(path, FileKind::JUNIT)?;
        }
        match folder.exists() {
            true => files.writes(&folder.join("index.html"), FileKind::PAGE),
            false => output::check_folder(folder),
        }
    }
}

impl Report {
    /// The number of entries with this verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.outcomes.iter().filter(|outcome| outcome.verdict() == verdict).count()
    }

    /// The exit code of `limpid check`: that of the first error, else 1 if anything failed, else 0.
    pub fn exit_code(&self) -> u8 {
        let not_blessed = || self.outcomes.iter().filter(|outcome| !outcome.blessed);
        match not_blessed().find_map(|outcome| outcome.error.as_ref()) {
            Some(error) => error.category() as u8,
            None => u8::from(self.count(Verdict::Failed) > 0),
        }
    }

    /// Makes the rendered pictures of every failed entry the expected ones, and records how they
    /// were rendered. Expected pictures of entries that passed are not touched.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file that could not be written; [`Error::Scene`] for a record that
    /// is not TOML; [`Error::Usage`] for an expected picture that lies outside the suite's folder
    /// or would replace a file that is not a picture: then nothing is written.
    pub fn bless(&mut self) -> Result<()> {
        let mut record = record::Record::open(&self.suite)?;
        for (path, _) in self.outcomes.iter().flat_map(|outcome| &outcome.blessing) {
            suite::check_blessing(&self.suite, path)?;
        }
        for outcome in &mut self.outcomes {
            if outcome.blessing.is_empty() {
                continue;
            }
            for (path, bytes) in &outcome.blessing {
                write_file(path, FileKind::PICTURE, bytes)?;
            }
            record.note(&outcome.name, &self.adapter, &outcome.drawn);
            // Written after each entry, so that the record is complete even if a later one fails.
            record.write()?;
            outcome.blessed = true;
        }
        Ok(())
    }

    /// Writes `index.html`, a self-contained page with all failures, and the pictures as files next
    /// to it. Files of the same entries from an earlier run are removed.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file or folder; [`Error::Usage`] if a result would overwrite an
    /// expected file, an input or a file that is not a result.
    pub fn write(&self, folder: &Path) -> Result<()> {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
        let blessings = self.outcomes.iter().flat_map(|outcome| &outcome.blessing);
        let blessed: HashSet<PathBuf> = blessings.map(|(path, _)| canonical_path(path)).collect();
        // Includes freshly blessed files, which may not have existed when the inputs were
        // collected.
        let is_kept =
            |path: &Path| self.files.has_input(path) || blessed.contains(&canonical_path(path));
        self.clear(folder, is_kept)?;
        for outcome in &self.outcomes {
            for (name, bytes) in outcome.files() {
                let path = folder.join(name);
                if is_kept(&path) {
                    let path = path.display();
                    let problem = "the suite reads or expects this file; name another folder";
                    return Err(Error::Usage(format!("{path}: {problem}")));
                }
                write_file(&path, FileKind::PICTURE, bytes)?;
            }
        }
        write_file(&folder.join("index.html"), FileKind::PAGE, self.page().as_bytes())
    }

    /// Removes pictures that an earlier run wrote for these entries, never an expected one.
    fn clear(&self, folder: &Path, is_kept: impl Fn(&Path) -> bool) -> Result<()> {
        let fail = |e| Error::io(folder, "list", e);
        for file in std::fs::read_dir(folder).map_err(fail)? {
            let file = file.map_err(fail)?;
            let name = file.file_name().to_string_lossy().into_owned();
            let stem = ENDINGS.iter().find_map(|ending| name.strip_suffix(ending));
            let is_ours = |outcome: &Outcome| {
                let rest = stem.and_then(|stem| stem.strip_prefix(&outcome.name));
                rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
            };
            let path = file.path();
            let picture = || FileKind::PICTURE.check(&path).is_ok();
            if self.outcomes.iter().any(is_ours) && !is_kept(&path) && picture() {
                std::fs::remove_file(&path).map_err(|e| Error::io(&path, "remove", e))?;
            }
        }
        Ok(())
    }

    /// The report as a self-contained HTML page.
    pub fn page(&self) -> String {
        page::page(self)
    }

    /// The report as `JUnit` XML, for CI systems.
    pub fn junit(&self) -> String {
        junit::junit(self)
    }

    /// Writes [`Report::junit`].
    ///
    /// # Errors
    /// [`Error::Io`] naming the file.
    pub fn write_junit(&self, path: &Path) -> Result<()> {
        let xml = self.junit();
        output::write_atomically(path, FileKind::JUNIT, |file| {
            std::io::Write::write_all(file, xml.as_bytes())
        })
    }

    /// The end of the listing: how many entries have which verdict, what was blessed, and where `results` are.
    pub fn summary(&self, results: Option<&Path>) -> String {
        let counts = [
            (Verdict::Passed, "passed"),
            (Verdict::Blessed, "blessed"),
            (Verdict::Failed, "failed"),
            (Verdict::Error, "could not be compared"),
        ];
        let counts = counts.into_iter().filter_map(|(verdict, word)| match self.count(verdict) {
            0 => None,
            count => Some(format!("{count} {word}")),
        });
        let counts = counts.collect::<Vec<_>>().join(", ");
        let mut text = format!("\n{counts} in {:.1} s on {}", self.seconds, self.adapter);
        for outcome in self.outcomes.iter().filter(|outcome| outcome.blessed) {
            for (path, _) in &outcome.blessing {
                text += &format!("\nwrote {}", path.display());
            }
        }
        if let Some(folder) = results {
            text += &format!("\nsee {}", folder.join("index.html").display());
        }
        if self.outcomes.iter().any(|o| !o.blessed && !o.blessing.is_empty()) {
            text += &format!("\nto accept what was drawn: {}", self.bless_command());
        }
        text
    }

    /// The report as JSON.
    pub fn json(&self) -> serde_json::Value {
        let entry = |outcome: &Outcome| {
            serde_json::json!({
                "name": outcome.name,
                "verdict": outcome.verdict(),
                "problems": outcome.problems,
                "error": outcome.error.as_ref().map(Error::to_string),
                "measures": outcome.measures,
                "seconds": outcome.seconds,
            })
        };
        serde_json::json!({
            "suite": self.suite.display().to_string(),
            "adapter": self.adapter,
            "limpid": env!("CARGO_PKG_VERSION"),
            "exit_code": self.exit_code(),
            "seconds": self.seconds,
            "entries": self.outcomes.iter().map(entry).collect::<Vec<_>>(),
        })
    }

    /// The command line that blesses the rendered pictures.
    pub fn bless_command(&self) -> String {
        let suite = self.suite.display().to_string();
        let needs_no_quotes = |c: char| c.is_alphanumeric() || "/._-+:=@,".contains(c);
        match suite.chars().all(needs_no_quotes) {
            true => format!("limpid check {suite} --bless"),
            false => format!("limpid check '{}' --bless", suite.replace('\'', "'\\''")),
        }
    }
}

impl Outcome {
    /// The files that [`Report::write`] writes for it, by name.
    fn files(&self) -> impl Iterator<Item = (&str, &[u8])> {
        let panels = self.exhibits.iter().flat_map(Exhibit::files);
        panels.chain(self.files.iter().map(|(name, bytes)| (name.as_str(), &**bytes)))
    }
}

/// A canonical path of a file that need not exist.
fn canonical_path(path: &Path) -> PathBuf {
    let folder = folder_of(path);
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    path.file_name().map_or(folder.clone(), |name| folder.join(name))
}

/// Writes a file, creating its folder if needed.
fn write_file(path: &Path, kind: FileKind, bytes: &[u8]) -> Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
    }
    output::write_atomically(path, kind, |file| std::io::Write::write_all(file, bytes))
}
