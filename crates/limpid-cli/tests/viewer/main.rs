//! The viewer without a window: pictures identical to those of `limpid render`, complete panels, and the
//! closed forms of camera controls and playback; and its real window, in processes of its own.

mod camera_controls;
mod colors;
mod data;
mod devices;
mod exploring;
mod first_minutes;
mod late;
mod panels;
mod parts;
mod pictures;
mod playing;
mod saving;
mod settings;
mod slow;
mod window;

use std::path::Path;
use std::time::{Duration, Instant};

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use limpid_viewer::model::document::Source;
use limpid_viewer::{FINE_SAMPLES, Options, Viewer};

const DATA: &str =
    concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/tests/data/double_dam_break/");

/// Timeout of every wait, long enough for a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

fn sequence() -> Source {
    let input = format!("{DATA}ParticleData_Fluid_{{}}.bgeo");
    Source { radius: Some(0.025), ..Source::new(input) }
}

/// A viewer of this source in a simulated window of this size.
fn harness(source: Source, size: [f32; 2]) -> Harness<'static, Viewer> {
    let options = Options { source: Some(source), ..Options::default() };
    shown(Viewer::new(options).expect("no log, no error"), size)
}

/// This viewer in a simulated window of this size, after its source has opened.
fn shown(viewer: Viewer, size: [f32; 2]) -> Harness<'static, Viewer> {
    let mut harness = Harness::builder()
        .with_size(size)
        .build_ui_state(|ui, viewer: &mut Viewer| viewer.ui(ui), viewer);
    until(&mut harness, "something is open", |viewer| viewer.command_line("x").is_some());
    harness
}

/// Steps until the viewer satisfies `condition`, and once more.
#[track_caller]
fn until(
    harness: &mut Harness<'static, Viewer>,
    what: &str,
    mut condition: impl FnMut(&Viewer) -> bool,
) {
    wait(harness, what, |harness| condition(harness.state()));
    harness.step();
}

/// Steps until the interface satisfies `condition`.
#[track_caller]
fn wait(
    harness: &mut Harness<'static, Viewer>,
    what: &str,
    mut condition: impl FnMut(&Harness<'static, Viewer>) -> bool,
) {
    let start = Instant::now();
    while !condition(harness) {
        let notices = harness.state().notices();
        assert!(start.elapsed() < PATIENCE, "not in time: {what}; notices: {notices:?}");
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
    }
}

/// Shows a tab of the side panel.
fn show_tab(harness: &mut Harness<'static, Viewer>, name: &str) {
    harness.get_by_label(name).click_accesskit();
    harness.step();
    harness.step();
}

#[track_caller]
fn until_saved(harness: &mut Harness<'static, Viewer>) {
    until(harness, "it is saved", |viewer| {
        viewer.notices().iter().any(|notice| notice.text.starts_with("saved"))
    });
}

/// Runs a shell command in a folder, with this limpid on `PATH`.
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

/// Fails unless the viewer's command line, run by a shell, writes the picture that the viewer saves.
#[track_caller]
fn assert_command_line_writes_what_is_saved(harness: &mut Harness<'static, Viewer>) {
    let folder = tempfile::tempdir().expect("a folder");
    // Read together, since the view may still change.
    let command = harness.state().command_line("rendered.png").expect("something is open");
    let size = harness.state().picture_size();
    harness.state_mut().save_picture(folder.path().join("saved.png"), size, FINE_SAMPLES);
    until_saved(harness);
    shell(&command, folder.path());
    assert!(same_picture(folder.path(), "saved.png", "rendered.png"), "{command}");
}
