//! The real window, under Xvfb with a software adapter, driven by simulated input.
//!
//! Xvfb and xdotool must be on PATH; otherwise the tests print a message and pass, unless
//! `LIMPID_REQUIRE_WINDOW` is set.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use glam::Vec3;
use limpid::liquid::Particles;
use serde_json::Value;

const DATA: &str =
    concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/tests/data/double_dam_break/");

/// Timeout of every wait, long enough for a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// A virtual X server.
struct Screen {
    server: Child,
    display: String,
    folder: tempfile::TempDir,
}

impl Screen {
    /// Starts a server; `None` without Xvfb or xdotool.
    fn start() -> Option<Self> {
        let folder = tempfile::tempdir().expect("a folder");
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp", "-fbdir"])
            .arg(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let xdotool = Command::new("xdotool").arg("--help").output();
        let (Ok(mut server), Ok(_)) = (server, xdotool) else {
            let required = std::env::var_os("LIMPID_REQUIRE_WINDOW").is_some();
            assert!(!required, "Xvfb and xdotool are required");
            eprintln!("not tested: no Xvfb or no xdotool");
            return None;
        };
        let mut number = String::new();
        let output = server.stdout.take().expect("it is piped");
        BufReader::new(output).read_line(&mut number).expect("Xvfb prints its number");
        Some(Self { server, display: format!(":{}", number.trim()), folder })
    }

    /// Runs xdotool, which presses keys, moves the pointer and changes windows; returns its output.
    fn tool(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool")
            .env("DISPLAY", &self.display)
            .args(arguments)
            .output()
            .expect("xdotool starts");
        assert!(output.status.success(), "xdotool {arguments:?}");
        String::from_utf8_lossy(&output.stdout).trim().to_owned()
    }

    /// Waits for the window, focuses it, and returns its id for xdotool.
    fn window(&self) -> String {
        let id = self.tool(&["search", "--sync", "--onlyvisible", "--name", "limpid"]);
        let id = id.lines().last().expect("a window").to_owned();
        self.tool(&["windowfocus", "--sync", &id]);
        id
    }

    /// Reads width, height and pixels of the screen from the server's XWD dump: a header of 25
    /// big-endian words, colours of 12 bytes each, rows.
    fn pixels(&self) -> (usize, usize, Vec<[u8; 3]>) {
        let dump = fs::read(self.folder.path().join("Xvfb_screen0")).expect("a screen");
        let word = |i: usize| {
            let bytes = dump[4 * i..4 * i + 4].try_into().expect("four bytes");
            u32::from_be_bytes(bytes) as usize
        };
        let (width, height, row, start) = (word(4), word(5), word(12), word(0) + 12 * word(19));
        let pixel = |x: usize, y: usize| {
            let at = start + y * row + 4 * x;
            [dump[at + 2], dump[at + 1], dump[at]]
        };
        let all = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        (width, height, all.map(|(x, y)| pixel(x, y)).collect())
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// A running `limpid view`, with its log.
struct Window {
    program: Option<Child>,
    log: PathBuf,
    /// Number of events already waited for.
    seen: usize,
}

impl Window {
    fn open(screen: &Screen, folder: &Path, arguments: &[&str]) -> Self {
        let log = folder.join("log.jsonl");
        let program = Command::new(env!("CARGO_BIN_EXE_limpid"))
            .env("DISPLAY", &screen.display)
            .env_remove("WAYLAND_DISPLAY")
            .env("RUST_BACKTRACE", "0")
            .arg("view")
            .args(arguments)
            .arg("--log")
            .arg(&log)
            .stderr(fs::File::create(folder.join("stderr")).expect("a file"))
            .spawn()
            .expect("it starts");
        Self { program: Some(program), log, seen: 0 }
    }

    fn events(&self) -> Vec<Value> {
        let text = fs::read_to_string(&self.log).unwrap_or_default();
        // The last line may be incomplete.
        text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
    }

    /// Waits for an event that satisfies `condition`, after those already waited for.
    #[track_caller]
    fn wait(&mut self, what: &str, condition: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        loop {
            let events = self.events();
            let mut new = events.iter().enumerate().skip(self.seen);
            let found = new.find(|(_, event)| condition(event));
            if let Some((i, event)) = found {
                self.seen = i + 1;
                return event.clone();
            }
            let ended = self.program.as_mut().and_then(|p| p.try_wait().expect("a state"));
            assert!(ended.is_none(), "ended with {ended:?} before: {what}; {}", last(&events));
            assert!(start.elapsed() < PATIENCE, "not in time: {what}; {}", last(&events));
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    #[track_caller]
    fn wait_for(&mut self, event: &str) -> Value {
        self.wait(event, |e| e["event"] == event)
    }

    /// Skips all present events.
    fn skip_events(&mut self) {
        self.seen = self.events().len();
    }

    /// Waits for the program to end successfully, and returns stderr.
    #[track_caller]
    fn end(&mut self, folder: &Path) -> String {
        let mut program = self.program.take().expect("it has not ended");
        let start = Instant::now();
        let status = loop {
            if let Some(status) = program.try_wait().expect("a state") {
                break status;
            }
            if start.elapsed() > PATIENCE {
                let _ = program.kill();
                panic!("the program does not end");
            }
            std::thread::sleep(Duration::from_millis(20));
        };
        let stderr = fs::read_to_string(folder.join("stderr")).expect("a file");
        assert!(status.success(), "{status:?}: {stderr}");
        stderr
    }
}

/// Formats the last events, one per line.
fn last(events: &[Value]) -> String {
    let lines = events.iter().skip(events.len().saturating_sub(8)).map(Value::to_string);
    lines.collect::<Vec<_>>().join("\n")
}

impl Drop for Window {
    fn drop(&mut self) {
        if let Some(program) = &mut self.program {
            let _ = program.kill();
            let _ = program.wait();
        }
    }
}

/// The window plays, scrubs, orbits, zooms, changes a setting and a view mode, is resized, hidden, shown
/// again and closed, without a panic or a validation error of wgpu, and shows a picture.
#[test]
fn window_handles_all_interactions() {
    let Some(screen) = Screen::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let input = format!("{DATA}ParticleData_Fluid_{{}}.bgeo");
    let arguments = [input.as_str(), "--radius", "0.025", "--size", "1000x640"];
    let mut window = Window::open(&screen, folder.path(), &arguments);
    window.wait_for("opened");
    window.wait("a picture at rest", |e| e["event"] == "picture" && e["level"] == "fine");
    let id = screen.window();
    let title = screen.tool(&["getwindowname", &id]);
    assert_eq!(title, "ParticleData_Fluid_{}.bgeo - limpid");

    // The picture's area, without the panels, has many colours.
    let (width, _, pixels) = screen.pixels();
    let middle: Vec<_> = (100..500)
        .flat_map(|y| (50..600).map(move |x| (x, y)))
        .map(|(x, y)| pixels[y * width + x])
        .collect();
    let mut colors = middle;
    colors.sort_unstable();
    colors.dedup();
    assert!(colors.len() > 200, "{} colours", colors.len());

    screen.tool(&["key", "space"]);
    window.wait_for("play");
    window.wait("the second frame", |e| e["event"] == "picture" && e["moment"] == 1);
    window.wait("the third frame", |e| e["event"] == "picture" && e["moment"] == 2);
    screen.tool(&["key", "space"]);
    window.wait_for("pause");

    // A drag on the timeline, from the middle towards the end.
    screen.tool(&["key", "Home"]);
    screen.tool(&["key", "End"]);
    window.wait("the last frame", |e| e["event"] == "picture" && e["moment"] == 4);
    window.skip_events();
    screen.tool(&["mousemove", "--window", &id, "400", "592", "mousedown", "1"]);
    window.wait_for("seek");
    screen.tool(&["mousemove", "--window", &id, "700", "592"]);
    let sought = window.wait("the end", |e| e["event"] == "seek" && e["index"].as_u64() > Some(2));
    screen.tool(&["mouseup", "1"]);
    window.wait("its picture", |e| e["event"] == "picture" && e["moment"] == sought["index"]);

    // A drag on the picture.
    window.skip_events();
    screen.tool(&["mousemove", "--window", &id, "300", "300", "mousedown", "1"]);
    // A press and a release between two frames of a slow interface would be a click.
    std::thread::sleep(Duration::from_millis(300));
    for x in ["320", "350", "380"] {
        screen.tool(&["mousemove", "--window", &id, x, "310"]);
        window.wait_for("camera");
    }
    screen.tool(&["mouseup", "1"]);
    let draft = window.wait("a draft", |e| e["event"] == "picture" && e["level"] == "draft");
    let fine = window.wait("at rest", |e| e["event"] == "picture" && e["level"] == "fine");
    assert!(draft["width"].as_u64() <= fine["width"].as_u64());

    // The wheel zooms.
    screen.tool(&["mousemove", "--window", &id, "300", "300", "click", "4"]);
    window.wait_for("camera");

    // The slider of the index of refraction.
    screen.tool(&["mousemove", "--window", &id, "745", "56", "click", "1"]);
    std::thread::sleep(Duration::from_millis(300));
    window.skip_events();
    screen.tool(&["mousemove", "--window", &id, "827", "260", "mousedown", "1"]);
    std::thread::sleep(Duration::from_millis(300));
    screen.tool(&["mousemove", "--window", &id, "845", "260"]);
    window.wait_for("setting");
    screen.tool(&["mouseup", "1"]);

    screen.tool(&["key", "v"]);
    window.wait("a view mode", |e| e["event"] == "view" && e["view"] == "Depth");
    window.wait("it at rest", |e| e["event"] == "picture" && e["level"] == "fine");

    window.skip_events();
    screen.tool(&["windowsize", &id, "760", "480"]);
    window.wait_for("resize");
    window.wait("it at rest", |e| e["event"] == "picture" && e["level"] == "fine");

    // The smallest window, then hidden.
    screen.tool(&["windowsize", &id, "1", "1"]);
    std::thread::sleep(Duration::from_millis(200));
    screen.tool(&["windowunmap", &id]);
    std::thread::sleep(Duration::from_millis(200));
    screen.tool(&["windowmap", &id]);
    window.skip_events();
    screen.tool(&["windowsize", &id, "900", "600"]);
    window.wait("a picture again", |e| {
        e["event"] == "picture" && e["level"] == "fine" && e["width"].as_u64() > Some(300)
    });

    screen.tool(&["windowfocus", &id]);
    screen.tool(&["key", "ctrl+q"]);
    let stderr = window.end(folder.path());
    let lowercase = stderr.to_lowercase();
    assert!(!lowercase.contains("panic") && !lowercase.contains("validation"), "{stderr}");
    let events = window.events();
    assert_eq!(events.last().expect("events")["event"], "close");
    assert!(!events.iter().any(|e| e["event"] == "notice"), "{events:#?}");
}

/// Without a display server, `limpid view` fails with exit code 5 and suggests `limpid render`.
#[test]
fn view_without_a_display_is_an_error() {
    let output = Command::new(env!("CARGO_BIN_EXE_limpid"))
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .args(["view", "sims/slab.toml"])
        .output()
        .expect("it starts");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(5), "{stderr}");
    assert!(stderr.contains("limpid render"), "{stderr}");
}

/// Loading never blocks the interface: while frames of many particles are read and classified, the
/// interface keeps working. The longest times on a machine are measured by:
///
/// ```text
/// LIMPID_PARTICLES=1000000 cargo test --release --features viewer-tests --test viewer -- \
///     window::loading --nocapture
/// ```
#[test]
fn loading_does_not_block_the_interface() {
    let Some(screen) = Screen::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let count: usize = std::env::var("LIMPID_PARTICLES")
        .map_or(30_000, |text| text.parse().expect("LIMPID_PARTICLES is a number"));
    let side = (count as f64).cbrt().ceil() as usize;
    for number in 0..3 {
        let place = |i: usize| {
            let cell = [i % side, i / side % side, i / side / side].map(|c| c as f32);
            0.02 * Vec3::from_array(cell) + 0.001 * number as f32
        };
        let particles =
            Particles { positions: (0..count).map(place).collect(), ..Default::default() };
        limpid_io::particles::write(&particles, &folder.path().join(format!("m_{number}.bgeo")))
            .expect("it is written");
    }
    let pattern = folder.path().join("m_{}.bgeo");
    let pattern = pattern.to_string_lossy();
    let arguments = [pattern.as_ref(), "--radius", "0.01", "--size", "640x480"];
    let mut window = Window::open(&screen, folder.path(), &arguments);
    window.wait_for("opened");
    let id = screen.window();
    screen.tool(&["key", "space"]);
    window.wait_for("play");
    // The pointer moves while frames are loading.
    let start = Instant::now();
    // Drawn when its time comes, or before and kept.
    let shows = |e: &Value| e["event"] == "picture" || e["event"] == "flip";
    let has_last = |window: &Window| window.events().iter().any(|e| shows(e) && e["moment"] == 2);
    while !has_last(&window) {
        assert!(start.elapsed() < 3 * PATIENCE, "not in time: the last frame");
        for x in ["100", "140"] {
            screen.tool(&["mousemove", "--window", &id, x, "200"]);
            std::thread::sleep(Duration::from_millis(30));
        }
    }
    screen.tool(&["key", "ctrl+q"]);
    window.end(folder.path());
    let events = window.events();
    let close = events.last().expect("events");
    let frames = events.iter().filter(|e| e["event"] == "picture").count();
    println!(
        "{count} particles a frame, {frames} pictures: the interface worked at most {:.1} ms at a \
         time, and was called again after at most {:.1} ms",
        close["longest_ui_ms"].as_f64().expect("a time"),
        close["longest_gap_ms"].as_f64().expect("a time"),
    );
}

/// Once each frame is drawn, a sequence that draws too slowly plays from memory: two rounds without a picture
/// that is drawn. The rate of a longer sequence, in a picture of 640×480 or more, is measured by:
///
/// ```text
/// LIMPID_SEQUENCE=$PWD/sims/dam_break.toml LIMPID_SIZE=1000x640 cargo test --features viewer-tests \
///     --test viewer -- window::full_flipbook --nocapture
/// ```
#[test]
fn full_flipbook_plays_without_drawing() {
    let Some(screen) = Screen::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let own = format!("{DATA}ParticleData_Fluid_{{}}.bgeo");
    let input = std::env::var("LIMPID_SEQUENCE").unwrap_or(own);
    let size = std::env::var("LIMPID_SIZE").unwrap_or_else(|_| "700x480".into());
    let mut window =
        Window::open(&screen, folder.path(), &[&input, "--fps", "30", "--size", &size]);
    let mut played = window.wait_for("opened");
    let frames = played["frames"].as_u64().expect("a number");
    if played["plays"] == false {
        let at_rest = |e: &Value| e["event"] == "picture" && e["level"] == "fine";
        window.wait("a picture at rest", at_rest);
        screen.window();
        screen.tool(&["key", "space"]);
        played = window.wait_for("play");
    }
    loop {
        let event = |e: &Value| e["event"] == "flip" || e["event"] == "picture";
        window.wait("playback", event);
        let events = window.events();
        let Some(drawn) = events.iter().rposition(|e| e["event"] == "picture") else { continue };
        let picture = &events[drawn];
        let flips: Vec<_> = events[drawn..].iter().filter(|e| e["event"] == "flip").collect();
        let moment = |e: &Value| e["moment"].as_u64().expect("an index");
        let advance = |pair: &[&Value]| (moment(pair[1]) + frames - moment(pair[0])) % frames;
        let advanced: u64 = flips.windows(2).map(advance).sum();
        if advanced < 2 * frames {
            continue;
        }
        let seconds = |from: &Value, to: &Value| {
            to["t"].as_f64().expect("a time") - from["t"].as_f64().expect("a time")
        };
        let (first, last) = (flips[0], flips[flips.len() - 1]);
        let playing = seconds(first, last);
        println!(
            "{frames} frames of {}×{}: drawn in {:.0} s; then {:.1} frames/s of the sequence, {:.1} shown",
            picture["width"],
            picture["height"],
            seconds(&played, first),
            advanced as f64 / playing,
            (flips.len() - 1) as f64 / playing,
        );
        break;
    }
    screen.window();
    screen.tool(&["key", "ctrl+q"]);
    window.end(folder.path());
}
