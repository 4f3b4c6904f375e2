//! Too few threads, and too little stack.

use super::*;

/// A user who may start only so many threads gets a picture, or one line and code 6, which farms
/// repeat: no panic, and no waiting for a driver that waits for its threads.
#[test]
#[cfg(target_os = "linux")]
fn too_few_threads_are_an_error() {
    if !adapter() {
        return;
    }
    let project = Project::new(1);
    fs::create_dir(project.path("f")).unwrap();
    fs::set_permissions(project.path("f"), Permissions::from_mode(0o777)).unwrap();
    let mut codes = BTreeSet::new();
    for most in [1, 3, 6, 8, 10, 40] {
        let most = format!("--nproc={most}");
        let Some(mut command) = project.limpid_as_nobody(&["prlimit", &most]) else { return };
        command.args(["render", "water", "--size=48x36", "-o", "f/"]).env("RAYON_NUM_THREADS", "4");
        let ended = command.timeout(Duration::from_secs(60)).output().unwrap();
        let told = String::from_utf8_lossy(&ended.stderr);
        let code = ended.status.code();
        assert!(matches!(code, Some(0 | 6)), "{most}: {code:?}: {told}");
        let refused = told.lines().count() == 1 && told.contains("no more threads");
        assert!(code == Some(0) || refused, "{most}: {told}");
        codes.extend(code);
    }
    assert_eq!(codes, [0, 6].into(), "neither too few nor enough");
}

/// The first thread's stack, which the system limits, is not the one that anything runs on.
#[test]
#[cfg(target_os = "linux")]
fn a_small_stack_does() {
    let project = Project::new(1);
    let mut command = Command::new("prlimit");
    command.args(["--stack=32768", env!("CARGO_BIN_EXE_limpid"), "info"]).arg(project.water(1));
    let ended = command.output().unwrap();
    assert!(ended.status.success(), "{ended:?}");
}
