//! Farms: many processes, on one machine or on several, that draw one sequence into one folder.
//!
//! Protects what a farm relies on: that no frame is lost, none is half-written, none is taken for
//! what it is not, and that the pictures do not depend on who drew them, or on how often that
//! process was killed.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Barrier, OnceLock};
use std::time::{Duration, Instant, SystemTime};

use limpid::claim::Claims;
use limpid::gpu::Gpu;
use serde_json::Value;
use tempfile::TempDir;

/// Whether pictures can be drawn here; with `LIMPID_REQUIRE_GPU` or `CI` they must.
fn adapter() -> bool {
    static FOUND: OnceLock<Result<(), String>> = OnceLock::new();
    let found = FOUND.get_or_init(|| Gpu::headless().map(|_| ()).map_err(|e| e.to_string()));
    let Err(problem) = found else { return true };
    let set = |name| std::env::var(name).is_ok_and(|value| !value.is_empty() && value != "0");
    let required = set("CI") || set("LIMPID_REQUIRE_GPU");
    assert!(!required, "this test must not be skipped here: {problem}");
    eprintln!("skipped: {problem}");
    false
}

/// A folder with the frames `water/block_1.xyz` and so on: a block of liquid that moves.
struct Project(TempDir);

impl Project {
    fn new(frames: usize) -> Self {
        let project = Self(tempfile::tempdir().expect("a temporary folder"));
        fs::create_dir(project.path("water")).unwrap();
        for frame in 1..=frames {
            project.write_water(frame, 0.03 * frame as f32);
        }
        project
    }

    fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.0.path().join(name)
    }

    fn water(&self, frame: usize) -> PathBuf {
        self.path(format!("water/block_{frame}.xyz"))
    }

    fn write_water(&self, frame: usize, offset: f32) {
        let mut text = String::new();
        for i in 0..8 * 4 * 6 {
            let [x, y, z] = [i % 8, i / 8 % 4, i / 32].map(|i| i as f32 * 0.05);
            writeln!(text, "{:.3} {y:.3} {z:.3}", x + offset).unwrap();
        }
        fs::write(self.water(frame), text).unwrap();
    }

    fn limpid(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
        command.args(["render", "water", "--size=48x36"]).args(args);
        command.current_dir(self.0.path()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn start(&self, args: &[&str]) -> Child {
        self.limpid(args).spawn().expect("the program starts")
    }

    /// Runs what must succeed without a word.
    #[track_caller]
    fn render(&self, args: &[&str]) {
        assert_success(self.limpid(args).output().expect("the program starts"));
    }

    /// Runs it, and returns what became of each frame.
    #[track_caller]
    fn statuses(&self, args: &[&str]) -> BTreeMap<i64, String> {
        let manifest = self.path("statuses.jsonl");
        let _ = fs::remove_file(&manifest);
        let args: Vec<_> = args.iter().copied().chain(["--manifest=statuses.jsonl"]).collect();
        self.render(&args);
        let lines = lines(&manifest).into_iter();
        lines.map(|line| (line["frame"].as_i64().unwrap(), text(&line, "status"))).collect()
    }

    /// The files in a folder, hidden ones included, with their contents.
    fn files(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        let entries = fs::read_dir(self.path(folder)).into_iter().flatten();
        let file = |entry: fs::DirEntry| {
            let name = entry.file_name().into_string().unwrap();
            (name, fs::read(entry.path()).unwrap())
        };
        entries.map(|entry| file(entry.unwrap())).collect()
    }
}

#[track_caller]
fn assert_success(output: Output) {
    let Output { status, stdout, stderr } = output;
    let (stdout, stderr) = (String::from_utf8_lossy(&stdout), String::from_utf8_lossy(&stderr));
    assert!(status.success() && stdout.is_empty() && stderr.is_empty(), "{status}: {stderr}");
}

/// The lines of a manifest, every one of them whole.
#[track_caller]
fn lines(manifest: &Path) -> Vec<Value> {
    let text = fs::read_to_string(manifest).unwrap();
    assert!(text.ends_with('\n'), "{text}");
    let parse = |line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{line}: {e}"));
    text.lines().map(parse).collect()
}

#[track_caller]
fn text(line: &Value, key: &str) -> String {
    line[key].as_str().unwrap_or_else(|| panic!("no {key} in {line}")).to_owned()
}

/// Fails unless both hold the same files, to the byte.
#[track_caller]
fn assert_same(found: &BTreeMap<String, Vec<u8>>, expected: &BTreeMap<String, Vec<u8>>) {
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(found), names(expected));
    for (name, bytes) in expected {
        assert!(&found[name] == bytes, "{name} differs");
    }
}

#[cfg(unix)]
fn signal(child: &Child, name: &str) {
    let status = Command::new("kill").args([format!("-{name}"), child.id().to_string()]).status();
    assert!(status.expect("there is a `kill`").success());
}

/// Waits until something is there that is to come.
fn until(what: &str, mut there: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !there() {
        assert!(begun.elapsed() < Duration::from_secs(120), "{what} does not come");
        std::thread::sleep(Duration::from_millis(5));
    }
}

// ------------------------------------------------------------------------------------ shards

/// The shares of 1, 2, 3 and 7 machines are disjoint, complete, and the same files as one
/// machine's; a share may be empty.
#[test]
fn shards_are_a_single_run() {
    if !adapter() {
        return;
    }
    let project = Project::new(6);
    project.render(&["-o", "single/"]);
    let single = project.files("single");
    assert_eq!(single.len(), 6);
    for count in [1, 2, 3, 7] {
        let mut union = BTreeMap::new();
        let shares: Vec<_> = (1..=count)
            .map(|index| {
                let (shard, folder) = (format!("{index}/{count}"), format!("{count}_{index}/"));
                project.start(&["--shard", &shard, "-o", &folder])
            })
            .collect();
        for (index, share) in (1..=count).zip(shares) {
            assert_success(share.wait_with_output().unwrap());
            for (name, bytes) in project.files(&format!("{count}_{index}")) {
                assert!(union.insert(name, bytes).is_none(), "a frame is in two of {count} shares");
            }
        }
        assert_same(&union, &single);
    }
}

/// Numbered names do not depend on how many of the frames are this share's.
#[test]
fn a_share_of_one_frame_has_its_number() {
    if !adapter() {
        return;
    }
    let project = Project::new(2);
    project.render(&["--shard", "2/2"]);
    assert!(project.path("limpid_0002.png").exists());
    let one_name = project.limpid(&["--shard", "1/2", "-o", "one.png"]).output().unwrap();
    assert_eq!(one_name.status.code(), Some(2), "both shares would have one name");
}

// ---------------------------------------------------------------------------------- restarts

/// Killed without a chance to tidy up, at any moment, a run leaves nothing under a picture's name
/// that is not that picture; started again it completes the sequence, to the byte as if nothing had
/// happened. Ten times here; `LIMPID_KILLS` says otherwise.
#[test]
fn killed_at_any_moment_and_restarted() {
    if !adapter() {
        return;
    }
    let kills = std::env::var("LIMPID_KILLS").map_or(10, |text| text.parse().expect("a number"));
    let project = Project::new(8);
    let aovs = "--aov=depth,inside";
    let begun = Instant::now();
    project.render(&[aovs, "-o", "single/"]);
    let whole_run = begun.elapsed();
    let single = project.files("single");
    assert_eq!(single.len(), 16);
    // Any moments will do; these are not the same in two runs.
    let seed = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap().as_nanos() as u64;
    let mut noise = seed | 1;
    let mut unfinished = 0;
    for kill in 0..kills {
        noise = noise.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let folder = format!("killed_{kill}");
        let mut args = vec![aovs, "--skip-existing", "-o"];
        let output = format!("{folder}/");
        args.push(&output);
        let mut child = project.start(&args);
        std::thread::sleep(whole_run.mul_f64((noise >> 11) as f64 / (1_u64 << 53) as f64));
        child.kill().unwrap();
        child.wait().unwrap();
        let mut left = project.files(&folder);
        left.retain(|name, _| !name.starts_with(".limpid-"));
        unfinished += usize::from(left.len() < single.len());
        for (name, bytes) in &left {
            assert!(bytes == &single[name], "{name} was half-written");
        }

        project.render(&args);
        let mut whole = project.files(&folder);
        whole.retain(|name, _| !name.starts_with(".limpid-"));
        assert_same(&whole, &single);
        fs::remove_dir_all(project.path(&folder)).unwrap();
    }
    println!("{kills} kills (seed {seed}), {unfinished} of them before the end");
    assert!(unfinished > 0, "the kills came too late");
}

/// What killed runs have left is removed when it is old; what may be another run's is not.
#[test]
fn old_temporary_files_are_swept_up() {
    if !adapter() {
        return;
    }
    let project = Project::new(1);
    // Beside a picture and beside a film.
    for output in ["a.png", "a.gif"] {
        for (name, hours) in [(".limpid-old", 25), (".limpid-young", 1), (".other-old", 25)] {
            let file = File::create(project.path(name)).unwrap();
            file.set_modified(SystemTime::now() - Duration::from_hours(hours)).unwrap();
        }
        project.render(&["-o", output]);
        assert!(!project.path(".limpid-old").exists());
        assert!(project.path(".limpid-young").exists() && project.path(".other-old").exists());
    }
}

// ------------------------------------------------------------------------------ fingerprints

const DONE: &str = "done";
const SKIPPED: &str = "skipped";

fn all(status: &str) -> BTreeMap<i64, String> {
    [(1, status.to_owned()), (2, status.to_owned())].into()
}

/// A picture is kept only if this run would draw the same: other settings, another size, camera,
/// radius or scene, other particles and other images beside it are drawn again; other numbers of
/// machines and other reports are not.
#[test]
fn only_the_same_picture_is_skipped() {
    if !adapter() {
        return;
    }
    let project = Project::new(2);
    fs::create_dir(project.path("scenes")).unwrap();
    let scene = |color: &str| {
        let text = format!(
            "[environment]\nradiance = {color}\n[camera]\neye = [0.9, 0.8, 1.6]\n\
             target = [0.3, 0.2, 0.2]\nfov_y = 35.0\n"
        );
        fs::write(project.path("scenes/s.toml"), text).unwrap();
    };
    scene("[0.5, 0.6, 0.7]");
    let base = ["-o", "f/", "--skip-existing", "--radius=0.025", "--scene=scenes/s.toml"];
    let run = |more: &[&str]| {
        let args: Vec<_> = base.iter().chain(more).copied().collect();
        project.statuses(&args)
    };
    assert_eq!(run(&[]), all(DONE));
    assert_eq!(run(&[]), all(SKIPPED));

    // What does not change the picture: not the order either, and not the way there.
    assert_eq!(run(&["--stats=s.json", "--memory=1", "--frames=2,1", "--claim"]), all(SKIPPED));
    let absolute = project.path("water").display().to_string();
    let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
    let scene_path = format!("--scene={}", project.path("scenes/s.toml").display());
    command.args(["render", &absolute, "--size=48x36", "--radius=0.025", &scene_path]);
    command.args(["--skip-existing", "-o", ".", "--manifest=../absolute.jsonl"]);
    assert_success(command.current_dir(project.path("f")).output().unwrap());
    for line in lines(&project.path("absolute.jsonl")) {
        assert_eq!(text(&line, "status"), SKIPPED);
    }

    // What does, there and back.
    let others: [&[&str]; 7] = [
        &["--samples=2"],
        &["--size=40x30"],
        &["--set=liquid.ior=1.2"],
        &["--set=tonemap.exposure=1"],
        &["--camera=eye=1,1,2 target=0.3,0.2,0.2 fov_y=40"],
        &["--preset=imai2016"],
        &["--radius=0.03"],
    ];
    for other in others {
        // The last of two says which size and radius.
        let mut args: Vec<&str> = base.to_vec();
        args.retain(|arg| !(arg.starts_with("--radius") && other[0].starts_with("--radius")));
        args.extend(other);
        let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
        command.args(["render", "water"]).args(&args).current_dir(project.0.path());
        if !other[0].starts_with("--size") {
            command.arg("--size=48x36");
        }
        command.args(["--frames=1", "--manifest=other.jsonl"]);
        assert_success(command.output().unwrap());
        assert_eq!(text(lines(&project.path("other.jsonl")).last().unwrap(), "status"), DONE);
        let expected: BTreeMap<_, _> = [(1, DONE.to_owned()), (2, SKIPPED.to_owned())].into();
        assert_eq!(run(&[]), expected, "{other:?}");
    }
    scene("[0.5, 0.6, 0.8]");
    assert_eq!(run(&[]), all(DONE), "another environment");

    // Other particles: of another length, and of the same written later.
    project.write_water(1, 10.0);
    let expected: BTreeMap<_, _> = [(1, DONE.to_owned()), (2, SKIPPED.to_owned())].into();
    assert_eq!(run(&[]), expected, "a longer file");
    let file = File::options().write(true).open(project.water(1)).unwrap();
    file.set_modified(SystemTime::now() + Duration::from_secs(1)).unwrap();
    assert_eq!(run(&[]), expected, "a later file");
    assert_eq!(run(&[]), all(SKIPPED));
    // The same name, length and time elsewhere.
    fs::rename(project.path("water"), project.path("moved")).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
    command.args(["render", "moved", "--size=48x36", "--manifest=moved.jsonl"]).args(base);
    assert_success(command.current_dir(project.0.path()).output().unwrap());
    for line in lines(&project.path("moved.jsonl")) {
        assert_eq!(text(&line, "status"), DONE, "other files of the same names");
    }
}

/// A picture that is not whole, that another program has touched or made, and one whose images
/// beside it are missing, damaged or of another run, is drawn again.
#[test]
fn only_whole_pictures_are_skipped() {
    if !adapter() {
        return;
    }
    let project = Project::new(1);
    let run = |more: &[&str]| {
        let args: Vec<_> = ["-o", "f/", "--skip-existing"].iter().chain(more).copied().collect();
        project.statuses(&args)[&1].clone()
    };
    assert_eq!(run(&[]), DONE);
    let path = project.path("f/frame_0001.png");
    let good = fs::read(&path).unwrap();
    let flipped = |at: usize| {
        let mut bytes = good.clone();
        bytes[at] ^= 1;
        bytes
    };
    // What another program makes of it, with the texts that it has found.
    let mut retouched = image::load_from_memory(&good).unwrap().into_rgb8();
    retouched.get_pixel_mut(7, 7).0[1] ^= 1;
    let mut touched = Vec::new();
    let mut encoder = png::Encoder::new(&mut touched, 48, 36);
    encoder.set_color(png::ColorType::Rgb);
    let decoder = png::Decoder::new(std::io::Cursor::new(&good)).read_info().unwrap();
    let texts = decoder.info().uncompressed_latin1_text.clone();
    assert_eq!(texts.len(), 3);
    for text in texts {
        encoder.add_text_chunk(text.keyword, text.text).unwrap();
    }
    encoder.write_header().unwrap().write_image_data(&retouched).unwrap();
    let mut plain = std::io::Cursor::new(Vec::new());
    retouched.write_to(&mut plain, image::ImageFormat::Png).unwrap();
    let damaged = [
        ("empty", Vec::new()),
        ("only a head", good[..60].to_vec()),
        ("half", good[..good.len() / 2].to_vec()),
        ("without its end", good[..good.len() - 5].to_vec()),
        ("a bit of its head", flipped(20)),
        ("a bit of its pixels", flipped(good.len() / 2)),
        ("another's", plain.into_inner()),
        ("touched up", touched),
    ];
    for (what, bytes) in damaged {
        fs::write(&path, bytes).unwrap();
        assert_eq!(run(&[]), DONE, "{what}");
        assert!(fs::read(&path).unwrap() == good, "{what}");
    }
    assert_eq!(run(&[]), SKIPPED);

    let aov = "--aov=depth";
    assert_eq!(run(&[aov]), DONE, "no images beside it");
    let images = project.path("f/frame_0001.aov.exr");
    let good = fs::read(&images).unwrap();
    assert_eq!(run(&[aov]), SKIPPED);
    assert_eq!(run(&[]), SKIPPED);
    assert_eq!(run(&["--aov=depth,inside"]), DONE, "other images");
    for bytes in [&good[..0], &good[..100], &good[..good.len() - 9]] {
        fs::write(&images, bytes).unwrap();
        assert_eq!(run(&[aov]), DONE, "{} of {} bytes", bytes.len(), good.len());
        assert!(fs::read(&images).unwrap() == good);
    }
    // Killed between the images and the picture of another run.
    assert_eq!(run(&["--samples=2", aov]), DONE);
    let other = fs::read(&images).unwrap();
    assert_eq!(run(&[aov]), DONE);
    fs::write(&images, other).unwrap();
    assert_eq!(run(&[aov]), DONE, "images of another run");
}

// ------------------------------------------------------------------------------------ claims

/// Two and four processes that are started alike, at once, draw each frame once between them, to the
/// same files as a single run; they share a manifest, and leave no claim.
#[test]
fn claims_share_out_the_frames() {
    if !adapter() {
        return;
    }
    let project = Project::new(12);
    project.render(&["-o", "single/"]);
    for count in [2, 4] {
        let (folder, manifest) = (format!("{count}/"), format!("{count}.jsonl"));
        let all: Vec<_> = (0..count)
            .map(|_| project.start(&["--claim", "-o", &folder, "--manifest", &manifest]))
            .collect();
        let ids: BTreeSet<u64> = all.iter().map(|child| child.id().into()).collect();
        for child in all {
            assert_success(child.wait_with_output().unwrap());
        }
        assert_same(&project.files(&folder), &project.files("single"));
        let lines = lines(&project.path(manifest));
        let mut drawn = BTreeMap::<i64, usize>::new();
        for line in &lines {
            assert!(ids.contains(&line["pid"].as_u64().unwrap()), "{line}");
            if text(line, "status") == DONE {
                *drawn.entry(line["frame"].as_i64().unwrap()).or_default() += 1;
            }
        }
        assert!(drawn.keys().copied().eq(1..=12) && drawn.values().all(|&n| n == 1), "{drawn:?}");
        // Each process says what became of each frame.
        assert_eq!(lines.len(), 12 * count);
    }
}

/// The claim of a dead process is taken over; what it has left is gone in the end. The frame of one
/// that lives is waited for, and drawn by whoever is left if that process gives it up.
#[test]
fn claims_of_the_dead_are_taken_over() {
    if !adapter() {
        return;
    }
    let project = Project::new(3);
    project.render(&["-o", "single/"]);
    fs::create_dir(project.path("f")).unwrap();
    // Claimed by dead processes: before its picture, after it, and twice.
    let claim = |name: &str| {
        let file = File::create(project.path("f").join(name)).unwrap();
        file.set_modified(SystemTime::now() - Duration::from_hours(1)).unwrap();
    };
    fs::copy(project.path("single/frame_0001.png"), project.path("f/frame_0001.png")).unwrap();
    for name in ["frame_0001.png.claim1", "frame_0002.png.claim1", "frame_0002.png.claim2"] {
        claim(name);
    }
    let living = Claims { owner: "a test".into(), timeout: Duration::from_secs(60) };
    let third = project.path("f/frame_0003.png");
    let held = living.take(&third).unwrap().expect("nobody has it");
    let mut child = project.start(&["--claim", "-o", "f/", "--manifest=m.jsonl"]);
    until("the second frame", || project.path("f/frame_0002.png").exists());
    assert!(child.try_wait().unwrap().is_none() && !third.exists(), "it waits");
    drop(held);
    assert_success(child.wait_with_output().unwrap());
    assert_same(&project.files("f"), &project.files("single"));
    let statuses: Vec<_> =
        lines(&project.path("m.jsonl")).iter().map(|line| text(line, "status")).collect();
    assert_eq!(statuses, [SKIPPED, DONE, DONE]);
}

/// A claim is one process's; a stale one is taken over by one of all that try, while its owner may
/// only seem to be dead.
#[test]
fn a_claim_is_one_owners() {
    let folder = tempfile::tempdir().unwrap();
    let names = || {
        let entries = fs::read_dir(folder.path()).unwrap();
        let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
        names.collect::<BTreeSet<_>>()
    };
    let claims =
        |seconds| Claims { owner: "a test\n".into(), timeout: Duration::from_secs(seconds) };
    let picture = folder.path().join("frame_0001.png");
    // At once, by many: one has it.
    let race = |claims: &Claims| {
        let start = Barrier::new(8);
        std::thread::scope(|scope| {
            let takers: Vec<_> = (0..8)
                .map(|_| {
                    scope.spawn(|| {
                        start.wait();
                        claims.take(&picture).unwrap()
                    })
                })
                .collect();
            takers.into_iter().filter_map(|taker| taker.join().unwrap()).collect::<Vec<_>>()
        })
    };
    for _ in 0..20 {
        let mut winners = race(&claims(60));
        assert_eq!(winners.len(), 1);
        assert_eq!(names(), ["frame_0001.png.claim1".to_owned()].into());
        assert_eq!(
            fs::read_to_string(folder.path().join("frame_0001.png.claim1")).unwrap(),
            "a test\n"
        );
        // It hangs, and others take it for dead.
        let hanging = winners.remove(0);
        let file = File::options().write(true).open(folder.path().join("frame_0001.png.claim1"));
        file.unwrap().set_modified(SystemTime::now() - Duration::from_hours(1)).unwrap();
        let mut winners = race(&claims(60));
        assert_eq!(winners.len(), 1, "a stale claim is taken over once");
        let taken = winners.remove(0);
        // It wakes up, and ends: the frame is still the other's.
        drop(hanging);
        assert!(race(&claims(60)).is_empty());
        drop(taken);
        assert!(names().is_empty(), "{:?}", names());
    }

    // While its owner lives, it does not age; the heart beats every sixth of the time.
    let alive = claims(1).take(&picture).unwrap().expect("nobody has it");
    for _ in 0..8 {
        std::thread::sleep(Duration::from_millis(200));
        assert!(claims(1).take(&picture).unwrap().is_none());
    }
    drop(alive);
    let nowhere = folder.path().join("nowhere/frame_0001.png");
    let error = claims(1).take(&nowhere).unwrap_err().to_string();
    assert!(error.contains("nowhere") && error.contains("claim"), "{error}");
}

// ----------------------------------------------------------------------------------- signals

/// The first signal finishes the frame in hand, gives the others up and says by the exit code that
/// not all is done; what is there is whole, and the next run completes it.
#[test]
#[cfg(unix)]
fn signals_finish_the_frame_in_hand() {
    if !adapter() {
        return;
    }
    let project = Project::new(10);
    let big = ["--size=200x150", "--samples=16"];
    let render = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
        command.args(["render", "water"]).args(big).args(more);
        command.current_dir(project.0.path()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    assert_success(render(&["-o", "single/"]).output().unwrap());
    let single = project.files("single");
    for (name, code, folder) in [("INT", 130, "int"), ("TERM", 143, "term")] {
        let output = format!("{folder}/");
        let child = render(&["--claim", "-o", &output]).spawn().unwrap();
        until("a frame", || project.path(folder).join("frame_0002.png").exists());
        signal(&child, name);
        let ended = child.wait_with_output().unwrap();
        let left = project.files(folder);
        // A machine may be so fast that nothing is left to give up.
        let code = if left.len() == single.len() { 0 } else { code };
        assert_eq!(ended.status.code(), Some(code));
        assert!(ended.stderr.is_empty(), "{}", String::from_utf8_lossy(&ended.stderr));
        for (name, bytes) in &left {
            assert!(single.get(name) == Some(bytes), "{name}");
        }
        assert_success(render(&["--claim", "-o", &output]).output().unwrap());
        assert_same(&project.files(folder), &single);
    }
}

/// The second signal ends it at once: no temporary file and no claim is left.
#[test]
#[cfg(unix)]
fn the_second_signal_leaves_nothing_behind() {
    if !adapter() {
        return;
    }
    let project = Project::new(2);
    // Frames that take far longer than this test, where the machine is not too fast.
    let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
    command.args(["render", "water", "--size=1600x1200", "--samples=64", "--claim", "-o", "f/"]);
    command.current_dir(project.0.path()).stderr(Stdio::piped());
    let child = command.spawn().unwrap();
    // Until it draws: the second frame is claimed then.
    until("another claim", || {
        let names = ["f/frame_0002.png.claim1", "f/frame_0002.png"];
        names.iter().any(|name| project.path(name).exists())
    });
    signal(&child, "TERM");
    std::thread::sleep(Duration::from_millis(300));
    signal(&child, "TERM");
    let ended = child.wait_with_output().unwrap();
    let left: Vec<String> = project.files("f").into_keys().collect();
    let code = if left.len() == 2 { 0 } else { 143 };
    assert_eq!(ended.status.code(), Some(code), "{}", String::from_utf8_lossy(&ended.stderr));
    assert!(
        left.iter().all(|name| name.starts_with("frame_") && name.ends_with(".png")),
        "{left:?}"
    );
}

// ---------------------------------------------------------------------- failures and manifest

/// One broken file costs one frame: it is reported with its number, the others are drawn, and the
/// exit code says that not all is well. Without --keep-going it ends the run with its own code.
#[test]
fn keep_going_draws_the_others() {
    if !adapter() {
        return;
    }
    let project = Project::new(4);
    fs::write(project.water(2), "0.1 0.2\nnonsense\n").unwrap();
    let render = |more: &[&str]| {
        let ended = project.limpid(more).output().unwrap();
        (ended.status.code().unwrap(), String::from_utf8(ended.stderr).unwrap())
    };
    let (code, told) = render(&["-o", "f/", "--keep-going", "--manifest=m.jsonl"]);
    let told: Vec<&str> = told.lines().collect();
    assert_eq!(code, 1, "{told:?}");
    let [error, summary] = told[..] else { panic!("{told:?}") };
    assert!(error.starts_with("limpid: frame 2: water/block_2.xyz: line 1"), "{error}");
    assert_eq!(summary, "limpid: 1 of 4 frames failed: 2");
    let names: Vec<_> = project.files("f").into_keys().collect();
    assert_eq!(names, ["frame_0001.png", "frame_0003.png", "frame_0004.png"]);
    let lines = lines(&project.path("m.jsonl"));
    let failed = lines.iter().find(|line| text(line, "status") == "failed").expect("a failure");
    assert_eq!((failed["frame"].as_i64(), failed["code"].as_i64()), (Some(2), Some(4)));
    assert_eq!(format!("limpid: {}", text(failed, "error")), error);

    let (code, told) = render(&["-o", "g/", "--manifest=n.jsonl"]);
    assert_eq!(code, 4, "{told}");
    assert_eq!(told.lines().collect::<Vec<_>>(), [error]);
    assert_eq!(project.files("g").into_keys().collect::<Vec<_>>(), ["frame_0001.png"]);
    // Repaired, what is missing is drawn.
    project.write_water(2, 0.06);
    let (code, told) = render(&["-o", "f/", "--keep-going", "--skip-existing"]);
    assert_eq!((code, told.as_str()), (0, ""));
    assert_eq!(project.files("f").len(), 4);
}

/// Three processes add to one manifest, each line whole and with everything that was promised; a
/// line that a full disk once cut off spoils no other.
#[test]
fn a_manifest_may_be_shared() {
    if !adapter() {
        return;
    }
    let project = Project::new(6);
    let manifest = project.path("m.jsonl");
    File::create(&manifest).unwrap().write_all(b"{\"frame\":7,\"sta").unwrap();
    let shares = ["1/3", "2/3", "3/3"]
        .map(|shard| project.start(&["--shard", shard, "-o", "f/", "--manifest=m.jsonl"]));
    for share in shares {
        assert_success(share.wait_with_output().unwrap());
    }
    let text_of = fs::read_to_string(&manifest).unwrap();
    let (torn, rest) = text_of.split_once('\n').unwrap();
    assert_eq!(torn, "{\"frame\":7,\"sta");
    fs::write(&manifest, rest).unwrap();
    let lines = lines(&manifest);
    assert_eq!(lines.len(), 6);
    let mut frames = BTreeSet::new();
    for line in lines {
        frames.insert(line["frame"].as_i64().unwrap());
        assert_eq!(text(&line, "status"), DONE);
        let picture = image::open(project.path(text(&line, "file"))).unwrap().into_rgb8();
        let mut crc = flate2::Crc::new();
        crc.update(&picture);
        assert_eq!(text(&line, "pixels"), format!("{:08x}", crc.sum()));
        assert_eq!(text(&line, "fingerprint").len(), 32);
        assert_eq!(line["particles"].as_u64(), Some(192));
        assert!(line["ms"].as_f64().unwrap() > 0.0);
        assert!(!text(&line, "adapter").is_empty() && !text(&line, "host").is_empty());
        assert!(line["pid"].as_u64().is_some());
    }
    assert!(frames.into_iter().eq(1..=6));
}

/// A film is one file: what concerns pictures is refused before anything is drawn.
#[test]
fn films_are_not_shared_out() {
    let project = Project::new(2);
    for option in ["--claim", "--keep-going", "--manifest=m.jsonl"] {
        let ended = project.limpid(&["-o", "film.apng", option]).output().unwrap();
        let told = String::from_utf8(ended.stderr).unwrap();
        assert_eq!(ended.status.code(), Some(2), "{told}");
        let name = option.split('=').next().unwrap();
        assert!(told.contains("film.apng") && told.contains(name), "{told}");
    }
    assert!(!project.path("film.apng").exists() && !project.path("m.jsonl").exists());
}

// ------------------------------------------------------------------------------------- Slurm

/// A real Slurm runs the job array of the documentation, with one task killed and one requeued in
/// the middle. Only where Slurm is installed, or `LIMPID_REQUIRE_SLURM=1` says that it must run.
#[test]
#[cfg(target_os = "linux")]
fn slurm_draws_every_frame_once() {
    let required = std::env::var("LIMPID_REQUIRE_SLURM").is_ok_and(|value| value == "1");
    let installed = ["/usr/sbin", "/usr/bin", "/usr/local/sbin"]
        .iter()
        .any(|folder| Path::new(folder).join("slurmctld").exists());
    if !adapter() || !(installed || required) {
        eprintln!("skipped: no Slurm here");
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/slurm.sh");
    let ended = Command::new(script).arg(env!("CARGO_BIN_EXE_limpid")).output().unwrap();
    let told = String::from_utf8_lossy(&ended.stdout);
    assert!(ended.status.success(), "{told}{}", String::from_utf8_lossy(&ended.stderr));
    println!("{told}");
}
