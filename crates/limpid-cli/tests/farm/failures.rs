//! Failed frames, manifests, and films.

use super::*;

/// With `--keep-going` a damaged file fails one frame: it is reported with its number, the others are
/// drawn, and the exit code is 1. Without it the run ends with the error's own code.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn keep_going_draws_the_others() {
    if !adapter() {
        return;
    }
    let project = Project::new(4);
    fs::write(project.water(2), "0.1 0.2\nnonsense\n").unwrap();
    let render = |more: &[&str]| {
        let ended = project.limpid(more).output().unwrap();
        (ended.status.code().unwrap(), String::from_utf8(ended.stderr).unwrap())
    };
    let (code, stderr) = render(&["-o", "f/", "--keep-going", "--manifest=m.jsonl"]);
    let messages: Vec<&str> = stderr.lines().collect();
    assert_eq!(code, 1, "{messages:?}");
    let [error, summary] = messages[..] else { panic!("{messages:?}") };
    assert!(error.starts_with("limpid: frame 2: water/block_2.xyz: line 1"), "{error}");
    assert_eq!(summary, "limpid: 1 of 4 frames failed: 2");
    let names: Vec<_> = project.files("f").into_keys().collect();
    assert_eq!(names, ["frame_0001.png", "frame_0003.png", "frame_0004.png"]);
    let lines = lines(&project.path("m.jsonl"));
    let failed = lines.iter().find(|line| text(line, "status") == "failed").expect("a failure");
    assert_eq!((failed["frame"].as_i64(), failed["code"].as_i64()), (Some(2), Some(4)));
    assert_eq!(format!("limpid: {}", text(failed, "error")), error);

    let (code, stderr) = render(&["-o", "g/", "--manifest=n.jsonl"]);
    assert_eq!(code, 4, "{stderr}");
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    assert!(stderr.starts_with(error) && stderr.contains("--missing hold"), "{stderr}");
    assert_eq!(project.files("g").into_keys().collect::<Vec<_>>(), ["frame_0001.png"]);
    // After a repair, a resumed run draws the missing frame.
    project.write_water(2, 0.06);
    let (code, stderr) = render(&["-o", "f/", "--keep-going", "--skip-existing"]);
    assert_eq!((code, stderr.as_str()), (0, ""));
    assert_eq!(project.files("f").len(), 4);
}

/// Three processes append complete lines with all documented fields to one manifest, also after a line
/// that a full disk has truncated.
#[test]
fn a_manifest_may_be_shared() {
    if !adapter() {
        return;
    }
    let project = Project::new(6);
    let manifest = project.path("m.jsonl");
    File::create(&manifest).unwrap().write_all(b"{\"frame\":7,\"sta").unwrap();
    let shares = ["1/3", "2/3", "3/3"]
        .map(|shard| project.start(&["--shard", shard, "-o", "f/", "--manifest=m.jsonl"]));
    for share in shares {
        assert_success(share.wait_with_output().unwrap());
    }
    let contents = fs::read_to_string(&manifest).unwrap();
    let (truncated, rest) = contents.split_once('\n').unwrap();
    assert_eq!(truncated, "{\"frame\":7,\"sta");
    fs::write(&manifest, rest).unwrap();
    let lines = lines(&manifest);
    assert_eq!(lines.len(), 6);
    let mut frames = BTreeSet::new();
    for line in lines {
        frames.insert(line["frame"].as_i64().unwrap());
        assert_eq!(text(&line, "status"), DONE);
        let picture = image::open(project.path(text(&line, "file"))).unwrap().into_rgb8();
        let mut crc = flate2::Crc::new();
        crc.update(&picture);
        assert_eq!(text(&line, "pixels"), format!("{:08x}", crc.sum()));
        assert_eq!(text(&line, "fingerprint").len(), 32);
        assert_eq!(line["particles"].as_u64(), Some(192));
        assert!(line["ms"].as_f64().unwrap() > 0.0);
        assert!(!text(&line, "adapter").is_empty() && !text(&line, "host").is_empty());
        assert!(line["pid"].as_u64().is_some());
    }
    assert!(frames.into_iter().eq(1..=6));
}

/// Options for separate pictures are refused for a film before anything is drawn.
#[test]
fn films_cannot_be_shared() {
    let project = Project::new(2);
    for option in ["--claim", "--skip-existing", "--manifest=m.jsonl"] {
        let ended = project.limpid(&["-o", "film.apng", option]).output().unwrap();
        let stderr = String::from_utf8(ended.stderr).unwrap();
        assert_eq!(ended.status.code(), Some(2), "{stderr}");
        let name = option.split('=').next().unwrap();
        assert!(stderr.contains("film.apng") && stderr.contains(name), "{stderr}");
    }
    assert!(!project.path("film.apng").exists() && !project.path("m.jsonl").exists());
}

/// If messages cannot be written, as with stderr on a full disk, the other frames are still drawn, and
/// the exit code is unchanged.
#[test]
#[cfg(target_os = "linux")]
fn unwritable_messages_do_not_end_the_run() {
    if !adapter() {
        return;
    }
    let full = || File::options().write(true).open("/dev/full").unwrap();
    let project = Project::new(5);
    fs::write(project.water(2), "0.1 0.2\nnonsense\n").unwrap();
    let mut command = project.limpid(&["-o", "f/", "--keep-going"]);
    assert_eq!(command.stderr(full()).status().unwrap().code(), Some(1));
    assert_eq!(project.files("f").len(), 4);
    let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
    assert_eq!(command.args(["info", "nosuch"]).stderr(full()).status().unwrap().code(), Some(4));
    // Results that cannot be written are an error.
    let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
    let ended = command.arg("info").arg(project.water(1)).stdout(full()).output().unwrap();
    let stderr = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(4), "{stderr}");
    assert!(stderr.starts_with("limpid: standard output: cannot write: "), "{stderr}");
}
