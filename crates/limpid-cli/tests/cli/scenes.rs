//! Automatic scenes: the options that change them, and `limpid scene`, which writes them.

use std::fs;

use tempfile::TempDir;

use super::{adapter, assert_contains, dam, fail, folder, open, render, succeed};

/// A folder with a frame of a dam break.
fn with_dam() -> TempDir {
    let folder = folder();
    fs::copy(dam("5"), folder.path().join("dam.bgeo")).unwrap();
    folder
}

/// `limpid scene` writes a scene that draws the same picture as the file without one, bit by bit, for each
/// look, in which each value has a comment; and the options do the same to both.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn written_scenes_draw_the_same_picture() {
    if !adapter() {
        return;
    }
    let folder = with_dam();
    let folder = folder.path();
    let at = |name: &str| folder.join(name);
    for changes in [
        &["--look=studio"][..],
        &["--look=night", "--sun=40,50", "--tint=0.4,0.8,0.7", "--ior=1.4"],
        &["--look=chart"],
        &["--look=pool", "--floor=-1", "--scale=0.001", "--up=z"],
    ] {
        let text = succeed(folder, &[&["scene", "dam.bgeo"][..], changes].concat());
        assert_contains(&text, &["# A scene of limpid", "[camera]", " # 1/m for red"]);
        fs::write(at("written.toml"), &text).unwrap();
        render(folder, &["written.toml", "-o", "written.png"]);
        render(folder, &[&["dam.bgeo", "-o", "bare.png"][..], changes].concat());
        assert_eq!(open(&at("written.png")), open(&at("bare.png")), "{changes:?}\n{text}");
    }
    // The look changes the picture.
    render(folder, &["dam.bgeo", "-o", "studio.png"]);
    render(folder, &["dam.bgeo", "-o", "night.png", "--look=night"]);
    assert_ne!(open(&at("studio.png")), open(&at("night.png")));
}

/// A scene grows from the automatic one: sections that it lacks are automatic, and one with an environment is
/// complete. Particles may be named on the command line alone.
#[test]
fn scenes_grow_from_the_automatic_one() {
    let folder = with_dam();
    let folder = folder.path();
    let scene = |text: &str, arguments: &[&str]| {
        fs::write(folder.join("a.toml"), text).unwrap();
        let arguments = [&["scene"][..], arguments].concat();
        succeed(folder, &arguments).parse::<toml::Table>().expect("TOML")
    };
    let bare = scene("", &["dam.bgeo"]);
    let file = "[particles]\nsource = \"dam.bgeo\"\n";
    // The particles alone.
    assert_eq!(scene(file, &["a.toml"])["environment"], bare["environment"]);
    let particles = "[particles]\nfps = 24.0\n";
    let named = scene(particles, &["dam.bgeo", "--scene=a.toml"]);
    assert_eq!(named["camera"], bare["camera"]);
    assert_eq!(named["particles"]["fps"].as_float(), Some(24.0));
    // Its own liquid and light.
    let own = format!("{file}[liquid]\nabsorption = [0.0, 0.0, 0.0]\n[[light]]\n");
    let own = own + "sun = { direction = [0.0, -1.0, 0.0], irradiance = [1.0, 1.0, 1.0] }\n";
    let grown = scene(&own, &["a.toml"]);
    assert_eq!((&grown["environment"], &grown["solid"]), (&bare["environment"], &bare["solid"]));
    assert_ne!(grown["light"], bare["light"]);
    assert_ne!(grown["liquid"], bare["liquid"]);
    // Complete.
    let complete =
        scene(&format!("{file}[environment]\nradiance = [1.0, 1.0, 1.0]\n"), &["a.toml"]);
    assert!(complete.get("solid").is_none() && complete.get("light").is_none(), "{complete}");
    // With a look, an environment is the only part that does not change.
    let text = format!("look = \"night\"\n{file}[environment]\nradiance = [1.0, 1.0, 1.0]\n");
    let night = scene(&text, &["a.toml"]);
    assert_eq!(night["environment"], complete["environment"]);
    assert!(night.get("solid").is_some() && night.get("light").is_some(), "{night}");

    fs::write(folder.join("a.toml"), particles).unwrap();
    assert_contains(
        &fail(folder, 2, &["scene", "a.toml"]),
        &["a.toml", "[particles] has no source"],
    );
}

/// Wrong values of the options are named with what was expected.
#[test]
fn wrong_changes_are_named() {
    let folder = with_dam();
    for (option, expected) in [
        ("--look=sunset", "one of studio, daylight, pool, night, chart"),
        ("--sun=north", "AZIMUTH,ELEVATION"),
        ("--sun=10,100", "AZIMUTH,ELEVATION"),
        ("--floor=low", "a height in metres, or none"),
        ("--tint=2,1,1", "above 0 and at most 1"),
        ("--tint=0.5", "above 0 and at most 1"),
        ("--scale=0", "1e-12 to 1e12"),
        ("--up=x", "y or z"),
        ("--ior=9", "ior must be between 0.3 and 3"),
    ] {
        assert_contains(&fail(folder.path(), 2, &["scene", "dam.bgeo", option]), &[expected]);
    }
    let complete =
        "[particles]\nsource = \"dam.bgeo\"\n[environment]\nradiance = [1.0, 1.0, 1.0]\n";
    fs::write(folder.path().join("a.toml"), complete).unwrap();
    let line = fail(folder.path(), 2, &["scene", "a.toml", "--floor=1"]);
    assert_contains(&line, &["no unbounded level plane"]);
}

/// `limpid settings` lists every setting with its default, and those of one pass.
#[test]
fn settings_are_listed() {
    let folder = with_dam();
    let all = succeed(folder.path(), &["settings"]);
    for control in limpid_io::project::controls::CONTROLS {
        assert_contains(&all, &[&control.path(), control.help]);
    }
    assert_contains(&all, &["refract.solver=guarded", "guarded | march", "1 to 64 /px"]);
    let smooth = succeed(folder.path(), &["settings", "smooth"]);
    assert!(smooth.contains("smooth.taps") && !smooth.contains("refract"), "{smooth}");
}

/// A solid moves through the frames of a film, between them too, and a changed key draws a picture again that
/// `--skip-existing` would keep.
#[test]
fn solids_move_with_the_frames() {
    if !adapter() {
        return;
    }
    let folder = with_dam();
    let folder = folder.path();
    let at = |name: &str| folder.join(name);
    for frame in 0..2 {
        fs::copy(at("dam.bgeo"), at(&format!("w_{frame}.bgeo"))).unwrap();
    }
    // The eye is far above the water, where the ball alone is.
    let scene = |reach: f64| {
        let text = format!(
            "[particles]\nsource = \"w_{{}}.bgeo\"\nradius = 0.025\n[environment]\nradiance = [1, 1, 1]\n\
             [camera]\neye = [0, 50, 0]\ntarget = [0, 50, -5]\nfov_y = 40\n\
             [[solid]]\nshape = \"sphere\"\ncenter = [-1, 50, -5]\nradius = 0.2\ncolor = [0.5, 0, 0]\n\
             [[solid.key]]\nframe = 0\ntranslate = [0, 0, 0]\n\
             [[solid.key]]\nframe = 1\ntranslate = [{reach}, 0, 0]\n"
        );
        fs::write(at("a.toml"), text).unwrap();
    };
    // At 5 m half of the 48 pixels are 5 tan 20° m: a metre is 13 pixels, and the middle is 32.
    let is_at = |name: &str, expected: u32| {
        let picture = open(&at(name));
        let red: Vec<u32> = (0..64).filter(|&x| picture.get_pixel(x, 24).0[1] == 0).collect();
        let middle = red.iter().sum::<u32>() / red.len().max(1) as u32;
        assert!(middle.abs_diff(expected) <= 1, "{name}: the ball is at {middle}, not {expected}");
    };
    scene(2.0);
    let all = ["a.toml", "-o", "p_####.png", "--skip-existing"];
    render(folder, &all);
    is_at("p_0000.png", 19);
    is_at("p_0001.png", 45);
    render(folder, &["a.toml", "-o", "half.png", "--at=0.5"]);
    is_at("half.png", 32);
    scene(1.0);
    render(folder, &all);
    is_at("p_0000.png", 19);
    is_at("p_0001.png", 32);
}
