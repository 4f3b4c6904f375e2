//! Farms: several processes, on one machine or many, draw one sequence into one folder. No frame is lost
//! or incomplete, no existing picture is mistaken for another, and the pictures depend neither on the
//! process that draws them nor on how often it was killed. A program of its own, so that no other test takes
//! the time of its races.

mod claims;
mod failures;
mod fingerprints;
mod restarts;
mod shards;
mod signals;
mod slurm;
mod threads;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::{self, File, Permissions};
use std::io::{BufRead as _, BufReader, Write as _};
#[cfg(unix)]
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Barrier, OnceLock};
use std::time::{Duration, Instant, SystemTime};

use limpid::gpu::Gpu;
use limpid_io::claim::Claims;
use serde_json::Value;
use tempfile::TempDir;

/// Statuses in a manifest.
const DONE: &str = "done";
const SKIPPED: &str = "skipped";

/// Whether there is an adapter; with `LIMPID_REQUIRE_GPU` or `CI` a missing one fails the test.
fn adapter() -> bool {
    static FOUND: OnceLock<Result<(), String>> = OnceLock::new();
    let found = FOUND.get_or_init(|| Gpu::headless().map(|_| ()).map_err(|e| e.to_string()));
    let Err(problem) = found else { return true };
    let set = |name| std::env::var(name).is_ok_and(|value| !value.is_empty() && value != "0");
    let required = set("CI") || set("LIMPID_REQUIRE_GPU");
    assert!(!required, "this test must not be skipped here: {problem}");
    eprintln!("skipped: {problem}");
    false
}

/// A folder with the frames `water/block_1.xyz` and so on: a moving block of liquid.
struct Project(TempDir);

impl Project {
    fn new(frames: usize) -> Self {
        let project = Self(tempfile::tempdir().expect("a temporary folder"));
        fs::create_dir(project.path("water")).unwrap();
        for frame in 1..=frames {
            project.write_water(frame, 0.03 * frame as f32);
        }
        project
    }

    fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.0.path().join(name)
    }

    fn water(&self, frame: usize) -> PathBuf {
        self.path(format!("water/block_{frame}.xyz"))
    }

    fn write_water(&self, frame: usize, offset: f32) {
        let mut text = String::new();
        for i in 0..8 * 4 * 6 {
            let [x, y, z] = [i % 8, i / 8 % 4, i / 32].map(|i| i as f32 * 0.05);
            writeln!(text, "{:.3} {y:.3} {z:.3}", x + offset).unwrap();
        }
        fs::write(self.water(frame), text).unwrap();
    }

    fn limpid(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
        command.args(["render", "water", "--quiet", "--size=48x36"]).args(args);
        command.current_dir(self.0.path()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// The program in the project's folder, run by an unprivileged and otherwise unused user through
    /// `wrapper`; `None` if the user cannot be changed.
    #[cfg(target_os = "linux")]
    fn limpid_as_nobody(&self, wrapper: &[&str]) -> Option<assert_cmd::Command> {
        const USER: &str = "54321";
        let mut command = assert_cmd::Command::new("setpriv");
        command.args(["--reuid", USER, "--regid", USER, "--clear-groups"]);
        // A copy, since that user may not be able to access the build folder.
        let program = self.path("limpid");
        fs::copy(env!("CARGO_BIN_EXE_limpid"), &program).unwrap();
        fs::set_permissions(&program, Permissions::from_mode(0o755)).unwrap();
        fs::set_permissions(self.0.path(), Permissions::from_mode(0o755)).unwrap();
        command.current_dir(self.0.path()).env("HOME", "/nonexistent");
        command.args(wrapper).arg(program);
        let mut probe = Command::new("setpriv");
        probe.args(["--reuid", USER, "--regid", USER, "--clear-groups", "true"]);
        if probe.output().is_ok_and(|ended| ended.status.success()) {
            return Some(command);
        }
        eprintln!("skipped: the user cannot be changed here");
        None
    }

    fn start(&self, args: &[&str]) -> Child {
        self.limpid(args).spawn().expect("the program starts")
    }

    /// Runs `render`, which must succeed without any output.
    #[track_caller]
    fn render(&self, args: &[&str]) {
        assert_success(self.limpid(args).output().expect("the program starts"));
    }

    /// Runs `render`, and returns the status of each frame.
    #[track_caller]
    fn statuses(&self, args: &[&str]) -> BTreeMap<i64, String> {
        let manifest = self.path("statuses.jsonl");
        let _ = fs::remove_file(&manifest);
        let args: Vec<_> = args.iter().copied().chain(["--manifest=statuses.jsonl"]).collect();
        self.render(&args);
        let lines = lines(&manifest).into_iter();
        lines.map(|line| (line["frame"].as_i64().unwrap(), text(&line, "status"))).collect()
    }

    /// Reads the files in a folder, including hidden ones.
    fn files(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        let entries = fs::read_dir(self.path(folder)).into_iter().flatten();
        let file = |entry: fs::DirEntry| {
            let name = entry.file_name().into_string().unwrap();
            (name, fs::read(entry.path()).unwrap())
        };
        entries.map(|entry| file(entry.unwrap())).collect()
    }
}

#[track_caller]
fn assert_success(output: Output) {
    let Output { status, stdout, stderr } = output;
    let (stdout, stderr) = (String::from_utf8_lossy(&stdout), String::from_utf8_lossy(&stderr));
    assert!(status.success() && stdout.is_empty() && stderr.is_empty(), "{status}: {stderr}");
}

/// Parses the lines of a manifest, all of which must be complete.
#[track_caller]
fn lines(manifest: &Path) -> Vec<Value> {
    let text = fs::read_to_string(manifest).unwrap();
    assert!(text.ends_with('\n'), "{text}");
    let parse = |line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{line}: {e}"));
    text.lines().map(parse).collect()
}

#[track_caller]
fn text(line: &Value, key: &str) -> String {
    line[key].as_str().unwrap_or_else(|| panic!("no {key} in {line}")).to_owned()
}

/// Fails unless both have the same files with the same bytes.
#[track_caller]
fn assert_same(found: &BTreeMap<String, Vec<u8>>, expected: &BTreeMap<String, Vec<u8>>) {
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(found), names(expected));
    for (name, bytes) in expected {
        assert!(&found[name] == bytes, "{name} differs");
    }
}

#[cfg(unix)]
fn signal(child: &Child, name: &str) {
    let status = Command::new("kill").args([format!("-{name}"), child.id().to_string()]).status();
    assert!(status.expect("there is a `kill`").success());
}

/// Waits for a condition, at most two minutes.
fn until(what: &str, mut condition: impl FnMut() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < Duration::from_secs(120), "not in time: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}
