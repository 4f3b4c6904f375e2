//! Inputs as people name them: patterns that the shell has expanded or not, and the files of several ranks.

use std::fs;
use std::path::Path;

use super::{adapter, assert_contains, dam, fail, folder, names, render, succeed};

/// Copies a frame to each of these names.
fn copies(folder: &Path, files: &[&str]) {
    for name in files {
        fs::copy(dam("5"), folder.join(name)).unwrap();
    }
}

/// The files of a sequence may be named one by one, in any order, as a shell expands `w_*.bgeo`: these frames
/// are drawn, and no others. Files that do not belong together are named.
#[test]
fn expanded_patterns_are_sequences() {
    let folder = folder();
    let folder = folder.path();
    copies(folder, &["w_1.bgeo", "w_2.bgeo", "w_10.bgeo", "other_1.bgeo"]);
    let (one, ten) = ("w_1.bgeo", "w_10.bgeo");
    let scene = succeed(folder, &["scene", ten, one]);
    assert_contains(&scene, &["source = \"w_{}.bgeo\""]);
    let line = fail(folder, 4, &["scene", one, "other_1.bgeo"]);
    assert_contains(&line, &["other_1.bgeo", "does not belong to the sequence w_{}.bgeo"]);
    if adapter() {
        render(folder, &[ten, one, "-o", "out/"]);
        assert_eq!(names(&folder.join("out")).len(), 2);
    }
}

/// A `*` that no shell has expanded stands for any text: the frames of one sequence.
#[test]
fn stars_match_the_frames_of_one_sequence() {
    let folder = folder();
    let folder = folder.path();
    copies(folder, &["w_1.bgeo", "w_2.bgeo", "v_1.bgeo", "notes.txt"]);
    let info = |pattern: &str| succeed(folder, &["info", pattern]);
    assert_contains(&info("w_*.bgeo"), &["2 frames"]);
    assert_contains(&info("w*"), &["2 frames"]);
    assert_contains(&info("*v_*eo"), &["1 frame,"]);
    assert_contains(
        &fail(folder, 4, &["info", "*.bgeo"]),
        &["2 sequences match", "v_{}.bgeo, w_{}.bgeo"],
    );
    assert_contains(&fail(folder, 4, &["info", "x_*.bgeo"]), &["x_*.bgeo", "no particle file"]);
}

/// The files of several ranks are one frame each; a missing one is named.
#[test]
fn ranks_are_merged() {
    let folder = folder();
    let folder = folder.path();
    copies(
        folder,
        &["rank0_7.bgeo", "rank1_7.bgeo", "rank0_8.bgeo", "rank1_8.bgeo", "rank0_x.bgeo"],
    );
    let info = succeed(folder, &["info", "rank{r}_{}.bgeo"]);
    assert_contains(&info, &["2 frames", "7 to 8", "9464 particles"]);
    assert_contains(&succeed(folder, &["scene", "--merge=rank{r}_{}.bgeo"]), &["rank{r}_{}.bgeo"]);
    fs::remove_file(folder.join("rank1_8.bgeo")).unwrap();
    let line = fail(folder, 4, &["info", "rank{r}_{}.bgeo"]);
    assert_contains(&line, &["frame 8 lacks the file of rank 1"]);
    let line = fail(folder, 2, &["scene", "--merge=rank_{}.bgeo"]);
    assert_contains(&line, &["expected {r} for the rank"]);
    // Without a number of the frame, the files of all ranks are one.
    assert_contains(&fail(folder, 4, &["info", "rank{r}.bgeo"]), &["no file of this name"]);
    copies(folder, &["rank0.bgeo", "rank1.bgeo"]);
    assert_contains(&succeed(folder, &["info", "rank{r}.bgeo"]), &["1 frame,", "9464 particles"]);
}
