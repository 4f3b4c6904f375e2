//! Shards: their union is a single run.

use super::*;

/// The shares of 1, 2, 3 and 7 machines are disjoint, complete, and the same files as one
/// machine's; a share may be empty.
#[test]
fn shards_are_a_single_run() {
    if !adapter() {
        return;
    }
    let project = Project::new(6);
    project.render(&["-o", "single/"]);
    let single = project.files("single");
    assert_eq!(single.len(), 6);
    for count in [1, 2, 3, 7] {
        let mut union = BTreeMap::new();
        let shares: Vec<_> = (1..=count)
            .map(|index| {
                let (shard, folder) = (format!("{index}/{count}"), format!("{count}_{index}/"));
                project.start(&["--shard", &shard, "-o", &folder])
            })
            .collect();
        for (index, share) in (1..=count).zip(shares) {
            assert_success(share.wait_with_output().unwrap());
            for (name, bytes) in project.files(&format!("{count}_{index}")) {
                assert!(union.insert(name, bytes).is_none(), "a frame is in two of {count} shares");
            }
        }
        assert_same(&union, &single);
    }
}

/// Numbered names do not depend on how many of the frames are this share's.
#[test]
fn a_share_of_one_frame_has_its_number() {
    if !adapter() {
        return;
    }
    let project = Project::new(2);
    project.render(&["--shard", "2/2"]);
    assert!(project.path("limpid_0002.png").exists());
    let one_name = project.limpid(&["--shard", "1/2", "-o", "one.png"]).output().unwrap();
    assert_eq!(one_name.status.code(), Some(2), "both shares would have one name");
}
