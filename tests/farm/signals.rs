//! SIGINT and SIGTERM.

use super::*;

/// The first signal finishes the frame in hand, gives the others up and says by the exit code that
/// not all is done; what is there is whole, and the next run completes it.
#[test]
#[cfg(unix)]
fn signals_finish_the_frame_in_hand() {
    if !adapter() {
        return;
    }
    let project = Project::new(10);
    let big = ["--size=200x150", "--samples=16"];
    let render = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
        command.args(["render", "water"]).args(big).args(more);
        command.current_dir(project.0.path()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    assert_success(render(&["-o", "single/"]).output().unwrap());
    let single = project.files("single");
    for (name, code, folder) in [("INT", 130, "int"), ("TERM", 143, "term")] {
        let output = format!("{folder}/");
        let child = render(&["--claim", "-o", &output]).spawn().unwrap();
        until("a frame", || project.path(folder).join("frame_0002.png").exists());
        signal(&child, name);
        let ended = child.wait_with_output().unwrap();
        let left = project.files(folder);
        // A machine may be so fast that nothing is left to give up.
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

/// The second signal ends it at once: no temporary file and no claim is left.
#[test]
#[cfg(unix)]
fn the_second_signal_leaves_nothing_behind() {
    if !adapter() {
        return;
    }
    let project = Project::new(2);
    // Frames that take far longer than this test, where the machine is not too fast.
    let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
    command.args(["render", "water", "--size=1600x1200", "--samples=64", "--claim", "-o", "f/"]);
    command.current_dir(project.0.path()).stderr(Stdio::piped());
    let child = command.spawn().unwrap();
    // Until it draws: the second frame is claimed then.
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
