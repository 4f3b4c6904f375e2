//! Exit codes, with the one line that says what went wrong and what helps; and help itself.

use std::fs;
use std::path::Path;

#[cfg(not(feature = "viewer"))]
use tempfile::TempDir;

use super::{
    SCENE, SIZE, adapter, assert_names, assert_picture, assert_tells, bytes, dam, fail, folder,
    names, one_line, pictures, project, run, run_with, succeed,
};

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
    fail(&["--max-error", "--shard"], &["render", "--max-error=5", "--shard=1/2"]);
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
    fail(&["none.json", "No such file"], &["report", "--against", "none.json"]);
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
        // Known before anything is drawn.
        assert_names(&folder.path().join("stats"), &[]);
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
    // Where there is OpenGL, it is the variable that is wrong.
    let told = if line.contains("there are:") {
        ["no graphics adapter fits WGPU_BACKEND=vulkan", ""]
    } else {
        ["adapter found: install a Vulkan driver", "mesa-vulkan-drivers"]
    };
    assert_tells(&line, &told);
    assert_names(folder.path(), &[]);
}

/// A name that no adapter has is not for want of a driver.
#[test]
fn no_such_adapter() {
    if !adapter() {
        return;
    }
    let folder = folder();
    let args = ["render", "--quiet", SIZE];
    for (name, value) in [("WGPU_ADAPTER_NAME", "no such card"), ("WGPU_BACKEND", "vulcan")] {
        let line = one_line(&args, 5, run_with(folder.path(), &args, &[(name, value)]));
        assert_tells(&line, &[&format!("adapter fits {name}={value}; there are: ")]);
        assert!(!line.contains("install"), "{line}");
    }
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
