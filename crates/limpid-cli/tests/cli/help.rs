//! Help: examples, shell completions and manual pages.

use std::fs;

use super::{SIZE, adapter, assert_contains, fail, folder, succeed};

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

/// An option that several commands have is on every command that has its subject: nobody has to remember where it is
/// refused. A new command has to be entered here.
#[test]
fn common_options_are_on_every_command() {
    const READING: [&str; 7] = ["render", "view", "scene", "web", "whitewater", "info", "convert"];
    const DRAWING: [&str; 4] = ["render", "view", "scene", "web"];
    const SEQUENCES: [&str; 5] = ["render", "view", "web", "info", "convert"];
    const OTHERS: [&str; 3] = ["bake", "completions", "man"];
    let options: [(&str, &[&str]); 17] = [
        ("--quiet", &[]),
        ("--help", &[]),
        ("--json", &["info", "compare", "check", "settings", "report"]),
        ("--max-unpacked", &READING),
        ("--map", &READING),
        ("--up", &READING[..4]),
        ("--radius", &READING[..5]),
        ("--merge", &READING[..5]),
        ("--frames", &SEQUENCES),
        ("--missing", &["render", "view", "whitewater"]),
        ("--scene", &READING[..4]),
        ("--set", &DRAWING),
        ("--look", &DRAWING),
        ("--color-by", &DRAWING),
        ("--scale", &READING[..4]),
        ("--fps", &READING[..4]),
        ("--preset", &["render", "view"]),
    ];
    let folder = folder();
    let help = succeed(folder.path(), &["--help"]);
    let (_, listed) = help.split_once("Commands:\n").expect("a list of commands");
    let commands = listed.lines().take_while(|line| !line.is_empty());
    let commands: Vec<&str> = commands.filter_map(|line| line.split_whitespace().next()).collect();
    assert!(commands.len() > 10 && READING.iter().all(|name| commands.contains(name)), "{help}");
    for command in commands.into_iter().filter(|&name| name != "help") {
        let help = succeed(folder.path(), &[command, "--help"]);
        let is_known = options.iter().any(|(_, commands)| commands.contains(&command));
        assert!(is_known || OTHERS.contains(&command), "{command}: enter it here");
        let listed = |option: &str| {
            let lines = help.lines().filter(|line| line.trim_start().starts_with('-'));
            lines.flat_map(|line| line.split([' ', ','])).any(|word| word == option)
        };
        for (option, commands) in options {
            let expected = commands.is_empty() || commands.contains(&command);
            assert!(listed(option) || !expected, "{command} lacks {option}");
        }
    }
    for args in [
        &["-q", "settings", "smooth"][..],
        &["settings", "-q", "smooth"],
        &["bake", "-q", "--help"],
    ] {
        succeed(folder.path(), args);
    }
}

/// An argument is any bytes where it names a file, and named in the error where it has to be text.
#[test]
#[cfg(unix)]
fn arguments_need_not_be_text() {
    use std::ffi::{OsStr, OsString};
    use std::os::unix::ffi::OsStrExt as _;
    let folder = folder();
    let odd = |text: &[u8]| OsStr::from_bytes(text).to_owned();
    let run = |args: &[OsString]| {
        let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_limpid"));
        let output = command.current_dir(folder.path()).args(args).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        (
            output.status.code().unwrap(),
            String::from_utf8_lossy(&output.stdout).into_owned() + &stderr,
        )
    };
    let words = |words: &[&str]| -> Vec<OsString> { words.iter().map(Into::into).collect() };
    let with = |before: &[&str], argument: &OsString, after: &[&str]| {
        [words(before), vec![argument.clone()], words(after)].concat()
    };
    let at = |name: &OsString| folder.path().join(name);
    let particles = "x,y,z\n0,0,0\n0.1,0,0\n0,0.1,0\n0.1,0.1,0.1\n";
    let (file, inside) = (odd(b"w\xff_1.csv"), odd(b"d\xfe"));
    fs::write(at(&file), particles).unwrap();
    fs::create_dir(at(&inside)).unwrap();
    let below = |name: &str| folder.path().join(&inside).join(name);
    for number in [1, 2] {
        fs::write(below(&format!("p_{number}.csv")), particles).unwrap();
    }
    fs::write(below("scene.toml"), "[particles]\nsource = \"p_{}.csv\"\n").unwrap();
    let path = |name: &str| below(name).into_os_string();
    for input in [
        file.clone(),
        inside.clone(),
        path("p_{}.csv"),
        path("p_*.csv"),
        path("scene.toml"),
        path("p_1.csv"),
    ] {
        let (code, text) = run(&with(&["info"], &input, &[]));
        assert!(code == 0 && text.contains("4 particles"), "{input:?}: {text}");
    }
    let expanded = [words(&["info"]), vec![path("p_1.csv"), path("p_2.csv")]].concat();
    assert!(run(&expanded).1.contains("2 frames"));
    let out = odd(b"o\xfd.ply");
    let (code, text) = run(&[words(&["convert"]), vec![file.clone(), out.clone()]].concat());
    assert!(code == 0 && at(&out).is_file(), "{text}");
    let numbered = [words(&["convert"]), vec![path("p_{}.csv"), path("q_##.ply")]].concat();
    assert!(run(&numbered).0 == 0 && below("q_02.ply").is_file());
    if adapter() {
        let picture = odd(b"o\xfc.png");
        let args = [
            words(&["render", "-q", SIZE, "--radius=0.05"]),
            vec![file.clone(), "-o".into(), picture.clone()],
        ]
        .concat();
        let (code, text) = run(&args);
        assert!(code == 0 && at(&picture).is_file(), "{text}");
        let (code, text) = run(&with(&["compare"], &picture, &["nowhere.png"]));
        assert!(code == 4 && text.contains("nowhere.png"), "{text}");
    }
    // Where text is needed.
    let bad = odd(b"x\xff");
    for (args, named) in [
        (with(&["render", "--set"], &bad, &[]), "--set x\u{fffd}: expected text in UTF-8"),
        (
            with(&["info"], &file, &["--frames"]).into_iter().chain([bad.clone()]).collect(),
            "--frames x\u{fffd}: ",
        ),
        (with(&["render"], &odd(b"--look=\xff"), &[]), "--look=\u{fffd}: "),
        (with(&["settings"], &bad, &[]), "x\u{fffd}: expected text in UTF-8"),
        (with(&["info"], &odd(b"w\xff_{}.csv"), &[]), "names of a sequence are text"),
        (with(&["scene"], &file, &[]), "INPUT w\u{fffd}_1.csv: expected text"),
    ] {
        let (code, text) = run(&args);
        assert!((code == 2 || code == 4) && text.contains(named), "{args:?}: {text}");
        assert_eq!(text.lines().count(), 1, "{text}");
    }
}

/// The help of the commands that people use first ends with examples.
#[test]
fn help_has_examples() {
    let folder = folder();
    for command in ["render", "view", "scene", "web"] {
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
