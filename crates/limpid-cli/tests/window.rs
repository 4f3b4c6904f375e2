//! The real window, under Xvfb with a software adapter, driven as a user drives it.
//!
//! Xvfb and xdotool must be found on PATH; otherwise the test says so and passes, unless
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

/// Longest that anything here may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// A screen that nobody sees.
struct Screen {
    server: Child,
    display: String,
    folder: tempfile::TempDir,
}

impl Screen {
    /// Starts one, if the programs for it are there.
    fn start() -> Option<Self> {
        let folder = tempfile::tempdir().expect("a folder");
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp", "-fbdir"])
            .arg(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let driven = Command::new("xdotool").arg("--help").output();
        let (Ok(mut server), Ok(_)) = (server, driven) else {
            let required = std::env::var_os("LIMPID_REQUIRE_WINDOW").is_some();
            assert!(!required, "Xvfb and xdotool are required");
            eprintln!("not tested: no Xvfb or no xdotool");
            return None;
        };
        let mut number = String::new();
        let output = server.stdout.take().expect("it is piped");
        BufReader::new(output).read_line(&mut number).expect("Xvfb tells its number");
        Some(Self { server, display: format!(":{}", number.trim()), folder })
    }

    /// Presses keys, moves the pointer, changes the window: what xdotool can do.
    fn tool(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool")
            .env("DISPLAY", &self.display)
            .args(arguments)
            .output()
            .expect("xdotool starts");
        assert!(output.status.success(), "xdotool {arguments:?}");
        String::from_utf8_lossy(&output.stdout).trim().to_owned()
    }

    /// Waits for the window, gives it the keys, and returns its name for xdotool.
    fn window(&self) -> String {
        let id = self.tool(&["search", "--sync", "--onlyvisible", "--name", "limpid"]);
        let id = id.lines().last().expect("a window").to_owned();
        self.tool(&["windowfocus", "--sync", &id]);
        id
    }

    /// What is on the screen: width, height, pixels as the X server keeps them (an XWD dump: a
    /// header of 25 big-endian words, colours of 12 bytes each, rows).
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

/// The program in its window.
struct Window {
    program: Option<Child>,
    log: PathBuf,
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
        // The last line may be half written.
        text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
    }

    /// Waits for an event that is as wanted, after those that were waited for before.
    #[track_caller]
    fn wait(&mut self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let events = self.events();
            let found = events.iter().enumerate().skip(self.seen).find(|(_, event)| wanted(event));
            if let Some((i, event)) = found {
                self.seen = i + 1;
                return event.clone();
            }
            let ended = self.program.as_mut().and_then(|p| p.try_wait().expect("a state"));
            assert!(ended.is_none(), "it ended with {ended:?} before: {what}; {}", last(&events));
            assert!(begun.elapsed() < PATIENCE, "not in time: {what}; {}", last(&events));
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    #[track_caller]
    fn wait_for(&mut self, event: &str) -> Value {
        self.wait(event, |e| e["event"] == event)
    }

    /// Forgets all events until now.
    fn forget(&mut self) {
        self.seen = self.events().len();
    }

    /// Waits for the program's end, which must be good, and returns what it said on stderr.
    #[track_caller]
    fn end(&mut self, folder: &Path) -> String {
        let mut program = self.program.take().expect("it has not ended");
        let begun = Instant::now();
        let status = loop {
            if let Some(status) = program.try_wait().expect("a state") {
                break status;
            }
            if begun.elapsed() > PATIENCE {
                let _ = program.kill();
                panic!("it does not end");
            }
            std::thread::sleep(Duration::from_millis(20));
        };
        let said = fs::read_to_string(folder.join("stderr")).expect("a file");
        assert!(status.success(), "{status:?}: {said}");
        said
    }
}

/// The last events, a line each.
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

/// Protects the whole of the window: it starts, plays, scrubs, orbits, takes a setting and a view
/// mode, is resized, hidden to nothing and shown again, and closed; it ends well, without a panic or
/// a word of wgpu's validation, and what it shows is a picture.
#[test]
fn window_is_driven_through_everything() {
    let Some(screen) = Screen::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let input = format!("{DATA}ParticleData_Fluid_{{}}.bgeo");
    let arguments = [input.as_str(), "--radius", "0.025", "--size", "1000x640"];
    let mut window = Window::open(&screen, folder.path(), &arguments);
    window.wait_for("opened");
    window.wait("a picture at rest", |e| e["event"] == "picture" && e["level"] == "fine");
    let id = screen.window();

    // A picture is no single colour, and it is not the panels' either.
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

    // On the timeline, from its end to its first third and back.
    screen.tool(&["key", "Home"]);
    screen.tool(&["key", "End"]);
    window.wait("the last frame", |e| e["event"] == "picture" && e["moment"] == 4);
    window.forget();
    screen.tool(&["mousemove", "--window", &id, "400", "592", "mousedown", "1"]);
    window.wait_for("seek");
    screen.tool(&["mousemove", "--window", &id, "700", "592"]);
    let sought = window.wait("the end", |e| e["event"] == "seek" && e["index"].as_u64() > Some(2));
    screen.tool(&["mouseup", "1"]);
    window.wait("its picture", |e| e["event"] == "picture" && e["moment"] == sought["index"]);

    // A drag on the picture.
    window.forget();
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
    window.forget();
    screen.tool(&["mousemove", "--window", &id, "830", "206", "mousedown", "1"]);
    std::thread::sleep(Duration::from_millis(300));
    screen.tool(&["mousemove", "--window", &id, "845", "206"]);
    window.wait_for("setting");
    screen.tool(&["mouseup", "1"]);

    screen.tool(&["key", "v"]);
    window.wait("a view mode", |e| e["event"] == "view" && e["view"] == "Depth");
    window.wait("it at rest", |e| e["event"] == "picture" && e["level"] == "fine");

    window.forget();
    screen.tool(&["windowsize", &id, "760", "480"]);
    window.wait_for("resize");
    window.wait("it at rest", |e| e["event"] == "picture" && e["level"] == "fine");

    // As small as a window can be, and hidden.
    screen.tool(&["windowsize", &id, "1", "1"]);
    std::thread::sleep(Duration::from_millis(200));
    screen.tool(&["windowunmap", &id]);
    std::thread::sleep(Duration::from_millis(200));
    screen.tool(&["windowmap", &id]);
    window.forget();
    screen.tool(&["windowsize", &id, "900", "600"]);
    window.wait("a picture again", |e| {
        e["event"] == "picture" && e["level"] == "fine" && e["width"].as_u64() > Some(300)
    });

    screen.tool(&["windowfocus", &id]);
    screen.tool(&["key", "ctrl+q"]);
    let said = window.end(folder.path());
    let low = said.to_lowercase();
    assert!(!low.contains("panic") && !low.contains("validation"), "{said}");
    let events = window.events();
    assert_eq!(events.last().expect("events")["event"], "close");
    assert!(!events.iter().any(|e| e["event"] == "notice"), "{events:#?}");
}

/// Protects a screen without a server: an error that says so, and its exit code.
#[test]
fn without_a_screen_there_is_an_error() {
    let output = Command::new(env!("CARGO_BIN_EXE_limpid"))
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .args(["view", "sims/slab.toml"])
        .output()
        .expect("it starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(5), "{said}");
    assert!(said.contains("limpid render"), "{said}");
}

/// Protects *loading never blocks the interface*: while frames of many particles are read and
/// classified, the interface's own work stays short. How short on which machine, a command measures:
///
/// ```text
/// LIMPID_PARTICLES=1000000 cargo test --release --features viewer-tests --test window -- \
///     loading --nocapture
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
    // Loading goes on; the interface moves with the pointer meanwhile.
    let begun = Instant::now();
    let has_last = |window: &Window| {
        window.events().iter().any(|e| e["event"] == "picture" && e["moment"] == 2)
    };
    while !has_last(&window) {
        assert!(begun.elapsed() < 3 * PATIENCE, "not in time: the last frame");
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
