//! Turbid liquids and media by name.

use std::path::Path;

use glam::Vec3;
use limpid::look::Look;
use limpid::scene::{Kind, Liquid, Medium, Scene};
use limpid_io::color_by::{Attribute, ColorBy, MapName};
use limpid_io::media::MediumName;
use limpid_io::project::Project;
use limpid_io::project::differences::between;

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

/// Scattering and anisotropy are replaced by name, in either order, of the liquid and of a fluid.
#[test]
fn turbid_liquids_are_set() {
    let set = |overrides: &[&str]| -> limpid_io::Result<Project> {
        let fluids =
            "[[fluid]]\nsource = \"a.npz\"\n[[fluid]]\nsource = \"b.npz\"\n[liquid]\nior = 1.4\n";
        let mut project = Project::parse(&format!("{SKY}{fluids}"), "scene.toml", Path::new(""))?;
        project.set(&overrides.iter().map(|&text| text.to_owned()).collect::<Vec<_>>())?;
        Ok(project)
    };
    let (scattering, anisotropy) = ("liquid.scattering=[4, 5, 6]", "liquid.anisotropy=0.5");
    for order in [[scattering, anisotropy], [anisotropy, scattering]] {
        let liquid = set(&order).unwrap().scene.liquid;
        assert_eq!((liquid.scattering, liquid.anisotropy), (Vec3::new(4.0, 5.0, 6.0), 0.5));
        assert_eq!(liquid.ior, 1.4);
    }
    let opaque = set(&[scattering, "liquid.kind=opaque"]).unwrap().scene.liquid;
    assert_eq!((opaque.kind, opaque.scattering), (Kind::Opaque, Vec3::ZERO));
    let tinted = set(&[scattering, "liquid.color=[1, 0.5, 0.5]"]).unwrap().scene.liquid;
    assert_eq!((tinted.absorption.x, tinted.scattering.x), (0.0, 4.0));
    let fluid = set(&["fluid.2.scattering=[7, 8, 9]", "fluid.2.anisotropy=-0.5"]).unwrap();
    let [one, two] = fluid.scene.fluids[..] else { panic!("two fluids") };
    assert_eq!((one.scattering, one.anisotropy), (Vec3::ZERO, 0.0));
    assert_eq!((two.scattering, two.anisotropy), (Vec3::new(7.0, 8.0, 9.0), -0.5));
    for (text, told) in [
        ("liquid.scattering=[1, 2, 3, 4]", "expected 3 numbers, found 4"),
        ("liquid.scattering=many", "scattering"),
        ("fluid.3.scattering=[1, 1, 1]", "the scene has 2"),
    ] {
        let error = set(&[text]).expect_err(text).to_string();
        assert!(error.contains(told), "{text}: {error}");
    }
    let error = set(&["liquid.kind=opaque", scattering]).expect_err("opaque").to_string();
    assert!(error.contains("no medium inside"), "{error}");
}

/// Differences turn one liquid into another to the bit, whatever their kinds and colours.
#[test]
fn differences_give_the_other_liquid() {
    let by = |name: &str, map, range| {
        Some(ColorBy { map, range, ..ColorBy::new(Attribute::from(name)) })
    };
    let clear = Liquid { absorption: Vec3::new(0.1, 1e-7, 3.3), ..Liquid::default() };
    let turbid = Liquid { scattering: Vec3::new(1.0, 0.1 + 0.2, 1e5), anisotropy: -0.3, ..clear };
    let varnished = Liquid { color: Vec3::new(0.9, 0.7, 1.0 / 3.0), ..Look::paint() };
    let matte = Liquid { roughness: 0.7, ior: 1.0, ..Look::paint() };
    let all = [
        (clear, None),
        (turbid, None),
        (Liquid { ior: 1.2, ..clear }, None),
        (varnished, None),
        (matte, None),
        (matte, by("velocity", MapName::Viridis, None)),
        (varnished, by("velocity", MapName::Turbo, Some([-1.5, 2e-3]))),
        (matte, by("Heat \"of\" [K]", MapName::Magma, None)),
    ];
    for (from, from_by) in &all {
        for (to, to_by) in &all {
            let project = |liquid: &Liquid, by: &Option<ColorBy>| Project {
                scene: Scene { liquid: *liquid, ..Scene::default() },
                color_by: by.clone(),
                ..Project::default()
            };
            let (mut changed, wanted) = (project(from, from_by), project(to, to_by));
            // Without a range there is nothing to set: it is the usual one of the sequence.
            let is_reset = to_by.as_ref().zip(from_by.as_ref()).is_some_and(|(to, from)| {
                to.attribute == from.attribute && to.range.is_none() && from.range.is_some()
            });
            if is_reset {
                continue;
            }
            let colored = (&changed.scene, changed.color_by.as_ref());
            let texts = between(colored, (&wanted.scene, wanted.color_by.as_ref()));
            changed.set(&texts).unwrap();
            assert_eq!(changed.color_by, wanted.color_by, "{texts:?}");
            let (found, expected) = (changed.scene.liquid, wanted.scene.liquid);
            let shown = |liquid: Liquid| match (liquid.kind, to_by) {
                (Kind::Clear, _) => Liquid { color: Vec3::ZERO, roughness: 0.0, ..liquid },
                // Its particles have the colours.
                (_, Some(_)) => Liquid { color: Vec3::ZERO, ..liquid },
                _ => liquid,
            };
            assert_eq!(shown(found), shown(expected), "{texts:?}");
            assert_eq!(texts.is_empty(), (from, from_by) == (to, to_by), "{texts:?}");
        }
    }
}
