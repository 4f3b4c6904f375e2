//! Too little memory.
//!
//! Protects farms: where the system gives no more, a command ends with the exit code that says that
//! it may be tried again, however far it has come, and leaves nothing behind.

use std::fs;
use std::path::Path;
use std::time::Duration;

use limpid::glam::Vec3;
use limpid::liquid::Particles;

use super::damage::Random;

/// Runs `limpid` with so many KiB of address space. It either does its work or ends as it should.
#[track_caller]
fn limited(folder: &Path, kib: usize, arguments: &[&str]) {
    let out = folder.join("out");
    fs::create_dir_all(&out).expect("a folder");
    let mut command = assert_cmd::Command::new("sh");
    let shell = format!("ulimit -v {kib}; exec \"$0\" \"$@\"");
    command.args(["-c", &shell, env!("CARGO_BIN_EXE_limpid")]).args(arguments);
    command.env("NODEVICE_SELECT", "1").env("RAYON_NUM_THREADS", "2").current_dir(folder);
    let output = command.timeout(Duration::from_secs(60)).output().expect("it ends");
    let (code, message) = (output.status.code(), String::from_utf8_lossy(&output.stderr));
    assert!(matches!(code, Some(0 | 6)), "{arguments:?} in {kib} KiB: {code:?}: {message}");
    let left: Vec<_> = fs::read_dir(&out).expect("a folder").map(|e| e.unwrap().path()).collect();
    assert_eq!(left.is_empty(), code != Some(0) || arguments[0] == "info", "{kib} KiB: {left:?}");
    fs::remove_dir_all(out).expect("it is ours");
}

/// Protects farms from frames that are given up for good where memory was short for a while.
#[test]
fn no_memory_is_told_by_its_exit_code() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let place = |i: usize| Vec3::new((i % 100) as f32, (i / 100 % 50) as f32, (i / 5000) as f32);
    let particles = Particles::from_positions((0..200_000).map(place).collect());
    limpid_io::particles::write(&particles, &folder.path().join("a.xyz"))
        .expect("it can be written");
    let mut random = Random(21);
    let mut codes_of = |arguments: &[&str], low: usize, high: usize| {
        for _ in 0..4 {
            limited(folder.path(), low + random.below(high - low), arguments);
        }
    };
    codes_of(&["info", "a.xyz"], 60_000, 200_000);
    codes_of(&["convert", "a.xyz", "out/a.vtu"], 60_000, 120_000);
    codes_of(&["convert", "a.xyz", "out/a.csv"], 60_000, 120_000);
    // A graphics driver takes most of it.
    let draw = ["render", "a.xyz", "--radius=0.5", "--size=80x60", "-o", "out/a.png"];
    codes_of(&draw, 700_000, 1_700_000);
}
