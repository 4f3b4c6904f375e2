//! The viewer without a window: that it draws what `limpid render` draws, that its panels have every
//! setting, and that what moves the camera and the clock does so by its closed forms.

mod camera_controls;
mod devices;
mod panels;
mod parts;
mod pictures;
mod playing;
mod settings;

use std::path::Path;
use std::time::{Duration, Instant};

use egui_kittest::Harness;
use limpid_viewer::document::Source;
use limpid_viewer::{FINE_SAMPLES, Options, Viewer};

const DATA: &str =
    concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/tests/data/double_dam_break/");

/// Longest that anything here may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

fn sequence() -> Source {
    let input = format!("{DATA}ParticleData_Fluid_{{}}.bgeo");
    Source { radius: Some(0.025), ..Source::new(input) }
}

/// A viewer in a window of this size that is not there.
fn harness(source: Source, size: [f32; 2]) -> Harness<'static, Viewer> {
    let options = Options { source: Some(source), ..Options::default() };
    shown(Viewer::new(options).expect("no log, no error"), size)
}

/// This viewer in a window of this size that is not there, once something is open.
fn shown(viewer: Viewer, size: [f32; 2]) -> Harness<'static, Viewer> {
    let mut harness = Harness::builder()
        .with_size(size)
        .build_ui_state(|ui, viewer: &mut Viewer| viewer.ui(ui), viewer);
    until(&mut harness, "something is open", |viewer| viewer.command_line("x").is_some());
    harness
}

/// Steps until the viewer says so, and once more.
#[track_caller]
fn until(
    harness: &mut Harness<'static, Viewer>,
    what: &str,
    mut come: impl FnMut(&Viewer) -> bool,
) {
    wait(harness, what, |harness| come(harness.state()));
    harness.step();
}

/// Steps until something is to be seen.
#[track_caller]
fn wait(
    harness: &mut Harness<'static, Viewer>,
    what: &str,
    mut come: impl FnMut(&Harness<'static, Viewer>) -> bool,
) {
    let begun = Instant::now();
    while !come(harness) {
        assert!(begun.elapsed() < PATIENCE, "not in time: {what}");
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
    }
}

#[track_caller]
fn until_saved(harness: &mut Harness<'static, Viewer>) {
    until(harness, "it is saved", |viewer| {
        viewer.notices().iter().any(|notice| notice.text.starts_with("saved"))
    });
}

/// Runs a command as a shell does, with this limpid, in a folder.
fn shell(command: &str, folder: &Path) {
    let program = Path::new(env!("CARGO_BIN_EXE_limpid"));
    let path = format!(
        "{}:{}",
        program.parent().expect("a program is in a folder").display(),
        std::env::var("PATH").unwrap_or_default()
    );
    let mut sh = assert_cmd::Command::new("sh");
    sh.current_dir(folder).env("PATH", path).args(["-c", command]).assert().success();
}

fn same_picture(folder: &Path, a: &str, b: &str) -> bool {
    let pixels = |name: &str| image::open(folder.join(name)).expect("a picture").into_rgb8();
    pixels(a) == pixels(b)
}

/// Fails unless a shell that runs the viewer's command line writes the very picture that the viewer
/// saves.
#[track_caller]
fn assert_command_line_writes_what_is_saved(harness: &mut Harness<'static, Viewer>) {
    let folder = tempfile::tempdir().expect("a folder");
    // Of the same moment: the view may still be on its way.
    let command = harness.state().command_line("rendered.png").expect("something is open");
    let size = harness.state().picture_size();
    harness.state_mut().save_picture(folder.path().join("saved.png"), size, FINE_SAMPLES);
    until_saved(harness);
    shell(&command, folder.path());
    assert!(same_picture(folder.path(), "saved.png", "rendered.png"), "{command}");
}
