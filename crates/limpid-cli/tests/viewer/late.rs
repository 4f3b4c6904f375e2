//! Late answers: the screen says what it shows and what it waits for, and shows nothing of what was asked before another
//! document or view. Devices that open late stand for pictures that take long.

use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

use eframe::egui::Key;
use eframe::egui::accesskit::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use glam::Vec3;
use limpid::aov::Aov;
use limpid::gpu::Gpu;
use limpid::liquid::Particles;
use limpid_io::input::FrameTime;
use limpid_viewer::model::document::Source;
use limpid_viewer::model::views::View;
use limpid_viewer::{Options, Viewer};

use super::{PATIENCE, sequence, shown, until, wait};

/// The devices that a viewer has opened, and the gate that later ones wait for.
struct Devices {
    opened: Arc<Mutex<Vec<Gpu>>>,
    gate: mpsc::Sender<()>,
}

impl Devices {
    /// A viewer of a source, whose first `free` devices open at once.
    fn viewer(source: Source, free: usize) -> (Self, Viewer) {
        let (gate, opens) = mpsc::channel();
        let opened = Arc::<Mutex<Vec<Gpu>>>::default();
        let list = opened.clone();
        let open = move || {
            if list.lock().expect("no panic holds this lock").len() >= free {
                // A test that fails must end.
                let _ = opens.recv_timeout(PATIENCE);
            }
            let gpu = Gpu::headless()?;
            list.lock().expect("no panic holds this lock").push(gpu.clone());
            Ok(gpu)
        };
        let options = Options { source: Some(source), ..Options::default() };
        let viewer = Viewer::with_devices(options, open).expect("a viewer");
        (Self { opened, gate }, viewer)
    }

    /// Loses the first device: the next picture waits for the gate.
    fn lose(&self) {
        self.opened.lock().expect("no panic holds this lock")[0].device.destroy();
    }

    fn open_gate(&self) {
        self.gate.send(()).expect("a device waits");
    }
}

fn steps(harness: &mut Harness<'static, Viewer>, time: Duration) {
    let start = Instant::now();
    while start.elapsed() < time {
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
    }
}

/// Writes a sequence of frames 101 and 102.
fn other_sequence() -> (tempfile::TempDir, Source) {
    let folder = tempfile::tempdir().expect("a folder");
    for number in 101..=102 {
        let positions = (0..60).map(|i| Vec3::new(0.05 * i as f32, 0.0, 0.1)).collect();
        let path = folder.path().join(format!("other_{number}.bgeo"));
        limpid_io::particles::write(&Particles { positions, ..Default::default() }, &path)
            .expect("it is written");
    }
    let source = Source { radius: Some(0.03), ..Source::new(folder.path().display().to_string()) };
    (folder, source)
}

/// A picture that was asked for before another document was opened is not shown in its place.
#[test]
fn pictures_of_the_last_document_are_not_shown() {
    let (_folder, other) = other_sequence();
    let (devices, viewer) = Devices::viewer(sequence(), 0);
    let mut harness = shown(viewer, [500.0, 400.0]);
    until(&mut harness, "particles", |viewer| !viewer.status()["particles"].is_null());
    harness.step();
    harness.state_mut().open(other);
    let is_other = |viewer: &Viewer| {
        viewer.status()["open"].as_str().is_some_and(|input| !input.contains("Particle"))
    };
    until(&mut harness, "the other document", is_other);
    devices.open_gate();
    until(&mut harness, "its picture at rest", |viewer| {
        let frame = viewer.shown().and_then(|(_, at)| at).map(|at| at.frame);
        assert!(frame.is_none_or(|frame| frame > 100), "frame {frame:?} of the last document");
        viewer.is_at_rest()
    });
}

/// A view's name and legend come with its picture, and the screen says that it waits for it.
#[test]
fn names_and_legends_come_with_their_pictures() {
    let (devices, viewer) = Devices::viewer(sequence(), 1);
    let mut harness = shown(viewer, [700.0, 400.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    devices.lose();
    harness.key_press(Key::V);
    steps(&mut harness, Duration::from_millis(700));
    let view = |viewer: &Viewer| viewer.shown().expect("a picture").0;
    assert_eq!(
        (harness.state().view(), view(harness.state())),
        (View::Image(Aov::Depth, 0), View::Picture)
    );
    assert!(harness.query_by_label("Depth, m").is_none(), "a legend without its picture");
    harness.get_by_label("drawing: Depth");
    assert!(!harness.state().is_at_rest());
    devices.open_gate();
    until(&mut harness, "depth", |viewer| view(viewer) == View::Image(Aov::Depth, 0));
    harness.get_by_label("Depth, m");
    until(&mut harness, "depth at rest", Viewer::is_at_rest);
    assert!(harness.query_by_label_contains("drawing").is_none());
}

/// The timeline's number is that of the frame on screen.
#[test]
fn timeline_has_the_number_of_the_frame_shown() {
    let (devices, viewer) = Devices::viewer(sequence(), 1);
    let mut harness = shown(viewer, [900.0, 400.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let shown = |viewer: &Viewer| viewer.shown().and_then(|(_, at)| at);
    devices.lose();
    harness.key_press(Key::End);
    steps(&mut harness, Duration::from_millis(700));
    assert_eq!(harness.state().playback().index(), 4);
    assert_eq!(shown(harness.state()), Some(FrameTime::at(5)));
    let number = |harness: &Harness<'static, Viewer>| {
        harness.get_by_role_and_label(Role::SpinButton, "Frame").accesskit_node().numeric_value()
    };
    assert_eq!(number(&harness), Some(5.0));
    harness.get_by_label("drawing");
    devices.open_gate();
    until(&mut harness, "the last frame", |viewer| shown(viewer) == Some(FrameTime::at(40)));
    assert_eq!(number(&harness), Some(40.0));
}

/// While another file is being opened the old one does not play on, and the screen says so; if that is stopped, the old one
/// does.
#[test]
fn documents_do_not_play_on_under_another_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("slow.toml");
    let text = "[simulation]\nframes = 9000\nradius = 0.05\n\
                bounds = { min = [-1.0, 0.0, -1.0], max = [1.0, inf, 1.0] }\n\
                [[simulation.block]]\nmin = [-0.3, 0.1, -0.3]\nmax = [0.3, 0.6, 0.3]\n";
    std::fs::write(&path, text).expect("it is written");
    let mut harness = super::harness(sequence(), [900.0, 400.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    harness.key_press(Key::Space);
    harness.step();
    // Its last frame is there after minutes.
    let frames = Some("9000".parse().expect("a frame"));
    harness.state_mut().open(Source { frames, ..Source::new(path.display().to_string()) });
    harness.step();
    let at = harness.state().playback().index();
    steps(&mut harness, Duration::from_millis(800));
    harness.get_by_label("opening slow.toml");
    assert_eq!(harness.state().playback().index(), at, "it plays on");
    let simulates =
        |harness: &Harness<'static, Viewer>| harness.query_by_label("Stop simulation").is_some();
    wait(&mut harness, "a simulation", simulates);
    harness.get_by_label("Stop simulation").click_accesskit();
    wait(&mut harness, "it plays on", |harness| harness.state().playback().index() != at);
    assert!(harness.query_by_label("opening slow.toml").is_none());
    assert!(harness.state().notices().iter().all(|notice| !notice.error));
}
