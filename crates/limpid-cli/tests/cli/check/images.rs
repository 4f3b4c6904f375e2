//! Intermediate images: what is wrong with them is found and named.

use std::fs;

use glam::Vec3;
use limpid::aov::{self, Part};
use limpid::liquid::Particles;
use limpid_io::exr;
use limpid_lab::check::{Report, Verdict};

use super::{SCENE, assert_verdict, bless, frames, run, suite_folder};
use crate::support::gpu;

/// In intermediate images, depth off by 1 %, inward normals, a count off by one, a moved outline, a
/// missing or additional layer, NaN, another size and damage are detected and named by image.
#[test]
fn wrong_images_fail() {
    let Some(gpu) = gpu() else { return };
    let aov = "aov = { depth = { within = 0.005, mean = 0.002, p99 = 0.01 }, normal = {}, \
               interfaces = { share = 0.02 } }";
    let names = [
        "same", "depth", "normal", "count", "outline", "fewer", "more", "nan", "size", "parts",
        "damaged", "missing",
    ];
    let (folder, path) = suite_folder(&frames(&names, aov));
    bless(gpu, &path);
    let file = |name: &str| folder.path().join(format!("suite/{name}.exr"));
    let change = |name: &str, change: &dyn Fn(&mut Part)| {
        let mut parts = exr::load(&file(name)).expect("the blessed images");
        change(&mut parts[0]);
        exr::write(&file(name), parts).unwrap();
    };
    let each = |part: &mut Part, prefix: &str, change: &dyn Fn(usize, f32) -> f32| {
        for channel in part.channels.iter_mut().filter(|c| c.name.starts_with(prefix)) {
            let values = channel.values.iter_mut().enumerate();
            values.for_each(|(i, value)| *value = change(i, *value));
        }
    };
    change("depth", &|part| each(part, "depth.aggregate_front", &|_, z| 1.01 * z));
    change("normal", &|part| each(part, "normal.aggregate_front", &|_, n| -n));
    change("count", &|part| {
        each(part, "interfaces", &|i, n| if i % 16 == 0 { n + 1.0 } else { n });
    });
    change("outline", &|part| {
        each(part, "depth.aggregate_back", &|i, z| if i / 64 < 20 { 0.0 } else { z });
    });
    change("fewer", &|part| part.channels.retain(|c| !c.name.starts_with("depth.aggregate_back")));
    change("more", &|part| {
        let mut channel = part.channels[0].clone();
        channel.name = "depth.splash_front".into();
        part.channels.push(channel);
    });
    change("nan", &|part| {
        each(part, "depth.aggregate_front", &|i, z| if i == 65 { f32::NAN } else { z });
    });
    change("size", &|part| {
        part.size.y -= 1;
        part.channels.iter_mut().for_each(|c| c.values.truncate(64 * 47));
    });
    // One channel of three in a separate, smaller part.
    let mut parts = exr::load(&file("parts")).expect("the blessed images");
    let x = |channel: &aov::Channel| channel.name == "normal.aggregate_front.X";
    let at = parts[0].channels.iter().position(x).expect("a normal");
    let mut channel = parts[0].channels.remove(at);
    channel.values.truncate(32 * 24);
    let size = glam::UVec2::new(32, 24);
    parts.push(Part { name: "limpid.2".into(), size, channels: vec![channel] });
    exr::write(&file("parts"), parts).unwrap();
    let mut bytes = fs::read(file("damaged")).unwrap();
    bytes.truncate(bytes.len() / 2);
    fs::write(file("damaged"), bytes).unwrap();
    fs::remove_file(file("missing")).unwrap();

    let mut report = run(gpu, &path);
    assert_verdict(&report, "same", Verdict::Passed, &[]);
    let depth = "depth.aggregate_front";
    assert_verdict(&report, "depth", Verdict::Failed, &[depth, "0.005 m", "mean error", "99th"]);
    assert_verdict(&report, "normal", Verdict::Failed, &["normal.aggregate_front", "1 degrees"]);
    assert_verdict(&report, "count", Verdict::Failed, &["interfaces", "0.0625 (at most 0.02)"]);
    assert_verdict(&report, "outline", Verdict::Failed, &["depth.aggregate_back", "share"]);
    assert_verdict(&report, "fewer", Verdict::Failed, &["depth.aggregate_back", "not expected"]);
    assert_verdict(&report, "more", Verdict::Failed, &["depth.splash_front: expected, but"]);
    assert_verdict(&report, "nan", Verdict::Error, &["nan.exr", depth, "NaN at pixel (1, 1)"]);
    assert_verdict(&report, "size", Verdict::Error, &["size.exr", "64x47", "64x48"]);
    let differ = "normal.aggregate_front differ in size";
    assert_verdict(&report, "parts", Verdict::Error, &["parts.exr", differ]);
    assert_verdict(&report, "damaged", Verdict::Error, &["damaged.exr"]);
    assert_verdict(&report, "missing", Verdict::Failed, &["missing.exr: no expected images"]);
    // The pictures are unchanged: only the images are blessed and shown.
    for outcome in report.outcomes.iter().filter(|outcome| outcome.name != "same") {
        let blessing: Vec<_> = outcome.blessing.iter().map(|(path, _)| path.clone()).collect();
        assert_eq!(blessing, [file(&outcome.name)]);
    }
    let failed = report.outcomes.iter().find(|o| o.name == "depth").unwrap();
    assert_eq!(failed.exhibits.len(), 1);
    assert_eq!(failed.exhibits[0].panels.len(), 3);
    report.bless().expect("written");
    assert_eq!(run(gpu, &path).count(Verdict::Passed), names.len());
}

/// An OpenEXR file with any byte changed or truncated anywhere is read or refused, without a panic or a
/// huge allocation.
#[test]
fn damaged_exr() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.exr");
    let values = (0..48).map(|i| i as f32).collect();
    let channels = vec![aov::Channel { name: "depth.aggregate_front".into(), values }];
    let size = glam::UVec2::new(8, 6);
    exr::write(&file, vec![Part { name: "limpid".into(), size, channels }]).unwrap();
    let good = fs::read(&file).unwrap();
    let part = &exr::load(&file).expect("read back")[0];
    assert_eq!((part.name.as_str(), part.size), ("limpid", size));
    assert_eq!(part.channels[0].values[47], 47.0);
    let mut refused = 0;
    for at in 0..good.len() {
        for change in [0xff, 0x01, 0x80] {
            let mut bytes = good.clone();
            bytes[at] ^= change;
            fs::write(&file, &bytes).unwrap();
            refused += u32::from(exr::load(&file).is_err());
        }
        fs::write(&file, &good[..at]).unwrap();
        assert!(exr::load(&file).is_err(), "cut at byte {at}");
    }
    assert!(refused > 100, "{refused}");
}

/// A sequence whose frames are all within tolerance, but which flickers where the expected one drifts,
/// fails by its change from frame to frame; so does one that does not change.
#[test]
fn flicker_fails() {
    let Some(gpu) = gpu() else { return };
    let suite = r#"
        size = [64, 48]
        [tolerance]
        mean_flip = 0.1
        p99_flip = 0.9
        temporal = 1.2
        [[sequence]]
        name = "drift"
        input = "drift_{}.bgeo"
        scene = "ball.toml"
        radius = 0.05
        frames = "1-6"
    "#;
    let (folder, path) = suite_folder(suite);
    let all = folder.path().join("all.toml");
    fs::write(&all, suite.replace("frames = \"1-6\"", "expected = \"suite/drift/####.png\""))
        .unwrap();
    // Only the camera and the floor of the scene are used.
    let scene = SCENE.split_once("[camera]").expect("a camera").1;
    fs::write(folder.path().join("ball.toml"), format!("[camera]{scene}")).unwrap();
    let grid = || (0..512).map(|i| Vec3::new((i % 8) as f32, (i / 8 % 8) as f32, (i / 64) as f32));
    let write = |number: usize, x: f32| {
        let positions = grid().map(|p| 0.1 * p + Vec3::new(x - 0.35, 0.2, -0.35)).collect();
        let particles = Particles { positions, ..Particles::default() };
        limpid_io::particles::write(
            &particles,
            &folder.path().join(format!("drift_{number}.bgeo")),
        )
        .unwrap();
    };
    (1..=6).for_each(|n| write(n, 0.001 * n as f32));
    let missing = run(gpu, &path);
    assert_verdict(&missing, "drift", Verdict::Failed, &["6 of 6 expected pictures missing"]);
    bless(gpu, &path);
    assert!(folder.path().join("suite/drift/0003.png").exists());
    assert_verdict(&run(gpu, &path), "drift", Verdict::Passed, &[]);

    let temporal = "change from frame to frame";
    let only_temporal = |report: &Report, bound: &str| {
        assert_verdict(report, "drift", Verdict::Failed, &[temporal, bound]);
        assert_eq!(report.outcomes[0].problems.len(), 1, "{:?}", report.outcomes[0].problems);
    };
    (1..=6).for_each(|n| write(n, 0.001 * n as f32 + if n % 2 == 0 { 0.01 } else { 0.0 }));
    let mut report = run(gpu, &path);
    only_temporal(&report, "(at most 1.2 times");
    let exhibit = &report.outcomes[0].exhibits[0];
    assert!(exhibit.title.contains("of 255"), "{}", exhibit.title);
    // The frames of a sequence are blessed together.
    assert_eq!(report.outcomes[0].blessing.len(), 6);
    (1..=6).for_each(|n| write(n, 0.0035));
    only_temporal(&run(gpu, &path), "(at least 0.833 times");
    report.bless().unwrap();

    fs::remove_file(folder.path().join("drift_4.bgeo")).unwrap();
    let report = run(gpu, &path);
    assert_verdict(&report, "drift", Verdict::Error, &["drift_{}.bgeo", "missing: 4"]);
    assert_eq!(report.exit_code(), 4);
    assert!(report.outcomes[0].blessing.is_empty(), "an incomplete sequence would be blessed");
    // A sequence of all existing frames has no missing one, but lacks expected ones.
    fs::remove_file(folder.path().join("drift_6.bgeo")).unwrap();
    let report = run(gpu, &all);
    let lost = ["frame 4: expected, but the input has none", "frame 6: expected"];
    assert_verdict(&report, "drift", Verdict::Failed, &lost);
    assert!(report.outcomes[0].blessing.is_empty(), "an incomplete sequence would be blessed");
}
