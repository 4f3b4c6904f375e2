//! What is written where: nothing over an input, nothing over a file of another kind, and all of it
//! refused before anything is drawn.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use image::ImageFormat;
use tempfile::TempDir;

use super::{
    SIZE, adapter, assert_tells, bytes, fail, names, open, pictures, project, render, run, succeed,
};

/// Every file below a folder, with its contents.
fn everything(folder: &Path) -> BTreeMap<String, Vec<u8>> {
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

/// Runs what must be refused, with a message that has all of `parts`, and leave all as it is.
#[track_caller]
fn refused(folder: &Path, args: &[&str], code: i32, parts: &[&str]) {
    let before = everything(folder);
    let line = fail(folder, code, args);
    assert_tells(&line, parts);
    assert!(everything(folder) == before, "{args:?}: a file has changed");
}

const READS: &str = "the same command reads this file";
const TWO: &str = "two outputs of the command";

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

/// Protects inputs: whatever option names one as an output is refused, by its own name, by another
/// path to it and by links of both kinds.
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
        refused(folder, &args, 2, &[name, READS]);
    }
}

/// Protects all other files: only one of the kind that is written is replaced.
#[test]
fn files_of_other_kinds_are_left_alone() {
    let project = crowded();
    let folder = project.path();
    let water = |more: &[&'static str]| [&["render", "water", "--frames=2"], more].concat();
    let not = "is not ";
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
            refused(folder, &args, 2, &[name, not, "left as it is"]);
        }
    }
}

/// Protects names: one that says no format that can be written is refused, and told which can.
#[test]
fn unknown_endings_are_refused() {
    let project = crowded();
    for output in ["x.tiff", "noext", "water/block_1.xyz", "scenes/block.toml", "x.png.bak"] {
        let args = ["render", "water", "--frames=2", "-o", output];
        refused(project.path(), &args, 2, &[output, ".png, .jpg, .webp or .exr", ".mp4"]);
    }
    for output in ["name_{}.bgeo", "take.####"] {
        let args = ["render", "water", "-o", output];
        refused(project.path(), &args, 2, &[".png, .jpg, .webp or .exr"]);
    }
    for (option, ending) in [("--skip-existing", "jpg"), ("--claim", "webp")] {
        let output = format!("f_#.{ending}");
        let args = ["render", "water", "-o", &output, option];
        refused(project.path(), &args, 2, &[option, ".png or .exr"]);
    }
}

/// Protects outputs from each other.
#[test]
fn two_outputs_are_two_files() {
    let project = crowded();
    let folder = project.path();
    for args in [
        ["--stats=s.json", "--manifest=s.json", "-o=a.png"],
        ["--stats=s.json", "--manifest=water/../s.json", "-o=a.png"],
        ["--stats=a.png", "--samples=1", "-o=a.png"],
        ["--stats=a.aov.exr", "--aov=depth", "-o=a.png"],
    ] {
        let args = [&["render", "water", "--frames=2"], &args[..]].concat();
        refused(folder, &args, 2, &[TWO]);
    }
}

/// Protects whoever mistypes a folder: its name is told before a frame is drawn or a device opened,
/// whichever output would be in it.
#[test]
fn missing_folders_are_told_first() {
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

/// Protects the limits that blessing keeps: below the suite's folder, on no input, on pictures only.
#[test]
fn blessing_stays_among_the_expectations() {
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

    // By way of links, and of files that are no pictures.
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

    // What the suite draws with is no expectation.
    fs::copy(folder.join("sky.png"), folder.join("scenes/map.png")).unwrap();
    let scene = fs::read_to_string(folder.join("scenes/sky.toml")).unwrap();
    fs::write(folder.join("scenes/sky.toml"), scene.replace("../sky.png", "map.png")).unwrap();
    suite("expected = \"map.png\"");
    refused(folder, &["check", "scenes/suite.toml", "--bless"], 2, &["map.png", "reads"]);
}

/// Protects other programs' frames from `bake --restart`: only what a bake is known to have made is
/// removed.
#[test]
fn restarting_removes_bakes_only() {
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

/// Protects what is run every day: outputs of the same kind are replaced, and manifests continued.
#[test]
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
    // A JPEG that was named by mistake.
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

/// Each ending is the format that it says: WebP the pixels of the PNG, JPEG nearly, and EXR the
/// radiance that the AOV of that name holds.
#[test]
fn pictures_are_what_their_names_say() {
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
    // Fine checks in few pixels are the worst for a JPEG; other colours are much farther.
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

/// Red for blue.
fn swapped(picture: &image::RgbImage) -> image::RgbImage {
    let mut picture = picture.clone();
    picture.pixels_mut().for_each(|pixel| pixel.0.reverse());
    picture
}

/// Linear pictures are numbered, resumed and claimed as others are.
#[test]
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
    assert_eq!([written(1), written(2)], kept, "whole pictures were drawn again");
    assert!(bytes(&path(3)) == good[2], "a damaged picture was kept");
    render(project.path(), &[&args[..4], &["--claim", "--samples=3"]].concat());
    assert!(bytes(&path(1)) != good[0], "other settings");
}

/// `--diff` takes the formats that hold 8 bits.
#[test]
fn differences_are_pictures_of_8_bits() {
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

    /// The exit code and standard error of what must end within a minute.
    #[track_caller]
    fn end(mut child: Child) -> (Option<i32>, String) {
        let begun = Instant::now();
        while child.try_wait().unwrap().is_none() {
            if begun.elapsed() > Duration::from_secs(60) {
                child.kill().unwrap();
                panic!("it does not end");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let output = child.wait_with_output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    }

    /// A pipe that nobody reads is waited for, but not beyond a signal: a manifest and a picture.
    #[test]
    fn waiting_for_a_reader_ends_at_a_signal() {
        if !adapter() {
            return;
        }
        for args in [["--manifest=pipe", "-o=f_#.png"], ["--frames=1", "-o=pipe"]] {
            let project = project();
            pipe(project.path(), "pipe");
            let mut child = start(project.path(), &args);
            std::thread::sleep(Duration::from_secs(1));
            assert!(child.try_wait().unwrap().is_none(), "{args:?}: nobody reads it");
            let kill = Command::new("kill").arg(child.id().to_string()).status().unwrap();
            assert!(kill.success());
            assert_eq!(end(child).0, Some(143), "{args:?}");
        }
    }

    /// A reader of a manifest that leaves ends the run with an error, not with a wait for ever; one
    /// that stays gets every line.
    #[test]
    fn manifests_go_to_their_reader() {
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
        assert_tells(&error, &["pipe: cannot write: Broken pipe"]);
    }

    /// A picture through a pipe is a whole PNG.
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

    /// `report --against` a pipe or a device is refused without reading it.
    #[test]
    fn earlier_reports_are_files() {
        let folder = super::super::folder();
        pipe(folder.path(), "pipe");
        for name in ["pipe", "/dev/zero"] {
            let args = ["report", "--quick", "--against", name, "--out", "."];
            refused_here(folder.path(), &args, &[name, "this is a pipe or device"]);
        }
    }

    #[track_caller]
    fn refused_here(folder: &Path, args: &[&str], parts: &[&str]) {
        let outcome = run(folder, args);
        assert_eq!(outcome.code, 4, "{}", outcome.stderr);
        assert_tells(&outcome.stderr, parts);
    }
}
