//! `render`: the pictures, their names, and the effect of settings and limits.

use std::collections::BTreeSet;
use std::fs;

use image::{Rgb, RgbImage};
use limpid::gpu::Gpu;
use serde_json::Value;

use super::{
    LIT, Outcome, SIZE, adapter, assert_contains, assert_names, assert_picture, bytes, dam, fail,
    folder, names, one_line, open, project, render, run_with, succeed,
};

/// `limpid render` without an input draws the demo.
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

/// A bare particle file is drawn in a default scene, to the given name.
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

/// A camera is in the axes of a file with z up, or in those that `--camera-up` says; the frame's line names the rule, and
/// a picture without liquid is remarked.
#[test]
fn cameras_are_in_the_axes_of_the_file() {
    if !adapter() {
        return;
    }
    let folder = folder();
    let path = folder.path();
    let rows: String =
        (0..512).map(|i| format!("{},{},{},1000\n", i % 8, i / 8 % 8, i / 64)).collect();
    fs::write(path.join("part.csv"), format!("x,y,z,Rhop\n{rows}")).unwrap();
    let draw = |camera: &str, more: &[&str], output: &str| {
        let args = ["render", "part.csv", SIZE, "--camera", camera, "-o", output];
        let Outcome { code, stderr, .. } = run_with(path, &[&args[..], more].concat(), &[]);
        assert_eq!(code, 0, "{stderr}");
        assert_contains(&stderr, &["z up (DualSPHysics)"]);
        stderr
    };
    let own = draw("eye=4,-14,9 target=4,4,3 fov_y=40", &[], "own.png");
    let world = draw("eye=4,9,14 target=4,3,-4 fov_y=40", &["--camera-up", "y"], "world.png");
    assert!(!own.contains("visible") && !world.contains("visible"), "{own}{world}");
    assert_eq!(bytes(&path.join("own.png")), bytes(&path.join("world.png")));
    let away = draw("eye=4,-14,9 target=4,-40,3 height=9", &[], "away.png");
    assert_contains(
        &away,
        &["no liquid is visible", "around 3.5,3.5,3.5 m, 7 x 7 x 7 m large, where z is up"],
    );
    assert_contains(&away, &["--camera-up"]);
}

/// Two runs of a pattern's frames, one into a folder and one to numbered names, give bit-identical
/// pictures, without a progress bar on a pipe.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
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

/// Without `-o`, several frames are written to numbered default names.
#[test]
fn default_names() {
    if !adapter() {
        return;
    }
    let project = project();
    render(project.path(), &["water", "--frames", "1,3"]);
    assert_names(project.path(), &["limpid_0001.png", "limpid_0003.png", "scenes", "water"]);
}

/// A scene's paths are relative to the scene, not to the working folder, and its frame is drawn unless
/// `--frames` selects others.
#[test]
fn render_a_scene() {
    if !adapter() {
        return;
    }
    let project = project();
    render(project.path(), &["scenes/block.toml", "-o", "a.png"]);
    render(project.path(), &["scenes/block.toml", "-o", "b.png", "--frames", "2"]);
    render(project.path(), &["scenes/block.toml", "-o", "c.png", "--frames", "3"]);
    // The same particles by file name, in the same scene.
    let radius = "--radius=0.025";
    let file = "water/block_2.xyz";
    render(project.path(), &[file, "--scene", "scenes/block.toml", radius, "-o", "d.png"]);
    let picture = |name: &str| bytes(&project.path().join(name));
    assert_picture(&project.path().join("a.png"));
    assert!(picture("a.png") == picture("b.png"), "frame 2 is the scene's");
    assert!(picture("a.png") != picture("c.png"), "frame 3 is another");
    assert!(picture("a.png") == picture("d.png"), "--scene draws other particles the same way");
}

/// `--samples` and `--set` change the picture.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
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

    // Another intersector finds the same interfaces: nearly the same picture.
    let marched = picture(&["--set", "refract.solver=march"]);
    let (comparison, _) = limpid_lab::compare::compare(&plain, &marched).unwrap();
    assert!(comparison.mean_flip < 0.03, "march differs by {}", comparison.mean_flip);

    // The processor of the classification does not show.
    let [on_device, on_cpu] =
        ["gpu", "cpu"].map(|on| picture(&["--set", &format!("classify.on={on}")]));
    let (comparison, _) = limpid_lab::compare::compare(&on_device, &on_cpu).unwrap();
    assert!(comparison.mean_flip < 5e-3, "the device differs by {}", comparison.mean_flip);

    let dark = picture(&["--set", "tonemap.exposure=-64", "--set", "refract.samples=2"]);
    assert!(dark.iter().all(|&value| value == 0), "an exposure of −64 stops is not black");
}

/// The shards of two machines are disjoint and complete, and have the same pixels as a single run: the
/// default scene of bare particles does not depend on the shard.
#[test]
fn shards_partition_the_frames() {
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
        assert!(picture(share) == picture("all"), "frame {frame} depends on the shard");
    }
}

/// A frame drawn alone is identical to that frame of a sequence.
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

/// Frames without particles or with one, as at the start of an emitter, and a picture of one pixel are
/// drawn.
#[test]
fn render_of_minimal_input() {
    if !adapter() {
        return;
    }
    let folder = folder();
    fs::write(folder.path().join("none.xyz"), "").unwrap();
    fs::write(folder.path().join("one.xyz"), "1 2 3\n").unwrap();
    render(folder.path(), &["none.xyz", "-o", "none.png"]);
    render(folder.path(), &["one.xyz", "--radius=0.1", "-o", "one.png"]);
    assert_picture(&folder.path().join("one.png"));
    succeed(folder.path(), &["render", "--quiet", "--size=1x1", "--samples=1", "-o", "small.png"]);
    assert_eq!(open(&folder.path().join("small.png")).dimensions(), (1, 1));
}

/// `--skip-existing` keeps the pictures of an equal run, and draws those that are missing, damaged, of
/// another size or of another program.
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
    // Truncated within the pixels: the header still has the right size.
    fs::write(path(2), &good[1][..good[1].len() / 2]).unwrap();
    RgbImage::new(32, 48).save(path(3)).unwrap();
    render(project.path(), &resume);
    assert!(written(1) == kept, "a complete picture was drawn again");
    assert!(bytes(&path(2)) == good[1], "a damaged picture was kept");
    assert!(bytes(&path(3)) == good[2], "a picture of another size was kept");

    RgbImage::from_pixel(64, 48, Rgb([1, 2, 3])).save(path(1)).unwrap();
    render(project.path(), &resume);
    assert!(bytes(&path(1)) == good[0], "a picture of another program was kept");
    // A run with nothing left to draw succeeds.
    render(project.path(), &resume);
}

/// `--stats` writes counts, adapter and pass times as JSON.
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

/// `--max-error` and `--budget` report the picked settings in one line on stderr and in the statistics. The cost
/// of settings is measured once, kept, and measured anew by `--calibrate` or where the file is damaged.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn limits_select_settings() {
    if !adapter() {
        return;
    }
    let project = project();
    let cache = project.path().join("cache");
    let variables = [("XDG_CACHE_HOME", cache.to_str().unwrap()), ("HOME", "")];
    // Mesa's own cache stays in place, or each run would compile its shaders.
    let mesa = std::env::var("HOME").map(|home| format!("{home}/.cache")).unwrap_or_default();
    let variables = [&variables[..], &[("MESA_SHADER_CACHE_DIR", &*mesa)]].concat();
    let draw = |limits: &[&str], calibrated: &str| {
        let stats = ["--stats", "stats.json", "-o", "picked_{}.png"];
        let render = ["render", SIZE, "scenes/block.toml", "--frames=1-2"];
        let args = [&render[..], limits, &stats[..]].concat();
        let Outcome { code, stdout, stderr } = run_with(project.path(), &args, &variables);
        assert_eq!((code, stdout.as_str()), (0, ""), "{stderr}");
        assert_contains(&stderr, &["limpid: picked refract.solver=", " px", calibrated]);
        assert_eq!(stderr.matches("limpid: picked").count(), 1, "{stderr}");
        let measures = calibrated == "calibrated in";
        assert_eq!(stderr.contains("limpid: measuring"), measures, "{stderr}");
        assert_picture(&project.path().join("picked_2.png"));
        serde_json::from_slice::<Value>(&bytes(&project.path().join("stats.json"))).unwrap()
    };
    let stats = draw(&["--max-error=1"], "calibrated in");
    assert!(stats["picked"]["error_px"].as_f64().is_some_and(|px| px <= 1.0), "{stats}");
    assert!(stats["picked"]["cost"].as_f64().is_some_and(|cost| cost > 0.0), "{stats}");
    assert!(stats["picked"].get("ms").is_none() && stats.get("budget").is_none(), "{stats}");
    assert!(stats["frames"][0].get("set").is_none(), "{stats}");
    let again = draw(&["--max-error=1"], "calibrated before");
    assert_eq!(again["picked"], stats["picked"], "one calibration, one choice");

    // A budget chooses from other settings, which have not been measured.
    let stats = draw(&["--budget=100000", "--max-error=0.1"], "calibrated in");
    assert!(stats["picked"]["ms"].as_f64().is_some_and(|ms| ms <= 1e5), "{stats}");
    assert_eq!(stats["budget"]["over"], 0, "{stats}");
    assert_eq!(stats["budget"]["ms"], 1e5, "{stats}");
    for frame in stats["frames"].as_array().expect("frames is a list") {
        assert_eq!(frame["set"], stats["picked"]["set"], "an ample budget changes nothing");
        assert!(frame["set"][0].as_str().is_some_and(|set| set.contains("solver")), "{stats}");
    }
    draw(&["--budget=100000", "--max-error=0.1"], "calibrated before");
    draw(&["--max-error=1"], "calibrated before");

    let name = names(&cache.join("limpid")).into_iter().find(|name| name.contains("calibration"));
    let file = cache.join("limpid").join(name.expect("a calibration is kept"));
    assert_contains(file.to_str().unwrap(), &["-64x48.toml"]);
    let whole = fs::read_to_string(&file).unwrap();
    assert_contains(&whole, &["--calibrate", "pictures = [", "intersectors = ["]);
    fs::write(&file, &whole[..whole.len() / 2]).unwrap();
    draw(&["--max-error=1"], "calibrated in");
    draw(&["--max-error=1"], "calibrated before");
    draw(&["--max-error=1", "--calibrate"], "calibrated in");

    // A budget that nothing keeps is an error that names the best; nothing is written.
    let args = ["render", "--quiet", SIZE, "scenes/block.toml", "--frames=1", "--budget=0.0001"];
    let args = [&args[..], &["-o", "no.png"]].concat();
    let line = one_line(&args, 2, run_with(project.path(), &args, &variables));
    assert_contains(&line, &["--budget 0.0001", "fastest settings take", "ms", "refract.solver="]);
    assert!(!project.path().join("no.png").exists());
}

/// Caustic settings from the command line are applied; one beyond the adapter's limits fails with code 5
/// and names the setting, and nothing is written.
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
    let max_buffer = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    if max_buffer < 8193 * 8193 * 48 {
        let large = ["render", SIZE, "lit.toml", "-o", "b.png", "--set", "caustics.grid=8192"];
        let line = fail(folder.path(), 5, &large);
        assert_contains(&line, &["caustics.grid = 8192", "MiB"]);
        assert_names(folder.path(), &["a.png", "lit.toml"]);
    }
}
