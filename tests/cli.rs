//! The program from outside, as scripts and render farms use it.
//!
//! Protects what they rely on: the files that are written and their names, what is printed and
//! where, one line per error, the exit codes, and that nothing half-written is ever left behind.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use image::{Rgb, RgbImage};
use limpid::gpu::Gpu;
use serde_json::Value;
use tempfile::TempDir;

/// Small pictures: what is tested here does not depend on the size.
const SIZE: &str = "--size=64x48";

/// What a run left behind.
struct Outcome {
    code: i32,
    stdout: String,
    stderr: String,
}

/// Runs the program in `folder`.
fn run(folder: &Path, args: &[&str]) -> Outcome {
    run_with(folder, args, &[])
}

fn run_with(folder: &Path, args: &[&str], variables: &[(&str, &str)]) -> Outcome {
    let mut command = assert_cmd::Command::new(env!("CARGO_BIN_EXE_limpid"));
    // One of Mesa's Vulkan layers complains on stderr where there is no desktop session.
    command.env("NODEVICE_SELECT", "1").envs(variables.iter().copied());
    let output = command.current_dir(folder).args(args).output().expect("the program starts");
    Outcome {
        code: output.status.code().expect("the program is not killed by a signal"),
        stdout: String::from_utf8(output.stdout).expect("stdout is UTF-8"),
        stderr: String::from_utf8(output.stderr).expect("stderr is UTF-8"),
    }
}

/// Runs what must succeed without a word on stderr, and returns stdout.
#[track_caller]
fn succeed(folder: &Path, args: &[&str]) -> String {
    let Outcome { code, stdout, stderr } = run(folder, args);
    assert_eq!((code, stderr.as_str()), (0, ""), "{args:?}");
    stdout
}

/// Runs `render`, which must succeed without a word, on a terminal or not.
#[track_caller]
fn render(folder: &Path, args: &[&str]) {
    let args: Vec<_> = ["render", SIZE].into_iter().chain(args.iter().copied()).collect();
    assert_eq!(succeed(folder, &args), "", "{args:?}: render prints nothing");
}

/// Runs what must fail with `code` and one line, and returns that line.
#[track_caller]
fn fail(folder: &Path, code: i32, args: &[&str]) -> String {
    one_line(args, code, run(folder, args))
}

#[track_caller]
fn one_line(args: &[&str], code: i32, outcome: Outcome) -> String {
    let Outcome { code: found, stdout, stderr } = outcome;
    assert_eq!(found, code, "{args:?}: {stderr}");
    assert_eq!(stdout, "", "{args:?}");
    let line = stderr.strip_suffix('\n').unwrap_or_else(|| panic!("{args:?}: no line: {stderr}"));
    assert!(!line.contains('\n'), "{args:?}: more than one line:\n{stderr}");
    assert!(line.starts_with("limpid: "), "{args:?}: {line}");
    // A cause that is told twice helps nobody.
    assert!(line.matches("os error").count() <= 1, "{args:?}: {line}");
    line.to_owned()
}

/// Fails unless `line` has all of `parts`.
#[track_caller]
fn assert_tells(line: &str, parts: &[&str]) {
    for part in parts {
        assert!(line.contains(part), "`{part}` is missing in: {line}");
    }
}

/// Whether pictures can be drawn here. Where they must be (`CI` or `LIMPID_REQUIRE_GPU=1`), a
/// missing adapter fails the test instead of skipping it.
fn adapter() -> bool {
    static FOUND: OnceLock<Result<(), String>> = OnceLock::new();
    let found = FOUND.get_or_init(|| Gpu::headless().map(|_| ()).map_err(|e| e.to_string()));
    let Err(problem) = found else { return true };
    let set = |name: &str, values: &[&str]| {
        std::env::var(name).is_ok_and(|value| values.contains(&value.as_str()))
    };
    let required = set("CI", &["1", "true"]) || set("LIMPID_REQUIRE_GPU", &["1", "true"]);
    assert!(!required, "this test must not be skipped here: {problem}");
    eprintln!("skipped: {problem}");
    false
}

/// A frame of the sequence that comes with limpid.
fn dam(frame: &str) -> String {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/double_dam_break");
    format!("{folder}/ParticleData_Fluid_{frame}.bgeo")
}

fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// Names of everything in a folder, hidden files included, so that temporary files show.
fn names(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).expect("the folder can be listed");
    entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
}

#[track_caller]
fn assert_names(folder: &Path, expected: &[&str]) {
    let expected: BTreeSet<String> = expected.iter().map(|&name| name.to_owned()).collect();
    assert_eq!(names(folder), expected);
}

/// A block of liquid at rest and one drop above it; the block is moved by `offset`.
fn write_water(path: &Path, offset: f32) {
    let mut text = String::new();
    for i in 0..12 * 5 * 8 {
        let [x, y, z] = [i % 12, i / 12 % 5, i / 60].map(|i| i as f32 * 0.05);
        writeln!(text, "{} {y} {z}", x + offset).unwrap();
    }
    writeln!(text, "0.3 0.6 0.2").unwrap();
    fs::write(path, text).unwrap();
}

const SCENE: &str = r#"
[particles]
source = "../water/block_{}.xyz"
frame = 2
radius = 0.025

[liquid]
ior = 1.33
absorption = [1.2, 0.35, 0.12]

[camera]
eye = [0.9, 0.8, 1.6]
target = [0.3, 0.2, 0.2]
fov_y = 35.0

[environment]
radiance = [0.55, 0.70, 0.90]

[[solid]]
shape = "plane"
origin = [0.0, -0.025, 0.0]
half_extent = 6.0
checker = { tile = 0.25, even = [0.85, 0.80, 0.70], odd = [0.15, 0.20, 0.30] }
"#;

/// A folder with `water/block_1.xyz` to `block_3.xyz` and `scenes/block.toml`, which names them.
fn project() -> TempDir {
    let folder = folder();
    for name in ["water", "scenes"] {
        fs::create_dir(folder.path().join(name)).unwrap();
    }
    for i in 1..=3 {
        write_water(&folder.path().join(format!("water/block_{i}.xyz")), 0.02 * i as f32);
    }
    fs::write(folder.path().join("scenes/block.toml"), SCENE).unwrap();
    folder
}

fn open(path: &Path) -> RgbImage {
    let picture = image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    picture.into_rgb8()
}

/// A picture of the right size that shows something.
#[track_caller]
fn assert_picture(path: &Path) {
    let picture = open(path);
    assert_eq!(picture.dimensions(), (64, 48), "{}", path.display());
    let colors: BTreeSet<_> = picture.pixels().map(|pixel| pixel.0).collect();
    assert!(colors.len() > 100, "{}: only {} colours", path.display(), colors.len());
}

fn bytes(path: &Path) -> Vec<u8> {
    fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

// ---------------------------------------------------------------------------------- render

/// The first thing a newcomer types.
#[test]
fn render_without_input_draws_the_demo() {
    if !adapter() {
        return;
    }
    let folder = folder();
    render(folder.path(), &["--samples", "1"]);
    assert_names(folder.path(), &["limpid.png"]);
    assert_picture(&folder.path().join("limpid.png"));
}

/// A bare particle file gets a scene, and a picture under the name that was asked for.
#[test]
fn render_one_file() {
    if !adapter() {
        return;
    }
    let folder = folder();
    render(folder.path(), &[&dam("20"), "-o", "frame.png"]);
    assert_names(folder.path(), &["frame.png"]);
    assert_picture(&folder.path().join("frame.png"));
}

/// Frames of a pattern, into a folder and under numbered names: the same pictures, bit by bit,
/// in one run and in another. The progress bar is silent when nobody watches.
#[test]
fn render_a_sequence_under_both_kinds_of_names() {
    if !adapter() {
        return;
    }
    let folder = folder();
    render(folder.path(), &[&dam("{}"), "--frames", "20-22", "-o", "frames/"]);
    render(folder.path(), &[&dam("{}"), "--frames", "20-22", "-o", "name_####.png"]);
    assert_names(
        &folder.path().join("frames"),
        &[20, 21, 22].map(frame_name).each_ref().map(String::as_str),
    );
    assert_names(folder.path(), &["frames", "name_0020.png", "name_0021.png", "name_0022.png"]);
    let mut different = BTreeSet::new();
    for frame in [20, 21, 22] {
        let one = folder.path().join("frames").join(frame_name(frame));
        let other = folder.path().join(format!("name_{frame:04}.png"));
        assert_picture(&one);
        assert!(bytes(&one) == bytes(&other), "two runs drew frame {frame} differently");
        different.insert(bytes(&one));
    }
    assert_eq!(different.len(), 3, "the frames differ from each other");
}

fn frame_name(frame: i64) -> String {
    format!("frame_{frame:04}.png")
}

/// Without -o, one frame is `limpid.png` and several are numbered.
#[test]
fn default_names() {
    if !adapter() {
        return;
    }
    let project = project();
    render(project.path(), &["water", "--frames", "1,3"]);
    assert_names(project.path(), &["limpid_0001.png", "limpid_0003.png", "scenes", "water"]);
}

/// A scene's paths are relative to the scene, wherever the program runs, and its frame is drawn
/// unless others are asked for.
#[test]
fn render_a_scene() {
    if !adapter() {
        return;
    }
    let project = project();
    render(project.path(), &["scenes/block.toml", "-o", "a.png"]);
    render(project.path(), &["scenes/block.toml", "-o", "b.png", "--frames", "2"]);
    render(project.path(), &["scenes/block.toml", "-o", "c.png", "--frames", "3"]);
    // The same particles by name, in the same scene.
    let radius = "--radius=0.025";
    let file = "water/block_2.xyz";
    render(project.path(), &[file, "--scene", "scenes/block.toml", radius, "-o", "d.png"]);
    let picture = |name: &str| bytes(&project.path().join(name));
    assert_picture(&project.path().join("a.png"));
    assert!(picture("a.png") == picture("b.png"), "frame 2 is the scene's");
    assert!(picture("a.png") != picture("c.png"), "frame 3 is another");
    assert!(picture("a.png") == picture("d.png"), "--scene draws other particles the same way");
}

/// --samples and --set reach the passes.
#[test]
fn settings_from_the_command_line() {
    if !adapter() {
        return;
    }
    let project = project();
    let picture = |args: &[&str]| {
        let args: Vec<_> =
            ["scenes/block.toml", "-o", "x.png"].into_iter().chain(args.iter().copied()).collect();
        render(project.path(), &args);
        open(&project.path().join("x.png"))
    };
    let plain = picture(&[]);
    let fine = picture(&["--samples", "4"]);
    assert!(plain != fine, "four samples differ from one");
    assert!(picture(&["--set", "refract.samples=4"]) == fine, "--samples is a setting");

    // Another way to the same interfaces: nearly the same picture.
    let marched = picture(&["--set", "refract.solver=march"]);
    let (comparison, _) = limpid::compare::compare(&plain, &marched).unwrap();
    assert!(comparison.mean_flip < 0.03, "march differs by {}", comparison.mean_flip);

    let dark = picture(&["--set", "tonemap.exposure=-64", "--set", "refract.samples=2"]);
    assert!(dark.iter().all(|&value| value == 0), "64 stops under is black");
}

/// The shares of two machines are disjoint, complete, and the same pixels as one machine's; a
/// scene that is made for bare particles must not depend on the share.
#[test]
fn shards_share_out_the_frames() {
    if !adapter() {
        return;
    }
    let project = project();
    for (output, shard) in [("all", "1/1"), ("one", "1/2"), ("two", "2/2")] {
        fs::create_dir(project.path().join(output)).unwrap();
        render(project.path(), &["water/block_{}.xyz", "-o", output, "--shard", shard]);
    }
    assert_names(&project.path().join("one"), &["frame_0001.png", "frame_0003.png"]);
    assert_names(&project.path().join("two"), &["frame_0002.png"]);
    for (share, frame) in [("one", 1), ("two", 2), ("one", 3)] {
        let picture = |folder: &str| bytes(&project.path().join(folder).join(frame_name(frame)));
        assert!(picture(share) == picture("all"), "frame {frame} depends on the share");
    }
}

/// A frame drawn alone is the frame as the sequence has it.
#[test]
fn frames_do_not_depend_on_each_other() {
    if !adapter() {
        return;
    }
    let project = project();
    render(project.path(), &["water/block_{}.xyz", "-o", "all_#.png"]);
    render(project.path(), &["water/block_{}.xyz", "-o", "alone.png", "--frames", "3"]);
    let picture = |name: &str| bytes(&project.path().join(name));
    assert!(picture("all_3.png") == picture("alone.png"));
}

/// The first frames of an emitter hold no particle or one, and are pictures too, of any size.
#[test]
fn render_next_to_nothing() {
    if !adapter() {
        return;
    }
    let folder = folder();
    fs::write(folder.path().join("none.xyz"), "").unwrap();
    fs::write(folder.path().join("one.xyz"), "1 2 3\n").unwrap();
    render(folder.path(), &["none.xyz", "-o", "none.png"]);
    render(folder.path(), &["one.xyz", "--radius=0.1", "-o", "one.png"]);
    assert_picture(&folder.path().join("one.png"));
    succeed(folder.path(), &["render", "--size=1x1", "--samples=1", "-o", "small.png"]);
    assert_eq!(open(&folder.path().join("small.png")).dimensions(), (1, 1));
}

/// --skip-existing resumes a sequence: it leaves alone what an equal run has drawn, and draws the
/// missing, the damaged, those of another size and those of other programs.
#[test]
fn skip_existing_resumes() {
    if !adapter() {
        return;
    }
    let project = project();
    let args = ["scenes/block.toml", "--frames", "1-3", "-o", "f_#.png"];
    let path = |frame: u32| project.path().join(format!("f_{frame}.png"));
    render(project.path(), &args);
    let good: Vec<_> = (1..=3).map(|frame| bytes(&path(frame))).collect();
    let resume: Vec<_> = args.into_iter().chain(["--skip-existing"]).collect();
    let written = |frame: u32| fs::metadata(path(frame)).unwrap().modified().unwrap();

    let kept = written(1);
    // Cut off in its pixels: the header still tells the right size.
    fs::write(path(2), &good[1][..good[1].len() / 2]).unwrap();
    RgbImage::new(32, 48).save(path(3)).unwrap();
    render(project.path(), &resume);
    assert!(written(1) == kept, "a whole picture was drawn again");
    assert!(bytes(&path(2)) == good[1], "a damaged picture was kept");
    assert!(bytes(&path(3)) == good[2], "a picture of another size was kept");

    RgbImage::from_pixel(64, 48, Rgb([1, 2, 3])).save(path(1)).unwrap();
    render(project.path(), &resume);
    assert!(bytes(&path(1)) == good[0], "a picture of another program was kept");
    // Nothing left to do is success too.
    render(project.path(), &resume);
}

/// --stats tells machine-readably what was drawn, with what, and how long each pass took.
#[test]
fn stats_name_the_adapter_and_every_pass() {
    if !adapter() {
        return;
    }
    let project = project();
    render(
        project.path(),
        &["scenes/block.toml", "--frames=1-2", "-o", "f_#.png", "--stats", "stats.json"],
    );
    let stats: Value = serde_json::from_slice(&bytes(&project.path().join("stats.json"))).unwrap();
    let gpu = Gpu::headless().unwrap();
    assert_eq!(stats["adapter"], gpu.adapter());
    let frames = stats["frames"].as_array().expect("frames is a list");
    assert_eq!(frames.len(), 2);
    for (number, frame) in (1..).zip(frames) {
        assert_eq!(frame["frame"], number);
        assert_eq!(frame["particles"], 481);
        assert_eq!(frame["splashes"], 1, "the drop");
        let passes = frame["passes"].as_array().expect("passes is a list");
        let names: Vec<_> = passes.iter().map(|pass| pass["name"].as_str().unwrap()).collect();
        if gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            for name in ["splat", "smooth", "refract", "tonemap"] {
                assert!(names.contains(&name), "{name} is missing in {names:?}");
            }
        }
        let times: Vec<_> = passes.iter().map(|pass| pass["ms"].as_f64().unwrap()).collect();
        assert!(times.iter().all(|&ms| ms >= 0.0), "{times:?}");
        let total = frame["total_ms"].as_f64().expect("total_ms is a number");
        assert!((total - times.iter().sum::<f64>()).abs() <= 1e-6 * total, "{total}: {times:?}");
    }
}

/// --max-error and --budget: what was picked is told on stderr, in one line, and in the stats.
#[test]
fn limits_pick_settings() {
    if !adapter() {
        return;
    }
    let project = project();
    let draw = |limit: &str| {
        let stats = ["--stats", "stats.json", "-o", "picked.png"];
        let args =
            [&["render", SIZE, "scenes/block.toml", "--frames=1", limit], &stats[..]].concat();
        let Outcome { code, stdout, stderr } = run(project.path(), &args);
        assert_eq!((code, stdout.as_str()), (0, ""), "{stderr}");
        assert_tells(&stderr, &["limpid: picked refract.solver=", " px"]);
        assert_eq!(stderr.lines().count(), 1, "{stderr}");
        assert_picture(&project.path().join("picked.png"));
        serde_json::from_slice::<Value>(&bytes(&project.path().join("stats.json"))).unwrap()
    };
    let stats = draw("--max-error=5");
    assert!(stats["picked"]["error_px"].as_f64().is_some_and(|px| px <= 5.0), "{stats}");
    assert_eq!(stats["picked"]["ms"], Value::Null);
    let stats = draw("--budget=100000");
    assert!(stats["picked"]["ms"].as_f64().is_some_and(|ms| ms <= 1e5), "{stats}");
    assert!(
        stats["picked"]["set"][0].as_str().is_some_and(|set| set.contains("solver")),
        "{stats}"
    );
}

/// --aov all: every channel that the documentation names, with values that make sense.
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
    let counts = ["solid_depth", "interfaces", "inside", "iterations", "failures"];
    expected.extend(counts.map(str::to_owned));
    assert_eq!(channels.keys().cloned().collect::<BTreeSet<_>>(), expected);

    for (name, values) in &channels {
        assert_eq!(values.len(), 64 * 48, "{name}");
        assert!(values.iter().all(|value| value.is_finite()), "{name} has a value without end");
        let may_be_zero = name == "failures";
        assert!(may_be_zero || values.iter().any(|&value| value != 0.0), "{name} is empty");
        let signed = name.contains("normal");
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
            // Fronts face the camera, which looks down −z; backs face away from it.
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
            "texel {i}: inside without a way in"
        );
    }
}

/// --aov takes a list, and writes no more than was asked for.
#[test]
fn aovs_can_be_chosen() {
    if !adapter() {
        return;
    }
    let project = project();
    // Frames of a sequence keep their numbers, whatever the pictures are called.
    let args = ["scenes/block.toml", "--frames=1-2", "-o", "take.####", "--aov", "inside,radiance"];
    render(project.path(), &args);
    let files =
        ["scenes", "take.0001", "take.0001.aov.exr", "take.0002", "take.0002.aov.exr", "water"];
    assert_names(project.path(), &files);
    let channels = channels(&project.path().join("take.0001.aov.exr"));
    let names: Vec<_> = channels.keys().map(String::as_str).collect();
    assert_eq!(names, ["inside", "radiance.B", "radiance.G", "radiance.R"]);
}

/// A block of liquid that lies on a lit floor under the midday sun, 0.5 m high.
const LIT: &str = r#"
[recipe]
kind = "slab"
min = [-1.0, 0.0, -1.0]
max = [1.0, 0.5, 1.0]
count = 4000
[liquid]
ior = 1.33
absorption = [1.0, 0.0, 0.0]
[camera]
eye = [0.0, 3.0, 3.0]
target = [0.0, 0.0, 0.0]
fov_y = 45.0
[[solid]]
shape = "plane"
origin = [0.0, 0.0, 0.0]
lit = true
[[light]]
sun = { direction = [0.0, -1.0, 0.0], irradiance = [2.0, 2.0, 4.0] }
[settings.caustics]
resolution = 48
grid = 96
"#;

/// --aov caustics: a part of its own for each light, of the map's size, whose values are those
/// under still water; and none for a scene without lights.
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
    // In the middle: what enters by a plane surface, less what 0.5 m absorb.
    let middle = |name: &str| {
        let rows = (16..32).flat_map(|y| (16..32).map(move |x| y * 48 + x));
        rows.map(|i| channels[name][i]).sum::<f32>() / 256.0
    };
    let entered = 1.0 - (0.33f32 / 2.33).powi(2);
    for (name, expected) in
        [("R", 2.0 * entered * (-0.5f32).exp()), ("G", 2.0 * entered), ("B", 4.0 * entered)]
    {
        let found = middle(&format!("irradiance.{name}"));
        assert!((found / expected - 1.0).abs() < 0.04, "{name}: {found}, not {expected}");
    }
    // A floor across the light is equally deep everywhere.
    let depths = &channels["receiver_depth"];
    let flat = depths.iter().all(|d| (d / depths[0] - 1.0).abs() < 1e-5);
    assert!(flat && depths[0] > 0.5, "{depths:?}");

    let dark = LIT.replace("lit = true", "");
    fs::write(folder.path().join("dark.toml"), dark).unwrap();
    render(folder.path(), &["dark.toml", "-o", "d.png", "--aov", "radiance,caustics"]);
    let image = read_all_flat_layers_from_file(folder.path().join("d.aov.exr")).expect("a file");
    assert_eq!(image.layer_data.len(), 1);
}

/// Settings of caustics from the command line reach the map; one that the adapter cannot hold is
/// code 5 and names the setting, and nothing is written.
#[test]
fn settings_of_caustics_from_the_command_line() {
    if !adapter() {
        return;
    }
    let folder = folder();
    fs::write(folder.path().join("lit.toml"), LIT).unwrap();
    render(folder.path(), &["lit.toml", "-o", "a.png", "--set", "caustics.method=gather"]);
    assert_picture(&folder.path().join("a.png"));
    let gpu = Gpu::headless().expect("an adapter");
    let limits = gpu.device.limits();
    let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    if most < 8193 * 8193 * 48 {
        let large = ["render", SIZE, "lit.toml", "-o", "b.png", "--set", "caustics.grid=8192"];
        let line = fail(folder.path(), 5, &large);
        assert_tells(&line, &["caustics.grid = 8192", "MiB"]);
        assert_names(folder.path(), &["a.png", "lit.toml"]);
    }
}

/// The channels of an `OpenEXR` file, by name.
fn channels(path: &Path) -> BTreeMap<String, Vec<f32>> {
    use exr::prelude::*;
    let image = read_first_flat_layer_from_file(path).expect("an OpenEXR file");
    let channels = image.layer_data.channel_data.list.into_iter();
    channels.map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect()
}

// --------------------------------------------------------------------------- info, compare

/// `info` as text tells what a person wants to know about a file.
#[test]
fn info_as_text() {
    let folder = folder();
    let text = succeed(folder.path(), &["info", &dam("{}")]);
    assert_tells(&text, &["5 frames", "5 to 40", "frame 5", "4732 particles"]);
    assert_tells(&text, &["velocity", "density", "id", "radius", "splashes"]);
    assert!(!text.contains("frame 20:"), "only the first frame is described: {text}");
    let text = succeed(folder.path(), &["info", &dam("{}"), "--frames", "20-21"]);
    assert_tells(&text, &["frame 20:", "frame 21:"]);
}

/// `info --json` tells the same to programs.
#[test]
fn info_as_json() {
    let project = project();
    let info = |args: &[&str]| -> Value {
        let args: Vec<_> = ["info", "--json"].into_iter().chain(args.iter().copied()).collect();
        serde_json::from_str(&succeed(project.path(), &args)).expect("JSON and nothing else")
    };
    let water = info(&["water"]);
    assert_eq!(water["frames"], 3);
    assert_eq!((&water["first"], &water["last"]), (&1.into(), &3.into()));
    let described = water["described"].as_array().unwrap();
    assert_eq!(described.len(), 1);
    let frame = &described[0];
    assert_eq!(frame["frame"], 1);
    assert_eq!(frame["particles"], 481);
    assert_eq!(frame["splashes"], 1);
    assert_eq!(frame["attributes"], Value::Array(Vec::new()));
    assert!(frame["path"].as_str().unwrap().ends_with("block_1.xyz"));
    let close = |value: &Value, expected: f64| {
        assert!((value.as_f64().unwrap() - expected).abs() < 1e-5, "{value}, not {expected}");
    };
    for (i, (min, max)) in [(0.02, 0.57), (0.0, 0.6), (0.0, 0.35)].into_iter().enumerate() {
        close(&frame["min"][i], min);
        close(&frame["max"][i], max);
    }
    close(&frame["radius"], 0.025);
    close(&info(&["water", "--radius", "0.03"])["described"][0]["radius"], 0.03);
    // A scene names particles too.
    let scene = info(&["scenes/block.toml", "--frames", "all"]);
    assert_eq!(scene["described"].as_array().unwrap().len(), 3);
    close(&scene["described"][2]["radius"], 0.025);
}

/// Two pictures of 32 × 24 pixels, one of 16 × 16, and two files that are no pictures.
fn pictures() -> TempDir {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    let picture = RgbImage::from_fn(32, 24, |x, y| Rgb([8 * x as u8, 10 * y as u8, 90]));
    picture.save(path("a.png")).unwrap();
    let mut other = picture;
    other.put_pixel(20, 11, Rgb([255, 255, 255]));
    other.save(path("b.png")).unwrap();
    RgbImage::new(16, 16).save(path("small.png")).unwrap();
    let whole = bytes(&path("a.png"));
    fs::write(path("cut.png"), &whole[..whole.len() / 2]).unwrap();
    fs::write(path("text.png"), "no picture").unwrap();
    folder
}

/// `compare` as text, and its answer as an exit code.
#[test]
fn compare_as_text() {
    let folder = pictures();
    let text = succeed(folder.path(), &["compare", "a.png", "b.png"]);
    assert_tells(&text, &["mean FLIP", "RMSE", "PSNR", "worst pixel (20, 11)", "[255, 255, 255]"]);
    let text = succeed(folder.path(), &["compare", "a.png", "a.png", "--max-flip", "0"]);
    assert_tells(&text, &["mean FLIP 0.0000", "identical"]);
    succeed(folder.path(), &["compare", "a.png", "b.png", "--max-flip", "0.9"]);

    // Too different is an answer, not an error: code 1, and the report on stdout.
    let outcome = run(folder.path(), &["compare", "a.png", "b.png", "--max-flip", "0.0001"]);
    assert_eq!((outcome.code, outcome.stderr.as_str()), (1, ""));
    assert_tells(&outcome.stdout, &["mean FLIP"]);
}

/// `compare --json` and --diff.
#[test]
fn compare_as_json_and_as_a_picture() {
    let folder = pictures();
    let json = |args: &[&str]| -> Value {
        let args: Vec<_> = ["compare", "--json"].into_iter().chain(args.iter().copied()).collect();
        serde_json::from_str(&succeed(folder.path(), &args)).expect("JSON and nothing else")
    };
    let differs = json(&["a.png", "b.png", "--diff", "diff.png"]);
    let flip = differs["mean_flip"].as_f64().unwrap();
    assert!(flip > 0.0 && flip < 0.2, "{flip}");
    assert!(differs["rmse"].as_f64().unwrap() > 0.0);
    assert!(differs["psnr_db"].as_f64().unwrap() > 10.0);
    assert_eq!(differs["worst"]["x"], 20);
    assert_eq!(differs["worst"]["y"], 11);
    let same = json(&["a.png", "a.png", "--diff", "same.png"]);
    assert_eq!(same["mean_flip"], 0.0);
    assert_eq!(same["psnr_db"], Value::Null);

    let diff = open(&folder.path().join("diff.png"));
    assert_eq!(diff.dimensions(), (32, 24));
    let brightness = |x, y| diff.get_pixel(x, y).0.iter().map(|&c| u32::from(c)).sum::<u32>();
    assert!(brightness(20, 11) > 200 + brightness(2, 2), "the difference shows where it is");
    let same = open(&folder.path().join("same.png"));
    assert!(
        same.pixels().all(|pixel| pixel == same.get_pixel(0, 0)),
        "no difference is one colour"
    );
}

// ------------------------------------------------------------------------------ exit codes

/// Code 2: a slip on the command line costs one line, which says what was expected, and no
/// adapter is opened for it.
#[test]
fn usage_errors() {
    let folder = folder();
    let fail = |parts: &[&str], args: &[&str]| assert_tells(&fail(folder.path(), 2, args), parts);
    for size in ["64", "64x", "0x48", "64x-1", "64x48x3", "widexhigh"] {
        fail(&["--size", "WIDTHxHEIGHT"], &["render", "--size", size]);
    }
    for frames in ["5-1:x", "1-", "a", "1-10:0", ","] {
        fail(&["frames"], &["render", "--frames", frames]);
    }
    for shard in ["3/2", "0/2", "1/0", "half", "1"] {
        fail(&["shard"], &["render", "--shard", shard]);
    }
    fail(&["depht", "smooth_depth"], &["render", "--aov", "depht"]);
    fail(&["--bogus"], &["render", "--bogus"]);
    fail(&["rendr", "render"], &["rendr"]);
    fail(&["required", "<TEST>"], &["compare", "only_one.png"]);
    for radius in ["0", "nan", "inf", "wide"] {
        fail(&["radius"], &["render", "--radius", radius]);
        fail(&["radius"], &["info", &dam("20"), "--radius", radius]);
    }
    for limit in ["0", "-1", "nan", "small"] {
        fail(&["--max-error", "above 0"], &["render", &format!("--max-error={limit}")]);
        fail(&["--budget", "above 0"], &["render", &format!("--budget={limit}")]);
    }
    // The least that can be had is told.
    fail(
        &["--max-error 0.000001", "least", "refract.solver="],
        &["render", "--max-error=0.000001"],
    );
    // Machines that share frames must not pick each for itself.
    fail(&["--budget", "--shard"], &["render", "--budget=5", "--shard=1/2"]);
    fail(&["--budget", "--skip-existing"], &["render", "--budget=5", "--skip-existing"]);
    fail(&["elisions"], &["report", "--kinds=pases"]);
    fail(&["--curve", "--passes"], &["report", "--curve=c.toml", "--passes"]);
    fail(&["--max-flip"], &["compare", "a.png", "b.png", "--max-flip", "nan"]);
    assert_names(folder.path(), &[]);
}

/// Code 2: settings name the key, the nearest right one, and the range.
#[test]
fn bad_settings() {
    let folder = folder();
    let set = |setting: &str| fail(folder.path(), 2, &["render", "--set", setting]);
    assert_tells(&set("refract.sovler=march"), &["`sovler`", "did you mean `solver`"]);
    assert_tells(&set("refrct.solver=march"), &["`refrct`", "did you mean `refract`"]);
    assert_tells(&set("refract.solver=marsh"), &["`marsh`", "did you mean `march`"]);
    assert_tells(&set("refract.samples=many"), &["refract.samples=many"]);
    assert_tells(&set("refract.samples=65"), &["refract.samples", "65", "1 to 64"]);
    assert_tells(&set("smooth.taps=4"), &["smooth.taps", "odd"]);
    assert_tells(&set("caustics.methd=gather"), &["`methd`", "did you mean `method`"]);
    assert_tells(&set("caustics.grid=9000"), &["caustics.grid", "8 to 8192"]);
    assert_tells(&set("refract"), &["pass.name=value"]);
    let samples = fail(folder.path(), 2, &["render", "--samples", "0"]);
    assert_tells(&samples, &["refract.samples", "1 to 64"]);
    assert_names(folder.path(), &[]);
}

/// Code 2: several frames cannot have one name. The message tells what to write.
#[test]
fn several_frames_need_several_names() {
    let project = project();
    let line = fail(project.path(), 2, &["render", "water", "-o", "one.png"]);
    assert_tells(&line, &["3 frames", "one.png", "####"]);
}

/// Code 2: a mistake in a scene file names the file, the line and the nearest key.
#[test]
fn scene_errors() {
    let project = project();
    let text = SCENE.replace("fov_y = 35.0", "fovy = 35.0");
    fs::write(project.path().join("scenes/block.toml"), &text).unwrap();
    let line = fail(project.path(), 2, &["render", "scenes/block.toml"]);
    let number = 1 + text.lines().position(|line| line.starts_with("fovy")).unwrap();
    let parts = ["scenes/block.toml", &format!("line {number}:"), "`fovy`", "did you mean `fov_y`"];
    assert_tells(&line, &parts);
}

/// Code 3: a file of a kind that limpid does not read, and pictures that cannot be compared.
#[test]
fn mismatches() {
    let folder = pictures();
    let fail = |parts: &[&str], args: &[&str]| assert_tells(&fail(folder.path(), 3, args), parts);
    fail(&["a.png", ".bgeo"], &["render", "a.png"]);
    fail(&["a.png", ".bgeo"], &["info", "a.png"]);
    fs::copy(folder.path().join("a.png"), folder.path().join("liar.bgeo")).unwrap();
    fail(&["liar.bgeo"], &["render", "liar.bgeo"]);
    fail(&["a.png", "small.png", "32x24", "16x16"], &["compare", "a.png", "small.png"]);
    fail(&["text.png", "PNG"], &["compare", "a.png", "text.png"]);
}

/// Code 4: what is not there, or not whole.
#[test]
fn missing_and_damaged_files() {
    let folder = pictures();
    let whole = bytes(Path::new(&dam("20")));
    fs::write(folder.path().join("cut.bgeo"), &whole[..whole.len() / 2]).unwrap();
    let before = names(folder.path());
    let fail = |parts: &[&str], args: &[&str]| assert_tells(&fail(folder.path(), 4, args), parts);
    fail(&["none.bgeo", "No such file"], &["render", "none.bgeo"]);
    fail(&["none.toml"], &["render", "none.toml"]);
    fail(&["none.toml"], &["render", "--scene", "none.toml"]);
    fail(&["none_{}.bgeo"], &["render", "none_{}.bgeo"]);
    fail(&["none.bgeo"], &["info", "none.bgeo"]);
    fail(&["none.png"], &["compare", "a.png", "none.png"]);
    fail(&["cut.png"], &["compare", "a.png", "cut.png"]);
    fail(&["cut.bgeo", "byte"], &["render", "cut.bgeo"]);
    fail(&["cut.bgeo", "byte"], &["info", "cut.bgeo"]);
    fail(&["23", "missing"], &["render", &dam("{}"), "--frames", "20-23"]);
    assert_eq!(names(folder.path()), before, "a failed run leaves nothing");
}

/// Code 4: a frame that cannot be read stops the sequence after those before it, all of which are
/// whole, and leaves nothing under its own name.
#[test]
fn a_damaged_frame_leaves_the_others_whole() {
    if !adapter() {
        return;
    }
    let project = project();
    fs::write(project.path().join("water/block_3.xyz"), "0 0 0\n0 0\n").unwrap();
    let args = ["render", SIZE, "water", "-o", "f_#.png"];
    let line = fail(project.path(), 4, &args);
    assert_tells(&line, &["block_3.xyz", "line 2"]);
    assert_names(project.path(), &["f_1.png", "f_2.png", "scenes", "water"]);
    assert_picture(&project.path().join("f_1.png"));
    assert_picture(&project.path().join("f_2.png"));
}

/// Code 4: what cannot be written is named, and no temporary file is left.
#[test]
fn unwritable_outputs() {
    let folder = pictures();
    let before = names(folder.path());
    let args = ["compare", "a.png", "b.png", "--diff", "a.png/diff.png"];
    assert_tells(&fail(folder.path(), 4, &args), &["a.png/diff.png", "write"]);
    if adapter() {
        // A file is no folder, for root either.
        let args = ["render", SIZE, "--samples=1", "-o", "a.png/frame.png"];
        assert_tells(&fail(folder.path(), 4, &args), &["a.png/frame.png", "write"]);
        // A name that is taken by a folder.
        fs::create_dir(folder.path().join("stats")).unwrap();
        let args = ["render", SIZE, "--samples=1", "-o", "stats/x.png", "--stats", "stats"];
        assert_tells(&fail(folder.path(), 4, &args), &["stats", "write"]);
        assert_names(&folder.path().join("stats"), &["x.png"]);
        fs::remove_dir_all(folder.path().join("stats")).unwrap();
    }
    assert_eq!(names(folder.path()), before);
}

/// Code 5: no adapter is one line that says what to install.
#[test]
fn no_adapter() {
    let folder = folder();
    let nowhere = [
        ("VK_ICD_FILENAMES", "/nonexistent"),
        ("VK_DRIVER_FILES", "/nonexistent"),
        ("WGPU_BACKEND", "vulkan"),
    ];
    let args = ["render", SIZE];
    let line = one_line(&args, 5, run_with(folder.path(), &args, &nowhere));
    assert_tells(&line, &["adapter", "install", "Vulkan", "mesa-vulkan-drivers"]);
    assert_names(folder.path(), &[]);
}

/// Help goes to stdout and is no error; without a command it is one, and says where help is.
#[test]
fn help() {
    let folder = folder();
    let text = succeed(folder.path(), &["--help"]);
    assert_tells(&text, &["render", "info", "compare", "Exit codes"]);
    let text = succeed(folder.path(), &["render", "--help"]);
    assert_tells(&text, &["--frames", "--shard", "--skip-existing", "--aov", "--stats", "--set"]);
    assert_tells(&text, &["--max-error", "--budget"]);
    let version = succeed(folder.path(), &["--version"]);
    assert_eq!(version.trim(), concat!("limpid ", env!("CARGO_PKG_VERSION")));
    assert_eq!(run(folder.path(), &[]).code, 2);
}

/// Protects a build without the window: `limpid view` says what is missing, and how to get it.
#[cfg(not(feature = "viewer"))]
#[test]
fn view_without_its_feature_is_an_error_that_names_it() {
    let folder = TempDir::new().expect("a folder");
    let line = fail(folder.path(), 2, &["view", "scene.toml"]);
    assert!(line.contains("--features viewer"), "{line}");
}
