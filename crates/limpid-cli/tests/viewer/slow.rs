//! Slow pictures and simulations: none keeps the user waiting, and all can be ended.

use std::path::Path;
use std::sync::{Arc, mpsc};
use std::time::Duration;

use eframe::egui::Shape;
use egui_kittest::kittest::Queryable as _;
use glam::UVec2;
use limpid::gpu::Gpu;
use limpid::scene::Scene;
use limpid_io::input::{FrameTime, Input};
use limpid_viewer::backend::native::draw_thread::{Answer, DrawThread, Pane, Request};
use limpid_viewer::model::document::Source;
use limpid_viewer::model::level::Level;
use limpid_viewer::model::views::View;
use limpid_viewer::{Options, Viewer};

use super::first_minutes::choose;
use super::{PATIENCE, harness, sequence, shown, until};

/// A newer request ends a picture that takes long, which is never answered; a coarse picture is always finished.
#[test]
fn newer_requests_end_pictures_that_take_long() {
    let input = Input::open(sequence().input).expect("the frames are there");
    let (input, project) =
        input.with_radius(0.025).expect("a radius").resolve().expect("it resolves");
    let loaded = Arc::new(input.load(FrameTime::at(20), &project.scene).expect("it loads"));
    let camera = project.camera_for(loaded.bulk.bounds);
    let (sender, answers) = mpsc::channel();
    let thread = DrawThread::new(limpid_io::device::open, move |answer| {
        // The test may have ended.
        let _ = sender.send(answer);
    });
    let request = |number: u64, level: Level, side: u32, samples: u32| {
        let mut scene: Scene = project.scene.clone();
        scene.settings.refract.samples = samples;
        let (scene, scale) = (scene.into(), None);
        let (size, loaded) = (UVec2::splat(side), loaded.clone());
        let pane = Pane { scene, camera, loaded, size, scale, legend: false };
        Request { number, panes: vec![pane], level, view: View::Picture }
    };
    let drawn = || loop {
        match answers.recv_timeout(PATIENCE).expect("an answer") {
            Answer::Drawn(drawn) => break drawn.number,
            Answer::Adapter(_) => {}
            other => panic!("{other:?}"),
        }
    };
    // The pipelines are compiled.
    thread.request(request(1, Level::Draft, 64, 64));
    assert_eq!(drawn(), 1);
    // Minutes on a software adapter.
    thread.request(request(2, Level::Fine, 2048, 64));
    std::thread::sleep(Duration::from_millis(300));
    thread.request(request(3, Level::Draft, 64, 64));
    assert_eq!(drawn(), 3, "the picture that takes long was finished first");
    thread.request(request(4, Level::Fine, 64, 4));
    assert_eq!(drawn(), 4);
}

/// Until the first picture is drawn, its particles are seen.
#[test]
fn first_picture_is_a_coarse_one() {
    let (gate, opens) = mpsc::channel::<()>();
    let open = move || {
        let _ = opens.recv_timeout(PATIENCE);
        Ok(Gpu::headless()?)
    };
    let options = Options { source: Some(sequence()), ..Options::default() };
    let mut harness = shown(Viewer::with_devices(options, open).expect("a viewer"), [700.0, 400.0]);
    until(&mut harness, "particles", |viewer| !viewer.status()["particles"].is_null());
    harness.step();
    assert!(harness.state().shown().is_none());
    let discs = |harness: &egui_kittest::Harness<'static, Viewer>| {
        let shapes = harness.output().shapes.iter();
        let meshes = shapes.filter_map(|clipped| match &clipped.shape {
            Shape::Mesh(mesh) => Some(mesh.vertices.len()),
            _ => None,
        });
        meshes.max().unwrap_or(0)
    };
    assert!(discs(&harness) > 1000, "{} corners", discs(&harness));
    gate.send(()).expect("a device waits");
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    assert!(discs(&harness) < 1000);
}

/// Another look draws the frames that are loaded: none is read again.
#[test]
fn looks_keep_the_frames_that_are_loaded() {
    let mut harness = harness(sequence(), [900.0, 900.0]);
    until(&mut harness, "all frames", |viewer| viewer.status()["loaded"] == 5);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    choose(&mut harness, "Look", "night");
    until(&mut harness, "another look", |viewer| {
        assert_eq!(viewer.status()["loaded"], 5, "frames are dropped");
        viewer.command_line("x").is_some_and(|command| command.contains("--look=night"))
    });
    until(&mut harness, "a picture at rest", |viewer| {
        assert_eq!(viewer.status()["loaded"], 5, "frames are dropped");
        viewer.is_at_rest()
    });
}

fn frames_in(folder: &Path) -> usize {
    std::fs::read_dir(folder).map_or(0, |entries| entries.count())
}

/// A simulation can be stopped: its frames stay, and no more are made.
#[test]
fn simulations_can_be_stopped() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("long.toml");
    let text = "[simulation]\nframes = 900\nradius = 0.05\n\
                bounds = { min = [-1.0, 0.0, -1.0], max = [1.0, inf, 1.0] }\n\
                [[simulation.block]]\nmin = [-0.3, 0.1, -0.3]\nmax = [0.3, 0.6, 0.3]\n";
    std::fs::write(&path, text).expect("it is written");
    let mut harness = harness(Source::new(path.display().to_string()), [900.0, 400.0]);
    until(&mut harness, "some frames", |viewer| viewer.playback().count() > 3);
    harness.get_by_label("Stop simulation").click_accesskit();
    harness.step();
    harness.step();
    assert_eq!(harness.state().status()["simulates"], false);
    assert!(harness.query_by_label("Stop simulation").is_none());
    let baked = limpid_io::bake::folder(&path);
    let mut made = frames_in(&baked);
    let mut steady = 0;
    // The frame that is being made may still come.
    until(&mut harness, "no more frames", |_| {
        let now = frames_in(&baked);
        steady = if now == made { steady + 1 } else { 0 };
        made = now;
        steady > 100
    });
    let count = harness.state().playback().count();
    assert!(count > 3 && count < 900, "{count} frames");
    assert!(harness.state().notices().iter().all(|notice| !notice.error));
}
