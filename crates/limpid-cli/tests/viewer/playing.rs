//! Playback and opening: keys, frames that are missing, damaged or not simulated yet, and windows of any
//! size.

use std::path::{Path, PathBuf};
use std::time::Duration;

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::Vec3;
use limpid::liquid::Particles;
use limpid_io::adjustments::Adjustments;
use limpid_viewer::model::document::Source;
use limpid_viewer::model::views::View;
use limpid_viewer::{Options, Viewer};

use serde_json::Value;

use super::{harness, sequence, shell, shown, until};

/// Keys control playback and switch the view modes, which show their legends.
#[test]
fn keys_play_step_and_switch_views() {
    use eframe::egui::Key;
    let mut harness = harness(sequence(), [700.0, 400.0]);
    let count = harness.state().playback().count();
    assert_eq!(count, 5);
    harness.key_press(Key::ArrowRight);
    harness.step();
    assert_eq!(harness.state().playback().index(), 1);
    harness.key_press(Key::End);
    harness.step();
    assert_eq!(harness.state().playback().index(), count - 1);
    harness.key_press(Key::Home);
    harness.key_press(Key::Space);
    harness.step();
    assert!(harness.state().playback().playing);
    until(&mut harness, "two frames have played", |viewer| viewer.playback().index() >= 2);
    harness.key_press(Key::Space);
    harness.step();
    assert!(!harness.state().playback().playing);
    let views: Vec<View> = View::all().collect();
    for view in views.iter().skip(1).chain(&views[..1]) {
        harness.key_press(Key::V);
        harness.step();
        assert_eq!(harness.state().view(), *view);
    }
    harness.key_press(Key::V);
    until(&mut harness, "depth at rest", Viewer::is_at_rest);
    harness.get_by_label("Depth, m");
}

/// A damaged frame gives a visible notice, and playback continues. The picture keeps its size when the notice goes.
#[test]
fn damaged_frame_is_reported_and_playback_continues() {
    let folder = tempfile::tempdir().expect("a folder");
    for number in 1..=4 {
        let path = folder.path().join(format!("w_{number}.bgeo"));
        let positions = (0..40).map(|i| Vec3::new(0.05 * i as f32, 0.0, 0.1)).collect();
        limpid_io::particles::write(&Particles { positions, ..Default::default() }, &path)
            .expect("it is written");
    }
    std::fs::write(folder.path().join("w_2.bgeo"), b"not particles").expect("it is damaged");
    let source = Source { radius: Some(0.03), ..Source::new(folder.path().display().to_string()) };
    let mut harness = harness(source, [700.0, 400.0]);
    harness.key_press(eframe::egui::Key::Space);
    until(&mut harness, "frame 4", |viewer| viewer.playback().index() == 3);
    let notices = harness.state().notices();
    assert!(notices.iter().any(|n| n.error && n.text.contains("w_2.bgeo")), "{notices:?}");
    let shown = notices.last().expect("there is one").text.clone();
    harness.get_by_label(&shown);
    let size = harness.state().picture_size();
    let dismiss = |harness: &Harness<'static, Viewer>| {
        let button = harness.query_all_by_label("Dismiss").next();
        button.map(|button| button.click_accesskit()).is_some()
    };
    while dismiss(&harness) {
        harness.step();
        harness.step();
    }
    assert!(harness.state().notices().is_empty());
    assert_eq!(harness.state().picture_size(), size, "notices resize the picture");
}

/// Notices float over the picture, which keeps its size, each with its whole text; the log has them all.
#[test]
fn notices_float_and_stay_in_the_log() {
    let mut harness = harness(sequence(), [700.0, 500.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let size = harness.state().picture_size();
    let long = "a/very/long/path/".repeat(12);
    let inputs = [format!("/nowhere/first/{long}x.bgeo"), "/nowhere/second.bgeo".to_owned()];
    for input in &inputs {
        harness.state_mut().open(Source::new(input));
        let reported =
            |viewer: &Viewer| viewer.notices().iter().any(|n| n.text.contains(input.as_str()));
        until(&mut harness, "a notice", reported);
        harness.step();
        harness.step();
    }
    let errors = harness.state().notices().iter().filter(|notice| notice.error);
    let texts: Vec<String> = errors.map(|notice| notice.text.clone()).collect();
    assert_eq!(texts.len(), 2, "{texts:?}");
    let picture = harness.get_by_label("Picture").rect();
    for text in &texts {
        let notice = harness.get_by_label(text).rect();
        assert!(picture.contains_rect(notice), "{text} is cut off: {notice:?}");
    }
    // The long one has several lines.
    assert!(harness.get_by_label(&texts[0]).rect().height() > 30.0);
    harness.key_press(eframe::egui::Key::Escape);
    harness.step();
    harness.step();
    assert!(harness.state().notices().is_empty());
    assert_eq!(harness.state().picture_size(), size, "notices resize the picture");
    harness.get_by_label_contains("Messages").click_accesskit();
    harness.step();
    harness.step();
    for text in &texts {
        harness.get_by_label(text);
    }
    assert_eq!(harness.state().picture_size(), size, "the log resizes the picture");
}

/// The viewer reports likely mistakes in an input as `render` does.
#[test]
fn likely_mistakes_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("dark.toml");
    let text = "[recipe]\nkind = \"ball\"\ncenter = [0, 0, 0]\nradius = 0.5\ncount = 200\n\
                [environment]\nradiance = [1, 1, 1]\n\
                [[light]]\nsun = { direction = [0, -1, 0], irradiance = [1, 1, 1] }\n";
    std::fs::write(&path, text).expect("it is written");
    let mut harness = harness(Source::new(path.display().to_string()), [700.0, 400.0]);
    let reported =
        |viewer: &Viewer| viewer.notices().iter().any(|n| n.text.contains("has no effect"));
    until(&mut harness, "a notice", reported);
    assert!(harness.state().notices().iter().all(|n| !n.error));
}

/// Where drawing is slower than playback, each frame is drawn once at full size, and then plays from memory; another
/// view is drawn anew, and the first one is still there.
#[test]
fn slow_playback_draws_each_frame_once() {
    use eframe::egui::Key;
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log.jsonl");
    // No device draws a frame in a millisecond.
    let adjustments = Adjustments { fps: Some(1000.0), ..Default::default() };
    let source = Source { adjustments, ..sequence() };
    let options = Options { source: Some(source), log: Some(log.clone()), ..Options::default() };
    let mut harness = shown(Viewer::new(options).expect("a viewer"), [700.0, 400.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    harness.key_press(Key::Space);
    harness.step();
    let complete = |viewer: &Viewer| {
        viewer.flipbook().is_some_and(|progress| progress.drawn == progress.frames)
    };
    until(&mut harness, "a full flipbook", complete);
    let events = |kind: &str| -> Vec<Value> {
        let text = std::fs::read_to_string(&log).expect("a log");
        let events = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        events.filter(|event| event["event"] == kind).collect()
    };
    let (drawn, flipped) = (events("picture").len(), events("flip").len());
    until(&mut harness, "three loops", |_| events("flip").len() > flipped + 15);
    assert_eq!(events("picture").len(), drawn, "kept frames are drawn again");
    let size = harness.state().picture_size();
    let whole = |event: &&Value| event["level"] != "draft";
    let sizes: Vec<_> =
        events("picture").iter().filter(whole).map(|e| e["width"].clone()).collect();
    assert!(sizes.len() >= 5 && sizes.iter().all(|width| *width == size.x), "{sizes:?}");

    harness.key_press(Key::V);
    until(&mut harness, "another view", |viewer| !complete(viewer));
    harness.key_press(Key::P);
    harness.step();
    harness.step();
    assert!(complete(harness.state()), "{:?}", harness.state().flipbook());
}

/// Writes a scene with a simulation of seven frames.
fn drip(folder: &Path) -> PathBuf {
    let path = folder.join("drip.toml");
    let text = "[simulation]\nframes = 7\nradius = 0.05\n\
                bounds = { min = [-1.0, 0.0, -1.0], max = [1.0, inf, 1.0] }\n\
                [[simulation.block]]\nmin = [-0.3, 0.1, -0.3]\nmax = [0.3, 0.6, 0.3]\n";
    std::fs::write(&path, text).expect("it is written");
    path
}

/// Missing frames of a simulated scene are computed during playback, and existing ones are not computed
/// again.
#[test]
fn simulation_runs_during_playback() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = drip(folder.path());
    let source = Source::new(path.display().to_string());
    let mut harness = harness(source.clone(), [700.0, 400.0]);
    until(&mut harness, "all frames", |viewer| viewer.playback().count() == 7);
    until(&mut harness, "it plays", |viewer| viewer.playback().index() > 0);
    assert!(harness.state().playback().playing && harness.state().notices().is_empty());
    let made = |number: u32| {
        let frame = limpid_io::bake::frame_path(&limpid_io::bake::folder(&path), "drip", number);
        std::fs::metadata(frame).expect("a frame").modified().expect("a time")
    };
    let before = made(7);
    drop(harness);
    let harness = self::harness(source, [700.0, 400.0]);
    assert_eq!((harness.state().playback().count(), made(7)), (7, before));
}

/// A simulation that opens with a single frame, and is late with the next, plays once that is made.
#[test]
fn simulation_with_one_frame_waits_for_the_next() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("drip.toml");
    let text = "[simulation]\nframes = 3\nradius = 0.015\n\
                bounds = { min = [-1.0, 0.0, -1.0], max = [1.0, inf, 1.0] }\n\
                [[simulation.block]]\nmin = [-0.3, 0.1, -0.3]\nmax = [0.3, 0.6, 0.3]\n";
    std::fs::write(&path, text).expect("it is written");
    shell("limpid bake drip.toml", folder.path());
    // The one before it and the one after it are made again.
    let frame =
        |number| limpid_io::bake::frame_path(&limpid_io::bake::folder(&path), "drip", number);
    for number in [1, 3] {
        std::fs::remove_file(frame(number)).expect("a frame");
    }
    let mut harness = harness(Source::new(path.display().to_string()), [700.0, 400.0]);
    assert!(!frame(1).exists(), "it is made too fast to say anything");
    assert_eq!(harness.state().playback().count(), 1);
    until(&mut harness, "all frames", |viewer| viewer.playback().count() == 3);
    assert!(harness.state().playback().playing);
}

/// Selected frames of a simulated scene are opened as soon as they exist, also if they are the last
/// ones, without notices of missing frames, and are not reopened later.
#[test]
fn selected_frames_of_a_simulation_are_opened_once() {
    for (frames, count) in [("1-3", 3), ("5-7", 3)] {
        let folder = tempfile::tempdir().expect("a folder");
        let path = drip(folder.path());
        let source = Source {
            frames: Some(frames.parse().expect("frames")),
            ..Source::new(path.display().to_string())
        };
        let log = folder.path().join("log.jsonl");
        let options =
            Options { source: Some(source), log: Some(log.clone()), ..Options::default() };
        let mut harness = shown(Viewer::new(options).expect("a viewer"), [700.0, 400.0]);
        let last = limpid_io::bake::frame_path(&limpid_io::bake::folder(&path), "drip", 7);
        until(&mut harness, "the last frame", |_| last.exists());
        let grown = || {
            let text = std::fs::read_to_string(&log).expect("a log");
            text.lines().filter(|line| line.contains("\"grown\"")).count()
        };
        let mut seen = Vec::new();
        for _ in 0..40 {
            std::thread::sleep(Duration::from_millis(5));
            harness.step();
            seen.push(grown());
        }
        assert_eq!(harness.state().playback().count(), count);
        assert!(seen[39] <= 5 && seen[39] == seen[30], "it is opened again: {seen:?}");
        assert!(harness.state().notices().is_empty(), "{:?}", harness.state().notices());
    }
}

/// A change of speed keeps the shown time in a sequence with missing frames.
#[test]
fn change_of_speed_keeps_the_time_despite_missing_frames() {
    use eframe::egui::Key;
    let mut harness = harness(sequence(), [700.0, 400.0]);
    for _ in 0..2 {
        harness.key_press(Key::ArrowRight);
        harness.step();
    }
    let shown = |harness: &Harness<'static, Viewer>| {
        let command = harness.state().command_line("x").expect("open");
        command.split_whitespace().find(|w| w.starts_with("--frames")).map(str::to_owned)
    };
    let before = shown(&harness);
    let index = harness.state().playback().index();
    for key in [Key::OpenBracket, Key::OpenBracket, Key::CloseBracket, Key::CloseBracket] {
        harness.key_press(key);
        harness.step();
        assert_eq!(shown(&harness), before, "{key:?}");
    }
    assert_eq!(harness.state().playback().index(), index);
}

/// A failed attempt to open another input does not end a running simulation.
#[test]
fn failure_to_open_does_not_end_a_simulation() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = drip(folder.path());
    let mut harness = harness(Source::new(path.display().to_string()), [700.0, 400.0]);
    harness.state_mut().open(Source::new("nowhere.bgeo"));
    until(&mut harness, "a notice", |viewer| viewer.notices().iter().any(|n| n.error));
    until(&mut harness, "all frames", |viewer| viewer.playback().count() == 7);
}

/// An input that cannot be opened gives a notice, and the present document stays open.
#[test]
fn failure_to_open_is_reported() {
    let mut harness = harness(sequence(), [700.0, 400.0]);
    harness.state_mut().open(Source::new("/nowhere/at_all.bgeo"));
    let reported =
        |viewer: &Viewer| viewer.notices().iter().any(|n| n.text.contains("/nowhere/at_all.bgeo"));
    until(&mut harness, "a notice", reported);
    assert!(harness.state().command_line("x").is_some());
}

/// A window without area, as when minimised, draws nothing without an error, and the picture returns
/// with the window's size.
#[test]
fn window_without_size_draws_nothing() {
    let mut harness = harness(sequence(), [700.0, 400.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    for size in [[0.0, 0.0], [1.0, 1.0], [700.0, 5.0], [700.0, 400.0]] {
        harness.set_size(size.into());
        for _ in 0..3 {
            harness.step();
        }
    }
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
}

/// Camera keys are added at the present time, in order, one for each time.
#[test]
fn camera_keys_are_added_in_order_of_time() {
    use eframe::egui::Key;
    let mut harness = harness(sequence(), [1000.0, 700.0]);
    for key in [Key::End, Key::K, Key::Home, Key::K, Key::K] {
        harness.key_press(key);
        harness.step();
    }
    let times: Vec<f64> = harness.state().path().keys.iter().map(|key| key.time).collect();
    // Frames 5 to 40 at 30 frames per second.
    assert_eq!(times, [0.0, 35.0 / 30.0]);
    harness.get_by_label("Camera").click_accesskit();
    harness.step();
    harness.step();
    harness.get_by_label("Delete key 1").click_accesskit();
    harness.step();
    harness.step();
    assert_eq!(harness.state().path().keys.len(), 1);
}
