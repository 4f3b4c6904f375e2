//! Suites of frame tests: correct frames pass, wrong frames fail by the right measure; and limpid's own
//! golden frames.

mod golden;
mod images;
mod suites;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use image::{Rgb, RgbImage};
use limpid::gpu::Gpu;
use limpid_io::output::write_png;
use limpid_lab::check::{Report, Suite, Verdict};
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
