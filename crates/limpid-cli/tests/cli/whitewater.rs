//! `whitewater`: foam, spray and bubbles as files, which other commands find, and with pictures.

use std::fs;

use super::{adapter, assert_contains, dam, fail, folder, names, render, succeed};

#[test]
fn whitewater_is_made_and_found() {
    let folder = folder();
    let at = folder.path();
    fs::create_dir(at.join("frames")).unwrap();
    for frame in [20, 21, 22] {
        fs::copy(dam(&frame.to_string()), at.join(format!("frames/dam_{frame}.bgeo"))).unwrap();
    }
    let made = succeed(at, &["whitewater", "frames", "-o", "frames", "--fps", "25"]);
    assert_contains(&made, &["dam_whitewater_{}.bgeo: ", " spray", "in the last frame"]);
    // It is beside the liquid, and not taken for it.
    let text = succeed(at, &["info", "frames", "--frames", "22"]);
    assert_contains(
        &text,
        &["3 frames, 20 to 22", "beside it: ", "  beside it ", "4732 particles"],
    );
    let json = succeed(at, &["info", "frames", "--frames", "22", "--json"]);
    assert_contains(&json, &["\"diffuse\"", "\"spray\""]);
    // Nothing is made twice.
    let again = succeed(at, &["whitewater", "frames", "-o", "frames", "--fps", "25"]);
    assert!(again.trim().ends_with("dam_whitewater_{}.bgeo"), "{again}");
    assert_contains(
        &succeed(at, &["whitewater", "frames", "-o", "w", "--format", "csv", "--amount", "0"]),
        &["nothing"],
    );
    let error = fail(at, 3, &["whitewater", "frames", "-o", "x", "--format", "xyz"]);
    assert_contains(&error, &["holds no kinds"]);
    let error = fail(at, 2, &["whitewater", "frames", "-o", "x", "--amount", "9e9"]);
    assert_contains(&error, &["0 to 1000"]);
}

/// The frames up to the one that is drawn are made beside the picture.
#[test]
fn pictures_are_drawn_with_whitewater() {
    let folder = folder();
    let at = folder.path();
    if !adapter() {
        return;
    }
    fs::create_dir(at.join("p")).unwrap();
    render(at, &[&dam("{}"), "--frames", "20", "--whitewater", "-o", "p/a.png"]);
    let expected = [".json", "_0005.bgeo", "_0020.bgeo"];
    let expected = expected.map(|end| format!("ParticleData_Fluid_whitewater{end}"));
    assert_eq!(names(&at.join("p/whitewater")), expected.into());
    let error = fail(at, 2, &["render", &dam("20"), "--whitewater", "-o", "-"]);
    assert_contains(&error, &["no place"]);
}
