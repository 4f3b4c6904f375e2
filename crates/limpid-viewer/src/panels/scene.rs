//! The scene's own controls: look, sky, sun, ground, and the axis and the unit of its files.

use eframe::egui;

use crate::model::document::Document;
use crate::panels::Command;
use crate::panels::toolbar::named;
use limpid::liquid::Up;
use limpid::look::Look;
use limpid::scene::Scene;
use limpid_io::adjustments::{Adjustments, Floor, Sun};

/// Units of length by name, m.
const UNITS: [(&str, f64); 5] = [
    ("metres", 1.0),
    ("centimetres", 0.01),
    ("millimetres", 0.001),
    ("kilometres", 1e3),
    ("feet", 0.3048),
];

/// Rows for the options `--look`, `--sky`, `--sun`, `--floor`, `--up` and `--scale`. They hold for A and B.
pub(crate) fn scene_rows(ui: &mut egui::Ui, document: &Document, commands: &mut Vec<Command>) {
    let before = &document.source.adjustments;
    let mut after = before.clone();
    let hint = "Sky, light, tone curve and, without ones of its own, ground and tint.\n--look";
    look_row(ui, "Look", hint, &mut after.look);
    look_row(ui, "Sky", "What is seen and reflected beyond the scene.\n--sky", &mut after.sky);
    let scene = &document.project.scene;
    let turned = sun_rows(ui, scene, &mut after);
    floor_rows(ui, scene, &mut after);
    if document.input.has_files() {
        file_rows(ui, &mut after);
    }
    if after == *before {
        return;
    }
    commands.push(match turned {
        // While the slider moves, the sun follows it at once.
        true => Command::TurnSun(after),
        false => Command::Adjust(after),
    });
}

fn look_row(ui: &mut egui::Ui, title: &str, hint: &str, chosen: &mut Option<Look>) {
    let label = ui.label(title).on_hover_text(hint);
    let name = |look: Option<Look>| look.map_or("as opened", Look::name);
    let choice = egui::ComboBox::from_id_salt(title).selected_text(name(*chosen));
    let response = choice.show_ui(ui, |ui| {
        for look in [None].into_iter().chain(Look::ALL.map(Some)) {
            ui.selectable_value(chosen, look, name(look));
        }
    });
    named(&response.response, title);
    response.response.labelled_by(label.id).on_hover_text(hint);
    ui.end_row();
}

/// Returns whether the sun has only been turned.
fn sun_rows(ui: &mut egui::Ui, scene: &Scene, adjustments: &mut Adjustments) -> bool {
    let hint = "Light from one direction, with shadows and caustics.\n--sun";
    let label = ui.label("Sun").on_hover_text(hint);
    let now = Sun::of(scene);
    let mut on = now != Sun::None;
    let toggled = ui.checkbox(&mut on, "").labelled_by(label.id).on_hover_text(hint).changed();
    ui.end_row();
    if toggled {
        // As it was opened, unless that has none.
        adjustments.sun = match (on, adjustments.sun) {
            (false, _) => Some(Sun::None),
            (true, Some(Sun::None)) => None,
            (true, _) => Some(Sun::At { azimuth: 45.0, elevation: 45.0 }),
        };
        return false;
    }
    let Sun::At { mut azimuth, mut elevation } = now else { return false };
    let mut row = |name: &str, value: &mut f64, low: f64, high: f64, hint: &str| {
        let label = ui.label(name).on_hover_text(hint);
        let slider = egui::Slider::new(value, low..=high).suffix("°").fixed_decimals(0);
        let slider = slider.clamping(egui::SliderClamping::Edits);
        let changed = ui.add(slider).labelled_by(label.id).on_hover_text(hint).changed();
        ui.end_row();
        changed
    };
    let turned = row("Azimuth", &mut azimuth, -180.0, 180.0, "from +z towards +x")
        | row("Elevation", &mut elevation, 1.0, 90.0, "above the horizon");
    if turned {
        // Whole degrees make short commands.
        let (azimuth, elevation) = (azimuth.round(), elevation.round());
        adjustments.sun = Some(Sun::At { azimuth, elevation });
    }
    turned
}

fn floor_rows(ui: &mut egui::Ui, scene: &Scene, adjustments: &mut Adjustments) {
    let hint = "The unbounded level ground.\n--floor";
    let now = Floor::of(scene);
    // Grounds cannot be added, only shown again.
    if now == Floor::None && adjustments.floor != Some(Floor::None) {
        return;
    }
    let label = ui.label("Ground").on_hover_text(hint);
    let mut on = now != Floor::None;
    if ui.checkbox(&mut on, "").labelled_by(label.id).on_hover_text(hint).changed() {
        adjustments.floor = (!on).then_some(Floor::None);
    }
    ui.end_row();
    if let Floor::At(height) = now
        && on
    {
        let label = ui.label("Height").on_hover_text(hint);
        let mut typed = height;
        let speed = 0.002 * (1.0 + height.abs());
        let drag = egui::DragValue::new(&mut typed).speed(speed).suffix(" m");
        let response = ui.add(drag.update_while_editing(false)).labelled_by(label.id);
        if response.changed() && typed.is_finite() {
            adjustments.floor = Some(Floor::At(typed));
        }
        ui.end_row();
    }
}

fn file_rows(ui: &mut egui::Ui, adjustments: &mut Adjustments) {
    let hint = "The axis of the files that points up.\n--up";
    let label = ui.label("Up").on_hover_text(hint);
    let name = |up: Option<Up>| match up {
        None => "as opened",
        Some(Up::Y) => "y",
        Some(Up::Z) => "z",
    };
    let choice = egui::ComboBox::from_id_salt("up axis").selected_text(name(adjustments.up));
    let response = choice.show_ui(ui, |ui| {
        for up in [None, Some(Up::Y), Some(Up::Z)] {
            ui.selectable_value(&mut adjustments.up, up, name(up));
        }
    });
    named(&response.response, "Up");
    response.response.labelled_by(label.id).on_hover_text(hint);
    ui.end_row();

    let hint = "The unit of the files. It decides how strongly water absorbs; looks tint by the liquid's size.\n--scale";
    let label = ui.label("Unit").on_hover_text(hint);
    let known = UNITS.iter().find(|(_, scale)| Some(*scale) == adjustments.scale);
    let shown = match (adjustments.scale, known) {
        (None, _) => "as opened".to_owned(),
        (_, Some((name, _))) => (*name).to_owned(),
        (Some(scale), None) => format!("{scale} m"),
    };
    let choice = egui::ComboBox::from_id_salt("unit").selected_text(shown);
    let response = choice.show_ui(ui, |ui| {
        ui.selectable_value(&mut adjustments.scale, None, "as opened");
        for (name, scale) in UNITS {
            ui.selectable_value(&mut adjustments.scale, Some(scale), name);
        }
    });
    named(&response.response, "Unit");
    response.response.labelled_by(label.id).on_hover_text(hint);
    ui.end_row();
}
