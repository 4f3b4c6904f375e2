//! Devices that are lost while the viewer plays, or that are not there: `docs/devices.md`.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use limpid::gpu::Gpu;
use limpid_viewer::{Options, Viewer};

use super::{assert_command_line_writes_what_is_saved, sequence, shown, until};

/// Opens devices, and keeps them for the test to destroy.
type Devices = Arc<Mutex<Vec<Gpu>>>;

fn opening(devices: &Devices) -> impl FnMut() -> limpid_io::Result<Gpu> + Send + 'static {
    let devices = devices.clone();
    move || {
        let gpu = Gpu::headless()?;
        devices.lock().expect("no panic holds this lock").push(gpu.clone());
        Ok(gpu)
    }
}

/// Protects playback from a device that is lost in the middle of it: another is opened, a notice
/// says so, playback goes on, and the picture at rest is what `render` draws.
#[test]
fn playback_goes_on_with_another_device() {
    let devices = Devices::default();
    let options = Options { source: Some(sequence()), ..Options::default() };
    let viewer = Viewer::with_devices(options, opening(&devices)).expect("a viewer");
    let mut harness = shown(viewer, [420.0, 300.0]);
    harness.key_press(eframe::egui::Key::Space);
    for round in 1..=2 {
        let at = harness.state().playback().index();
        until(&mut harness, "it plays", |viewer| viewer.playback().index() != at);
        let newest = devices.lock().expect("no panic holds this lock")[round - 1].clone();
        newest.device.destroy();
        until(&mut harness, "another device", |_| {
            devices.lock().expect("no panic holds this lock").len() > round
        });
        assert!(harness.state().playback().playing);
    }
    let at = harness.state().playback().index();
    until(&mut harness, "it plays on", |viewer| viewer.playback().index() != at);
    harness.key_press(eframe::egui::Key::Space);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let notices = harness.state().notices();
    assert!(notices.iter().any(|n| n.error && n.text.contains("destroyed")), "{notices:?}");
    assert_eq!(devices.lock().expect("no panic holds this lock").len(), 3);
    assert_command_line_writes_what_is_saved(&mut harness);
}

/// Protects against endless attempts: with devices that are all lost at once, and with none at all,
/// it is given up after a few, told once, and tried again only when something changes.
#[test]
fn devices_that_fail_are_given_up() {
    for there_are_some in [true, false] {
        let opened = Arc::new(Mutex::new(0));
        let count = opened.clone();
        let open = move || {
            *count.lock().expect("no panic holds this lock") += 1;
            if !there_are_some {
                return Err(limpid::Error::NoAdapter.into());
            }
            let gpu = Gpu::headless()?;
            gpu.device.destroy();
            Ok(gpu)
        };
        let options = Options { source: Some(sequence()), ..Options::default() };
        let viewer = Viewer::with_devices(options, open).expect("a viewer");
        let mut harness = shown(viewer, [420.0, 300.0]);
        harness.key_press(eframe::egui::Key::Space);
        let number = || *opened.lock().expect("no panic holds this lock");
        until(&mut harness, "it is given up", |viewer| {
            number() >= if there_are_some { 3 } else { 1 } && !viewer.playback().playing
        });
        for _ in 0..100 {
            harness.step();
            std::thread::sleep(Duration::from_millis(5));
        }
        let before = number();
        assert!(before <= 6, "{before} devices");
        let errors = harness.state().notices().iter().filter(|notice| notice.error).count();
        assert!(errors <= 4, "{:?}", harness.state().notices());
        assert!(!harness.state().is_at_rest(), "there is no picture");
        harness.key_press(eframe::egui::Key::End);
        until(&mut harness, "another attempt", |_| number() > before);
    }
}
