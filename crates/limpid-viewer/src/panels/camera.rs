//! The camera panel: the camera's parameters and its key frames.

use eframe::egui;

use crate::model::eye::{Eye, with_height};
use crate::model::platform::IN_BROWSER;
use crate::model::shortcuts::{self, Action};
use crate::panels::Command;
use crate::panels::icons::{self, Sign};
use crate::panels::sliders::{edited_number, rounded};
use limpid::camera::{Camera, Lens};

pub(crate) fn camera_panel(ui: &mut egui::Ui, eye: &mut Eye, commands: &mut Vec<Command>) {
    let mut camera = eye.camera;
    let speed = 0.005 * camera.eye.distance(camera.target);
    egui::Grid::new("camera").num_columns(4).spacing([6.0, 5.0]).show(ui, |ui| {
        for (name, place) in [("Eye", &mut camera.eye), ("Target", &mut camera.target)] {
            ui.label(name);
            for axis in 0..3 {
                let shown = rounded(place[axis], 4);
                let drag = egui::DragValue::new(&mut place[axis]).speed(speed).suffix(" m");
                ui.add(
                    drag.custom_formatter(|x, _| rounded(x, 4)).custom_parser(edited_number(shown)),
                );
            }
            ui.end_row();
        }
        ui.label("Up");
        for axis in 0..3 {
            let shown = rounded(camera.up[axis].into(), 3);
            let drag = egui::DragValue::new(&mut camera.up[axis]).speed(0.01);
            ui.add(drag.custom_formatter(|x, _| rounded(x, 3)).custom_parser(edited_number(shown)));
        }
        ui.end_row();
    });
    lens(ui, &mut camera);
    eye.set(camera);
    ui.horizontal(|ui| {
        if ui.button("Fit to liquid").clicked() {
            commands.push(Command::Act(Action::Fit));
        }
        if ui.button("The scene's own").clicked() {
            commands.push(Command::Act(Action::Home));
        }
    });
    ui.horizontal(|ui| {
        let views = [("Front", Action::Front), ("Side", Action::Side), ("Top", Action::Top)];
        for (name, action) in views {
            let hint = shortcuts::of(action).tooltip();
            if ui.button(name).on_hover_text(hint).clicked() {
                commands.push(Command::Act(action));
            }
        }
    });
    ui.separator();
    ui.strong("Key frames");
    keys(ui, eye, commands);
}

/// How much the camera shows: by its field of view, or with parallel rays by its height.
fn lens(ui: &mut egui::Ui, camera: &mut Camera) {
    ui.horizontal(|ui| match camera.lens {
        None => {
            let label = ui.label("Field of view");
            let shown = rounded(camera.fov_y.into(), 2);
            let slider = egui::Slider::new(&mut camera.fov_y, 1.0..=150.0).suffix("°");
            let slider = slider.clamping(egui::SliderClamping::Edits);
            let slider =
                slider.custom_formatter(|x, _| rounded(x, 2)).custom_parser(edited_number(shown));
            ui.add(slider).labelled_by(label.id);
        }
        Some(Lens::Orthographic { mut height }) => {
            let label = ui.label("Height");
            let shown = rounded(height, 4);
            let slider = egui::Slider::new(&mut height, 1e-3..=1e4).logarithmic(true).suffix(" m");
            let slider = slider.clamping(egui::SliderClamping::Edits);
            let slider =
                slider.custom_formatter(|x, _| rounded(x, 4)).custom_parser(edited_number(shown));
            if ui.add(slider).labelled_by(label.id).changed() {
                *camera = with_height(camera, height);
            }
        }
        Some(Lens::Pinhole { .. }) => {
            ui.weak("A calibrated lens, whose field of view is its own");
        }
    });
}

fn keys(ui: &mut egui::Ui, eye: &mut Eye, commands: &mut Vec<Command>) {
    ui.horizontal(|ui| {
        if ui.button("Add key").on_hover_text("the camera at the present time (K)").clicked() {
            commands.push(Command::Act(Action::AddKey));
        }
        let some = !eye.path.keys.is_empty();
        ui.add_enabled(some, egui::Checkbox::new(&mut eye.follow, "Follow"))
            .on_hover_text("playback takes the camera along the keys");
        // A page is given scenes and particles alone.
        if !IN_BROWSER && ui.button("Load…").clicked() {
            commands.push(Command::LoadPath);
        }
        if ui.add_enabled(some, egui::Button::new("Save…")).clicked() {
            commands.push(Command::SavePath);
        }
    });
    if eye.path.keys.is_empty() {
        ui.weak("No keys. A camera path of keys can be followed here, and rendered with `limpid render --camera-path`.");
        return;
    }
    let (mut selected, mut removed) = (None, None);
    egui::Grid::new("keys").num_columns(4).striped(true).show(ui, |ui| {
        for (i, key) in eye.path.keys.iter_mut().enumerate() {
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
        commands.push(Command::GoTo(key));
    }
    if let Some(i) = removed {
        eye.remove_key(i);
    }
    // Not while a key is dragged past another.
    if !ui.input(|input| input.pointer.any_down()) {
        eye.order_keys();
    }
}
