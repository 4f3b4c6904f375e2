//! Runs the program on each case of the list in `cases.rs` and checks its outcome.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use limpid::gpu::Gpu;
use rayon::prelude::*;

use super::cases::{self, Case, Way};

/// Splits a command line into words; quoted words may contain blanks.
fn words(line: &str) -> Vec<String> {
    line.split('"').enumerate().fold(Vec::new(), |mut words, (k, part)| {
        if k % 2 == 1 {
            words.push(part.to_owned());
        } else {
            words.extend(part.split(' ').filter(|word| !word.is_empty()).map(str::to_owned));
        }
        words
    })
}

/// Whether `text` matches `pattern`, where `…` matches any text.
fn matches(pattern: &str, text: &str) -> bool {
    let parts: Vec<&str> = pattern.split('…').collect();
    let (first, last) = (parts[0], parts[parts.len() - 1]);
    if parts.len() == 1 {
        return text == pattern;
    }
    let Some(mut rest) = text.strip_prefix(first).and_then(|rest| rest.strip_suffix(last)) else {
        return false;
    };
    parts[1..parts.len() - 1].iter().all(|part| match rest.split_once(part) {
        Some((_, after)) => {
            rest = after;
            true
        }
        None => false,
    })
}

/// Whether a command succeeds on this machine.
fn succeeds(program: &str, arguments: &[&str]) -> bool {
    Command::new(program).args(arguments).output().is_ok_and(|output| output.status.success())
}

/// Runs a case.
///
/// # Errors
/// A description of its outcome, if that is not the expected one.
fn run(case: &Case, limpid: &Path) -> Result<(), String> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).expect("it is ours");
    let out = folder.path().join("out");
    fs::create_dir(&out).expect("a folder");
    (case.prepare)(folder.path());
    // A full disk is a file system that is mounted for the process alone.
    let shell = match case.way {
        Way::Small => "ulimit -v 3145728; exec \"$0\" \"$@\"",
        Way::Drawing => "exec \"$0\" \"$@\"",
        Way::Nobody => "exec setpriv --reuid 65534 --regid 65534 --clear-groups \"$0\" \"$@\"",
        Way::Short => "ulimit -f 8; exec \"$0\" \"$@\"",
        Way::Full | Way::FullDrawing => {
            "mount -t tmpfs -o size=4k none out || exit 99; \"$0\" \"$@\"; code=$?; \
             ls -A out | grep -v bake.json >&2; exit $code"
        }
    };
    let mut command = match case.way {
        Way::Full | Way::FullDrawing => {
            let mut command = assert_cmd::Command::new("unshare");
            command.args(["--mount", "sh"]);
            command
        }
        _ => assert_cmd::Command::new("sh"),
    };
    command.args(["-c", shell]).arg(limpid).args(words(case.arguments));
    // The list has errors only.
    if case.arguments.starts_with("render") {
        command.arg("--quiet");
    }
    command.env("NODEVICE_SELECT", "1").env("RAYON_NUM_THREADS", "2");
    let output = command.current_dir(folder.path()).timeout(Duration::from_secs(120)).output();
    let output = output.map_err(|error| format!("it does not end: {error}"))?;
    let stderr = String::from_utf8_lossy(&output.stderr);
    let message = stderr.strip_prefix("limpid: ").unwrap_or(&stderr);
    let message = message.strip_suffix('\n').unwrap_or(message);
    let code = output.status.code();
    if code != Some(case.code) || !matches(case.message, message) || message.contains('\n') {
        return Err(format!("{code:?}: {message}"));
    }
    let left: Vec<_> =
        fs::read_dir(&out).expect("a folder").map(|e| e.unwrap().file_name()).collect();
    let left: Vec<_> = left.iter().map(|name| name.to_string_lossy()).collect();
    let expected = |name: &str| name.ends_with("bake.json") || case.code == 0 && name == "a.png";
    match left.iter().find(|name| !expected(name)) {
        Some(name) => Err(format!("{name} is left")),
        None => Ok(()),
    }
}

/// Each case has the listed exit code and message.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn every_case_has_its_listed_outcome() {
    let limpid = Path::new(env!("CARGO_BIN_EXE_limpid"));
    let adapter = Gpu::headless().is_ok();
    let quoted = limpid.to_string_lossy();
    let drop_privileges =
        ["--reuid", "65534", "--regid", "65534", "--clear-groups", &quoted, "--version"];
    let nobody = succeeds("setpriv", &drop_privileges);
    let mount = succeeds("unshare", &["--mount", "true"]);
    let possible = |case: &&Case| match case.way {
        Way::Small | Way::Short => true,
        Way::Drawing => adapter,
        Way::Nobody => nobody,
        Way::Full => mount,
        Way::FullDrawing => mount && adapter,
    };
    let skipped = cases::all().filter(|case| !possible(case)).count();
    eprintln!("{skipped} of {} cases are not possible here", cases::all().count());
    let cases: Vec<_> = cases::all().filter(possible).collect();
    let wrong: Vec<String> = cases
        .par_iter()
        .filter_map(|case| Some(format!("{}: {}", case.what, run(case, limpid).err()?)))
        .collect();
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
}

/// Patterns match only what they should.
#[test]
fn patterns() {
    for (pattern, text, expected) in [
        ("a", "a", true),
        ("a", "ab", false),
        ("a…", "abc", true),
        ("…c", "abc", true),
        ("a…d", "abc", false),
        ("a…b…c", "axbyc", true),
        ("a…b…c", "axyc", false),
    ] {
        assert_eq!(matches(pattern, text), expected, "{pattern} {text}");
    }
}
