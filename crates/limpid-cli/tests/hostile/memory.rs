//! Limits on memory: if memory runs out at any point, a command ends with the exit code of a retryable
//! error and leaves no files.

use std::fs;
use std::path::Path;
use std::time::Duration;

use limpid::glam::Vec3;
use limpid::liquid::Particles;

use super::damage::Random;

/// Runs `limpid` with `kib` KiB of address space. It must succeed, or fail with code 6 and without
/// files.
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

/// A command without enough memory has the exit code of a retryable error, so that farms retry the
/// frame.
#[test]
fn exhausted_memory_has_its_own_exit_code() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let position = |i: usize| Vec3::new((i % 100) as f32, (i / 100 % 50) as f32, (i / 5000) as f32);
    let particles = Particles::from_positions((0..200_000).map(position).collect());
    limpid_io::particles::write(&particles, &folder.path().join("a.xyz"))
        .expect("it can be written");
    // From the least memory with which the program starts to enough for parsing its arguments.
    for kib in (60_000..72_000).step_by(1000) {
        limited(folder.path(), kib, &["info", "a.xyz"]);
    }
    let mut random = Random(21);
    let mut run_between = |arguments: &[&str], low: usize, high: usize| {
        for _ in 0..4 {
            limited(folder.path(), low + random.below(high - low), arguments);
        }
    };
    run_between(&["info", "a.xyz"], 60_000, 200_000);
    run_between(&["convert", "a.xyz", "out/a.vtu"], 60_000, 120_000);
    run_between(&["convert", "a.xyz", "out/a.csv"], 60_000, 120_000);
    // A graphics driver needs most of the memory.
    let draw = ["render", "a.xyz", "--radius=0.5", "--size=80x60", "-o", "out/a.png"];
    run_between(&draw, 700_000, 1_700_000);
}
