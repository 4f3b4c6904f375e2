//! A shared folder without a server.

use super::*;

/// Two and four processes that are started alike, at once, draw each frame once between them, to the
/// same files as a single run; they share a manifest, and leave no claim.
#[test]
fn claims_share_out_the_frames() {
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
        // Each process says what became of each frame.
        assert_eq!(lines.len(), 12 * count);
    }
}

/// The claim of a dead process is taken over; what it has left is gone in the end. The frame of one
/// that lives is waited for, and drawn by whoever is left if that process gives it up.
#[test]
fn claims_of_the_dead_are_taken_over() {
    if !adapter() {
        return;
    }
    let project = Project::new(3);
    project.render(&["-o", "single/"]);
    fs::create_dir(project.path("f")).unwrap();
    // Claimed by dead processes: before its picture, after it, and twice.
    let claim = |name: &str| {
        let file = File::create(project.path("f").join(name)).unwrap();
        file.set_modified(SystemTime::now() - Duration::from_hours(1)).unwrap();
    };
    fs::copy(project.path("single/frame_0001.png"), project.path("f/frame_0001.png")).unwrap();
    for name in ["frame_0001.png.claim1", "frame_0002.png.claim1", "frame_0002.png.claim2"] {
        claim(name);
    }
    let living = Claims { owner: "a test".into(), timeout: Duration::from_secs(60) };
    let third = project.path("f/frame_0003.png");
    let held = living.take(&third).unwrap().expect("nobody has it");
    let mut child = project.start(&["--claim", "-o", "f/", "--manifest=m.jsonl"]);
    until("the second frame", || project.path("f/frame_0002.png").exists());
    assert!(child.try_wait().unwrap().is_none() && !third.exists(), "it waits");
    drop(held);
    assert_success(child.wait_with_output().unwrap());
    assert_same(&project.files("f"), &project.files("single"));
    let statuses: Vec<_> =
        lines(&project.path("m.jsonl")).iter().map(|line| text(line, "status")).collect();
    assert_eq!(statuses, [SKIPPED, DONE, DONE]);
}

/// A claim is one process's; a stale one is taken over by one of all that try, while its owner may
/// only seem to be dead.
#[test]
fn a_claim_is_one_owners() {
    let folder = tempfile::tempdir().unwrap();
    let names = || {
        let entries = fs::read_dir(folder.path()).unwrap();
        let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
        names.collect::<BTreeSet<_>>()
    };
    let claims =
        |seconds| Claims { owner: "a test\n".into(), timeout: Duration::from_secs(seconds) };
    let picture = folder.path().join("frame_0001.png");
    // At once, by many: one has it.
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
        // It hangs, and others take it for dead.
        let hanging = winners.remove(0);
        let file = File::options().write(true).open(folder.path().join("frame_0001.png.claim1"));
        file.unwrap().set_modified(SystemTime::now() - Duration::from_hours(1)).unwrap();
        let mut winners = race(&claims(60));
        assert_eq!(winners.len(), 1, "a stale claim is taken over once");
        let taken = winners.remove(0);
        // It wakes up, and ends: the frame is still the other's.
        drop(hanging);
        assert!(race(&claims(60)).is_empty());
        drop(taken);
        assert!(names().is_empty(), "{:?}", names());
    }

    // While its owner lives, it does not age; the heart beats every sixth of the time.
    let alive = claims(1).take(&picture).unwrap().expect("nobody has it");
    for _ in 0..8 {
        std::thread::sleep(Duration::from_millis(200));
        assert!(claims(1).take(&picture).unwrap().is_none());
    }
    drop(alive);
    let nowhere = folder.path().join("nowhere/frame_0001.png");
    let error = claims(1).take(&nowhere).unwrap_err().to_string();
    assert!(error.contains("nowhere") && error.contains("claim"), "{error}");
}
