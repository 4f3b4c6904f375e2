//! The tab of the scene: the data, the look around them, and their colours. It holds for settings A and B.

use eframe::egui;
use glam::UVec2;

use crate::model::coloring::Coloring;
use crate::model::document::Document;
use crate::model::editing::{Compare, Editing};
use crate::panels::Command;
use crate::panels::colors::ColorRows;
use crate::panels::data::DataRows;
use crate::panels::layout::{grid, section};
use crate::panels::sliders::{edited_number, significant};
use crate::panels::toolbar::named;
use limpid::look::Look;
use limpid::scene::Scene;
use limpid_io::adjustments::{Adjustments, Floor, Sun};
use limpid_io::color_by::AttributeRange;
use limpid_io::input::Loaded;

/// State that the tab shows and changes.
pub(crate) struct ScenePanel<'a> {
    pub(crate) document: &'a Document,
    /// The frame that is shown, once it is loaded.
    pub(crate) loaded: Option<&'a Loaded>,
    pub(crate) editing: &'a mut Editing,
    pub(crate) colors: &'a mut Coloring,
    /// The attributes of the files; `None` until they are known.
    pub(crate) attributes: Option<&'a [AttributeRange]>,
    /// Size of the picture, pixels.
    pub(crate) size: UVec2,
}

impl ScenePanel<'_> {
    pub(crate) fn show(self, ui: &mut egui::Ui, commands: &mut Vec<Command>) {
        let Self { document, loaded, editing, colors, attributes, size } = self;
        if editing.compare != Compare::Off {
            ui.weak("Data, look and colors are those of A and of B; the settings differ.");
        }
        let scene = &mut editing.scenes[editing.edited];
        section(ui, "data", "Data", true, |ui| {
            grid(ui, "data", |ui| DataRows { document, loaded, scene }.show(ui, commands));
        });
        let scene = &editing.scenes[editing.edited];
        section(ui, "colors", "Colors", true, |ui| {
            grid(ui, "colors", |ui| {
                ColorRows { document, colors, attributes, scene, size }.show(ui, commands);
            });
        });
        section(ui, "look", "Light and ground", true, |ui| {
            grid(ui, "look", |ui| look_rows(ui, document, commands));
        });
    }
}

/// Rows for the options `--look`, `--sky`, `--sun` and `--floor`.
fn look_rows(ui: &mut egui::Ui, document: &Document, commands: &mut Vec<Command>) {
    let before = &document.source.adjustments;
    let mut after = before.clone();
    let hint = "Sky, light, tone curve and, without ones of its own, ground and tint.\n--look";
    let usual = match (document.is_bare(), before.color_by.is_some()) {
        (true, false) => Look::default().name(),
        (true, true) => Look::Paint.name(),
        (false, _) => "the scene's own",
    };
    look_row(ui, "Look", hint, usual, &mut after.look);
    let usual = if before.look.is_some() || document.is_bare() { "the look's" } else { usual };
    let hint = "What is seen and reflected beyond the scene.\n--sky";
    look_row(ui, "Sky", hint, usual, &mut after.sky);
    let scene = &document.project.scene;
    let turned = sun_rows(ui, scene, &mut after);
    floor_rows(ui, scene, &mut after);
    if after == *before {
        return;
    }
    commands.push(match turned {
        // While the slider moves, the sun follows it at once.
        true => Command::TurnSun(after),
        false => Command::Adjust(after),
    });
}

/// A row for a look; without one, it is the `usual` one.
fn look_row(
    ui: &mut egui::Ui,
    title: &str,
    hint: &str,
    usual: &'static str,
    chosen: &mut Option<Look>,
) {
    let label = ui.label(title).on_hover_text(hint);
    let shown = chosen.map_or(usual, Look::name);
    let choice = egui::ComboBox::from_id_salt(title).selected_text(shown);
    let response = choice.show_ui(ui, |ui| {
        let is_look = Look::ALL.iter().any(|look| look.name() == usual);
        if !is_look {
            ui.selectable_value(chosen, None, usual);
        }
        for look in Look::ALL {
            let mut option = Some(look).filter(|look| look.name() != usual);
            if ui.selectable_label(*chosen == option, look.name()).clicked() {
                *chosen = option.take();
            }
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
    let turned = row("Sun direction", &mut azimuth, -180.0, 180.0, "azimuth, from +z towards +x")
        | row("Sun height", &mut elevation, 1.0, 90.0, "elevation, above the horizon");
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
        let label = ui.label("Ground height").on_hover_text(hint);
        let mut typed = height;
        let speed = 0.002 * (1.0 + height.abs());
        let drag = egui::DragValue::new(&mut typed).speed(speed).suffix(" m");
        let drag = drag.custom_formatter(|x, _| significant(x));
        let drag = drag.custom_parser(edited_number(significant(height)));
        let response = ui.add(drag.update_while_editing(false)).labelled_by(label.id);
        if response.changed() && typed.is_finite() {
            adjustments.floor = Some(Floor::At(typed));
        }
        ui.end_row();
    }
}
