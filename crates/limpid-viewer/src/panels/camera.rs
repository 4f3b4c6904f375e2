//! The camera panel: the camera's parameters and its key frames.

use eframe::egui;

use crate::Viewer;
use crate::model::shortcuts::Action;
use crate::panels::dialogs::Dialog;
use crate::panels::icons::{self, Sign};
use limpid_io::camera_path::Key;

impl Viewer {
    pub(crate) fn camera_panel(&mut self, ui: &mut egui::Ui) {
        let ctx = ui.ctx().clone();
        let mut camera = self.eye.camera;
        let speed = 0.005 * camera.eye.distance(camera.target);
        egui::Grid::new("camera").num_columns(4).spacing([6.0, 5.0]).show(ui, |ui| {
            for (name, place) in [("Eye", &mut camera.eye), ("Target", &mut camera.target)] {
                ui.label(name);
                for axis in 0..3 {
                    let shown = rounded(place[axis], 4);
                    let drag = egui::DragValue::new(&mut place[axis]).speed(speed).suffix(" m");
                    ui.add(
                        drag.custom_formatter(|x, _| rounded(x, 4))
                            .custom_parser(edited_number(shown)),
                    );
                }
                ui.end_row();
            }
            ui.label("Up");
            for axis in 0..3 {
                let shown = rounded(camera.up[axis].into(), 3);
                let drag = egui::DragValue::new(&mut camera.up[axis]).speed(0.01);
                ui.add(
                    drag.custom_formatter(|x, _| rounded(x, 3)).custom_parser(edited_number(shown)),
                );
            }
            ui.end_row();
        });
        ui.horizontal(|ui| {
            let label = ui.label("Field of view");
            let shown = rounded(camera.fov_y.into(), 2);
            let slider = egui::Slider::new(&mut camera.fov_y, 1.0..=150.0).suffix("°");
            let slider = slider.clamping(egui::SliderClamping::Edits);
            let slider =
                slider.custom_formatter(|x, _| rounded(x, 2)).custom_parser(edited_number(shown));
            ui.add(slider).labelled_by(label.id);
        });
        self.set_camera(camera);
        ui.horizontal(|ui| {
            if ui.button("Fit to liquid").clicked() {
                self.act(&ctx, Action::Fit);
            }
            if ui.button("The scene's own").clicked() {
                self.act(&ctx, Action::Home);
            }
        });
        ui.separator();
        ui.strong("Key frames");
        self.keys(ui);
    }

    fn keys(&mut self, ui: &mut egui::Ui) {
        let ctx = ui.ctx().clone();
        ui.horizontal(|ui| {
            if ui.button("Add key").on_hover_text("the camera at the present time (K)").clicked() {
                self.act(&ctx, Action::AddKey);
            }
            let some = !self.eye.path.keys.is_empty();
            ui.add_enabled(some, egui::Checkbox::new(&mut self.eye.follow, "Follow"))
                .on_hover_text("playback takes the camera along the keys");
            // A page is given scenes and particles alone.
            if !cfg!(target_arch = "wasm32") && ui.button("Load…").clicked() {
                self.interface.dialog = Some(Dialog::load_path());
            }
            if ui.add_enabled(some, egui::Button::new("Save…")).clicked() {
                self.interface.dialog = Some(Dialog::save_path());
            }
        });
        if self.eye.path.keys.is_empty() {
            ui.weak("No keys. A camera path of keys can be followed here, and rendered with `limpid render --camera-path`.");
            return;
        }
        let (mut selected, mut removed) = (None, None);
        egui::Grid::new("keys").num_columns(4).striped(true).show(ui, |ui| {
            for (i, key) in self.eye.path.keys.iter_mut().enumerate() {
                ui.label(format!("{}", i + 1));
                let shown = format!("{:.2}", key.time);
                let drag = egui::DragValue::new(&mut key.time).speed(0.05).suffix(" s");
                let drag = drag.range(0.0..=1e6).clamp_existing_to_range(false);
                ui.add(drag.fixed_decimals(2).custom_parser(edited_number(shown)));
                if ui.button("Go to").clicked() {
                    selected = Some(*key);
                }
                let name = format!("Delete key {}", i + 1);
                if icons::button(ui, Sign::Cross, &name, &name, false).clicked() {
                    removed = Some(i);
                }
                ui.end_row();
            }
        });
        if let Some(key) = selected {
            self.go_to(key);
        }
        if let Some(i) = removed {
            self.eye.path.keys.remove(i);
            self.eye.follow &= !self.eye.path.keys.is_empty();
        }
        self.order_keys(ui.input(|input| input.pointer.any_down()));
    }

    /// Sorts the keys and removes duplicate times, but not while a key is dragged past another.
    fn order_keys(&mut self, dragging: bool) {
        if !dragging {
            self.eye.path.keys.sort_by(|a, b| a.time.total_cmp(&b.time));
            self.eye.path.keys.dedup_by(|a, b| a.time == b.time);
        }
    }

    /// Adds a key at the current time, or for a still one second after the last key.
    pub(crate) fn add_key(&mut self) {
        let still = self.playback.count() < 2;
        let after = self.eye.path.keys.last().map_or(0.0, |key| key.time + 1.0);
        let time = if still { after } else { self.seconds() };
        self.eye.path.keys.retain(|key| key.time != time);
        self.eye.path.keys.push(Key { time, camera: self.eye.camera });
        self.order_keys(false);
        self.show_info(format!("key {} at {time:.2} s", self.eye.path.keys.len()));
    }

    fn go_to(&mut self, key: Key) {
        self.set_camera(key.camera);
        let Some(document) = self.opened.document.clone() else { return };
        self.seek(document.nearest(&self.opened.frame_times, key.time));
    }

    /// The camera path of key frames.
    pub fn path(&self) -> &limpid_io::camera_path::CameraPath {
        &self.eye.path
    }
}

/// Formats a number with `decimals` decimals, without trailing zeros.
fn rounded(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    let text =
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    text.to_owned()
}

/// Parses a number, but rejects the text that is `shown`: entering and leaving a field must not drop the
/// decimals that it does not show.
fn edited_number(shown: String) -> impl Fn(&str) -> Option<f64> {
    move |text| text.trim().parse().ok().filter(|_| text.trim() != shown)
}
