//! Lost and missing devices in the viewer: `docs/devices.md`.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use limpid::gpu::Gpu;
use limpid_viewer::{Options, Viewer};

use super::{assert_command_line_writes_what_is_saved, sequence, shown, until};

/// The devices opened by a viewer, for the test to destroy.
type Devices = Arc<Mutex<Vec<Gpu>>>;

fn opening(devices: &Devices) -> impl FnMut() -> limpid_io::Result<Gpu> + Send + 'static {
    let devices = devices.clone();
    move || {
        let gpu = Gpu::headless()?;
        devices.lock().expect("no panic holds this lock").push(gpu.clone());
        Ok(gpu)
    }
}

/// After the loss of a device during playback another is opened with a notice, playback continues, and
/// the picture at rest is that of `render`.
#[test]
fn playback_continues_with_another_device() {
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
    until(&mut harness, "it continues", |viewer| viewer.playback().index() != at);
    harness.key_press(eframe::egui::Key::Space);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let notices = harness.state().notices();
    assert!(notices.iter().any(|n| n.error && n.text.contains("destroyed")), "{notices:?}");
    assert_eq!(devices.lock().expect("no panic holds this lock").len(), 3);
    assert_command_line_writes_what_is_saved(&mut harness);
}

/// If every device is lost at once, or none exists, the viewer stops after a few attempts, reports the
/// error once, and tries again only after a change.
#[test]
fn attempts_to_open_devices_are_limited() {
    for exist in [true, false] {
        let opened = Arc::new(Mutex::new(0));
        let count = opened.clone();
        let open = move || {
            *count.lock().expect("no panic holds this lock") += 1;
            if !exist {
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
        until(&mut harness, "the last attempt", |viewer| {
            number() >= if exist { 3 } else { 1 } && !viewer.playback().playing
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
