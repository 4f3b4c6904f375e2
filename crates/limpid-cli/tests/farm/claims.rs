//! Claims: sharing a folder without a server.

use super::*;

/// Two or four processes started alike at once draw each frame exactly once, to the same files as a
/// single run; they share a manifest, and leave no claims.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn claims_partition_the_frames() {
    if !adapter() {
        return;
    }
    let project = Project::new(12);
    project.render(&["-o", "single/"]);
    for count in [2, 4] {
        let (folder, manifest) = (format!("{count}/"), format!("{count}.jsonl"));
        let all: Vec<_> = (0..count)
            .map(|_| project.start(&["--claim", "-o", &folder, "--manifest", &manifest]))
            .collect();
        let ids: BTreeSet<u64> = all.iter().map(|child| child.id().into()).collect();
        for child in all {
            assert_success(child.wait_with_output().unwrap());
        }
        assert_same(&project.files(&folder), &project.files("single"));
        let lines = lines(&project.path(manifest));
        let mut drawn = BTreeMap::<i64, usize>::new();
        for line in &lines {
            assert!(ids.contains(&line["pid"].as_u64().unwrap()), "{line}");
            if text(line, "status") == DONE {
                *drawn.entry(line["frame"].as_i64().unwrap()).or_default() += 1;
            }
        }
        assert!(drawn.keys().copied().eq(1..=12) && drawn.values().all(|&n| n == 1), "{drawn:?}");
        // Each process records every frame.
        assert_eq!(lines.len(), 12 * count);
    }
}

/// Claims of dead processes are taken over and removed. A frame claimed by a live process is waited for,
/// and drawn after the claim is released.
#[test]
fn claims_of_dead_processes_are_taken_over() {
    if !adapter() {
        return;
    }
    let project = Project::new(3);
    project.render(&["-o", "single/"]);
    fs::create_dir(project.path("f")).unwrap();
    // Stale claims: one on a finished picture, and two on an unfinished one.
    let claim = |name: &str| {
        let file = File::create(project.path("f").join(name)).unwrap();
        file.set_modified(SystemTime::now() - Duration::from_hours(1)).unwrap();
    };
    fs::copy(project.path("single/frame_0001.png"), project.path("f/frame_0001.png")).unwrap();
    for name in ["frame_0001.png.claim1", "frame_0002.png.claim1", "frame_0002.png.claim2"] {
        claim(name);
    }
    let living = Claims::new("a test".into(), Duration::from_secs(60));
    let third = project.path("f/frame_0003.png");
    let held = living.take(&third).unwrap().expect("it is free");
    let mut child = project.start(&["--claim", "-o", "f/", "--manifest=m.jsonl"]);
    until("the second frame", || project.path("f/frame_0002.png").exists());
    assert!(child.try_wait().unwrap().is_none() && !third.exists(), "it does not wait");
    drop(held);
    assert_success(child.wait_with_output().unwrap());
    assert_same(&project.files("f"), &project.files("single"));
    let statuses: Vec<_> =
        lines(&project.path("m.jsonl")).iter().map(|line| text(line, "status")).collect();
    assert_eq!(statuses, [SKIPPED, DONE, DONE]);
}

/// A claim has one owner; a stale claim is taken over by exactly one of several processes, also if its
/// owner is still alive.
#[test]
fn a_claim_has_one_owner() {
    let folder = tempfile::tempdir().unwrap();
    let names = || {
        let entries = fs::read_dir(folder.path()).unwrap();
        let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
        names.collect::<BTreeSet<_>>()
    };
    let claims = |seconds| Claims::new("a test\n".into(), Duration::from_secs(seconds));
    let picture = folder.path().join("frame_0001.png");
    // Several threads claim at once, and one succeeds.
    let race = |claims: &Claims| {
        let start = Barrier::new(8);
        std::thread::scope(|scope| {
            let takers: Vec<_> = (0..8)
                .map(|_| {
                    scope.spawn(|| {
                        start.wait();
                        claims.take(&picture).unwrap()
                    })
                })
                .collect();
            takers.into_iter().filter_map(|taker| taker.join().unwrap()).collect::<Vec<_>>()
        })
    };
    for _ in 0..20 {
        let mut winners = race(&claims(60));
        assert_eq!(winners.len(), 1);
        assert_eq!(names(), ["frame_0001.png.claim1".to_owned()].into());
        assert_eq!(
            fs::read_to_string(folder.path().join("frame_0001.png.claim1")).unwrap(),
            "a test\n"
        );
        // The owner hangs, so that its claim becomes stale.
        let hanging = winners.remove(0);
        let file = File::options().write(true).open(folder.path().join("frame_0001.png.claim1"));
        file.unwrap().set_modified(SystemTime::now() - Duration::from_hours(1)).unwrap();
        let mut winners = race(&claims(60));
        assert_eq!(winners.len(), 1, "a stale claim is taken over once");
        let taken = winners.remove(0);
        // The first owner wakes up and ends: the frame still belongs to the second.
        drop(hanging);
        assert!(race(&claims(60)).is_empty());
        drop(taken);
        assert!(names().is_empty(), "{:?}", names());
    }

    // A live owner rewrites its claim every sixth of the timeout, so that it does not become stale.
    let alive = claims(1).take(&picture).unwrap().expect("it is free");
    for _ in 0..8 {
        std::thread::sleep(Duration::from_millis(200));
        assert!(claims(1).take(&picture).unwrap().is_none());
    }
    drop(alive);
    let nowhere = folder.path().join("nowhere/frame_0001.png");
    let error = claims(1).take(&nowhere).unwrap_err().to_string();
    assert!(error.contains("nowhere") && error.contains("claim"), "{error}");
}

/// A claim from the future, as after the server's clock was set back, is stale once it has not changed
/// for the timeout.
#[test]
fn claims_from_the_future_become_stale() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("frame_0001.png");
    let claims = Claims::new("a test".into(), Duration::from_secs(1));
    let claim = File::create(folder.path().join("frame_0001.png.claim1")).unwrap();
    claim.set_modified(SystemTime::now() + Duration::from_hours(48)).unwrap();
    assert!(claims.take(&picture).unwrap().is_none(), "its owner may be alive");
    std::thread::sleep(Duration::from_millis(600));
    // A live owner's claim changes.
    claim.set_modified(SystemTime::now() + Duration::from_hours(47)).unwrap();
    assert!(claims.take(&picture).unwrap().is_none());
    std::thread::sleep(Duration::from_millis(600));
    assert!(claims.take(&picture).unwrap().is_none());
    std::thread::sleep(Duration::from_millis(600));
    assert!(claims.take(&picture).unwrap().is_some(), "it is stale");
}

/// A stale claim of another user that cannot be read is taken over. The program runs as an unprivileged
/// user, since root can read it.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
#[cfg(target_os = "linux")]
fn unreadable_stale_claims_are_taken_over() {
    if !adapter() {
        return;
    }
    let project = Project::new(1);
    let Some(mut command) = project.limpid_as_nobody(&[]) else { return };
    let claim = project.path("f/frame_0001.png.claim1");
    fs::create_dir(project.path("f")).unwrap();
    fs::set_permissions(project.path("f"), Permissions::from_mode(0o777)).unwrap();
    let file = File::create(&claim).unwrap();
    file.set_modified(SystemTime::now() - Duration::from_hours(1)).unwrap();
    fs::set_permissions(&claim, Permissions::from_mode(0o600)).unwrap();
    command.args(["render", "water", "--size=48x36", "--claim", "-o", "f/"]);
    // An endless wait alone takes so long: without its own cache it compiles all shaders, on a machine that may be busy.
    let ended = command.timeout(Duration::from_mins(5)).output().unwrap();
    assert!(ended.status.success(), "{ended:?}");
    assert_eq!(project.files("f").into_keys().collect::<Vec<_>>(), ["frame_0001.png"]);
}

/// A link, a pipe or a folder with a claim's name is an error of its frame, not a silent endless wait;
/// with `--keep-going` the other frames are drawn.
#[test]
#[cfg(unix)]
fn invalid_claims_are_errors() {
    if !adapter() {
        return;
    }
    let project = Project::new(4);
    fs::create_dir(project.path("f")).unwrap();
    let claim = |frame: u32| project.path(format!("f/frame_000{frame}.png.claim1"));
    std::os::unix::fs::symlink("nowhere", claim(1)).unwrap();
    assert!(Command::new("mkfifo").arg(claim(2)).status().unwrap().success());
    fs::create_dir(claim(3)).unwrap();
    let mut command = assert_cmd::Command::from_std(project.limpid(&["--claim", "-o", "f/"]));
    let ended = command.arg("--keep-going").timeout(Duration::from_secs(60)).output().unwrap();
    let stderr = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(1), "{stderr}");
    for frame in 1..=3 {
        let expected =
            format!("limpid: frame {frame}: f/frame_000{frame}.png.claim1: cannot claim: this is");
        assert!(stderr.lines().any(|line| line.starts_with(&expected)), "{stderr}");
    }
    assert!(stderr.ends_with("3 of 4 frames failed: 1-3\n"), "{stderr}");
    assert!(project.path("f/frame_0004.png").is_file());
}

/// A process that waits reports after a time the frames, the owner and its claim.
#[test]
fn waits_are_reported() {
    if !adapter() {
        return;
    }
    let project = Project::new(1);
    fs::create_dir(project.path("f")).unwrap();
    let claims = Claims::new("somebody on a far machine\n".into(), Duration::from_secs(1));
    let held = claims.take(&project.path("f/frame_0001.png")).unwrap().expect("it is free");
    let mut child = project.start(&["--claim", "--claim-timeout=1", "-o", "f/"]);
    let mut line = String::new();
    BufReader::new(child.stderr.take().unwrap()).read_line(&mut line).unwrap();
    assert_eq!(
        line,
        "limpid: waiting for a frame of others: 1 of somebody on a far machine: f/frame_0001.png.claim1\n"
    );
    drop(held);
    assert!(child.wait().unwrap().success());
}

/// A process holds at most two claims: on the frame being drawn, and on the one being loaded.
#[test]
fn a_process_holds_at_most_two_claims() {
    if !adapter() {
        return;
    }
    let project = Project::new(6);
    let mut child = project.start(&["--samples=64", "--claim", "-o", "f/"]);
    let mut max = 0;
    while child.try_wait().unwrap().is_none() {
        let names = fs::read_dir(project.path("f")).into_iter().flatten().flatten();
        let claims = names.filter(|entry| entry.path().extension().is_some_and(|e| e == "claim1"));
        max = max.max(claims.count());
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!((1..=2).contains(&max), "{max} claims");
    assert_eq!(project.files("f").len(), 6);
}
