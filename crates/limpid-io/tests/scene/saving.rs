//! Saving of scenes: a saved scene is read back as the same scene.

use std::fs;
use std::path::Path;

use image::{Rgb, Rgb32FImage};
use limpid::scene::Light;
use limpid_io::project::Project;

/// Every example scene is written and read back as the same scene.
#[test]
fn example_scenes_survive_saving() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("sims");
    let mut count = 0;
    for entry in fs::read_dir(&folder).expect("the example scenes") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        count += 1;
        let text = fs::read_to_string(&path).expect("readable text");
        let parse = |text: &str| Project::parse(text, "scene", Path::new(""));
        let project = parse(&text).expect("a valid scene");
        let written = project.to_toml(None).expect("a scene as text");
        let again =
            parse(&written).unwrap_or_else(|e| panic!("{}: {e}\n{written}", path.display()));
        assert_eq!(again, project, "{}\n{written}", path.display());
    }
    assert!(count > 5);
}

/// Features missing in the example scenes survive saving: several fluids, a sphere, a point light,
/// further views, an environment map.
#[test]
fn a_scene_with_all_features_survives_saving() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    Rgb32FImage::from_fn(4, 2, |x, y| Rgb([0.1 + x as f32, 1e-3, 7.5 * y as f32]))
        .save(at("sky.exr"))
        .expect("a map");
    let text = r#"
        [[fluid]]
        source = "a_{}.bgeo"
        radius = 0.01
        fps = 24.0
        color = [0.9, 0.5, 0.1]
        [[fluid]]
        source = "b.ply"
        up = "z"
        frame = 3
        [liquid]
        ior = 1.1
        [[view]]
        name = "near"
        camera = { eye = [0.1, 2, 3], target = [0, 0, 0], fov_y = 30 }
        [environment]
        map = "sky.exr"
        scale = 0.3
        [[solid]]
        shape = "sphere"
        center = [0.1, 0.2, 0.3]
        radius = 0.7
        lit = true
        [[solid]]
        shape = "plane"
        origin = [0, -1, 0]
        normal = [0, 0, 2]
        [[light]]
        point = { position = [0.1, 5, 0], intensity = [1, 2, 3] }
        [settings]
        preset = "mayer2026"
        smooth = { sigma = 0.3 }
        classify = { on = "cpu" }
    "#;
    fs::write(at("scene.toml"), text).expect("a scene file");
    let project = Project::load(&at("scene.toml")).expect("a valid scene");
    assert!(matches!(project.scene.lights[0], Light::Point { .. }));
    project.save(&at("saved.toml")).expect("a saved scene");
    assert_eq!(Project::load(&at("saved.toml")).expect("a valid scene"), project);
    let written = fs::read_to_string(at("saved.toml")).expect("text");
    assert!(
        written.contains("source = \"a_{}.bgeo\""),
        "a path beside the scene is relative: {written}"
    );
    assert!(project.to_toml(None).is_err(), "a map needs a file to be saved beside");
}
