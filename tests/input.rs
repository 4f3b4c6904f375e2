//! Protects what a sequence is drawn with: one radius, one view, whatever its first frames hold and
//! however its frames are shared out.

use std::path::Path;

use glam::{DVec3, Vec3};
use limpid::Error;
use limpid::input::Input;
use limpid::scene::Scene;
use tempfile::TempDir;

/// A folder of `.xyz` frames, numbered from 0.
fn frames(contents: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (number, text) in contents.iter().enumerate() {
        std::fs::write(folder.path().join(format!("w_{number}.xyz")), text).unwrap();
    }
    folder
}

fn open(folder: &TempDir) -> Input {
    Input::open(folder.path().join("w_{}.xyz").to_str().unwrap(), &[]).unwrap()
}

const PAIR: &str = "50.0 1.0 0.0\n50.2 1.0 0.0\n";
const CLOSER: &str = "50.0 1.0 0.0\n50.1 1.0 0.0\n";

/// Emitters begin with nothing: radius and view come from the first frame that has particles, and
/// stay, though later frames are spaced otherwise.
#[test]
fn the_first_filled_frame_settles_radius_and_view() {
    let folder = frames(&["", PAIR, CLOSER]);
    let (input, scene) = open(&folder).settle(&[]).unwrap();
    for (frame, particles) in input.sequence.frames.iter().zip([0, 2, 2]) {
        let loaded = input.load(frame, &scene).unwrap();
        assert_eq!(loaded.particles, particles);
        assert!((loaded.splats.radius - 0.1).abs() < 1e-6, "{}", loaded.splats.radius);
    }
    let target = scene.camera.expect("a fitted camera").target;
    assert!(target.abs_diff_eq(DVec3::new(50.1, 1.0, 0.0), 1e-4), "{target}");
}

/// A scene without a camera gets one for all frames, not one a frame.
#[test]
fn a_scene_without_a_camera_gets_one() {
    let folder = frames(&[PAIR, "0.0 0.0 0.0\n1.0 0.0 0.0\n"]);
    let scene = Scene::parse("", "empty", Path::new("."), &[]).unwrap();
    let (_, scene) = open(&folder).with_scene(scene).settle(&[]).unwrap();
    assert!(scene.camera.expect("a fitted camera").target.x > 49.0);
}

/// Nothing to see is a picture too; a lone particle without a radius is a question.
#[test]
fn empty_and_lone_frames() {
    let folder = frames(&["", ""]);
    let (input, scene) = open(&folder).settle(&[]).unwrap();
    assert_eq!(input.load(&input.sequence.frames[0], &scene).unwrap().particles, 0);

    let folder = frames(&["1.0 2.0 3.0\n"]);
    let error = open(&folder).settle(&[]).unwrap_err();
    assert!(error.to_string().contains("--radius"), "{error}");
    let (input, scene) = open(&folder).with_radius(0.5).unwrap().settle(&[]).unwrap();
    assert_eq!(input.load(&input.sequence.frames[0], &scene).unwrap().splats.radius, 0.5);
}

/// A scene's frame is that frame, also where the pattern matches only another one.
#[test]
fn a_missing_frame_is_not_replaced_by_another() {
    let folder = frames(&[PAIR]);
    let text = "[particles]\nsource = \"w_{}.xyz\"\nframe = 7\n";
    std::fs::write(folder.path().join("scene.toml"), text).unwrap();
    let input = Input::open(folder.path().join("scene.toml").to_str().unwrap(), &[]).unwrap();
    assert_eq!(input.frame, Some(7));
    assert!(input.sequence.frame(7).is_none());
}

/// Particles drawn in a scene that names some of its own take their radius and axis.
#[test]
fn a_scene_gives_radius_and_axis() {
    let folder = frames(&["0.0 1.0 2.0\n5.0 1.0 2.0\n"]);
    let text = "[particles]\nsource = \"other.xyz\"\nradius = 0.25\nup = \"z\"\n";
    let scene = Scene::parse(text, "scene", Path::new("."), &[]).unwrap();
    let (input, scene) = open(&folder).with_scene(scene).settle(&[]).unwrap();
    let frame = &input.sequence.frames[0];
    assert_eq!(input.load(frame, &scene).unwrap().splats.radius, 0.25);
    assert_eq!(input.particles(frame).unwrap().positions[0], Vec3::new(0.0, 2.0, -1.0));
    assert!(matches!(open(&folder).with_radius(-1.0), Err(Error::Usage(_))));
}
