//! Farms: many processes, on one machine or on several, that draw one sequence into one folder.
//!
//! Protects what a farm relies on: that no frame is lost, none is half-written, none is taken for
//! what it is not, and that the pictures do not depend on who drew them, or on how often that
//! process was killed.

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

/// What a manifest says of a frame.
const DONE: &str = "done";
const SKIPPED: &str = "skipped";

/// Whether pictures can be drawn here; with `LIMPID_REQUIRE_GPU` or `CI` they must.
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

/// A folder with the frames `water/block_1.xyz` and so on: a block of liquid that moves.
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

    /// The program in the project's folder as a user who may do nothing in particular, and whom nobody
    /// else is, started by a `wrapper`; `None` where one cannot become another user.
    #[cfg(target_os = "linux")]
    fn limpid_as_nobody(&self, wrapper: &[&str]) -> Option<assert_cmd::Command> {
        const USER: &str = "54321";
        let mut command = assert_cmd::Command::new("setpriv");
        command.args(["--reuid", USER, "--regid", USER, "--clear-groups"]);
        // The one that was built may lie in a folder of somebody's own.
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
        eprintln!("skipped: one cannot become another user here");
        None
    }

    fn start(&self, args: &[&str]) -> Child {
        self.limpid(args).spawn().expect("the program starts")
    }

    /// Runs what must succeed without a word.
    #[track_caller]
    fn render(&self, args: &[&str]) {
        assert_success(self.limpid(args).output().expect("the program starts"));
    }

    /// Runs it, and returns what became of each frame.
    #[track_caller]
    fn statuses(&self, args: &[&str]) -> BTreeMap<i64, String> {
        let manifest = self.path("statuses.jsonl");
        let _ = fs::remove_file(&manifest);
        let args: Vec<_> = args.iter().copied().chain(["--manifest=statuses.jsonl"]).collect();
        self.render(&args);
        let lines = lines(&manifest).into_iter();
        lines.map(|line| (line["frame"].as_i64().unwrap(), text(&line, "status"))).collect()
    }

    /// The files in a folder, hidden ones included, with their contents.
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

/// The lines of a manifest, every one of them whole.
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

/// Fails unless both hold the same files, to the byte.
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

/// Waits until something is there that is to come.
fn until(what: &str, mut there: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !there() {
        assert!(begun.elapsed() < Duration::from_secs(120), "{what} does not come");
        std::thread::sleep(Duration::from_millis(5));
    }
}
