//! Help: examples, shell completions and manual pages.

use std::fs;

use super::{assert_contains, fail, folder, succeed};

/// Completions name every command and its options, for each shell; an unknown shell is refused.
#[test]
fn completions_name_commands_and_options() {
    let folder = folder();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = succeed(folder.path(), &["completions", shell]);
        assert_contains(&script, &["render", "scene", "turntable"]);
    }
    assert_contains(&fail(folder.path(), 2, &["completions", "tcsh"]), &["tcsh", "bash"]);
}

/// Each command has a manual page, which replaces its older version but no other file.
#[test]
fn commands_have_manual_pages() {
    let folder = folder();
    for _ in 0..2 {
        assert_eq!(succeed(folder.path(), &["man", "pages"]), "");
    }
    for (page, part) in
        [("limpid", "render"), ("limpid-render", "turntable"), ("limpid-scene", "look")]
    {
        let text = fs::read_to_string(folder.path().join(format!("pages/{page}.1"))).unwrap();
        assert_contains(&text, &[".TH", part]);
    }
    fs::write(folder.path().join("pages/limpid.1"), "my notes").unwrap();
    assert_contains(&fail(folder.path(), 2, &["man", "pages"]), &["limpid.1"]);
}

/// The help of the commands that people use first ends with examples.
#[test]
fn help_has_examples() {
    let folder = folder();
    for command in ["render", "view", "scene"] {
        let help = succeed(folder.path(), &[command, "--help"]);
        assert_contains(&help, &["Examples:", &format!("limpid {command}"), "--look"]);
    }
}

/// `--version` is one line; with `--verbose` it tells the commit that was built and the adapter.
#[test]
fn versions() {
    let folder = folder();
    let version = format!("limpid {}", env!("CARGO_PKG_VERSION"));
    for flag in ["--version", "-V"] {
        assert_eq!(succeed(folder.path(), &[flag]).trim(), version);
    }
    let verbose = succeed(folder.path(), &["--version", "--verbose"]);
    let lines: Vec<&str> = verbose.lines().collect();
    assert_eq!((lines.len(), lines[0]), (4, version.as_str()));
    let commit = lines[1].strip_prefix("commit ").expect("a commit");
    let is_commit = commit.len() == 12 && commit.chars().all(|c| c.is_ascii_hexdigit());
    assert!(is_commit || commit == "unknown", "{commit}");
    assert!(lines[2].starts_with("adapter ") && lines[3].starts_with("window "), "{verbose}");
    assert_contains(&fail(folder.path(), 2, &["--verbose"]), &["--version"]);
}
