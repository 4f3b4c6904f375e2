//! Saving of scenes: a saved scene is read back as the same scene.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, UVec2};
use image::{Rgb, Rgb32FImage};
use limpid::environment::Environment;
use limpid::mesh::{MeshData, Texture};
use limpid::scene::{Light, Shape, Surface};
use limpid_io::project::{Given, Project};

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

/// A scene's text may name what the caller has in memory. It is read back with that, and saved in files beside it.
#[test]
fn scenes_name_what_is_in_memory() {
    let triangle = MeshData {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
        triangles: vec![[0, 1, 2]],
        ..MeshData::default()
    };
    let texture = Arc::new(Texture::new(UVec2::ONE, vec![[1, 2, 3, 255]]).unwrap());
    let map = Environment::Map { size: UVec2::ONE, pixels: Arc::new([[0.5, 0.25, 1.0, 1.0]]) };
    let given = Given {
        meshes: vec![("triangle".into(), triangle)],
        environments: vec![("sky".into(), map.clone())],
        textures: vec![("paint".into(), texture.clone())],
        ..Given::default()
    };
    let text = "environment = { map = \"sky\" }\nsolid = [\n\
        { shape = \"mesh\", file = \"triangle\", scale = 2 },\n\
        { shape = \"sphere\", center = [0, 0, 0], radius = 1, texture = \"paint\" } ]\n";
    let parse = |text: &str, given: &Given| {
        Project::parse_given(text, "test", Path::new("/somewhere"), given.clone())
    };
    let project = parse(text, &given).unwrap();
    let Shape::Mesh { mesh, placement } = &project.scene.solids[0].shape else { panic!("a mesh") };
    assert_eq!((mesh.triangles().len(), placement.scale), (1, 2.0));
    assert_eq!(project.scene.environment, map);
    let painted = matches!(&project.scene.solids[1].surface,
        Surface::Texture { texture: shown, .. } if Arc::ptr_eq(shown, &texture));
    assert!(painted);

    let again = parse(&project.to_toml(Some("sky")).unwrap(), &given).unwrap();
    assert_eq!(again.scene, project.scene);
    // A variant has the mesh, not another of the same data.
    let like = Some(Arc::new(project.solid_files.clone()));
    let given_too = Given { like, ..given };
    let variant = parse(&format!("look = \"pool\"\n{text}"), &given_too).unwrap();
    let Shape::Mesh { mesh: same, .. } = &variant.scene.solids[0].shape else { panic!("a mesh") };
    assert!(Arc::ptr_eq(same, mesh));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    // Twice: files of the same kind are replaced.
    project.save(&path).unwrap();
    project.save(&path).unwrap();
    let loaded = Project::load(&path).unwrap().scene;
    let Shape::Mesh { mesh: saved, placement: at } = &loaded.solids[0].shape else {
        panic!("a mesh")
    };
    assert_eq!((saved.triangles(), at), (mesh.triangles(), placement));
    assert_eq!(loaded.environment, map);
    assert_eq!(loaded.solids[1].surface, project.scene.solids[1].surface);
    let unknown = parse(text, &Given::default()).unwrap_err().to_string();
    assert!(unknown.contains("triangle"), "{unknown}");
}
