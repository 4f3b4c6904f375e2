//! The first minutes: the first screen, demos, recent files, looks, and films.

use std::fs;

use eframe::egui::accesskit::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::UVec2;
use limpid::scene::{Light, Scene};
use limpid_io::adjustments::{Floor, Sun};
use limpid_io::project::Project;
use limpid_viewer::model::demos::DEMOS;
use limpid_viewer::model::document::Source;
use limpid_viewer::{Options, Viewer};

use super::{
    DATA, assert_command_line_writes_what_is_saved, harness, sequence, shell, shown, until,
    until_saved,
};

/// Without a source there are demos and the sources that were opened last, each a click away.
#[test]
fn first_screen_offers_demos_and_recent_sources() {
    let folder = tempfile::tempdir().expect("a folder");
    let recent = folder.path().join("recent.json");
    let pattern = format!("{DATA}ParticleData_Fluid_{{}}.bgeo");
    fs::write(&recent, serde_json::to_string(&["/gone.bgeo", &pattern]).expect("a list"))
        .expect("it is written");
    let options = Options { recent: Some(recent.clone()), ..Options::default() };
    let viewer = Viewer::new(options).expect("a viewer");
    let mut harness = Harness::builder()
        .with_size([1100.0, 700.0])
        .build_ui_state(|ui, viewer: &mut Viewer| viewer.ui(ui), viewer);
    harness.step();
    for demo in &DEMOS {
        harness.get_by_role_and_label(Role::Button, demo.title);
    }
    harness.get_by_label("gone.bgeo");
    harness.get_by_label("ParticleData_Fluid_{}.bgeo").click_accesskit();
    until(&mut harness, "the sequence", |viewer| viewer.playback().count() == 5);
    let list = || -> Vec<String> {
        let text = fs::read_to_string(&recent).expect("the list");
        serde_json::from_str(&text).expect("JSON")
    };
    until(&mut harness, "a new list", |_| list() == [pattern.clone(), "/gone.bgeo".into()]);
}

/// A damaged list of recent sources is an empty one.
#[test]
fn damaged_list_of_recent_sources_is_ignored() {
    let folder = tempfile::tempdir().expect("a folder");
    let recent = folder.path().join("recent.json");
    fs::write(&recent, "{ \"not\": a list").expect("it is written");
    let options =
        Options { source: Some(sequence()), recent: Some(recent.clone()), ..Options::default() };
    let mut harness = shown(Viewer::new(options).expect("a viewer"), [700.0, 400.0]);
    let repaired = |_: &Viewer| {
        let text = fs::read_to_string(&recent).expect("the list");
        serde_json::from_str::<Vec<String>>(&text).is_ok_and(|list| list.len() == 1)
    };
    until(&mut harness, "a list of one", repaired);
}

/// Every demo is a scene that opens on its own, with a picture, and is written once.
#[test]
fn demos_open_on_their_own() {
    let folder = tempfile::tempdir().expect("a folder");
    for demo in &DEMOS {
        let source = demo.source_in(folder.path()).expect("it is written");
        Project::load(source.input.as_ref()).expect(demo.name).check().expect(demo.name);
        let written = fs::metadata(&source.input).expect("a file").modified().expect("a time");
        demo.source_in(folder.path()).expect("it is there");
        let after = fs::metadata(&source.input).expect("a file").modified().expect("a time");
        assert_eq!(written, after, "{}", demo.name);
    }
}

/// Another look, sky, sun and ground take effect at once: settings, frame and camera stay, and the command line draws what
/// is shown.
#[test]
fn looks_change_in_place() {
    let mut harness = harness(sequence(), [900.0, 900.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    harness.key_press(eframe::egui::Key::ArrowRight);
    harness.step();
    let command = |viewer: &Viewer| viewer.command_line("x").expect("something is open");
    let camera = |command: &str| {
        let from = command.find("--camera").expect("a camera");
        command[from..].split("' ").next().expect("its text").to_owned()
    };
    let before = camera(&command(harness.state()));
    choose(&mut harness, "Look", "night");
    until(&mut harness, "another look", |viewer| command(viewer).contains("--look=night"));
    assert_eq!(harness.state().playback().index(), 1);
    assert_eq!(camera(&command(harness.state())), before);
    let exposure = |viewer: &Viewer| viewer.scenes()[0].settings.tonemap.exposure;
    assert_eq!((exposure(harness.state()), harness.state().scenes()[0].lights.len()), (0.6, 1));

    choose(&mut harness, "Sky", "daylight");
    until(&mut harness, "another sky", |viewer| command(viewer).contains("--sky=daylight"));
    assert_eq!(exposure(harness.state()), 0.6, "the look is not changed");

    let sun = |viewer: &Viewer| Sun::of(&viewer.scenes()[0]);
    let Sun::At { azimuth, .. } = sun(harness.state()) else { panic!("no sun") };
    harness.get_by_role_and_label(Role::Slider, "Sun height").focus();
    harness.step();
    harness.key_press(eframe::egui::Key::ArrowRight);
    harness.step();
    harness.step();
    let Sun::At { azimuth: turned, elevation } = sun(harness.state()) else { panic!("no sun") };
    assert!((turned - azimuth).abs() < 0.51, "{turned} instead of {azimuth}");
    let option = format!("--sun={},{}", turned.round(), elevation.round());
    assert!(command(harness.state()).contains(&option), "{option}");

    harness.get_by_label("Ground").click_accesskit();
    until(&mut harness, "no ground", |viewer| command(viewer).contains("--floor=none"));
    assert_eq!(Floor::of(&harness.state().scenes()[0]), Floor::None);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    assert_command_line_writes_what_is_saved(&mut harness);
    // The notice of the saved picture may have gone meanwhile, and with it the numbers of all widgets.
    harness.step();
    harness.get_by_label("Sun").click_accesskit();
    let dark = |scene: &Scene| !scene.lights.iter().any(|light| matches!(light, Light::Sun { .. }));
    until(&mut harness, "no sun", |viewer| dark(&viewer.scenes()[0]));
}

/// Files with z up are turned in the viewer too, and the camera follows.
#[test]
fn files_with_z_up_are_turned() {
    let mut harness = harness(sequence(), [900.0, 900.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let command = |viewer: &Viewer| viewer.command_line("x").expect("something is open");
    let before = command(harness.state());
    choose(&mut harness, "Up", "z");
    until(&mut harness, "the other axis", |viewer| command(viewer).contains("--up=z"));
    assert_ne!(command(harness.state()).split("--camera").nth(1), before.split("--camera").nth(1));
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    assert_command_line_writes_what_is_saved(&mut harness);
}

/// Chooses an item of a combo box.
pub(super) fn choose(harness: &mut Harness<'static, Viewer>, name: &str, item: &str) {
    harness.get_by_label(name).click_accesskit();
    harness.step();
    harness.step();
    harness.get_by_label(item).click_accesskit();
    harness.step();
}

/// A film holds what `limpid render` films with the same camera, to the bit; a single frame is no film.
#[test]
fn films_are_those_of_render() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut harness = harness(sequence(), [700.0, 400.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let size = UVec2::new(96, 64);
    harness.state_mut().save_film(folder.path().join("saved.apng"), size, 1);
    until_saved(&mut harness);
    let command = harness.state().command_line("x").expect("something is open");
    let word = |name: &str| {
        let rest = command.split_once(&format!("--{name}=")).expect("an option").1;
        rest.trim_start_matches('\'').split('\'').next().expect("its value").to_owned()
    };
    let input = format!("{DATA}ParticleData_Fluid_{{}}.bgeo");
    let camera = word("camera");
    shell(
        &format!(
            "limpid render '{input}' --radius=0.025 '--camera={camera}' --size 96x64 --fps 30 -o rendered.apng"
        ),
        folder.path(),
    );
    let read = |name: &str| fs::read(folder.path().join(name)).expect("a film");
    assert!(read("saved.apng") == read("rendered.apng"), "{camera}");

    let still = Source { frames: Some("20".parse().expect("a frame")), ..sequence() };
    let mut harness = self::harness(still, [700.0, 400.0]);
    harness.state_mut().save_film(folder.path().join("still.apng"), size, 1);
    harness.step();
    assert!(harness.state().notices().iter().any(|n| n.error && n.text.contains("several frames")));
    assert!(!folder.path().join("still.apng").exists());
}
