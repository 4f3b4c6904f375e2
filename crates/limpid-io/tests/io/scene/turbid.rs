//! Turbid liquids and media by name.

use std::path::Path;

use glam::Vec3;
use limpid::scene::Medium;
use limpid_io::media::MediumName;
use limpid_io::project::Project;

const SKY: &str = "[environment]\nradiance = [1, 1, 1]\n";

fn scene(text: &str) -> limpid_io::Result<Project> {
    let text = format!("[particles]\nsource = \"w_{{}}.npz\"\nradius = 0.1\n{text}\n");
    Project::parse(&text, "scene.toml", Path::new(""))
}

fn read_again(project: &Project) -> Project {
    let text = project.to_toml(None).unwrap();
    Project::parse(&text, "scene.toml", Path::new("")).unwrap()
}

/// Keys of turbid liquids are read, and written so that they are read back.
#[test]
fn turbid_liquids_are_read_and_written() {
    let liquid = "[liquid]\nabsorption = [1, 2, 3]\nscattering = [4, 5, 6]\nanisotropy = 0.5";
    let turbid = scene(&format!("{SKY}{liquid}")).unwrap();
    let expected = Medium {
        absorption: Vec3::new(1.0, 2.0, 3.0),
        scattering: Vec3::new(4.0, 5.0, 6.0),
        anisotropy: 0.5,
    };
    assert_eq!(turbid.scene.liquid.medium(), expected);
    assert!(turbid.scene.is_turbid() && !scene(SKY).unwrap().scene.is_turbid());
    assert_eq!(read_again(&turbid).scene.liquid, turbid.scene.liquid);
}

/// A medium has the measured coefficients and the index of its liquid, and other keys replace some of them. A look
/// scales it, and a scene that a look completes keeps its name.
#[test]
fn media_are_known_by_name() {
    let milk = scene(&format!("{SKY}[liquid]\nmedium = \"milk\"")).unwrap();
    assert_eq!(milk.scene.liquid.medium(), MediumName::Milk.medium());
    assert_eq!(milk.scene.liquid.ior, MediumName::Milk.ior());
    assert_eq!(read_again(&milk).scene.liquid, milk.scene.liquid);
    let white =
        scene(&format!("{SKY}[liquid]\nmedium = \"milk\"\nabsorption = [0, 0, 0]")).unwrap();
    assert_eq!(white.scene.liquid.absorption, Vec3::ZERO);
    assert_eq!(white.scene.liquid.scattering, MediumName::Milk.medium().scattering);
    let scaled = MediumName::Sea.liquid(0.1);
    let off = scaled.absorption - 10.0 * MediumName::Sea.medium().absorption;
    assert!(off.abs().max_element() < 1e-4, "{scaled:?}");
    let with_look = scene("[liquid]\nmedium = \"blood\"").unwrap();
    assert_eq!(with_look.automatic.unwrap().medium, Some(MediumName::Blood));
    assert_eq!(read_again(&with_look).automatic, with_look.automatic);
}

/// Contradictions and values out of range are errors that say so.
#[test]
fn contradictions_are_told() {
    for (liquid, told) in [
        ("kind = \"opaque\"\nscattering = [1, 1, 1]", "no medium inside"),
        ("kind = \"opaque\"\nmedium = \"milk\"", "no medium inside"),
        ("scattering = [-1, 0, 0]", "scattering must not be negative"),
        ("scattering = [1, 0, 0]\nanisotropy = 1.0", "between -0.99 and 0.99"),
        ("medium = \"tea\"", "coffee"),
    ] {
        let error = scene(&format!("{SKY}[liquid]\n{liquid}")).expect_err(liquid).to_string();
        assert!(error.contains(told), "{liquid}: {error}");
    }
}
