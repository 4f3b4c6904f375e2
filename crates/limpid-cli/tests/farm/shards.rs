//! Shards: their union equals a single run.

use super::*;

/// The shards of 1, 2, 3 and 7 machines are disjoint and complete, and have the files of a single run; a
/// shard may be empty.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn shards_equal_a_single_run() {
    if !adapter() {
        return;
    }
    let project = Project::new(6);
    project.render(&["-o", "single/"]);
    let single = project.files("single");
    assert_eq!(single.len(), 6);
    for count in [1, 2, 3, 7] {
        let mut union = BTreeMap::new();
        let shards: Vec<_> = (1..=count)
            .map(|index| {
                let (shard, folder) = (format!("{index}/{count}"), format!("{count}_{index}/"));
                project.start(&["--shard", &shard, "-o", &folder])
            })
            .collect();
        for (index, process) in (1..=count).zip(shards) {
            assert_success(process.wait_with_output().unwrap());
            for (name, bytes) in project.files(&format!("{count}_{index}")) {
                assert!(union.insert(name, bytes).is_none(), "a frame is in two of {count} shards");
            }
        }
        assert_same(&union, &single);
    }
}

/// Pictures have numbered names even if the shard has a single frame.
#[test]
fn pictures_of_a_one_frame_shard_are_numbered() {
    if !adapter() {
        return;
    }
    let project = Project::new(2);
    project.render(&["--shard", "2/2"]);
    assert!(project.path("limpid_0002.png").exists());
    let one_name = project.limpid(&["--shard", "1/2", "-o", "one.png"]).output().unwrap();
    assert_eq!(one_name.status.code(), Some(2), "both shards would have one name");
}
