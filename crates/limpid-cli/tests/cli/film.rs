//! Films: written files are decoded and compared with their pictures, directly and through the command
//! line.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

use glam::UVec2;
use image::{AnimationDecoder as _, Rgb, RgbImage};
use limpid::gpu::Gpu;
use limpid_io::Error;
use limpid_io::film::{Film, FilmFormat};
use tempfile::TempDir;

const SIZE: UVec2 = UVec2::new(160, 120);

fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// Names of all entries of a folder, including hidden temporary files.
fn names(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).expect("the folder can be listed");
    entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
}

fn is_set(name: &str) -> bool {
    std::env::var(name).is_ok_and(|value| !value.is_empty() && value != "0")
}

/// Whether ffmpeg and ffprobe exist; with `LIMPID_REQUIRE_FFMPEG` a missing one fails the test.
fn ffmpeg() -> bool {
    static FOUND: OnceLock<bool> = OnceLock::new();
    let found = FOUND.get_or_init(|| {
        let runs = |name| Command::new(name).arg("-version").output().is_ok();
        runs("ffmpeg") && runs("ffprobe")
    });
    assert!(*found || !is_set("LIMPID_REQUIRE_FFMPEG"), "this test must not be skipped here");
    if !found {
        eprintln!("skipped: no ffmpeg and ffprobe on PATH");
    }
    *found
}

/// Whether there is an adapter; with `LIMPID_REQUIRE_GPU` or `CI` a missing one fails the test.
fn adapter() -> bool {
    static FOUND: OnceLock<Result<(), String>> = OnceLock::new();
    let found = FOUND.get_or_init(|| Gpu::headless().map(|_| ()).map_err(|e| e.to_string()));
    let Err(problem) = found else { return true };
    let required = is_set("CI") || is_set("LIMPID_REQUIRE_GPU");
    assert!(!required, "this test must not be skipped here: {problem}");
    eprintln!("skipped: {problem}");
    false
}

/// A picture of few colours: a bar that moves with every frame.
fn few_colors(frame: u32) -> RgbImage {
    RgbImage::from_fn(SIZE.x, SIZE.y, |x, y| match (x / 8 + 20 - frame) % 20 {
        0 => Rgb([250, 20, 90]),
        _ => Rgb([40, (y / 8 * 16) as u8, 200]),
    })
}

/// A picture of more colours than a GIF can have.
fn many_colors(frame: u32) -> RgbImage {
    let part = |x: u32, size: u32| (x * 255 / size) as u8;
    RgbImage::from_fn(SIZE.x, SIZE.y, |x, y| {
        Rgb([part(x, SIZE.x), part(y, SIZE.y), 30 * frame as u8])
    })
}

/// Writes a film of these pictures, which must be the only file in its folder.
fn write(path: &Path, fps: f64, pictures: &[RgbImage]) {
    let mut film = Film::create(path, SIZE, fps).expect("the film begins");
    for picture in pictures {
        film.push(picture).expect("the picture is added");
    }
    film.finish().expect("the film ends");
    let folder = path.parent().unwrap();
    assert_eq!(names(folder), [path.file_name().unwrap().to_str().unwrap().into()].into());
}

/// Reads the pictures of a GIF, their delays, 1/100 s, and its repetition.
fn read_gif(path: &Path) -> (Vec<RgbImage>, Vec<u16>, gif::Repeat) {
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(fs::File::open(path).unwrap()).unwrap();
    let size = UVec2::new(decoder.width().into(), decoder.height().into());
    let (mut pictures, mut delays) = (Vec::new(), Vec::new());
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        assert_eq!((frame.left, frame.top), (0, 0));
        let rgb = frame.buffer.chunks_exact(4).flat_map(|pixel| pixel[..3].iter().copied());
        pictures.push(RgbImage::from_raw(size.x, size.y, rgb.collect()).expect("whole frames"));
        delays.push(frame.delay);
    }
    let repeat = decoder.repeat();
    (pictures, delays, repeat)
}

fn read_apng(path: &Path) -> Vec<RgbImage> {
    let file = std::io::BufReader::new(fs::File::open(path).unwrap());
    let decoder = image::codecs::png::PngDecoder::new(file).unwrap();
    assert!(decoder.is_apng().unwrap());
    let frames = decoder.apng().unwrap().into_frames().collect_frames().unwrap();
    let rgb = |frame: image::Frame| image::DynamicImage::from(frame.into_buffer()).into_rgb8();
    frames.into_iter().map(rgb).collect()
}

/// Mean absolute difference per channel, 0 to 255.
fn difference(a: &RgbImage, b: &RgbImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let total: f64 = a.iter().zip(b.iter()).map(|(&a, &b)| f64::from(a.abs_diff(b))).sum();
    total / a.len() as f64
}

// ------------------------------------------------------------------------- GIF and APNG

/// An APNG preserves its pictures bit-exactly, and has the right number of frames, known only at the
/// end, and the right delays.
#[test]
fn an_apng_is_lossless_and_exactly_timed() {
    let folder = folder();
    let path = folder.path().join("film.apng");
    for (fps, delay) in [(30.0, (1, 30)), (29.97, (100, 2997)), (0.5, (2, 1)), (1000.0, (1, 1000))]
    {
        for count in [1, 5] {
            let pictures: Vec<_> = (0..count).map(many_colors).collect();
            write(&path, fps, &pictures);
            assert_eq!(read_apng(&path), pictures);
            // Refused as a picture, which would be its first frame.
            let error = limpid_lab::compare::load_picture(&path).unwrap_err().to_string();
            assert!(error.contains("film"), "{error}");

            let mut options = png::DecodeOptions::default();
            options.set_skip_ancillary_crc_failures(false);
            let file = std::io::BufReader::new(fs::File::open(&path).unwrap());
            let mut reader = png::Decoder::new_with_options(file, options).read_info().unwrap();
            let control = *reader.info().animation_control().expect("an animation");
            assert_eq!((control.num_frames, control.num_plays), (count, 0));
            for _ in 0..count {
                reader.next_frame(&mut vec![0; reader.output_buffer_size().unwrap()]).unwrap();
                let control = reader.info().frame_control().expect("a frame");
                assert_eq!((control.delay_num, control.delay_den), delay, "{fps} per second");
            }
        }
    }
}

/// A GIF of few colours preserves its pictures bit-exactly, and repeats for ever.
#[test]
fn a_gif_of_few_colors_is_lossless() {
    let folder = folder();
    let path = folder.path().join("film.gif");
    let pictures: Vec<_> = (0..6).map(few_colors).collect();
    write(&path, 25.0, &pictures);
    let (read, delays, repeat) = read_gif(&path);
    assert!(read == pictures);
    assert_eq!(delays, [4; 6]);
    assert_eq!(repeat, gif::Repeat::Infinite);
}

/// A GIF of many colours approximates its pictures closely, since every frame has its own palette.
#[test]
fn a_gif_of_many_colors_is_close() {
    let folder = folder();
    let path = folder.path().join("film.gif");
    let pictures: Vec<_> = (0..6).map(many_colors).collect();
    write(&path, 25.0, &pictures);
    let (read, ..) = read_gif(&path);
    for (read, picture) in read.iter().zip(&pictures) {
        assert!(difference(read, picture) < 6.0, "{}", difference(read, picture));
    }
    // The measure distinguishes frames.
    assert!(difference(&read[0], &pictures[3]) > 20.0);
}

/// A GIF plays at its rate, although its delays are multiples of 1/100 s: each differs by less than one,
/// and their sum by at most half of one.
#[test]
fn delays_of_a_gif_do_not_drift() {
    let folder = folder();
    let path = folder.path().join("film.gif");
    let pictures: Vec<_> = (0..50).map(|_| RgbImage::new(SIZE.x, SIZE.y)).collect();
    for fps in [30.0, 24.0, 29.97, 50.0, 7.0] {
        write(&path, fps, &pictures);
        let (_, delays, _) = read_gif(&path);
        let mut sum = 0;
        for (frame, delay) in (1..).zip(delays) {
            sum += u32::from(delay);
            let time = f64::from(frame) * 100.0 / fps;
            assert!((f64::from(sum) - time).abs() <= 0.5, "{fps}: frame {frame} ends at {sum}");
            assert!((f64::from(delay) - 100.0 / fps).abs() < 1.0);
        }
    }
}

// -------------------------------------------------------------------------- MP4 and WebM

/// A video has the right properties and, decoded by the matrix that it names, the colours of its
/// pictures.
#[test]
fn videos_have_the_right_properties_and_colors() {
    if !ffmpeg() {
        return;
    }
    // Saturated colours, for which the matrices differ most, and a picture with gradients.
    let colors = [[200, 30, 60], [20, 180, 40], [30, 60, 210], [128, 128, 128]];
    let mut pictures: Vec<_> =
        colors.into_iter().map(|color| RgbImage::from_pixel(SIZE.x, SIZE.y, Rgb(color))).collect();
    pictures.push(many_colors(4));
    for (kind, codec) in [("mp4", "h264"), ("webm", "vp9")] {
        let folder = folder();
        // A name that ffmpeg would read as a protocol without the prefix `file:`.
        let path = folder.path().join(format!("a:b %d 'c'.{kind}"));
        write(&path, 29.97, &pictures);
        let entries = "stream=codec_name,width,height,pix_fmt,color_range,color_space,\
                       r_frame_rate,nb_read_frames";
        let output = Command::new("ffprobe")
            .args(["-v", "error", "-count_frames", "-of", "default=nw=1:nk=0"])
            .args(["-show_entries", entries])
            .arg(file_url(&path))
            .output()
            .unwrap();
        let output = String::from_utf8(output.stdout).unwrap();
        for expected in [
            &format!("codec_name={codec}"),
            "width=160",
            "height=120",
            "pix_fmt=yuv420p",
            "color_range=tv",
            "color_space=bt709",
            "r_frame_rate=2997/100",
            "nb_read_frames=5",
        ] {
            assert!(output.lines().any(|line| line == expected), "{expected}: {output}");
        }
        let by_tag = decode(&path, "auto");
        let by_other = decode(&path, "bt601");
        assert_eq!(by_tag.len(), 5);
        for (i, picture) in pictures.iter().enumerate() {
            let [near, far] = [&by_tag, &by_other].map(|all| difference(&all[i], picture));
            assert!(near < 2.5, "{kind}: frame {i} is off by {near}");
            // The measure distinguishes the matrices, except for grey.
            assert!(far > 4.0 || i == 3, "{kind}: frame {i} by another matrix is off by {far}");
        }
    }
}

/// Videos of the same pictures are the same bytes, without random names inside.
#[test]
fn videos_are_reproducible() {
    if !ffmpeg() {
        return;
    }
    for kind in ["mp4", "webm"] {
        let [one, other] = [(); 2].map(|()| {
            let folder = folder();
            let path = folder.path().join("film").with_extension(kind);
            write(&path, 25.0, &[many_colors(1), many_colors(2)]);
            fs::read(path).unwrap()
        });
        assert!(one == other, "{kind}");
    }
}

fn file_url(path: &Path) -> String {
    format!("file:{}", path.display())
}

/// Decodes the pictures of a video with the colour matrix `matrix`.
fn decode(path: &Path, matrix: &str) -> Vec<RgbImage> {
    let filter = format!("scale=in_color_matrix={matrix}:flags=accurate_rnd+full_chroma_int");
    let output = Command::new("ffmpeg")
        .args(["-v", "error", "-nostdin", "-i", &file_url(path), "-vf", &filter])
        .args(["-f", "rawvideo", "-pix_fmt", "rgb24", "pipe:1"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let frames = output.stdout.chunks_exact((3 * SIZE.x * SIZE.y) as usize);
    frames.map(|rgb| RgbImage::from_raw(SIZE.x, SIZE.y, rgb.to_vec()).unwrap()).collect()
}

/// The index of an MP4 precedes its pictures, so that it plays while it is still being downloaded.
#[test]
fn an_mp4_begins_with_its_index() {
    if !ffmpeg() {
        return;
    }
    let folder = folder();
    let path = folder.path().join("film.mp4");
    write(&path, 30.0, &[many_colors(0), many_colors(1)]);
    let bytes = fs::read(path).unwrap();
    let at = |name: &[u8]| bytes.windows(4).position(|window| window == name).unwrap();
    assert!(at(b"moov") < at(b"mdat"));
}

// ------------------------------------------------------------------------------ failures

/// An unfinished film leaves no file and no process, and does not replace an earlier film.
#[test]
fn a_dropped_film_leaves_nothing() {
    for name in ["film.gif", "film.apng", "film.mp4", "film.webm"] {
        if matches!(FilmFormat::of(Path::new(name)), Some(FilmFormat::Mp4 | FilmFormat::Webm))
            && !ffmpeg()
        {
            continue;
        }
        let folder = folder();
        let path = folder.path().join(name);
        let before = "GIF89a: a film that was there before";
        fs::write(&path, before).unwrap();
        let mut film = Film::create(&path, SIZE, 30.0).unwrap();
        for frame in 0..3 {
            film.push(&many_colors(frame)).unwrap();
        }
        assert_eq!(names(folder.path()).len(), 2, "{name}: no temporary file");
        // A running encoder is counted.
        let video = name.ends_with("mp4") || name.ends_with("webm");
        assert!(!cfg!(target_os = "linux") || processes(folder.path()) == usize::from(video));
        drop(film);
        assert_eq!(processes(folder.path()), 0, "{name}");
        assert_eq!(names(folder.path()), [name.into()].into());
        assert_eq!(fs::read_to_string(&path).unwrap(), before);
    }
}

/// Number of processes with this folder on their command line; 0 without `/proc`.
fn processes(folder: &Path) -> usize {
    let folder = folder.to_str().unwrap();
    let Ok(entries) = fs::read_dir("/proc") else { return 0 };
    let lines = entries.filter_map(|entry| fs::read(entry.ok()?.path().join("cmdline")).ok());
    lines.filter(|line| String::from_utf8_lossy(line).contains(folder)).count()
}

/// A format, size or rate that no film can have is refused at once, with the remedy, and nothing is
/// written.
#[test]
fn invalid_films_are_refused() {
    let folder = folder();
    let refusal = |name: &str, size: [u32; 2], fps: f64| {
        let made = Film::create(&folder.path().join(name), size.into(), fps);
        let error = made.map(|_| ()).expect_err(name);
        assert!(matches!(error, Error::Usage(_)), "{error:?}");
        error.to_string()
    };
    let cases = [
        (refusal("film.avi", [160, 120], 30.0), ".mp4, .webm, .gif or .apng"),
        (refusal("film", [160, 120], 30.0), ".mp4, .webm, .gif or .apng"),
        (refusal("film.mp4", [161, 120], 30.0), "162x120"),
        (refusal("film.webm", [161, 119], 30.0), "162x120"),
        (refusal("film.gif", [160, 120], 60.0), ".apng"),
        (refusal("film.gif", [70000, 120], 30.0), "65535"),
        (refusal("film.apng", [0, 120], 30.0), "0x120"),
        (refusal("film.apng", [160, 120], 0.0), "between 0.01 and 1000"),
        (refusal("film.gif", [160, 120], f64::NAN), "between 0.01 and 1000"),
    ];
    for (error, expected) in cases {
        assert!(error.contains(expected), "`{expected}` is missing in: {error}");
    }
    assert_eq!(names(folder.path()), BTreeSet::new());
    // Only videos refuse odd sizes.
    Film::create(&folder.path().join("film.GIF"), UVec2::new(161, 119), 50.0).unwrap();

    let nowhere = folder.path().join("nowhere/film.gif");
    let error = Film::create(&nowhere, SIZE, 30.0).map(|_| ()).unwrap_err();
    assert!(matches!(error, Error::Io { .. }) && error.to_string().contains("nowhere/film.gif"));
    let directory = folder.path().join("directory.gif");
    fs::create_dir(&directory).unwrap();
    Film::create(&directory, SIZE, 30.0).map(|_| ()).unwrap_err();

    let mut film = Film::create(&folder.path().join("film.gif"), SIZE, 30.0).unwrap();
    let error = film.push(&RgbImage::new(120, 160)).unwrap_err();
    assert!(matches!(error, Error::Mismatch(_)), "{error:?}");
    let error = film.finish().unwrap_err();
    assert!(error.to_string().contains("a film without pictures"), "{error}");
    assert_eq!(names(folder.path()), ["directory.gif".into()].into());
}

// -------------------------------------------------------------------- the command line

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
