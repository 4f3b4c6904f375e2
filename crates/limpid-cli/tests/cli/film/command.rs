//! Films of `limpid render`.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use image::RgbImage;
use tempfile::TempDir;

use super::{
    SIZE, adapter, decode, difference, ffmpeg, folder, names, processes, read_apng, read_gif,
};

/// Writes three frames of a moving block of water.
fn water() -> TempDir {
    let folder = folder();
    for frame in 1..=3 {
        let lattice = (0..12 * 5 * 8).map(|i| {
            let [x, y, z] = [i % 12, i / 12 % 5, i / 60].map(|i| i as f32 * 0.05);
            format!("{} {y} {z}\n", x + 0.1 * frame as f32)
        });
        let path = folder.path().join(format!("water_{frame}.xyz"));
        fs::write(path, lattice.collect::<String>()).unwrap();
    }
    folder
}

/// Runs `limpid render` in a folder, with `PATH` set to `path` if given; a failure has the exit code and
/// stderr.
fn render(folder: &Path, args: &[&str], path: Option<&Path>) -> Result<(), (i32, String)> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
    if let Some(path) = path {
        command.env("PATH", path);
    }
    let command = command.current_dir(folder).args(["render", "--quiet"]).args(args);
    if !args.iter().any(|arg| arg.starts_with("--size")) {
        command.arg("--size=160x120");
    }
    let output = command.output().expect("the program starts");
    let stderr = String::from_utf8(output.stderr).unwrap();
    if output.status.success() {
        assert_eq!(stderr, "", "{args:?}");
        return Ok(());
    }
    assert_eq!(stderr.lines().count(), 1, "one line per error: {stderr}");
    Err((output.status.code().expect("an exit code"), stderr))
}

fn open(path: &Path) -> RgbImage {
    image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).into_rgb8()
}

const PATH_FILE: &str = r"
[[key]]
time = 0.0
eye = [0.3, 0.5, 2.0]
target = [0.3, 0.1, 0.2]

[[key]]
time = 0.3
eye = [1.5, 0.5, 1.5]
target = [0.3, 0.1, 0.2]
fov_y = 50.0
";

/// A film has the pictures that the same command line draws as separate files.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn a_film_has_the_pictures_of_its_frames() {
    if !adapter() {
        return;
    }
    let folder = water();
    render(folder.path(), &["water_{}.xyz", "-o", "w_#.png"], None).unwrap();
    render(folder.path(), &["water_{}.xyz", "-o", "w.apng"], None).unwrap();
    let pictures = [1, 2, 3].map(|i| open(&folder.path().join(format!("w_{i}.png"))));
    assert_eq!(read_apng(&folder.path().join("w.apng")), pictures);
    render(folder.path(), &["water_{}.xyz", "--frames=1,3", "-o", "w.gif", "--fps=10"], None)
        .unwrap();
    let (frames, delays, _) = read_gif(&folder.path().join("w.gif"));
    assert_eq!(delays, [10, 10]);
    assert!(difference(&frames[1], &pictures[2]) < 6.0);
    if ffmpeg() {
        render(folder.path(), &["water_{}.xyz", "-o", "w.mp4"], None).unwrap();
        let frames = decode(&folder.path().join("w.mp4"), "auto");
        assert_eq!(frames.len(), 3);
        assert!(difference(&frames[2], &pictures[2]) < 6.0);
        assert!(difference(&frames[0], &pictures[2]) > difference(&frames[2], &pictures[2]));
    }
}

/// A frame that cannot be read costs no film: it is held, or, as whatever else fails, the film repeats the picture
/// before, or after where there is none, so that the others keep their times. Without an option the message has both.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn a_film_survives_damaged_frames() {
    if !adapter() {
        return;
    }
    let folder = water();
    let at = |name: &str| folder.path().join(name);
    fs::copy(at("water_3.xyz"), at("water_4.xyz")).unwrap();
    for number in [1, 3] {
        fs::write(at(&format!("water_{number}.xyz")), "0.1 0.2\nnonsense\n").unwrap();
    }
    let run = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
        let args = ["render", "water_{}.xyz", "--size=64x48", "--fps=10"];
        let output = command.current_dir(folder.path()).args(args).args(more).output().unwrap();
        (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, stderr) = run(&["-q", "-o", "w.apng"]);
    assert!(code == 4 && stderr.starts_with("limpid: frame 1: "), "{stderr}");
    assert!(stderr.contains("water_1.xyz: line 1"), "{stderr}");
    assert!(stderr.contains("--missing hold") && stderr.contains("--keep-going"), "{stderr}");
    assert!(!at("w.apng").exists());

    let (code, stderr) = run(&["--missing=hold", "-o", "w.apng"]);
    assert_eq!(code, 0, "{stderr}");
    let held = stderr.lines().filter(|line| line.contains("shown in its place"));
    let held: Vec<&str> = held.collect();
    assert!(held[0].contains("water_1.xyz: line 1") && held[0].contains("; nothing is shown"));
    assert!(held[1].contains("water_3.xyz: line 1") && held[1].contains("; frame 2 is shown"));
    let film = read_apng(&at("w.apng"));
    assert_eq!(film.len(), 4);
    assert!(film[1] == film[2] && film[0] != film[1] && film[2] != film[3]);

    for name in ["w.apng", "w.gif"] {
        let (code, stderr) = run(&["-q", "--keep-going", "-o", name]);
        let lines: Vec<&str> = stderr.lines().collect();
        let [first, second, summary] = lines[..] else { panic!("{stderr}") };
        assert!(code == 1 && first.contains("frame 1: ") && second.contains("frame 3: "));
        assert!(!first.contains("to continue"), "{first}");
        assert!(summary.contains("2 of 4 frames failed: 1,3; the film repeats"), "{summary}");
    }
    let again = read_apng(&at("w.apng"));
    assert_eq!(again.len(), 4);
    assert!(again[0] == film[1] && again[1..] == film[1..]);
    assert_eq!(read_gif(&at("w.gif")).0.len(), 4);

    let (code, stderr) = run(&["-q", "--keep-going", "--frames=1,3", "-o", "none.apng"]);
    assert!(code == 1 && stderr.contains("2 of 2 frames failed"), "{stderr}");
    assert!(!at("none.apng").exists() && names(folder.path()).iter().all(|n| !n.starts_with('.')));
}

/// `--camera-path` and `--turntable` move the camera over a single frame and over a sequence, in
/// pictures and in films.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn the_camera_moves() {
    if !adapter() {
        return;
    }
    let folder = water();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("path.toml"), PATH_FILE).unwrap();
    // The automatic ground and tint fit all frames of the sequence.
    let moving = ["--camera-path=path.toml", "--fps=10", "--floor=none", "--tint=physical"];
    let one = [&["water_2.xyz"], &moving[..]].concat();
    render(folder.path(), &[&one[..], &["-o", "one/"]].concat(), None).unwrap();
    let numbered: BTreeSet<_> = (1..=4).map(|i| format!("frame_{i:04}.png")).collect();
    assert_eq!(names(&at("one")), numbered, "from 0 to 0.3 s, at 10 per second");
    render(folder.path(), &[&one[..], &["-o", "one.apng"]].concat(), None).unwrap();
    let pictures: Vec<_> = numbered.iter().map(|name| open(&at("one").join(name))).collect();
    assert_eq!(read_apng(&at("one.apng")), pictures);
    for pair in pictures.windows(2) {
        assert!(difference(&pair[0], &pair[1]) > 1.0, "the camera does not move");
    }

    // The second of three frames has the camera of the second picture of a single frame.
    let all = [&["water_{}.xyz"], &moving[..]].concat();
    render(folder.path(), &[&all[..], &["-o", "all_#.png"]].concat(), None).unwrap();
    assert!(difference(&open(&at("all_2.png")), &pictures[1]) < 0.2);
    assert!(difference(&open(&at("all_3.png")), &pictures[2]) > 0.5, "the water does not move");

    let turn = ["water_{}.xyz", "--turntable=0.4", "--fps=10"];
    render(folder.path(), &[&turn[..], &["-o", "turn.apng"]].concat(), None).unwrap();
    render(folder.path(), &[&turn[..], &["-o", "turn/"]].concat(), None).unwrap();
    assert_eq!(names(&at("turn")), numbered);
    let pictures: Vec<_> = numbered.iter().map(|name| open(&at("turn").join(name))).collect();
    assert_eq!(read_apng(&at("turn.apng")), pictures);
    // Shards have the same pictures.
    let share = [&turn[..], &["-o", "share/", "--shard=2/2"]].concat();
    render(folder.path(), &share, None).unwrap();
    assert_eq!(names(&at("share")), ["frame_0002.png".into(), "frame_0004.png".into()].into());
    assert_eq!(open(&at("share/frame_0004.png")), pictures[3]);
}

/// `--views` draws a frame from each key of a camera path.
#[test]
fn views_are_pictures_from_each_key() {
    if !adapter() {
        return;
    }
    let folder = water();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("path.toml"), PATH_FILE).unwrap();
    let still = ["water_2.xyz", "--floor=none", "--tint=physical"];
    let views = [&still[..], &["--views=path.toml", "-o", "views/"]].concat();
    render(folder.path(), &views, None).unwrap();
    let numbered: Vec<_> = (1..=2).map(|i| format!("frame_{i:04}.png")).collect();
    assert_eq!(names(&at("views")), numbered.iter().cloned().collect());
    let cameras = [
        "eye=0.3,0.5,2 target=0.3,0.1,0.2 fov_y=40",
        "eye=1.5,0.5,1.5 target=0.3,0.1,0.2 fov_y=50",
    ];
    for (name, camera) in numbered.iter().zip(cameras) {
        let one = [&still[..], &["--camera", camera, "-o", "one.png"]].concat();
        render(folder.path(), &one, None).unwrap();
        assert!(open(&at("views").join(name)) == open(&at("one.png")), "{camera}");
    }
}

/// Options that exclude each other or a film are refused before anything is drawn, with the reason.
#[test]
fn incompatible_options_are_refused() {
    let folder = water();
    fs::write(folder.path().join("path.toml"), PATH_FILE).unwrap();
    let before = names(folder.path());
    let cases: [(&[&str], &str); 12] = [
        (&["-o", "w.gif", "--shard=1/2"], "--shard"),
        (&["-o", "w.gif", "--skip-existing"], "--skip-existing"),
        (&["-o", "w.gif", "--aov=all"], "--aov"),
        (&["-o", "w.gif", "--frames=1-3@b"], "in order"),
        (&["-o", "w_#.png", "--frames=3,1", "--turntable=1"], "in order"),
        (&["-o", "w_####.gif"], "one file"),
        (&["-o", "w.mp4", "--size=161x120"], "162x120"),
        (&["-o", "w.gif", "--fps=0"], "between 0.01 and 1000"),
        (&["--turntable=0"], "above 0"),
        (&["-o", "w/", "--views=path.toml"], "choose one of them with --frames"),
        (&["--turntable=1", "--views=path.toml"], "--views"),
        (&["--turntable=1", "--camera-path=path.toml"], "--camera-path"),
    ];
    for (args, expected) in cases {
        let args = [&["water_{}.xyz"], args].concat();
        let (code, error) = render(folder.path(), &args, None).unwrap_err();
        assert_eq!(code, 2, "{error}");
        assert!(error.contains(expected), "`{expected}` is missing in: {error}");
    }
    let args = ["water_{}.xyz", "-o", "w.gif", "--camera-path=nowhere.toml"];
    let (code, error) = render(folder.path(), &args, None).unwrap_err();
    assert!(code == 4 && error.contains("nowhere.toml"), "{error}");
    assert_eq!(names(folder.path()), before, "a file is left");
}

/// A missing ffmpeg is reported with its remedies before anything is drawn.
#[test]
fn a_missing_ffmpeg_is_reported() {
    let folder = water();
    let before = names(folder.path());
    let args = ["water_{}.xyz", "-o", "w.mp4"];
    let (code, error) = render(folder.path(), &args, Some(Path::new(""))).unwrap_err();
    assert_eq!(code, 4, "{error}");
    for part in ["w.mp4: ", "ffmpeg", "PATH", "apt-get install ffmpeg", ".gif", ".apng", ".png"] {
        assert!(error.contains(part), "`{part}` is missing in: {error}");
    }
    assert_eq!(names(folder.path()), before, "a file is left");
}

/// Ctrl-C and Ctrl-\ end a film without leaving an unfinished file or a process.
#[cfg(unix)]
#[test]
fn an_interrupted_film_leaves_nothing() {
    if !adapter() {
        return;
    }
    for (name, signal, code) in
        [("w.apng", "INT", Some(130)), ("w.mp4", "INT", Some(130)), ("w.mp4", "QUIT", None)]
    {
        if name == "w.mp4" && !ffmpeg() {
            continue;
        }
        let folder = water();
        let before = names(folder.path());
        let mut film = Command::new(env!("CARGO_BIN_EXE_limpid"))
            .current_dir(folder.path())
            .args(["render", "water_{}.xyz", "--size=160x120", "--turntable=10000", "-o", name])
            .spawn()
            .unwrap();
        while names(folder.path()) == before {
            assert_eq!(film.try_wait().unwrap(), None, "{name}: ended before the signal");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        let interrupt = format!("kill -{signal} {}", film.id());
        assert!(Command::new("sh").args(["-c", &interrupt]).status().unwrap().success());
        assert_eq!(film.wait().unwrap().code(), code, "{name}, {signal}");
        assert_eq!(names(folder.path()), before, "{name}: a file is left");
        assert_eq!(processes(folder.path()), 0, "{name}");
    }
}

/// If ffmpeg fails, at the start, in the middle or at the end, its last message is quoted, and there is
/// no film.
#[cfg(unix)]
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn a_failing_ffmpeg_is_quoted() {
    use std::os::unix::fs::PermissionsExt as _;
    if !adapter() {
        return;
    }
    let folder = water();
    let bin = folder.path().join("bin");
    fs::create_dir(&bin).unwrap();
    let before = names(folder.path());
    let picture = 3 * SIZE.x * SIZE.y;
    for script in [
        "echo one >&2; echo 'Unknown encoder' >&2; exit 1".into(),
        format!("/usr/bin/head -c {picture} >/dev/null; echo 'Unknown encoder' >&2; exit 1"),
        "/bin/cat >/dev/null; echo 'Unknown encoder' >&2; exit 1".into(),
    ] {
        let program = bin.join("ffmpeg");
        fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        let args = ["water_{}.xyz", "-o", "w.mp4"];
        let (code, error) = render(folder.path(), &args, Some(&bin)).unwrap_err();
        assert_eq!(code, 4, "{error}");
        assert!(error.contains("w.mp4: ") && error.contains("Unknown encoder"), "{error}");
        assert!(error.contains("exit status: 1"), "{error}");
        assert_eq!(names(folder.path()), before, "a file is left");
    }
    // ffmpeg exits with 0 if the disk is full at the trailer, or if it has written nothing.
    for (script, problem) in [
        ("/bin/cat >/dev/null; echo 'Error writing trailer' >&2", "Error writing trailer"),
        ("/bin/cat >/dev/null", "nothing was written"),
    ] {
        fs::write(bin.join("ffmpeg"), format!("#!/bin/sh\n{script}\n")).unwrap();
        let args = ["water_{}.xyz", "-o", "w.mp4"];
        let (code, error) = render(folder.path(), &args, Some(&bin)).unwrap_err();
        assert!(code == 4 && error.contains(problem), "{code}: {error}");
        assert_eq!(names(folder.path()), before, "a file is left");
    }
    // The same command succeeds if ffmpeg does.
    let script = "#!/bin/sh\nfor last; do :; done\n/bin/cat >\"${last#file:}\"\n";
    fs::write(bin.join("ffmpeg"), script).unwrap();
    render(folder.path(), &["water_{}.xyz", "-o", "w.mp4"], Some(&bin)).unwrap();
}
