//! The command-line interface, as scripts and render farms use it: output files and their names, printed
//! text, errors of one line, exit codes, and no unfinished files. In the same program: films, playback, presets, suites of
//! frame tests, failures of the device, and the cost of starting.

mod aov;
mod beside;
mod check;
mod colors;
mod compare;
mod convert;
mod coverage;
mod device;
mod exit_codes;
mod film;
mod help;
mod info;
mod inputs;
mod mistakes;
mod outputs;
mod playback;
mod presets;
mod render;
mod report;
mod scenes;
mod standard;
mod startup;
#[path = "../../../../tests/support/mod.rs"]
mod support;
mod web;
mod whitewater;
mod words;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use image::{Rgb, RgbImage};
use limpid::gpu::Gpu;
use tempfile::TempDir;

/// Small pictures, since these tests do not depend on the size.
const SIZE: &str = "--size=64x48";

/// The result of a run.
struct Outcome {
    code: i32,
    stdout: String,
    stderr: String,
}

/// Runs the program in `folder`.
fn run(folder: &Path, args: &[&str]) -> Outcome {
    run_with(folder, args, &[])
}

fn run_with(folder: &Path, args: &[&str], variables: &[(&str, &str)]) -> Outcome {
    let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_limpid"));
    // A Vulkan layer of Mesa prints warnings on stderr without a desktop session.
    command.env("NODEVICE_SELECT", "1").envs(variables.iter().copied());
    let output = command.current_dir(folder).args(args).output().expect("the program starts");
    Outcome {
        code: output.status.code().expect("the program is not killed by a signal"),
        stdout: String::from_utf8(output.stdout).expect("stdout is UTF-8"),
        stderr: String::from_utf8(output.stderr).expect("stderr is UTF-8"),
    }
}

/// Runs a command that must succeed with an empty stderr, and returns stdout.
#[track_caller]
fn succeed(folder: &Path, args: &[&str]) -> String {
    let Outcome { code, stdout, stderr } = run(folder, args);
    assert_eq!((code, stderr.as_str()), (0, ""), "{args:?}");
    stdout
}

/// Runs `render --quiet`, which must succeed without any output.
#[track_caller]
fn render(folder: &Path, args: &[&str]) {
    let args: Vec<_> =
        ["render", "--quiet", SIZE].into_iter().chain(args.iter().copied()).collect();
    assert_eq!(succeed(folder, &args), "", "{args:?}: render prints nothing");
}

/// Runs a command that must fail with `code` and one line, and returns that line.
#[track_caller]
fn fail(folder: &Path, code: i32, args: &[&str]) -> String {
    one_line(args, code, run(folder, &quiet(args)))
}

/// Adds `--quiet` to `render`, which leaves only errors on stderr.
fn quiet<'a>(args: &[&'a str]) -> Vec<&'a str> {
    match args {
        ["render", rest @ ..] => ["render", "--quiet"].iter().chain(rest).copied().collect(),
        _ => args.to_vec(),
    }
}

/// Returns the only line of a failed run.
#[track_caller]
fn one_line(args: &[&str], code: i32, outcome: Outcome) -> String {
    let Outcome { code: found, stdout, stderr } = outcome;
    assert_eq!(found, code, "{args:?}: {stderr}");
    assert_eq!(stdout, "", "{args:?}");
    let line = stderr.strip_suffix('\n').unwrap_or_else(|| panic!("{args:?}: no line: {stderr}"));
    assert!(!line.contains('\n'), "{args:?}: more than one line:\n{stderr}");
    assert!(line.starts_with("limpid: "), "{args:?}: {line}");
    // The cause is not repeated.
    assert!(line.matches("os error").count() <= 1, "{args:?}: {line}");
    line.to_owned()
}

/// Fails unless `line` contains all of `parts`.
#[track_caller]
fn assert_contains(line: &str, parts: &[&str]) {
    for part in parts {
        assert!(line.contains(part), "`{part}` is missing in: {line}");
    }
}

/// Whether there is an adapter. With `CI` or `LIMPID_REQUIRE_GPU=1`, a missing adapter fails the test
/// instead of skipping it.
fn adapter() -> bool {
    static FOUND: OnceLock<Result<(), String>> = OnceLock::new();
    let found = FOUND.get_or_init(|| Gpu::headless().map(|_| ()).map_err(|e| e.to_string()));
    let Err(problem) = found else { return true };
    let set = |name: &str, values: &[&str]| {
        std::env::var(name).is_ok_and(|value| values.contains(&value.as_str()))
    };
    let required = set("CI", &["1", "true"]) || set("LIMPID_REQUIRE_GPU", &["1", "true"]);
    assert!(!required, "this test must not be skipped here: {problem}");
    eprintln!("skipped: {problem}");
    false
}

/// Path of a frame of the sequence in `tests/data`.
fn dam(frame: &str) -> String {
    let folder =
        concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/tests/data/double_dam_break");
    format!("{folder}/ParticleData_Fluid_{frame}.bgeo")
}

fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// Names of all entries of a folder, including hidden temporary files.
fn names(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).expect("the folder can be listed");
    entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
}

#[track_caller]
fn assert_names(folder: &Path, expected: &[&str]) {
    let expected: BTreeSet<String> = expected.iter().map(|&name| name.to_owned()).collect();
    assert_eq!(names(folder), expected);
}

/// Writes a block of liquid, moved by `offset`, and one drop above it.
fn write_water(path: &Path, offset: f32) {
    let mut text = String::new();
    for i in 0..12 * 5 * 8 {
        let [x, y, z] = [i % 12, i / 12 % 5, i / 60].map(|i| i as f32 * 0.05);
        writeln!(text, "{} {y} {z}", x + offset).unwrap();
    }
    writeln!(text, "0.3 0.6 0.2").unwrap();
    fs::write(path, text).unwrap();
}

const SCENE: &str = r#"
[particles]
source = "../water/block_{}.xyz"
frame = 2
radius = 0.025

[liquid]
ior = 1.33
absorption = [1.2, 0.35, 0.12]

[camera]
eye = [0.9, 0.8, 1.6]
target = [0.3, 0.2, 0.2]
fov_y = 35.0

[environment]
radiance = [0.55, 0.70, 0.90]

[[solid]]
shape = "plane"
origin = [0.0, -0.025, 0.0]
half_extent = 6.0
checker = { tile = 0.25, even = [0.85, 0.80, 0.70], odd = [0.15, 0.20, 0.30] }
"#;

/// A folder with `water/block_1.xyz` to `block_3.xyz` and `scenes/block.toml`, which reads them.
fn project() -> TempDir {
    let folder = folder();
    for name in ["water", "scenes"] {
        fs::create_dir(folder.path().join(name)).unwrap();
    }
    for i in 1..=3 {
        write_water(&folder.path().join(format!("water/block_{i}.xyz")), 0.02 * i as f32);
    }
    fs::write(folder.path().join("scenes/block.toml"), SCENE).unwrap();
    folder
}

fn open(path: &Path) -> RgbImage {
    let picture = image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    picture.into_rgb8()
}

/// Fails unless the file is a picture of the right size with many colours.
#[track_caller]
fn assert_picture(path: &Path) {
    let picture = open(path);
    assert_eq!(picture.dimensions(), (64, 48), "{}", path.display());
    let colors: BTreeSet<_> = picture.pixels().map(|pixel| pixel.0).collect();
    assert!(colors.len() > 100, "{}: only {} colours", path.display(), colors.len());
}

fn bytes(path: &Path) -> Vec<u8> {
    fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// A block of liquid, 0.5 m high, on a lit floor under a sun at the zenith.
const LIT: &str = r#"
[recipe]
kind = "slab"
min = [-1.0, 0.0, -1.0]
max = [1.0, 0.5, 1.0]
count = 4000
[liquid]
ior = 1.33
absorption = [1.0, 0.0, 0.0]
[camera]
eye = [0.0, 3.0, 3.0]
target = [0.0, 0.0, 0.0]
fov_y = 45.0
[[solid]]
shape = "plane"
origin = [0.0, 0.0, 0.0]
lit = true
[[light]]
sun = { direction = [0.0, -1.0, 0.0], irradiance = [2.0, 2.0, 4.0] }
[settings.caustics]
resolution = 48
grid = 96
"#;

/// A folder with two pictures of 32 × 24 pixels, one of 16 × 16, and two invalid ones.
fn pictures() -> TempDir {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    let picture = RgbImage::from_fn(32, 24, |x, y| Rgb([8 * x as u8, 10 * y as u8, 90]));
    picture.save(path("a.png")).unwrap();
    let mut other = picture;
    other.put_pixel(20, 11, Rgb([255, 255, 255]));
    other.save(path("b.png")).unwrap();
    RgbImage::new(16, 16).save(path("small.png")).unwrap();
    let whole = bytes(&path("a.png"));
    fs::write(path("cut.png"), &whole[..whole.len() / 2]).unwrap();
    fs::write(path("text.png"), "no picture").unwrap();
    folder
}
