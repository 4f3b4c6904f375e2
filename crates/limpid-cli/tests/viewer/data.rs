//! The open data: the title of the window, the data in the panel, and everything that can be opened.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use eframe::egui::accesskit::Role;
use eframe::egui::{DroppedFile, DroppedFileHandle};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use limpid_viewer::model::document::Source;
use limpid_viewer::{Options, Viewer};

use super::{DATA, harness, shown, until, wait};

fn pattern() -> String {
    format!("{DATA}ParticleData_Fluid_{{}}.bgeo")
}

fn command(viewer: &Viewer) -> String {
    viewer.command_line("x").expect("something is open")
}

/// The title names the file. The panel tells path, frames, fields, extents, and which values are guesses; these can be
/// corrected, and a given radius forgotten.
#[test]
fn data_are_told_and_corrected() {
    let mut harness = harness(Source::new(pattern()), [1000.0, 900.0]);
    assert_eq!(harness.state().title(), "ParticleData_Fluid_{}.bgeo - limpid");
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let fields = "position, id, velocity, density";
    for text in [&pattern(), "5, numbered 5 to 40", fields, "guessed", "assumed"] {
        assert!(harness.query_all_by_label(text).next().is_some(), "{text} is not shown");
    }
    assert!(harness.query_by_label("given").is_none());
    harness.get_by_role_and_label(Role::SpinButton, "Radius").set_value_accesskit(0.03);
    harness.step();
    until(&mut harness, "another radius", |viewer| command(viewer).contains("--radius=0.03"));
    wait(&mut harness, "its origin", |harness| harness.query_by_label("given").is_some());
    harness.get_by_label("Forget").click_accesskit();
    harness.step();
    until(&mut harness, "no radius", |viewer| !command(viewer).contains("--radius"));
    harness.get_by_role_and_label(Role::SpinButton, "Rate").set_value_accesskit(60.0);
    harness.step();
    until(&mut harness, "another rate", |viewer| viewer.playback().fps == 60.0);
    wait(&mut harness, "its origin", |harness| harness.query_by_label("given").is_some());
}

/// The panel tells how much whitewater lies beside the liquid.
#[test]
fn whitewater_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let water = folder.path().join("water_1.bgeo");
    std::fs::copy(format!("{DATA}ParticleData_Fluid_20.bgeo"), &water).expect("it is copied");
    let foam = folder.path().join("water_foam_1.csv");
    std::fs::write(foam, "x,y,z\n0,1,0\n0.1,1,0\n").expect("it is written");
    let mut harness = harness(Source::new(water.display().to_string()), [1000.0, 900.0]);
    wait(&mut harness, "its number", |harness| harness.query_by_label("2 foam").is_some());
}

/// A file from a simulation that names its values is no guess, and a single file needs no number in the command line.
#[test]
fn single_files_need_no_frame() {
    let file = format!("{DATA}ParticleData_Fluid_20.bgeo");
    let harness = harness(Source::new(file), [1000.0, 700.0]);
    let command = command(harness.state());
    assert!(!command.contains("--frames"), "{command}");
    assert!(harness.query_by_label("Frames").is_none());
}

/// While something is open, files, folders, recent sources and demos are a menu away; equal names tell their folders.
#[test]
fn everything_can_be_opened_at_any_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let recent = folder.path().join("recent.json");
    let list = ["/a/run1/w.bgeo", "/a/run2/w.bgeo", &pattern()];
    std::fs::write(&recent, serde_json::to_string(&list).expect("a list")).expect("it is written");
    let slab = concat!(env!("CARGO_MANIFEST_DIR"), "/../../sims/slab.toml");
    let source = Some(Source::new(slab));
    let options = Options { source, recent: Some(recent), ..Options::default() };
    let mut harness = shown(Viewer::new(options).expect("a viewer"), [700.0, 500.0]);
    harness.get_by_role_and_label(Role::Button, "Open").click_accesskit();
    harness.step();
    harness.step();
    for name in ["File…", "Folder…", "slab.toml", "run1/w.bgeo", "run2/w.bgeo", "Fountain", "Vase"]
    {
        assert!(harness.query_all_by_label_contains(name).next().is_some(), "{name} is not listed");
    }
    harness.get_by_label("ParticleData_Fluid_{}.bgeo").click_accesskit();
    until(&mut harness, "the sequence", |viewer| viewer.playback().count() == 5);
}

#[derive(Debug)]
struct Dropped(PathBuf);

impl DroppedFile for Dropped {
    fn path(&self) -> &Path {
        &self.0
    }

    fn bytes(&self) -> Result<Vec<u8>, String> {
        Err("only the path is used".into())
    }
}

/// Files that are dropped together are a sequence of these frames; others among them are told of.
#[test]
fn dropped_files_are_opened_together() {
    let viewer = Viewer::new(Options::default()).expect("a viewer");
    let mut harness = Harness::builder()
        .with_size([700.0, 500.0])
        .build_ui_state(|ui, viewer: &mut Viewer| viewer.ui(ui), viewer);
    harness.step();
    let names = ["ParticleData_Fluid_21.bgeo", "notes.txt", "ParticleData_Fluid_40.bgeo"];
    let files = names.map(|name| {
        let file: DroppedFileHandle = Arc::new(Dropped(format!("{DATA}{name}").into()));
        file
    });
    harness.input_mut().dropped_files = files.to_vec();
    harness.step();
    until(&mut harness, "two frames", |viewer| viewer.playback().count() == 2);
    let told = |viewer: &Viewer| viewer.notices().iter().any(|n| n.text.contains("1 other file"));
    assert!(told(harness.state()), "{:?}", harness.state().notices());
}
