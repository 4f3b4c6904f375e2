//! Killed runs: completion by a restart, and their temporary files.

use super::*;

/// A run killed by SIGKILL at any time leaves only complete pictures, and a restart completes the
/// sequence bit-identically. Repeated ten times, or `LIMPID_KILLS` times.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn killed_at_any_time_and_restarted() {
    if !adapter() {
        return;
    }
    let kills = std::env::var("LIMPID_KILLS").map_or(10, |text| text.parse().expect("a number"));
    let project = Project::new(8);
    let aovs = "--aov=depth,inside";
    let start = Instant::now();
    project.render(&[aovs, "-o", "single/"]);
    let whole_run = start.elapsed();
    let single = project.files("single");
    assert_eq!(single.len(), 16);
    // Pseudorandom times of the kills; `LIMPID_SEED` selects others.
    let seed = std::env::var("LIMPID_SEED").map_or(1, |text| text.parse().expect("a number"));
    let mut noise: u64 = seed;
    let mut unfinished = 0;
    for kill in 0..kills {
        noise = noise.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let folder = format!("killed_{kill}");
        let mut args = vec![aovs, "--skip-existing", "-o"];
        let output = format!("{folder}/");
        args.push(&output);
        let mut child = project.start(&args);
        std::thread::sleep(whole_run.mul_f64((noise >> 11) as f64 / (1_u64 << 53) as f64));
        child.kill().unwrap();
        child.wait().unwrap();
        let mut left = project.files(&folder);
        left.retain(|name, _| !name.starts_with(".limpid-"));
        unfinished += usize::from(left.len() < single.len());
        for (name, bytes) in &left {
            assert!(bytes == &single[name], "{name} is incomplete");
        }

        project.render(&args);
        let mut whole = project.files(&folder);
        whole.retain(|name, _| !name.starts_with(".limpid-"));
        assert_same(&whole, &single);
        fs::remove_dir_all(project.path(&folder)).unwrap();
    }
    println!("{kills} kills (seed {seed}), {unfinished} of them before the end");
    assert!(unfinished > 0, "the kills came too late");
}

/// Old temporary files of killed runs are removed; recent ones, which may belong to another run, are
/// not.
#[test]
fn old_temporary_files_are_removed() {
    if !adapter() {
        return;
    }
    let project = Project::new(1);
    // Beside a picture and beside a film.
    for output in ["a.png", "a.gif"] {
        for (name, hours) in [(".limpid-old", 25), (".limpid-recent", 1), (".other-old", 25)] {
            let file = File::create(project.path(name)).unwrap();
            file.set_modified(SystemTime::now() - Duration::from_hours(hours)).unwrap();
        }
        project.render(&["-o", output]);
        assert!(!project.path(".limpid-old").exists());
        assert!(project.path(".limpid-recent").exists() && project.path(".other-old").exists());
    }
}

/// A machine whose clock is two days ahead removes no recent temporary files, since ages are measured by
/// the file system's clock. Skipped without `faketime`, unless `LIMPID_REQUIRE_FAKETIME=1` is set.
#[test]
#[cfg(target_os = "linux")]
fn a_fast_clock_removes_no_recent_files() {
    let required = std::env::var("LIMPID_REQUIRE_FAKETIME").is_ok_and(|value| value == "1");
    let installed = Command::new("faketime").arg("--version").output().is_ok();
    if !adapter() || !(installed || required) {
        eprintln!("skipped: no faketime here");
        return;
    }
    let project = Project::new(1);
    File::create(project.path(".limpid-recent")).unwrap();
    let mut command = Command::new("faketime");
    command.args(["+2 days", env!("CARGO_BIN_EXE_limpid"), "render", "water", "--size=48x36"]);
    // Only the program's clock is changed, not the file times.
    command.args(["--quiet", "-o", "a.png"]).env("NO_FAKE_STAT", "1").current_dir(project.0.path());
    assert_success(command.output().unwrap());
    assert!(project.path(".limpid-recent").exists());
}
