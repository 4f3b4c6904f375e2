//! Handling of SIGINT, SIGTERM, SIGHUP, SIGQUIT and SIGABRT.

use super::*;

/// After the first signal the current frame is finished, the other claims are released, and the exit
/// code is the signal's; the existing pictures are complete, and the next run draws the others.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
#[cfg(unix)]
fn the_first_signal_finishes_the_current_frame() {
    if !adapter() {
        return;
    }
    let project = Project::new(10);
    let big = ["--size=200x150", "--samples=16"];
    let render = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
        command.args(["render", "water", "--quiet"]).args(big).args(more);
        command.current_dir(project.0.path()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    assert_success(render(&["-o", "single/"]).output().unwrap());
    let single = project.files("single");
    for (name, code, folder) in [("INT", 130, "int"), ("TERM", 143, "term"), ("HUP", 129, "hup")] {
        let output = format!("{folder}/");
        let child = render(&["--claim", "-o", &output]).spawn().unwrap();
        until("a frame", || project.path(folder).join("frame_0002.png").exists());
        signal(&child, name);
        let ended = child.wait_with_output().unwrap();
        let left = project.files(folder);
        // A fast machine may have drawn all frames.
        let code = if left.len() == single.len() { 0 } else { code };
        assert_eq!(ended.status.code(), Some(code));
        assert!(ended.stderr.is_empty(), "{}", String::from_utf8_lossy(&ended.stderr));
        for (name, bytes) in &left {
            assert!(single.get(name) == Some(bytes), "{name}");
        }
        assert_success(render(&["--claim", "-o", &output]).output().unwrap());
        assert_same(&project.files(folder), &single);
    }
}

/// The second signal ends the process at once, without temporary files and claims.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
#[cfg(unix)]
fn the_second_signal_leaves_no_files() {
    if !adapter() {
        return;
    }
    let project = Project::new(2);
    // Frames that take far longer than this test, except on a very fast machine.
    let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
    command.args(["render", "water", "--size=1600x1200", "--samples=64", "--claim", "-o", "f/"]);
    command.current_dir(project.0.path()).stderr(Stdio::piped());
    let child = command.spawn().unwrap();
    // The second frame is claimed once the first is being drawn.
    until("another claim", || {
        let names = ["f/frame_0002.png.claim1", "f/frame_0002.png"];
        names.iter().any(|name| project.path(name).exists())
    });
    signal(&child, "TERM");
    std::thread::sleep(Duration::from_millis(300));
    signal(&child, "TERM");
    let ended = child.wait_with_output().unwrap();
    let left: Vec<String> = project.files("f").into_keys().collect();
    let code = if left.len() == 2 { 0 } else { 143 };
    assert_eq!(ended.status.code(), Some(code), "{}", String::from_utf8_lossy(&ended.stderr));
    assert!(
        left.iter().all(|name| name.starts_with("frame_") && name.ends_with(".png")),
        "{left:?}"
    );
}

/// SIGQUIT ends the process at once by its default action, but without temporary files and claims.
#[test]
#[cfg(unix)]
fn sigquit_leaves_no_files() {
    if !adapter() {
        return;
    }
    // Without a core dump.
    let ended = ended_by("QUIT", "ulimit -c 0");
    assert_eq!(std::os::unix::process::ExitStatusExt::signal(&ended), Some(3), "{ended}");
}

/// Libraries abort if an allocation fails: under a memory limit that is a retryable error, and leaves no files either.
#[test]
#[cfg(unix)]
fn aborts_under_a_memory_limit_leave_no_files() {
    if !adapter() {
        return;
    }
    let ended = ended_by("ABRT", "ulimit -v 16000000");
    assert_eq!(ended.code(), Some(6), "{ended}");
}

/// Sends a signal to a run, under a limit, that has claimed a frame. It must leave nothing.
#[cfg(unix)]
fn ended_by(name: &str, limit: &str) -> std::process::ExitStatus {
    let project = Project::new(2);
    let mut command = Command::new("sh");
    let shell = format!("{limit}; exec \"$0\" \"$@\"");
    command.args(["-c", &shell, env!("CARGO_BIN_EXE_limpid"), "render"]);
    command.args(["water", "--size=1600x1200", "--samples=64", "--claim", "-o", "f/"]);
    let mut child = command.current_dir(project.0.path()).spawn().unwrap();
    until("a claim", || project.path("f/frame_0001.png.claim1").exists());
    signal(&child, name);
    let ended = child.wait().unwrap();
    assert!(project.files("f").is_empty(), "{:?}", project.files("f").keys());
    ended
}

/// A run started by `nohup` continues when its terminal is closed.
#[test]
#[cfg(target_os = "linux")]
fn ignored_hangups_stay_ignored() {
    if !adapter() {
        return;
    }
    let project = Project::new(4);
    let mut command = Command::new("nohup");
    command.args([env!("CARGO_BIN_EXE_limpid"), "render", "water", "--size=48x36", "-o", "f/"]);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.current_dir(project.0.path()).spawn().unwrap();
    until("a frame", || project.path("f/frame_0001.png").exists());
    signal(&child, "HUP");
    assert!(child.wait().unwrap().success());
    assert_eq!(project.files("f").len(), 4);
}

/// An interrupted `limpid check` leaves no simulated frames in the temporary folder.
#[test]
#[cfg(unix)]
fn an_interrupted_check_leaves_no_simulation() {
    if !adapter() {
        return;
    }
    let project = Project::new(0);
    let scene =
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("sims/dam_break.toml");
    let suite = format!(
        "[[frame]]\nname = \"dam\"\ninput = {:?}\nexpected = \"dam.png\"\nbake = {{ seconds = 20.0 }}\n",
        scene.display().to_string()
    );
    fs::write(project.path("suite.toml"), suite).unwrap();
    for (name, temporary) in [("TERM", "a"), ("HUP", "b"), ("QUIT", "c")] {
        let temporary = project.path(temporary);
        fs::create_dir(&temporary).unwrap();
        let mut command = Command::new("sh");
        command.args(["-c", "ulimit -c 0; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_limpid")]);
        command.args(["check", "suite.toml"]).env("TMPDIR", &temporary);
        let mut child = command.current_dir(project.0.path()).spawn().unwrap();
        let baked = || {
            fs::read_dir(&temporary)
                .unwrap()
                .flatten()
                .any(|folder| folder.path().join("baked/baked").is_dir())
        };
        until("a simulation", baked);
        std::thread::sleep(Duration::from_millis(100));
        signal(&child, name);
        assert!(!child.wait().unwrap().success());
        let left: Vec<_> = fs::read_dir(&temporary).unwrap().flatten().collect();
        assert!(left.is_empty(), "SIG{name} leaves {left:?}");
    }
}
