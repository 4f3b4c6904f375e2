//! `render --aov`: the channels and parts of the OpenEXR files beside the pictures.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::{LIT, adapter, assert_names, folder, project, render};

/// `--aov all` writes every documented channel, with plausible values.
#[test]
fn aovs_are_channels_of_one_file() {
    if !adapter() {
        return;
    }
    let project = project();
    render(project.path(), &["scenes/block.toml", "-o", "f.png", "--aov", "all"]);
    assert_names(project.path(), &["f.aov.exr", "f.png", "scenes", "water"]);
    let channels = channels(&project.path().join("f.aov.exr"));

    let mut expected = BTreeSet::new();
    let layers = ["aggregate_front", "aggregate_back", "splash_front", "splash_back"];
    for (kind, layers) in [("", &layers[..]), ("smooth_", &layers[..2])] {
        for layer in layers {
            expected.insert(format!("{kind}depth.{layer}"));
            expected.extend(["X", "Y", "Z"].map(|axis| format!("{kind}normal.{layer}.{axis}")));
        }
    }
    expected.extend(["R", "G", "B"].map(|color| format!("radiance.{color}")));
    let composed = ["depth.Z", "normal.X", "normal.Y", "normal.Z", "motion.X", "motion.Y"];
    expected.extend(composed.map(str::to_owned));
    expected.extend(["coverage.A", "mask.fluid1"].map(str::to_owned));
    let counts = ["solid_depth", "interfaces", "inside", "iterations", "failures"];
    expected.extend(counts.map(str::to_owned));
    assert_eq!(channels.keys().cloned().collect::<BTreeSet<_>>(), expected);

    for (name, values) in &channels {
        assert_eq!(values.len(), 64 * 48, "{name}");
        assert!(values.iter().all(|value| value.is_finite()), "{name} is not finite");
        let may_be_zero = name == "failures" || name.starts_with("motion");
        assert!(may_be_zero || values.iter().any(|&value| value != 0.0), "{name} is empty");
        let signed = name.contains("normal") || name.starts_with("motion");
        assert!(signed || values.iter().all(|&value| value >= 0.0), "{name} is negative");
    }
    let texel = |name: &str, i: usize| channels[name][i];
    for i in 0..64 * 48 {
        let at = |name: &str| texel(name, i);
        for layer in layers {
            let normal = ["X", "Y", "Z"].map(|axis| at(&format!("normal.{layer}.{axis}")));
            let length = normal.map(|n| n * n).iter().sum::<f32>().sqrt();
            let filled = at(&format!("depth.{layer}")) > 0.0;
            let expected = if filled { 1.0 } else { 0.0 };
            assert!((length - expected).abs() < 1e-3, "{layer}, texel {i}: normal of {length}");
            // Front planes face the camera, which looks down −z; back planes face away from it.
            let [toward, front] = [normal[2], if layer.ends_with("front") { 1.0 } else { -1.0 }];
            assert!(!filled || toward.abs() < 0.5 || toward * front > 0.0, "{layer}: {normal:?}");
        }
        for class in ["aggregate", "splash"] {
            let [front, back] = ["front", "back"].map(|side| at(&format!("depth.{class}_{side}")));
            assert_eq!(front > 0.0, back > 0.0, "{class}, texel {i}: {front}, {back}");
            assert!(front <= back, "{class}, texel {i}: front {front} behind back {back}");
        }
        assert!(
            at("interfaces") > 0.0 || at("inside") == 0.0,
            "texel {i}: a path inside without an interface"
        );
    }
}

/// `--aov` with a list writes only these images.
#[test]
fn aovs_can_be_selected() {
    if !adapter() {
        return;
    }
    let project = project();
    // The intermediate images have the names of their pictures.
    let args =
        ["scenes/block.toml", "--frames=1-2", "-o", "take.####.jpg", "--aov", "inside,radiance"];
    render(project.path(), &args);
    let files = [
        "scenes",
        "take.0001.aov.exr",
        "take.0001.jpg",
        "take.0002.aov.exr",
        "take.0002.jpg",
        "water",
    ];
    assert_names(project.path(), &files);
    let channels = channels(&project.path().join("take.0001.aov.exr"));
    let names: Vec<_> = channels.keys().map(String::as_str).collect();
    assert_eq!(names, ["inside", "radiance.B", "radiance.G", "radiance.R"]);
}

/// Motion vectors are those of a frame's time, however a simulator numbers its files, and a resumed run draws
/// the same again after another frame.
#[test]
fn motion_is_since_the_picture_before() {
    if !adapter() {
        return;
    }
    let folder = folder();
    let scene = |stride: usize| {
        for i in 0..3 {
            let mut text = "x,y,z,vx,vy,vz\n".to_owned();
            for k in 0..12 * 5 * 8 {
                let [x, y, z] = [k % 12, k / 12 % 5, k / 60].map(|k| k as f32 * 0.05);
                writeln!(text, "{x},{y},{z},0.6,0,0").unwrap();
            }
            let name = format!("s{stride}_{}.csv", i * stride);
            fs::write(folder.path().join(name), text).unwrap();
        }
        let source = format!("source = \"s{stride}_{{}}.csv\"\nfps = 30");
        let text = super::SCENE.replace("source = \"../water/block_{}.xyz\"\nframe = 2", &source);
        fs::write(folder.path().join(format!("s{stride}.toml")), text).unwrap();
    };
    scene(1);
    scene(100);
    let motion = |file: &str| channels(&folder.path().join(file)).remove("motion.X").unwrap();
    for (scene, out) in [("s1.toml", "a_#.png"), ("s100.toml", "b_#.png")] {
        render(folder.path(), &[scene, "--frames", "all", "-o", out, "--aov", "motion"]);
    }
    let usual = motion("a_1.aov.exr");
    let most = usual.iter().fold(0.0, |most: f32, x| most.max(*x));
    // 0.6 m/s for 1/30 s at a distance of about 1.7 m, of 48 pixels for 35 degrees.
    assert!((0.5..1.5).contains(&most), "{most} pixels");
    assert_eq!(motion("b_100.aov.exr"), usual);
    assert_eq!(motion("b_200.aov.exr"), usual);

    let resumed = |frames: &str| {
        let args = ["s1.toml", "--frames", frames, "-o", "r_#.png", "--aov", "motion"];
        render(folder.path(), &[&args[..], &["--skip-existing"]].concat());
        motion("r_2.aov.exr")
    };
    let twice: Vec<f32> = usual.iter().map(|x| 2.0 * x).collect();
    let apart = resumed("0-2:2");
    assert!(apart.iter().zip(&twice).all(|(x, y)| (x - y).abs() < 0.02), "two frames");
    assert_eq!(resumed("0-2"), usual);
}

/// `--aov caustics` writes a part of the map's size for each light, with the irradiance below still
/// water; without lit solids it writes none.
#[test]
fn caustic_maps_are_parts_of_the_file() {
    use exr::prelude::*;
    if !adapter() {
        return;
    }
    let folder = folder();
    fs::write(folder.path().join("lit.toml"), LIT).unwrap();
    render(folder.path(), &["lit.toml", "-o", "f.png", "--aov", "radiance,caustics"]);
    let image = read_all_flat_layers_from_file(folder.path().join("f.aov.exr")).expect("a file");
    let parts: Vec<_> = image.layer_data.iter().collect();
    let name = |i: usize| parts[i].attributes.layer_name.as_ref().map(ToString::to_string);
    assert_eq!(parts.len(), 2);
    assert_eq!((name(0), name(1)), (Some("limpid".into()), Some("caustics.1".into())));
    assert_eq!(parts[0].size, Vec2(64, 48));
    assert_eq!(parts[1].size, Vec2(48, 48));
    let channels: BTreeMap<String, Vec<f32>> = (parts[1].channel_data.list.iter())
        .map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect()))
        .collect();
    let names: Vec<_> = channels.keys().map(String::as_str).collect();
    assert_eq!(names, ["irradiance.B", "irradiance.G", "irradiance.R", "receiver_depth"]);
    // In the middle: the irradiance transmitted by a plane surface and absorbed over 0.5 m.
    let middle = |name: &str| {
        let rows = (16..32).flat_map(|y| (16..32).map(move |x| y * 48 + x));
        rows.map(|i| channels[name][i]).sum::<f32>() / 256.0
    };
    let transmitted = 1.0 - (0.33f32 / 2.33).powi(2);
    for (name, expected) in [
        ("R", 2.0 * transmitted * (-0.5f32).exp()),
        ("G", 2.0 * transmitted),
        ("B", 4.0 * transmitted),
    ] {
        let found = middle(&format!("irradiance.{name}"));
        assert!((found / expected - 1.0).abs() < 0.04, "{name}: {found}, not {expected}");
    }
    // A floor perpendicular to the light has the same depth everywhere.
    let depths = &channels["receiver_depth"];
    let flat = depths.iter().all(|d| (d / depths[0] - 1.0).abs() < 1e-5);
    assert!(flat && depths[0] > 0.5, "{depths:?}");

    let dark = LIT.replace("lit = true", "");
    fs::write(folder.path().join("dark.toml"), dark).unwrap();
    render(folder.path(), &["dark.toml", "-o", "d.png", "--aov", "radiance,caustics"]);
    let image = read_all_flat_layers_from_file(folder.path().join("d.aov.exr")).expect("a file");
    assert_eq!(image.layer_data.len(), 1);
}

/// Reads the channels of an OpenEXR file, by name.
fn channels(path: &Path) -> BTreeMap<String, Vec<f32>> {
    use exr::prelude::*;
    let image = read_first_flat_layer_from_file(path).expect("an OpenEXR file");
    let channels = image.layer_data.channel_data.list.into_iter();
    channels.map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect()
}
