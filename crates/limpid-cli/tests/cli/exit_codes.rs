//! Exit codes, the error line with problem and remedy, and the help.

use std::fs;
use std::path::Path;

#[cfg(not(feature = "viewer"))]
use tempfile::TempDir;

use super::{
    SCENE, SIZE, adapter, assert_contains, assert_names, assert_picture, bytes, dam, fail, folder,
    names, one_line, pictures, project, run, run_with, succeed,
};

/// Code 2: an invalid argument is reported in one line with the expected form, before an adapter is
/// opened.
#[test]
fn usage_errors() {
    let folder = folder();
    let fail =
        |parts: &[&str], args: &[&str]| assert_contains(&fail(folder.path(), 2, args), parts);
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
    // The least possible error is reported.
    fail(
        &["--max-error 0.000001", "least", "refract.solver="],
        &["render", "--max-error=0.000001"],
    );
    // Machines that share frames must use the same settings.
    fail(&["--budget", "--shard"], &["render", "--budget=5", "--shard=1/2"]);
    fail(&["--budget", "--skip-existing"], &["render", "--budget=5", "--skip-existing"]);
    fail(&["--max-error", "--shard"], &["render", "--max-error=5", "--shard=1/2"]);
    fail(&["--calibrate", "--max-error", "--budget"], &["render", "--calibrate"]);
    fail(&["elisions"], &["report", "--kinds=pases"]);
    fail(&["--curve", "--passes"], &["report", "--curve=c.toml", "--passes"]);
    fail(&["--max-flip"], &["compare", "a.png", "b.png", "--max-flip", "nan"]);
    assert_names(folder.path(), &[]);
}

/// Code 2: errors in settings name the key, the nearest valid one, and the range.
#[test]
fn bad_settings() {
    let folder = folder();
    let set = |setting: &str| fail(folder.path(), 2, &["render", "--set", setting]);
    assert_contains(&set("refract.sovler=march"), &["`sovler`", "did you mean `solver`"]);
    assert_contains(&set("refrct.solver=march"), &["`refrct`", "did you mean `refract`"]);
    assert_contains(&set("refract.solver=marsh"), &["`marsh`", "did you mean `march`"]);
    assert_contains(&set("refract.samples=many"), &["refract.samples=many"]);
    assert_contains(&set("refract.samples=65"), &["refract.samples", "65", "1 to 64"]);
    assert_contains(&set("smooth.taps=4"), &["smooth.taps", "odd"]);
    assert_contains(&set("caustics.methd=gather"), &["`methd`", "did you mean `method`"]);
    assert_contains(&set("caustics.grid=9000"), &["caustics.grid", "8 to 8192"]);
    assert_contains(&set("refract"), &["pass.name=value"]);
    let samples = fail(folder.path(), 2, &["render", "--samples", "0"]);
    assert_contains(&samples, &["refract.samples", "1 to 64"]);
    assert_names(folder.path(), &[]);
}

/// Code 2: several frames need a name with a placeholder, which the message shows.
#[test]
fn several_frames_need_numbered_names() {
    let project = project();
    let line = fail(project.path(), 2, &["render", "water", "-o", "one.png"]);
    assert_contains(&line, &["3 frames", "one.png", "####"]);
}

/// Code 2: an error in a scene file names the file, the line and the nearest key.
#[test]
fn scene_errors() {
    let project = project();
    let text = SCENE.replace("fov_y = 35.0", "fovy = 35.0");
    fs::write(project.path().join("scenes/block.toml"), &text).unwrap();
    let line = fail(project.path(), 2, &["render", "scenes/block.toml"]);
    let number = 1 + text.lines().position(|line| line.starts_with("fovy")).unwrap();
    let parts = ["scenes/block.toml", &format!("line {number}:"), "`fovy`", "did you mean `fov_y`"];
    assert_contains(&line, &parts);
}

/// Code 3: files of an unsupported format, and pictures that cannot be compared.
#[test]
fn mismatches() {
    let folder = pictures();
    let fail =
        |parts: &[&str], args: &[&str]| assert_contains(&fail(folder.path(), 3, args), parts);
    fail(&["a.png", ".bgeo"], &["render", "a.png"]);
    fail(&["a.png", ".bgeo"], &["info", "a.png"]);
    fs::copy(folder.path().join("a.png"), folder.path().join("picture.bgeo")).unwrap();
    fail(&["picture.bgeo"], &["render", "picture.bgeo"]);
    fail(&["a.png", "small.png", "32x24", "16x16"], &["compare", "a.png", "small.png"]);
    fail(&["text.png", "PNG"], &["compare", "a.png", "text.png"]);
}

/// Code 4: missing and damaged files.
#[test]
fn missing_and_damaged_files() {
    let folder = pictures();
    let whole = bytes(Path::new(&dam("20")));
    fs::write(folder.path().join("cut.bgeo"), &whole[..whole.len() / 2]).unwrap();
    let before = names(folder.path());
    let fail =
        |parts: &[&str], args: &[&str]| assert_contains(&fail(folder.path(), 4, args), parts);
    fail(&["none.bgeo", "No such file"], &["render", "none.bgeo"]);
    fail(&["none.toml"], &["render", "none.toml"]);
    fail(&["none.toml"], &["render", "--scene", "none.toml"]);
    fail(&["none_{}.bgeo"], &["render", "none_{}.bgeo"]);
    fail(&["none.bgeo"], &["info", "none.bgeo"]);
    fail(&["none.png"], &["compare", "a.png", "none.png"]);
    fail(&["cut.png"], &["compare", "a.png", "cut.png"]);
    fail(&["none.json", "No such file"], &["report", "--against", "none.json"]);
    fail(&["cut.bgeo", "byte"], &["render", "cut.bgeo"]);
    fail(&["cut.bgeo", "byte"], &["info", "cut.bgeo"]);
    fail(&["23", "missing"], &["render", &dam("{}"), "--frames", "20-23"]);
    assert_eq!(names(folder.path()), before, "a failed run has left a file");
}

/// Code 4: an unreadable frame ends the sequence; the previous frames are complete, and the frame itself
/// leaves no file.
#[test]
fn a_damaged_frame_keeps_the_previous_pictures() {
    if !adapter() {
        return;
    }
    let project = project();
    fs::write(project.path().join("water/block_3.xyz"), "0 0 0\n0 0\n").unwrap();
    let args = ["render", SIZE, "water", "-o", "f_#.png"];
    let line = fail(project.path(), 4, &args);
    assert_contains(&line, &["block_3.xyz", "line 2"]);
    assert_names(project.path(), &["f_1.png", "f_2.png", "scenes", "water"]);
    assert_picture(&project.path().join("f_1.png"));
    assert_picture(&project.path().join("f_2.png"));
}

/// Code 4: an output that cannot be written is named, and no temporary file is left.
#[test]
fn unwritable_outputs() {
    let folder = pictures();
    let before = names(folder.path());
    let args = ["compare", "a.png", "b.png", "--diff", "a.png/diff.png"];
    assert_contains(&fail(folder.path(), 4, &args), &["a.png/diff.png", "write"]);
    if adapter() {
        // A file in place of a folder, which fails for root too.
        let args = ["render", SIZE, "--samples=1", "-o", "a.png/frame.png"];
        assert_contains(&fail(folder.path(), 4, &args), &["a.png/frame.png", "write"]);
        // A folder with the name of the output.
        fs::create_dir(folder.path().join("stats")).unwrap();
        let args = ["render", SIZE, "--samples=1", "-o", "stats/x.png", "--stats", "stats"];
        assert_contains(&fail(folder.path(), 4, &args), &["stats", "write"]);
        // Reported before anything is drawn.
        assert_names(&folder.path().join("stats"), &[]);
        fs::remove_dir_all(folder.path().join("stats")).unwrap();
    }
    assert_eq!(names(folder.path()), before);
}

/// Code 5: without an adapter, one line names the driver to install.
#[test]
fn no_adapter() {
    let folder = folder();
    let variables = [
        ("VK_ICD_FILENAMES", "/nonexistent"),
        ("VK_DRIVER_FILES", "/nonexistent"),
        ("WGPU_BACKEND", "vulkan"),
    ];
    let args = ["render", SIZE];
    let line = one_line(&args, 5, run_with(folder.path(), &args, &variables));
    // With OpenGL there are adapters, but the variable excludes them.
    let parts = if line.contains("there are:") {
        ["no graphics adapter fits WGPU_BACKEND=vulkan", ""]
    } else {
        ["adapter found: install a Vulkan driver", "mesa-vulkan-drivers"]
    };
    assert_contains(&line, &parts);
    assert_names(folder.path(), &[]);
}

/// If variables select no existing adapter, the message lists the adapters and suggests no driver.
#[test]
fn no_matching_adapter() {
    if !adapter() {
        return;
    }
    let folder = folder();
    let args = ["render", "--quiet", SIZE];
    for (name, value) in [("WGPU_ADAPTER_NAME", "no such card"), ("WGPU_BACKEND", "vulcan")] {
        let line = one_line(&args, 5, run_with(folder.path(), &args, &[(name, value)]));
        assert_contains(&line, &[&format!("adapter fits {name}={value}; there are: ")]);
        assert!(!line.contains("install"), "{line}");
    }
}

/// `--help` prints to stdout and succeeds; without a command it is a usage error.
#[test]
fn help() {
    let folder = folder();
    let text = succeed(folder.path(), &["--help"]);
    assert_contains(&text, &["render", "info", "compare", "Exit codes"]);
    let text = succeed(folder.path(), &["render", "--help"]);
    assert_contains(
        &text,
        &["--frames", "--shard", "--skip-existing", "--aov", "--stats", "--set"],
    );
    assert_contains(&text, &["--max-error", "--budget", "--calibrate"]);
    let version = succeed(folder.path(), &["--version"]);
    assert_eq!(version.trim(), concat!("limpid ", env!("CARGO_PKG_VERSION")));
    assert_eq!(run(folder.path(), &[]).code, 2);
}

/// In a build without the viewer, `limpid view` names the missing feature.
#[cfg(not(feature = "viewer"))]
#[test]
fn view_without_the_viewer_names_the_feature() {
    let folder = TempDir::new().expect("a folder");
    let line = fail(folder.path(), 2, &["view", "scene.toml"]);
    assert!(line.contains("--features viewer"), "{line}");
}
