//! Suites of frame tests: correct frames pass, wrong frames fail by the right measure; and limpid's own
//! golden frames.

mod golden;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use glam::Vec3;
use image::{Rgb, RgbImage};
use limpid::aov::{self, Part};
use limpid::gpu::Gpu;
use limpid::liquid::Particles;
use limpid_io::error::Category;
use limpid_io::exr;
use limpid_io::output::write_png;
use limpid_lab::check::{Adapter, Report, Suite, Verdict};
use limpid_lab::compare::load_picture;
use tempfile::TempDir;

use crate::support::gpu;

/// A small body of liquid over a checker: edges, reflections and refraction.
const SCENE: &str = r#"
[recipe]
kind = "ball"
center = [0.0, 0.65, 0.0]
radius = 0.5
count = 600

[camera]
eye = [0.35, 1.05, 2.6]
target = [0.0, 0.56, 0.0]
fov_y = 34.0

[[solid]]
shape = "plane"
origin = [0.0, 0.0, 0.0]
half_extent = 20.0
checker = { tile = 0.25, even = [0.85, 0.80, 0.70], odd = [0.15, 0.20, 0.30] }
"#;

/// A folder with `ball.toml` and `suite.toml`; returns the suite's path too.
fn suite_folder(suite: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("ball.toml"), SCENE).expect("written");
    let path = folder.path().join("suite.toml");
    fs::write(&path, suite).expect("written");
    (folder, path)
}

/// A suite of equal frames of the ball with these names and additional keys.
fn frames(names: &[&str], keys: &str) -> String {
    let mut suite = "size = [64, 48]\n[tolerance]\nmax_channel_error = 40\n".to_owned();
    for name in names {
        let _ = write!(suite, "[[frame]]\nname = \"{name}\"\ninput = \"ball.toml\"\n{keys}\n");
    }
    suite
}

fn run(gpu: &Gpu, path: &Path) -> Report {
    run_some(gpu, path, &[])
}

fn run_some(gpu: &Gpu, path: &Path, filter: &[&str]) -> Report {
    let filter: Vec<String> = filter.iter().map(ToString::to_string).collect();
    Suite::load(path).and_then(|suite| suite.run(gpu, &filter, |_| ())).expect("a suite that runs")
}

/// Draws a suite and blesses all of it.
fn bless(gpu: &Gpu, path: &Path) {
    let mut report = run(gpu, path);
    report.bless().expect("expectations are written");
    assert_eq!(report.exit_code(), 0);
    assert_eq!(report.count(Verdict::Blessed), report.outcomes.len());
}

/// The verdict of an entry, and its reasons as one text.
#[track_caller]
fn verdict(report: &Report, name: &str) -> (Verdict, String) {
    let outcome = report.outcomes.iter().find(|outcome| outcome.name == name).expect("an entry");
    (outcome.verdict(), outcome.reasons().join("\n"))
}

#[track_caller]
fn assert_verdict(report: &Report, name: &str, expected: Verdict, parts: &[&str]) {
    let (found, reasons) = verdict(report, name);
    assert_eq!(found, expected, "{name}: {reasons}");
    for part in parts {
        assert!(reasons.contains(part), "{name}: `{part}` is not in: {reasons}");
    }
}

/// A missing expectation fails and names the file; a blessed one passes; blessing passed entries writes
/// nothing; the record contains the adapter and the settings.
#[test]
fn blessing_creates_expectations() {
    let Some(gpu) = gpu() else { return };
    let (folder, path) = suite_folder(&frames(&["one", "two.b"], ""));
    let expected = folder.path().join("suite/one.png");
    let mut report = run(gpu, &path);
    assert_eq!((report.exit_code(), report.count(Verdict::Failed)), (1, 2));
    let expected_name = expected.display().to_string();
    assert_verdict(&report, "one", Verdict::Failed, &[&expected_name, "no expected picture"]);
    assert!(!expected.exists(), "only blessing writes expectations");
    report.bless().expect("written");
    assert_eq!((report.exit_code(), report.count(Verdict::Blessed)), (0, 2));

    let record_path = folder.path().join("suite/blessed.toml");
    let record: toml::Table = fs::read_to_string(&record_path).unwrap().parse().expect("TOML");
    let one = &record["one"];
    assert_eq!(one["adapter"].as_str(), Some(gpu.device.adapter_info().name.as_str()));
    assert_eq!(one["limpid"].as_str(), Some(env!("CARGO_PKG_VERSION")));
    assert!(one["driver"].is_str() && one["camera"].is_str());
    assert_eq!(one["refract"]["solver"].as_str(), Some("guarded"));
    assert!(record.contains_key("two.b"));

    // Now one entry fails, and only its picture is written.
    let other = folder.path().join("suite/two.b.png");
    write_png(&other, &RgbImage::new(64, 48)).unwrap();
    let before = (fs::read(&expected).unwrap(), fs::metadata(&expected).unwrap().modified().ok());
    let mut report = run(gpu, &path);
    assert_verdict(&report, "one", Verdict::Passed, &[]);
    assert_verdict(&report, "two.b", Verdict::Failed, &["mean FLIP"]);
    report.bless().expect("written");
    let after = (fs::read(&expected).unwrap(), fs::metadata(&expected).unwrap().modified().ok());
    assert!(before == after, "the picture of a passed entry was written");
    let report = run(gpu, &path);
    assert_eq!((report.exit_code(), report.count(Verdict::Passed)), (0, 2));
    assert!(report.outcomes.iter().all(|outcome| outcome.blessing.is_empty()));
}

/// A picture shifted by a pixel, off in a channel, noisy, or wrong at one pixel fails by the measure for
/// that fault; pictures that cannot be compared are errors, of which the first gives the exit code;
/// blessing repairs all of them.
#[test]
fn wrong_pictures_fail() {
    let Some(gpu) = gpu() else { return };
    let names =
        ["same", "shifted", "channel", "hot", "noise", "size", "damaged", "text", "transparent"];
    let (folder, path) = suite_folder(&frames(&names, ""));
    bless(gpu, &path);
    let file = |name: &str| folder.path().join(format!("suite/{name}.png"));
    let good = load_picture(&file("same")).expect("a picture");
    let change = |name: &str, change: &dyn Fn(u32, u32, Rgb<u8>) -> Rgb<u8>| {
        let picture = RgbImage::from_fn(64, 48, |x, y| change(x, y, *good.get_pixel(x, y)));
        write_png(&file(name), &picture).unwrap();
    };
    change("shifted", &|x, y, _| *good.get_pixel(x.saturating_sub(1), y));
    change("channel", &|_, _, Rgb([r, g, b])| Rgb([r.saturating_add(8), g, b]));
    change("hot", &|x, y, pixel| if (x, y) == (5, 40) { Rgb([255, 0, 255]) } else { pixel });
    let random = |x: u32, y: u32| (x * 7919 + y * 104_729).wrapping_mul(2_654_435_761) >> 28;
    change("noise", &|x, y, pixel| {
        Rgb(pixel.0.map(|c| c.saturating_add(random(x, y) as u8).saturating_sub(8)))
    });
    write_png(&file("size"), &RgbImage::new(32, 24)).unwrap();
    let mut bytes = fs::read(file("damaged")).unwrap();
    bytes.truncate(bytes.len() / 2);
    fs::write(file("damaged"), bytes).unwrap();
    fs::write(file("text"), "no picture").unwrap();
    image::RgbaImage::new(64, 48).save(file("transparent")).unwrap();

    let mut report = run(gpu, &path);
    assert_verdict(&report, "same", Verdict::Passed, &[]);
    assert_verdict(&report, "shifted", Verdict::Failed, &["mean FLIP", "at most 0.01"]);
    assert_verdict(&report, "channel", Verdict::Failed, &["mean FLIP"]);
    assert_verdict(&report, "noise", Verdict::Failed, &["mean FLIP"]);
    assert_verdict(&report, "hot", Verdict::Failed, &["greatest channel error", "at most 40"]);
    let (_, hot) = verdict(&report, "hot");
    assert!(!hot.contains("mean FLIP"), "one pixel in 3072 shows in the mean: {hot}");
    assert_verdict(&report, "size", Verdict::Error, &["size.png", "32x24", "64x48"]);
    assert_verdict(&report, "damaged", Verdict::Error, &["damaged.png: byte "]);
    assert_verdict(&report, "text", Verdict::Error, &["text.png: not a PNG"]);
    assert_verdict(&report, "transparent", Verdict::Error, &["transparent at pixel"]);
    // The exit code is that of the first error, the size.
    assert_eq!(report.exit_code(), 3);
    assert_eq!(run_some(gpu, &path, &["damaged"]).exit_code(), 4);
    assert_eq!(run_some(gpu, &path, &["hot", "same"]).exit_code(), 1);

    // A file that is not a picture is not replaced, and then no other file is.
    let before = fs::read(file("hot")).unwrap();
    let error = report.bless().expect_err("a text in a picture's place").to_string();
    assert!(error.contains("text.png: this file is not a picture"), "{error}");
    assert_eq!(fs::read(file("text")).unwrap(), b"no picture");
    assert!(fs::read(file("hot")).unwrap() == before);
    fs::remove_file(file("text")).unwrap();
    report.bless().expect("written");
    assert_eq!(report.exit_code(), 0);
    assert_eq!(run(gpu, &path).count(Verdict::Passed), names.len());
}

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

/// A frame or time that the input does not have, within the sequence or beyond its end, is an error that
/// names it; no other frame is drawn in its place.
#[test]
fn missing_frames_are_errors() {
    let Some(gpu) = gpu() else { return };
    let mut suite = String::new();
    for (name, key) in [
        ("there", "frame = 3"),
        ("between", "at = 3.5"),
        ("lost", "frame = 4"),
        ("after", "frame = 7"),
        ("beyond", "at = 5.5"),
    ] {
        let _ = write!(
            suite,
            "[[frame]]\nname = \"{name}\"\ninput = \"f_{{}}.xyz\"\nradius = 0.1\n\
             size = [32, 24]\n{key}\n"
        );
    }
    let (folder, path) = suite_folder(&suite);
    for number in [2, 3, 5] {
        fs::write(folder.path().join(format!("f_{number}.xyz")), "0 0 0\n0.1 0 0\n").unwrap();
    }
    let report = run(gpu, &path);
    assert_verdict(&report, "there", Verdict::Failed, &["no expected picture"]);
    assert_verdict(&report, "between", Verdict::Failed, &["no expected picture"]);
    assert_verdict(&report, "lost", Verdict::Error, &["f_{}.xyz", "frame 4", "from 2 to 5"]);
    assert_verdict(&report, "after", Verdict::Error, &["frame 7"]);
    assert_verdict(&report, "beyond", Verdict::Error, &["5.5", "from 2 to 5"]);
}

/// Expectations in the results' folder with the names of results are neither removed as those of an
/// earlier run nor overwritten.
#[test]
fn results_do_not_replace_expectations() {
    let Some(gpu) = gpu() else { return };
    let entry = |name: &str, file: &str| {
        frames(&[name], &format!("expected = \"out/{file}\"\n"))
            .split_once("[[frame]]")
            .map(|(_, entry)| format!("[[frame]]{entry}"))
            .expect("an entry")
    };
    let suite = "size = [64, 48]\n".to_owned()
        + &entry("a", "a.expected.png")
        + &entry("b", "b.actual.png");
    let (folder, path) = suite_folder(&suite);
    bless(gpu, &path);
    let out = folder.path().join("out");
    let expected = [out.join("a.expected.png"), out.join("b.actual.png")];
    let bytes = || expected.each_ref().map(|path| fs::read(path).expect("it is still there"));
    let before = bytes();
    // By another path to the same folder.
    let report = run(gpu, &path);
    report.write(&folder.path().join("out/../out")).expect("written");
    assert!(bytes() == before);
    write_png(&expected[1], &RgbImage::new(64, 48)).unwrap();
    let before = bytes();
    let error = run(gpu, &path).write(&out).expect_err("a result in an expectation's place");
    assert!(error.to_string().contains("b.actual.png"), "{error}");
    assert!(bytes() == before);
}

/// If the device is lost, only the present entry is an error, and the next ones are drawn on another
/// device.
#[test]
fn a_lost_device_costs_one_entry() {
    let Some(gpu) = gpu() else { return };
    let (_folder, path) = suite_folder(&frames(&["one", "two", "three"], ""));
    bless(gpu, &path);
    let lost = Gpu::headless().expect("an adapter");
    lost.device.destroy();
    let report = run(&lost, &path);
    assert_verdict(&report, "one", Verdict::Error, &["the graphics device failed"]);
    assert_verdict(&report, "two", Verdict::Passed, &[]);
    assert_verdict(&report, "three", Verdict::Passed, &[]);
    assert_eq!(report.exit_code(), 6);
}

/// An error in a suite is refused before anything is drawn, with its line, the key and the nearest valid
/// one.
#[test]
fn errors_in_suites() {
    let frame = "[[frame]]\nname = \"a\"\ninput = \"b.toml\"\n";
    let cases: &[(&str, &[&str])] = &[
        ("", &["nothing to check", "[[frame]]"]),
        ("[tolerance]\nmean_flip = 0.1\n", &["nothing to check"]),
        ("[[frame]\n", &["line 1"]),
        ("[[fram]]\nname = 1\n", &["line 1", "`fram`", "did you mean `frame`?"]),
        ("FRAME\nimput = 1\n", &["line 5", "`imput`", "did you mean `input`?"]),
        ("FRAME\naov = { dept = {} }\n", &["`dept`", "did you mean `depth`?"]),
        ("FRAME\naov = { depth = { withn = 1 } }\n", &["`withn`", "did you mean `within`?"]),
        ("FRAME\ntolerance = { mean_flop = 1 }\n", &["did you mean `mean_flip`?"]),
        ("FRAME\nbake = { second = 1 }\n", &["did you mean `seconds`?"]),
        ("[tolerance]\nmean_flip = nan\nFRAME", &["[tolerance]", "mean_flip is NaN", "0 to 1"]),
        ("[tolerance]\nmean_flip = -0.1\nFRAME", &["mean_flip is -0.1"]),
        ("[tolerance]\np99_flip = 1.5\nFRAME", &["p99_flip is 1.5"]),
        ("[tolerance]\nmax_channel_error = -1\nFRAME", &["line 2", "-1"]),
        ("[tolerance]\nmax_channel_error = 256\nFRAME", &["line 2", "256"]),
        ("[tolerance]\ntemporal = 0.9\nFRAME", &["temporal is 0.9"]),
        ("[tolerance]\ntemporal = nan\nFRAME", &["temporal is NaN"]),
        ("FRAME\ntolerance = { p99_flip = nan }\n", &["`a`", "tolerance.p99_flip is NaN"]),
        ("FRAME\naov = { depth = { share = 2 } }\n", &["aov.depth.share is 2"]),
        ("FRAME\naov = { depth = { within = nan } }\n", &["aov.depth.within is NaN"]),
        ("FRAME\naov = { depth = { mean = -1 } }\n", &["aov.depth.mean is -1"]),
        ("FRAME\naov = { depth = { p99 = inf } }\n", &["aov.depth.p99 is inf"]),
        ("[[adapter]]\nname = \"\"\nFRAME", &["[[adapter]] name"]),
        ("[[adapter]]\nname = \"x\"\nmean_flip = nan\nFRAME", &["`x`", "mean_flip is NaN"]),
        ("FRAME\nbake = { seconds = -1 }\n", &["bake.seconds is -1"]),
        ("FRAME\nbake = { seconds = inf }\n", &["bake.seconds is inf"]),
        ("FRAME\nsize = [0, 10]\n", &["size", "0x10"]),
        ("FRAME\nframe = 1\nat = 2.5\n", &["one of frame and at"]),
        ("FRAME\nat = nan\n", &["at must be finite"]),
        ("FRAME\nframes = \"1-3\"\n", &["`frames` is a key of [[sequence]]"]),
        ("SEQUENCE\nframe = 1\n", &["`frame` is a key of [[frame]]"]),
        ("SEQUENCE\naov = {}\n", &["`aov` is a key of [[frame]]"]),
        ("SEQUENCE\nframes = \"3-\"\n", &["[[sequence]] `a`", "`3-`"]),
        ("SEQUENCE\nexpected = \"a.png\"\n", &["a.png", "####"]),
        ("FRAME\nFRAME", &["two entries are named `a`"]),
        ("FRAME\nSEQUENCE", &["two entries are named `a`"]),
        ("[[frame]]\nname = \"../a\"\ninput = \"b\"\n", &["letters"]),
        ("[[frame]]\nname = \"\"\ninput = \"b\"\n", &["letters"]),
        ("[[frame]]\nname = \"a\"\n", &["missing field `input`"]),
    ];
    for (text, parts) in cases {
        let text = text.replace("FRAME", frame);
        let text = text.replace("SEQUENCE", &frame.replace("frame", "sequence"));
        let error = Suite::parse(&text, "tests/suite.toml".as_ref()).expect_err(&text);
        assert_eq!(error.category(), Category::Request, "{error}");
        let message = error.to_string();
        assert!(message.starts_with("tests/suite.toml"), "{message}");
        for part in *parts {
            assert!(message.contains(part), "`{part}` is not in `{message}`:\n{text}");
        }
    }
    let missing = Suite::load("nowhere.toml".as_ref()).expect_err("no file");
    assert_eq!(missing.category(), Category::Data);
}

/// Precedence of tolerances: the entry's for the adapter, the entry's, the suite's for the adapter, the
/// suite's, the default.
#[test]
fn precedence_of_tolerances() {
    let suite = r#"
        [tolerance]
        mean_flip = 0.1
        p99_flip = 0.5
        [[adapter]]
        name = "LLVMpipe"
        mean_flip = 0.01
        temporal = 1.5
        [[adapter]]
        name = "Mesa 25"
        max_channel_error = 9
        [[frame]]
        name = "plain"
        input = "a.toml"
        [[frame]]
        name = "own"
        input = "a.toml"
        tolerance.mean_flip = 0.2
        [[frame.adapter]]
        name = "geforce"
        mean_flip = 0.3
    "#;
    let suite = Suite::parse(suite, "a.toml".as_ref()).expect("a suite");
    let tolerance = |entry: usize, name: &str, driver: &str| {
        let (name, driver) = (name.to_owned(), driver.to_owned());
        let adapter = Adapter { name, driver, backend: "vulkan".into() };
        suite.tolerance(&suite.entries[entry], &adapter)
    };
    let mesa = tolerance(0, "llvmpipe (LLVM 19.1.7, 256 bits)", "llvmpipe Mesa 25.0.7");
    assert_eq!((mesa.mean_flip, mesa.p99_flip, mesa.temporal), (0.01, 0.5, 1.5));
    assert_eq!(mesa.max_channel_error, 9);
    let other = tolerance(0, "NVIDIA GeForce RTX", "580");
    assert_eq!((other.mean_flip, other.max_channel_error, other.temporal), (0.1, 255, 1.1));
    assert_eq!(tolerance(1, "llvmpipe", "").mean_flip, 0.2);
    assert_eq!(tolerance(1, "NVIDIA GeForce RTX", "580").mean_flip, 0.3);
}

/// Runs `limpid check` in `folder`; returns exit code, stdout and stderr.
fn program(folder: &Path, args: &[&str]) -> (i32, String, String) {
    let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_limpid"));
    let output = command.current_dir(folder).arg("check").args(args).output().expect("it starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code().expect("not killed"), text(output.stdout), text(output.stderr))
}

/// `limpid check`: exit codes, printed text and result files. An unreadable input does not prevent the
/// other entries, the printed command blesses, and results of an earlier run are removed.
#[test]
fn command_line() {
    let Some(_) = gpu() else { return };
    let mut suite = frames(&["good", "bad"], "");
    suite += "[[frame]]\nname = \"gone\"\ninput = \"gone.bgeo\"\n";
    let (folder, _) = suite_folder(&suite);
    let folder = folder.path();
    let (code, out, err) = program(folder, &["suite.toml", "--junit", "ci.xml"]);
    assert_eq!((code, err.as_str()), (4, ""), "{out}");
    for part in ["FAILED  good", "FAILED  bad", "ERROR   gone", "gone.bgeo: cannot read"] {
        assert!(out.contains(part), "{part}: {out}");
    }
    assert!(out.contains("2 failed, 1 could not be compared in "), "{out}");
    assert!(out.contains("see limpid-check/index.html"), "{out}");
    let xml = fs::read_to_string(folder.join("ci.xml")).expect("a JUnit file");
    assert!(xml.contains("tests=\"3\" skipped=\"0\" failures=\"2\" errors=\"1\""), "{xml}");
    let result = |name: &str| folder.join("limpid-check").join(name);
    assert!(result("bad.actual.png").exists() && !result("bad.expected.png").exists());

    let (_, command) = out.split_once("to accept what was drawn: limpid check ").expect(&out);
    let command: Vec<_> = command.trim().split(' ').chain(["--filter", "good"]).collect();
    let (code, out, _) = program(folder, &command);
    assert_eq!(code, 0, "{out}");
    assert!(out.contains("1 blessed") && out.contains("wrote suite/good.png"), "{out}");
    let (code, out, _) = program(folder, &["suite.toml", "--filter", "good", "--filter", "bad"]);
    assert_eq!(code, 1, "{out}");
    assert!(out.contains("1 passed, 1 failed"), "{out}");
    assert!(!result("good.actual.png").exists(), "a result of the earlier run is left");

    fs::copy(folder.join("suite/good.png"), folder.join("suite/bad.png")).unwrap();
    write_png(&folder.join("suite/good.png"), &RgbImage::new(64, 48)).unwrap();
    let (code, out, _) = program(folder, &["suite.toml", "--json", "--out", "results"]);
    assert_eq!(code, 4, "{out}");
    let json: serde_json::Value = serde_json::from_str(&out).expect("JSON");
    let verdicts: Vec<_> =
        json["entries"].as_array().unwrap().iter().map(|e| e["verdict"].as_str()).collect();
    assert_eq!(verdicts, [Some("failed"), Some("passed"), Some("error")]);
    assert!(json["entries"][0]["measures"][0]["value"].as_f64().unwrap() > 0.1);
    for kind in ["expected", "actual", "difference", "side-by-side"] {
        assert!(folder.join(format!("results/good.{kind}.png")).exists(), "{kind}");
    }
    let page = fs::read_to_string(folder.join("results/index.html")).expect("a page");
    // Three pictures, and the element that enlarges them.
    assert_eq!(page.matches("src=\"data:").count(), 4);

    let (code, _, err) = program(folder, &["suite.toml", "--filter", "none"]);
    assert_eq!(code, 2);
    assert!(err.starts_with("limpid: suite.toml: no entry is named `none`"), "{err}");
    let (code, _, err) = program(folder, &["nowhere.toml"]);
    assert_eq!((code, err.contains("nowhere.toml: cannot read")), (4, true), "{err}");
    fs::write(folder.join("bad.toml"), "frames = 1").unwrap();
    let (code, _, err) = program(folder, &["bad.toml"]);
    assert_eq!((code, err.contains("line 1")), (2, true), "{err}");
}
