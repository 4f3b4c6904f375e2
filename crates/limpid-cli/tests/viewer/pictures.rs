//! The viewer's pictures are bit-identical to those of the offscreen renderer, of the copied command
//! line and of the saved scene.

use std::sync::{Arc, mpsc};

use glam::UVec2;
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::offscreen::Offscreen;
use limpid::scene::Scene;
use limpid_io::input::{FrameTime, Input};
use limpid_io::project::overrides::replaced;
use limpid_viewer::Viewer;
use limpid_viewer::backend::native::draw_thread::{Answer, DrawThread, Pane, Request};
use limpid_viewer::model::level::Level;
use limpid_viewer::model::views::View;

use super::{
    PATIENCE, assert_command_line_writes_what_is_saved, harness, same_picture, sequence, shell,
    until, until_saved,
};

/// The draw thread and the offscreen renderer draw the same bits: at a frame, between two frames, and
/// with another setting, each with the solids where they are then.
#[test]
fn draw_thread_and_offscreen_draw_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scene.toml");
    let source = sequence().input;
    let text = format!(
        "[particles]\nsource = {source:?}\nradius = 0.025\n\
         [[solid]]\nshape = \"sphere\"\ncenter = [0, 1, 0]\nradius = 0.5\ncolor = [0.5, 0, 0]\n\
         [[solid.key]]\nframe = 20\ntranslate = [-0.5, 0, 0]\n\
         [[solid.key]]\nframe = 40\ntranslate = [0.5, 0, 0]\n"
    );
    std::fs::write(&file, text).expect("a scene");
    let input = Input::open(file).expect("the frames are there");
    let (input, project) = input.resolve().expect("it resolves");
    let scene = &project.scene;
    let gpu = Gpu::headless().expect("an adapter");
    let mut offscreen = Offscreen::new(&gpu);
    let (sender, answers) = mpsc::channel();
    let thread = DrawThread::new(limpid_io::device::open, move |answer| {
        sender.send(answer).expect("the test waits");
    });
    let between = FrameTime { frame: 20, next: 21, fraction: 0.5 };
    let set = |text: &str| vec![text.to_owned()];
    let cases = [
        (FrameTime::at(20), vec![]),
        (between, vec![]),
        (FrameTime::at(40), set("refract.solver=march")),
        (FrameTime::at(40), set("classify.short_axis=1.1")),
    ];
    let mut pictures = Vec::new();
    for (number, (at, overrides)) in (1..).zip(cases) {
        let settings = replaced(&scene.settings, &overrides).expect("settings");
        let scene = Scene { settings, ..scene.clone() };
        let loaded = Arc::new(input.load(at, &scene).expect("it loads"));
        let camera = project.camera_for(loaded.bulk.bounds);
        let size = UVec2::new(160, 120);
        let shown = loaded.scene(&scene);
        assert_ne!(*shown, scene, "the ball has moved");
        let input = FrameInput::new(&shown, &camera, &loaded.splats, size);
        let expected = offscreen.draw(input).expect("it draws");
        let (scene, scale) = (scene.into(), None);
        let pane = Pane { scene, camera, loaded, size, scale, legend: false };
        let request =
            Request { number, panes: vec![pane], level: Level::Full, view: View::Picture };
        thread.request(request);
        let drawn = loop {
            match answers.recv_timeout(PATIENCE).expect("an answer") {
                Answer::Drawn(drawn) => break drawn,
                Answer::Adapter(_) => {}
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(drawn.number, number);
        let shown = drawn.panes[0].image.pixels.iter().flat_map(|c| [c.r(), c.g(), c.b()]);
        assert!(shown.eq(expected.picture.as_raw().iter().copied()), "{at:?} {overrides:?}");
        pictures.push(expected.picture);
    }
    // The cases give different pictures.
    assert!((1..pictures.len()).all(|i| pictures[i] != pictures[i - 1]));
}

/// The copied command line, run by a shell, writes the picture that the viewer saves, here with a
/// changed setting, liquid and view, between two frames.
#[test]
fn copied_command_line_writes_what_the_viewer_saves() {
    let mut source = sequence();
    source.overrides = vec!["smooth.iterations=2".into(), "liquid.ior=1.41".into()];
    source.frames = Some("20-21".parse().expect("frames"));
    let mut harness = harness(source, [420.0, 300.0]);
    // Half speed has frame times between frames.
    harness.key_press(eframe::egui::Key::OpenBracket);
    harness.key_press(eframe::egui::Key::ArrowRight);
    harness.key_press(eframe::egui::Key::F);
    harness.step();
    harness.step();
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let command = harness.state().command_line("rendered.png").expect("something is open");
    assert!(command.contains("--at=20.5") && command.contains("smooth.iterations=2"), "{command}");
    assert_command_line_writes_what_is_saved(&mut harness);
}

/// A scene file saved by the viewer renders as the command line does.
#[test]
fn saved_scene_renders_as_the_command_line_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut source = sequence();
    source.frames = Some("40".parse().expect("a frame"));
    source.overrides = vec!["classify.wetting=0".into()];
    let mut harness = harness(source, [420.0, 300.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    harness.state_mut().save_scene(folder.path().join("s.toml"));
    until_saved(&mut harness);
    shell(&harness.state().command_line("a.png").expect("open"), folder.path());
    let UVec2 { x, y } = harness.state().picture_size();
    shell(&format!("limpid render s.toml --frames 40 --size {x}x{y} -o b.png"), folder.path());
    assert!(same_picture(folder.path(), "a.png", "b.png"));
}
