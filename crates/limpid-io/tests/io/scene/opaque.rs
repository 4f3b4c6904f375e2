//! Opaque bodies, and colours by an attribute of their particles.

use std::path::Path;

use glam::Vec3;
use limpid::liquid::Particles;
use limpid::scene::Kind;
use limpid_io::color_by::{Attribute, MapName};
use limpid_io::input::Input;
use limpid_io::particles;
use limpid_io::project::Project;

fn scene(liquid: &str) -> limpid_io::Result<Project> {
    let text = format!("[particles]\nsource = \"w_{{}}.npz\"\nradius = 0.1\n[liquid]\n{liquid}\n");
    Project::parse(&text, "scene.toml", Path::new(""))
}

/// Keys of opaque bodies are read, and written so that they are read back.
#[test]
fn opaque_bodies_are_read_and_written() {
    let painted =
        scene("kind = \"opaque\"\ncolor = [0.5, 0.1, 0.0]\nior = 1.5\nroughness = 0.3").unwrap();
    let liquid = painted.scene.liquid;
    assert_eq!((liquid.kind, liquid.ior, liquid.roughness), (Kind::Opaque, 1.5, 0.3));
    assert_eq!((liquid.color, painted.color_by), (Vec3::new(0.5, 0.1, 0.0), None));
    // Data are shown by opaque bodies without a coat.
    let colored =
        scene("color_by = \"velocity\"\ncolormap = \"turbo\"\ncolor_range = [1.0, 2.5]").unwrap();
    let by = colored.color_by.unwrap();
    assert_eq!((colored.scene.liquid.kind, colored.scene.liquid.ior), (Kind::Opaque, 1.0));
    assert_eq!(
        (by.attribute, by.map, by.range),
        (Attribute::Velocity, MapName::Turbo, Some([1.0, 2.5]))
    );
    for project in [painted, colored] {
        let text = project.to_toml(None).unwrap();
        let again = Project::parse(&text, "scene.toml", Path::new("")).unwrap();
        assert_eq!((again.scene.liquid, again.color_by), (project.scene.liquid, project.color_by));
    }
}

/// Keys that contradict each other, and values out of range, are errors that say so.
#[test]
fn contradictions_are_told() {
    for (liquid, told) in [
        ("kind = \"opaque\"\nabsorption = [1, 1, 1]", "give its color"),
        ("roughness = 0.2", "kind = \"opaque\""),
        ("kind = \"clear\"\ncolor_by = \"density\"", "color_by colors opaque bodies"),
        ("colormap = \"turbo\"", "need color_by"),
        ("color_by = \"density\"\ncolor = [1, 0, 0]", "one of color and color_by"),
        ("color_by = \"density\"\ncolor_range = [2.0, 1.0]", "the smaller one first"),
        ("kind = \"opaque\"\nior = 0.8", "1 is no coat"),
        ("kind = \"opaque\"\ncolor = [2.0, 0.0, 0.0]", "color must be between 0 and 1"),
        ("color_by = \"temperature\"", "velocity"),
        ("kind = \"milk\"", "opaque"),
    ] {
        let error = scene(liquid).expect_err(liquid).to_string();
        assert!(error.contains(told), "{liquid}: {error}");
    }
}

/// The range of all frames holds for each; a frame without the attribute is an error that names those it has.
#[test]
fn frames_share_a_range() {
    let folder = tempfile::tempdir().unwrap();
    let frame = |speed: f32| Particles {
        velocities: Some((0..200).map(|i| Vec3::X * speed * i as f32 / 199.0).collect()),
        ..Particles::from_positions((0..200).map(|i| Vec3::X * 0.2 * i as f32).collect())
    };
    for (number, speed) in [(1, 1.0), (2, 3.0)] {
        particles::write(&frame(speed), &folder.path().join(format!("w_{number}.npz"))).unwrap();
    }
    let write = |by: &str| {
        let path = folder.path().join("scene.toml");
        let text = format!(
            "[particles]\nsource = \"w_{{}}.npz\"\nradius = 0.1\n[liquid]\ncolor_by = \"{by}\"\n"
        );
        std::fs::write(&path, text).unwrap();
        let (loader, project) = Input::open(path.to_str().unwrap()).unwrap().resolve().unwrap();
        loader.load(&loader.sequence.frames[0], &project.scene)
    };
    let colors = write("velocity").unwrap().splats.colors.unwrap();
    let [low, high] = colors.map().unwrap().range;
    assert!((0.0..0.1).contains(&low) && (2.5..3.0).contains(&high), "{low} to {high}");
    let error = write("density").expect_err("the frames have no density").to_string();
    assert!(error.contains("no density") && error.contains("velocity"), "{error}");
}
