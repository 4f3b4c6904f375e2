//! Limits on threads and stack size.

use super::*;

/// With a limit on the number of threads, a run succeeds or ends with one line and code 6, which farms
/// retry, without a panic or a deadlock in the driver.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
#[cfg(target_os = "linux")]
fn too_few_threads_are_an_error() {
    if !adapter() {
        return;
    }
    let project = Project::new(1);
    fs::create_dir(project.path("f")).unwrap();
    fs::set_permissions(project.path("f"), Permissions::from_mode(0o777)).unwrap();
    let mut codes = BTreeSet::new();
    for limit in [1, 3, 6, 8, 10, 40] {
        let limit = format!("--nproc={limit}");
        let Some(mut command) = project.limpid_as_nobody(&["prlimit", &limit]) else { return };
        command.args(["render", "water", "--size=48x36", "-o", "f/"]).env("RAYON_NUM_THREADS", "4");
        let ended = command.timeout(Duration::from_secs(60)).output().unwrap();
        let stderr = String::from_utf8_lossy(&ended.stderr);
        let code = ended.status.code();
        assert!(matches!(code, Some(0 | 6)), "{limit}: {code:?}: {stderr}");
        let refused = stderr.lines().count() == 1 && stderr.contains("another thread");
        assert!(code == Some(0) || refused, "{limit}: {stderr}");
        codes.extend(code);
    }
    assert_eq!(codes, [0, 6].into(), "the limits cover success and failure");
}

/// The program runs on a thread of its own, not on the first thread with its limited stack.
#[test]
#[cfg(target_os = "linux")]
fn a_small_stack_limit_is_sufficient() {
    let project = Project::new(1);
    let mut command = Command::new("prlimit");
    command.args(["--stack=32768", env!("CARGO_BIN_EXE_limpid"), "info"]).arg(project.water(1));
    let ended = command.output().unwrap();
    assert!(ended.status.success(), "{ended:?}");
}
