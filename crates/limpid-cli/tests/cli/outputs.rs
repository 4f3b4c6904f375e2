//! Output files: none replaces an input or a file of another kind, which is checked before anything is
//! drawn.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use image::ImageFormat;
use tempfile::TempDir;

use super::{
    SIZE, adapter, assert_contains, bytes, fail, names, open, pictures, project, render, run,
    succeed,
};

/// Reads every file below a folder.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_symlink() && path.is_dir() {
                continue;
            }
            if path.is_dir() {
                folders.push(path);
            } else {
                all.insert(path.display().to_string(), bytes(&path));
            }
        }
    }
    all
}

/// Runs a command that must fail with a message that contains all of `parts`, and change no file.
#[track_caller]
fn refused(folder: &Path, args: &[&str], code: i32, parts: &[&str]) {
    let before = contents(folder);
    let line = fail(folder, code, args);
    assert_contains(&line, parts);
    assert!(contents(folder) == before, "{args:?}: a file has changed");
}

const IS_INPUT: &str = "the same command reads this file";
const IS_OTHER_OUTPUT: &str = "two outputs of the command";

/// A project with an environment map, a camera path, a suite, and files of other programs.
fn crowded() -> TempDir {
    let project = project();
    let path = |name: &str| project.path().join(name);
    let sky = image::RgbImage::from_fn(16, 8, |x, y| image::Rgb([9 * x as u8, 20 * y as u8, 200]));
    sky.save(path("sky.png")).unwrap();
    let linear = image::DynamicImage::ImageRgb8(sky).into_rgb32f();
    linear.save(path("shot.aov.exr")).unwrap();
    let scene = |map: &str| {
        format!(
            "environment.map = \"../{map}\"\n[particles]\nsource = \"../water/block_{{}}.xyz\"\n\
             radius = 0.025\nframe = 2\n"
        )
    };
    fs::write(path("scenes/sky.toml"), scene("sky.png")).unwrap();
    fs::write(path("scenes/aov.toml"), scene("shot.aov.exr")).unwrap();
    let key = "[[key]]\ntime = 0.0\neye = [1.0, 1.0, 2.0]\ntarget = [0.0, 0.0, 0.0]\n";
    fs::write(path("keys.toml"), key).unwrap();
    let suite =
        "size = [48, 36]\n[[frame]]\nname = \"a\"\ninput = \"scenes/sky.toml\"\nframe = 2\n";
    fs::write(path("suite.toml"), suite).unwrap();
    fs::write(path("foreign.vtk"), "# vtk DataFile Version 3.0\nfluid\nASCII\n").unwrap();
    fs::write(path("mesh.vtu"), "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\">\n").unwrap();
    fs::write(path("package.json"), "{\n  \"name\": \"tank\"\n}\n").unwrap();
    fs::write(path("notes.txt"), "Do not lose this.\n").unwrap();
    fs::write(path("notes.xyz"), "Do not lose this.\n").unwrap();
    fs::write(path("notes.png"), "Do not lose this.\n").unwrap();
    fs::write(path("notes.gif"), "Do not lose this.\n").unwrap();
    fs::write(path("cursor.ani"), b"RIFF\x24\0\0\0ACON").unwrap();
    fs::create_dir(path("site")).unwrap();
    fs::write(path("site/index.html"), "<!DOCTYPE html>\n<title>Tank</title>\n").unwrap();
    fs::write(path("site/report.md"), "# Tank\n").unwrap();
    project
}

/// An option that names an input as an output is refused: by its own name, by another path to it, and by
/// hard and symbolic links.
#[test]
fn no_output_is_an_input() {
    let project = crowded();
    let folder = project.path();
    fs::write(folder.join("old.json"), "{\"adapter\":\"a\",\"rows\":[],\"stress\":[]}").unwrap();
    fs::hard_link(folder.join("sky.png"), folder.join("hard.png")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("sky.png", folder.join("soft.png")).unwrap();
    let sky = |more: &[&'static str]| [&["render", "scenes/sky.toml"], more].concat();
    let mut cases = vec![
        (sky(&["-o", "sky.png"]), "sky.png"),
        (sky(&["-o", "hard.png"]), "hard.png"),
        (sky(&["-o", "water/../sky.png"]), "sky.png"),
        (sky(&["--stats", "scenes/sky.toml"]), "scenes/sky.toml"),
        (sky(&["--manifest", "water/block_1.xyz"]), "water/block_1.xyz"),
        (vec!["render", "scenes/aov.toml", "-o", "shot.png", "--aov", "depth"], "shot.aov.exr"),
        (sky(&["--camera-path", "keys.toml", "--stats", "keys.toml"]), "keys.toml"),
        (
            vec!["render", "water", "--scene=scenes/sky.toml", "--frames=1", "-o", "sky.png"],
            "sky.png",
        ),
        (vec!["convert", "water/block_1.xyz", "water/block_1.xyz"], "block_1.xyz"),
        (vec!["convert", "water", "water/block_{}.xyz"], "block_1.xyz"),
        (vec!["compare", "sky.png", "hard.png", "--diff", "sky.png"], "sky.png"),
        (vec!["check", "suite.toml", "--junit", "suite.toml"], "suite.toml"),
        (vec!["check", "suite.toml", "--junit", "scenes/sky.toml"], "scenes/sky.toml"),
        (vec!["check", "suite.toml", "--junit", "sky.png"], "sky.png"),
        (vec!["report", "--against", "old.json", "--json", "old.json"], "old.json"),
    ];
    if cfg!(unix) {
        cases.push((sky(&["-o", "soft.png"]), "soft.png"));
    }
    for (args, name) in cases {
        if args[0] == "report" {
            fs::create_dir_all(folder.join("report")).unwrap();
        }
        refused(folder, &args, 2, &[name, IS_INPUT]);
    }
}

/// Outputs replace only files of their own kind.
#[test]
fn files_of_other_kinds_are_not_replaced() {
    let project = crowded();
    let folder = project.path();
    let water = |more: &[&'static str]| [&["render", "water", "--frames=2"], more].concat();
    let other_kind = "is not ";
    for (args, name) in [
        (water(&["-o", "notes.png"]), "notes.png"),
        (water(&["-o", "notes.gif"]), "notes.gif"),
        (water(&["--stats", "foreign.vtk"]), "foreign.vtk"),
        (water(&["--stats", "package.json"]), "package.json"),
        (water(&["--stats", "keys.toml"]), "keys.toml"),
        (water(&["--manifest", "foreign.vtk"]), "foreign.vtk"),
        (water(&["--manifest", "package.json"]), "package.json"),
        (vec!["convert", "water/block_1.xyz", "notes.xyz"], "notes.xyz"),
        (vec!["convert", "water/block_1.xyz", "cursor.pos"], "cursor.ani"),
        (vec!["convert", "water/block_1.xyz", "mesh.vtu", "--skip-existing"], ""),
        (vec!["compare", "sky.png", "hard.png", "--diff", "notes.png"], "notes.png"),
        (vec!["check", "suite.toml", "--junit", "mesh.vtu"], "mesh.vtu"),
        (vec!["check", "suite.toml", "--junit", "notes.txt"], "notes.txt"),
        (vec!["check", "suite.toml", "--out", "site"], "site/index.html"),
        (vec!["report", "--out", "site"], "site/report.md"),
        (vec!["report", "--out", "site", "--json", "package.json"], "package.json"),
        (vec!["report", "--curve", "keys.toml"], "keys.toml"),
    ] {
        if name.is_empty() {
            succeed(folder, &args);
        } else {
            refused(folder, &args, 2, &[name, other_kind, "left as it is"]);
        }
    }
}

/// An output name without the extension of a writable format is refused, with a list of these.
#[test]
fn unknown_extensions_are_refused() {
    let project = crowded();
    for output in ["x.tiff", "noext", "water/block_1.xyz", "scenes/block.toml", "x.png.bak"] {
        let args = ["render", "water", "--frames=2", "-o", output];
        refused(project.path(), &args, 2, &[output, ".png, .jpg, .webp or .exr", ".mp4"]);
    }
    for output in ["name_{}.bgeo", "take.####"] {
        let args = ["render", "water", "-o", output];
        refused(project.path(), &args, 2, &[".png, .jpg, .webp or .exr"]);
    }
    for (option, extension) in [("--skip-existing", "jpg"), ("--claim", "webp")] {
        let output = format!("f_#.{extension}");
        let args = ["render", "water", "-o", &output, option];
        refused(project.path(), &args, 2, &[option, ".png or .exr"]);
    }
}

/// Two outputs of a command cannot be the same file.
#[test]
fn outputs_are_different_files() {
    let project = crowded();
    let folder = project.path();
    for args in [
        ["--stats=s.json", "--manifest=s.json", "-o=a.png"],
        ["--stats=s.json", "--manifest=water/../s.json", "-o=a.png"],
        ["--stats=a.png", "--samples=1", "-o=a.png"],
        ["--stats=a.aov.exr", "--aov=depth", "-o=a.png"],
    ] {
        let args = [&["render", "water", "--frames=2"], &args[..]].concat();
        refused(folder, &args, 2, &[IS_OTHER_OUTPUT]);
    }
}

/// A missing folder of any output is reported before a device is opened or a frame drawn.
#[test]
fn missing_folders_are_reported_first() {
    let project = crowded();
    let folder = project.path();
    fs::write(folder.join("a.png"), bytes(&folder.join("sky.png"))).unwrap();
    let water = |more: &[&'static str]| [&["render", "water", "--frames=2"], more].concat();
    for args in [
        water(&["-o", "nosuch/a.png"]),
        water(&["-o", "nosuch/a.exr"]),
        water(&["-o", "nosuch/a.gif"]),
        water(&["--stats", "nosuch/s.json"]),
        water(&["--manifest", "nosuch/m.jsonl"]),
        vec!["convert", "water", "nosuch/a_#.ply"],
        vec!["compare", "sky.png", "a.png", "--diff", "nosuch/d.png"],
        vec!["check", "suite.toml", "--junit", "nosuch/ci.xml"],
        vec!["report", "--curve", "nosuch/c.toml"],
    ] {
        refused(folder, &args, 4, &["cannot write: there is no folder nosuch"]);
    }
    for args in [
        water(&["-o", "notes.txt/"]),
        vec!["check", "suite.toml", "--out", "notes.txt/results"],
        vec!["convert", "water", "notes.txt/"],
    ] {
        refused(folder, &args, 4, &["notes.txt"]);
    }
}

/// `check --bless` replaces only pictures below the suite's folder that are not inputs.
#[test]
fn blessing_replaces_only_expected_pictures() {
    let project = crowded();
    let folder = project.path();
    fs::create_dir(folder.join("suites")).unwrap();
    let suite = |expected: &str| {
        let text = format!(
            "[[frame]]\nname = \"a\"\ninput = \"sky.toml\"\nframe = 2\n{expected}\n\
             size = [48, 36]\n"
        );
        fs::write(folder.join("scenes/suite.toml"), text).unwrap();
    };
    let outside = folder.join("sky.png").display().to_string();
    for expected in ["../sky.png", "a/../../sky.png", &outside] {
        suite(&format!("expected = \"{expected}\""));
        let args = ["check", "scenes/suite.toml", "--bless"];
        refused(folder, &args, 2, &[expected, "below the suite's folder"]);
    }
    for expected in ["sky.toml", "a.jpg", "noext"] {
        suite(&format!("expected = \"{expected}\""));
        refused(folder, &["check", "scenes/suite.toml", "--bless"], 2, &[expected, ".png"]);
    }
    suite("aov = { depth = {} }\nexpected_aov = \"../shot.aov.exr\"");
    refused(folder, &["check", "scenes/suite.toml"], 2, &["below the suite's folder"]);

    // Through links, and over files that are not pictures.
    #[cfg(unix)]
    {
        use std::os::unix::fs::symlink;
        symlink("../sky.png", folder.join("scenes/out.png")).unwrap();
        symlink("..", folder.join("scenes/up")).unwrap();
        for expected in ["out.png", "up/new.png"] {
            suite(&format!("expected = \"{expected}\""));
            let args = ["check", "scenes/suite.toml", "--bless"];
            refused(folder, &args, 2, &[expected]);
        }
    }
    fs::copy(folder.join("notes.png"), folder.join("scenes/text.png")).unwrap();
    suite("expected = \"text.png\"");
    refused(folder, &["check", "scenes/suite.toml", "--bless"], 2, &["text.png", "not a picture"]);

    // An input of the suite cannot be an expected picture.
    fs::copy(folder.join("sky.png"), folder.join("scenes/map.png")).unwrap();
    let scene = fs::read_to_string(folder.join("scenes/sky.toml")).unwrap();
    fs::write(folder.join("scenes/sky.toml"), scene.replace("../sky.png", "map.png")).unwrap();
    suite("expected = \"map.png\"");
    refused(folder, &["check", "scenes/suite.toml", "--bless"], 2, &["map.png", "reads"]);
}

/// `bake --restart` removes only frames recorded as baked, not those of other programs.
#[test]
fn restart_removes_only_baked_frames() {
    let folder = super::folder();
    let folder = folder.path();
    let sims = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("sims");
    fs::copy(sims.join("dam_break.toml"), folder.join("dam.toml")).unwrap();
    fs::create_dir(folder.join("f")).unwrap();
    fs::copy(super::dam("20"), folder.join("f/dam_0001.bgeo")).unwrap();
    let args = ["bake", "dam.toml", "-o", "f", "--frames=1"];
    refused(folder, &args, 2, &["dam.bake.json", "another program's"]);
    let restart = [&args[..], &["--restart"]].concat();
    refused(folder, &restart, 2, &["dam.bake.json", "another program's"]);
}

/// Outputs of the same kind are replaced, and manifests are appended to.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn files_of_the_same_kind_are_replaced() {
    if !adapter() {
        return;
    }
    let project = project();
    let args = ["water", "--frames=2", "--stats=s.json", "--manifest=m.jsonl", "--aov=depth"];
    for output in ["a.png", "a.png", "a.jpg", "a.gif", "a.apng"] {
        let film = output.ends_with("gif") || output.ends_with("apng");
        let args = if film { &args[..3] } else { &args[..] };
        render(project.path(), &[args, &["-o", output]].concat());
    }
    let manifest = fs::read_to_string(project.path().join("m.jsonl")).unwrap();
    assert_eq!(manifest.lines().count(), 3);
    // A JPEG with the extension of a PNG.
    fs::copy(project.path().join("a.jpg"), project.path().join("a.png")).unwrap();
    render(project.path(), &["water", "--frames=2", "-o", "a.png"]);
    fs::write(project.path().join("empty.png"), "").unwrap();
    render(project.path(), &["water", "--frames=2", "-o", "empty.png"]);
    assert_eq!(bytes(&project.path().join("empty.png")), bytes(&project.path().join("a.png")));
    for _ in 0..2 {
        let args = ["convert", "water", "c_#.bgeo"];
        succeed(project.path(), &args);
        succeed(project.path(), &["convert", "water/block_1.xyz", "c.xyz"]);
        succeed(project.path(), &["convert", "water/block_1.xyz", "c.pos"]);
        succeed(project.path(), &["convert", "water/block_1.xyz", "c.npz"]);
        succeed(project.path(), &["convert", "water/block_1.xyz", "c.csv"]);
    }
}

/// The extension selects the format: WebP has the pixels of the PNG, JPEG nearly, and OpenEXR the
/// radiance of the AOV of that name.
#[test]
fn extensions_select_the_picture_format() {
    if !adapter() {
        return;
    }
    let project = project();
    let path = |name: &str| project.path().join(name);
    let exposure = "--set=tonemap.exposure=1.5";
    for name in ["a.png", "a.jpg", "b.JPEG", "a.webp", "a.exr"] {
        let aov = if name == "a.exr" { "--aov=radiance" } else { "--memory=64" };
        render(project.path(), &["scenes/block.toml", exposure, aov, "--samples=1", "-o", name]);
    }
    let formats = [
        ("a.png", ImageFormat::Png),
        ("a.jpg", ImageFormat::Jpeg),
        ("b.JPEG", ImageFormat::Jpeg),
        ("a.webp", ImageFormat::WebP),
        ("a.exr", ImageFormat::OpenExr),
    ];
    for (name, format) in formats {
        assert_eq!(image::guess_format(&bytes(&path(name))).unwrap(), format, "{name}");
    }
    let decode = |name: &str| image::load_from_memory(&bytes(&path(name))).unwrap();
    let png = open(&path("a.png"));
    assert!(decode("a.webp").into_rgb8() == png, "WebP is lossless");
    let (near, _) = limpid_lab::compare::compare(&png, &decode("b.JPEG").into_rgb8()).unwrap();
    // Fine checkers in few pixels are the worst case of JPEG; swapped colours differ much more.
    assert!(near.mean_flip > 0.0 && near.mean_flip < 0.1, "{}", near.mean_flip);
    let (far, _) = limpid_lab::compare::compare(&png, &swapped(&png)).unwrap();
    assert!(far.mean_flip > 0.2, "{}", far.mean_flip);

    let linear = decode("a.exr");
    assert!(!linear.color().has_alpha(), "pictures are opaque");
    let linear = linear.into_rgb32f();
    let parts = limpid_io::exr::load(&path("a.aov.exr")).unwrap();
    for (i, channel) in parts[0].channels.iter().rev().enumerate() {
        assert_eq!(channel.name, ["radiance.R", "radiance.G", "radiance.B"][i]);
        assert!(linear.pixels().map(|p| p[i]).eq(channel.values.iter().copied()), "{i}");
    }
    // The PNG is this picture, exposed and encoded.
    let gain = 1.5_f64.exp2();
    for (linear, png) in linear.pixels().zip(png.pixels()) {
        for i in 0..3 {
            let byte = limpid::passes::tonemap::srgb_byte(gain * f64::from(linear[i]));
            assert!(byte.abs_diff(png[i]) <= 1, "{linear:?} {png:?}");
        }
    }
}

/// Swaps red and blue.
fn swapped(picture: &image::RgbImage) -> image::RgbImage {
    let mut picture = picture.clone();
    picture.pixels_mut().for_each(|pixel| pixel.0.reverse());
    picture
}

/// Linear pictures are numbered, resumed and claimed like others.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn linear_pictures_are_resumed() {
    if !adapter() {
        return;
    }
    let project = project();
    let path = |frame: u32| project.path().join(format!("f_{frame}.exr"));
    let args = ["water", "--radius=0.025", "-o", "f_#.exr", "--skip-existing"];
    render(project.path(), &args);
    assert_eq!(names(project.path()).len(), 5);
    let good: Vec<_> = (1..=3).map(|frame| bytes(&path(frame))).collect();
    let written = |frame: u32| fs::metadata(path(frame)).unwrap().modified().unwrap();
    let kept = [written(1), written(2)];
    fs::write(path(3), &good[2][..good[2].len() / 2]).unwrap();
    render(project.path(), &args);
    assert_eq!([written(1), written(2)], kept, "complete pictures were drawn again");
    assert!(bytes(&path(3)) == good[2], "a damaged picture was kept");
    render(project.path(), &[&args[..4], &["--claim", "--samples=3"]].concat());
    assert!(bytes(&path(1)) != good[0], "a picture of other settings was kept");
}

/// `--diff` accepts 8-bit formats only.
#[test]
fn difference_pictures_have_8_bits() {
    let folder = pictures();
    for (name, format) in [("d.jpg", ImageFormat::Jpeg), ("d.webp", ImageFormat::WebP)] {
        succeed(folder.path(), &["compare", "a.png", "b.png", "--diff", name]);
        assert_eq!(image::guess_format(&bytes(&folder.path().join(name))).unwrap(), format);
    }
    let args = ["compare", "a.png", "b.png", "--diff", "d.exr"];
    refused(folder.path(), &args, 2, &["d.exr", ".png, .jpg or .webp"]);
    let args = ["compare", "a.png", "b.png", "--diff", "d.bmp"];
    refused(folder.path(), &args, 2, &["d.bmp", ".png, .jpg, .webp or .exr"]);
}

#[cfg(unix)]
mod pipes {
    use std::io::{BufRead as _, BufReader, Read as _};
    use std::process::{Child, Command, Stdio};
    use std::time::{Duration, Instant};

    use super::*;

    fn pipe(folder: &Path, name: &str) {
        assert!(Command::new("mkfifo").arg(folder.join(name)).status().unwrap().success());
    }

    fn start(folder: &Path, args: &[&str]) -> Child {
        let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
        command.args(["render", "water", SIZE, "--radius=0.025"]).args(args);
        command.env("NODEVICE_SELECT", "1").current_dir(folder).stderr(Stdio::piped());
        command.spawn().unwrap()
    }

    /// Waits for a process, at most a minute; returns its exit code and standard error.
    #[track_caller]
    fn end(mut child: Child) -> (Option<i32>, String) {
        let start = Instant::now();
        while child.try_wait().unwrap().is_none() {
            if start.elapsed() > Duration::from_secs(60) {
                child.kill().unwrap();
                panic!("the process does not end");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let output = child.wait_with_output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    }

    /// Opening a pipe without a reader, for a manifest or a picture, blocks until a signal.
    #[test]
    fn wait_for_a_reader_ends_at_a_signal() {
        if !adapter() {
            return;
        }
        for args in [["--manifest=pipe", "-o=f_#.png"], ["--frames=1", "-o=pipe"]] {
            let project = project();
            pipe(project.path(), "pipe");
            let mut child = start(project.path(), &args);
            std::thread::sleep(Duration::from_secs(1));
            assert!(child.try_wait().unwrap().is_none(), "{args:?}: ended without a reader");
            let kill = Command::new("kill").arg(child.id().to_string()).status().unwrap();
            assert!(kill.success());
            assert_eq!(end(child).0, Some(143), "{args:?}");
        }
    }

    /// A manifest's reader gets every line; if it closes the pipe, the run ends with an error and does
    /// not wait for ever.
    #[test]
    fn manifests_go_through_pipes() {
        if !adapter() {
            return;
        }
        let project = project();
        pipe(project.path(), "pipe");
        let child = start(project.path(), &["--manifest=pipe", "-o=f_#.png"]);
        let mut lines = BufReader::new(fs::File::open(project.path().join("pipe")).unwrap());
        let mut line = String::new();
        lines.read_line(&mut line).unwrap();
        assert!(line.contains("\"frame\":1"), "{line}");
        lines.read_line(&mut line).unwrap();
        lines.read_line(&mut line).unwrap();
        assert_eq!((line.lines().count(), end(child).0), (3, Some(0)));
        drop(lines);

        let child = start(project.path(), &["--manifest=pipe", "-o=f_#.png", "--samples=9"]);
        drop(fs::File::open(project.path().join("pipe")).unwrap());
        let (code, error) = end(child);
        assert_eq!(code, Some(4), "{error}");
        assert_contains(&error, &["pipe: cannot write: Broken pipe"]);
    }

    /// A picture written to a pipe is a complete PNG.
    #[test]
    fn pictures_go_through_pipes() {
        if !adapter() {
            return;
        }
        let project = project();
        pipe(project.path(), "pipe");
        let child = start(project.path(), &["--frames=1", "-o=pipe"]);
        let mut png = Vec::new();
        fs::File::open(project.path().join("pipe")).unwrap().read_to_end(&mut png).unwrap();
        assert_eq!(end(child).0, Some(0));
        let picture = image::load_from_memory_with_format(&png, ImageFormat::Png).unwrap();
        assert_eq!((picture.width(), picture.height()), (64, 48));
    }

    /// `report --against` refuses a pipe or a device without reading it.
    #[test]
    fn earlier_reports_must_be_files() {
        let folder = super::super::folder();
        pipe(folder.path(), "pipe");
        for name in ["pipe", "/dev/zero"] {
            let args = ["report", "--quick", "--against", name, "--out", "."];
            unreadable(folder.path(), &args, &[name, "this is a pipe or device"]);
        }
    }

    #[track_caller]
    fn unreadable(folder: &Path, args: &[&str], parts: &[&str]) {
        let outcome = run(folder, args);
        assert_eq!(outcome.code, 4, "{}", outcome.stderr);
        assert_contains(&outcome.stderr, parts);
    }
}
