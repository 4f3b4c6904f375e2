//! The tab of settings A or B: the liquid, and the settings of every pass.

use eframe::egui;
use eframe::egui::SliderClamping::Edits;
use serde_json::json;

use crate::model::document::Document;
use crate::model::editing::Editing;
use crate::model::level::FINE_SAMPLES;
use crate::model::log::Log;
use crate::panels::Command;
use crate::panels::layout::{grid, section};
use crate::panels::liquid::liquid_rows;
use crate::panels::sliders::number_slider;
use crate::panels::toolbar::named;
use limpid::scene::Scene;
use limpid::settings::{Preset, Settings};
use limpid_io::color_by::ColorBy;
use limpid_io::project::controls::{self, CONTROLS, Control, ControlKind, PASSES, Value};
use limpid_io::project::overrides::replaced;
use limpid_io::shared_classifier::Processor;

/// State that the settings panel shows and changes.
pub(crate) struct SettingsPanel<'a> {
    pub(crate) document: &'a Document,
    pub(crate) editing: &'a mut Editing,
    /// Whether pictures at rest are refined.
    pub(crate) refine: &'a mut bool,
    /// The processor that classifies the particles.
    pub(crate) processor: &'a mut Processor,
    /// The attribute that colours the particles.
    pub(crate) color_by: Option<&'a ColorBy>,
    pub(crate) log: &'a mut Log,
}

impl SettingsPanel<'_> {
    pub(crate) fn show(self, ui: &mut egui::Ui, commands: &mut Vec<Command>) {
        let Self { document, editing, refine, processor, color_by, log } = self;
        ui.horizontal(|ui| {
            for (i, name) in ["A", "B"].into_iter().enumerate() {
                let hint = format!("edit settings {name} (X)");
                ui.selectable_value(&mut editing.edited, i, name).on_hover_text(hint);
            }
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let (from, to) = if editing.edited == 0 { ("A", "B") } else { ("B", "A") };
                let copy = ui.button(format!("Copy {from} to {to}"));
                if copy.clicked() {
                    editing.scenes[1 - editing.edited] = editing.scenes[editing.edited].clone();
                }
                let reset = ui.button("Reset all").on_hover_text("all as they were opened");
                if reset.clicked() {
                    editing.scenes[editing.edited] = document.project.scene.clone();
                }
            });
        });
        let scene = &mut editing.scenes[editing.edited];
        let before = scene.clone();
        let opened = &document.project.scene;
        ui.horizontal(|ui| {
            ui.label("Preset").on_hover_text("The settings of a published method.");
            let choice =
                egui::ComboBox::from_id_salt("preset").selected_text(preset_of(scene, opened));
            let response = choice.width(140.0).show_ui(ui, |ui| {
                for preset in Preset::ALL {
                    if ui.selectable_label(false, preset.to_string()).clicked() {
                        take_preset(&mut scene.settings, preset);
                    }
                }
            });
            named(&response.response, "Preset");
        });
        let hint = format!("draw at least {FINE_SAMPLES} rays per pixel once nothing changes");
        ui.checkbox(refine, "Refine pictures at rest").on_hover_text(hint);
        ui.add_space(4.0);
        section(ui, "liquid", "Liquid", true, |ui| {
            grid(ui, "liquid", |ui| liquid_rows(ui, scene, document, color_by, commands));
            reset(ui, "liquid", || {
                scene.liquid = document.project.scene.liquid;
                scene.fluids.clone_from(&document.project.scene.fluids);
            });
        });
        let table = controls::table(&scene.settings);
        for (pass, title) in PASSES {
            let open = ["refract", "smooth"].contains(&pass);
            section(ui, pass, title, open, |ui| {
                grid(ui, pass, |ui| {
                    for control in CONTROLS.iter().filter(|control| control.pass == pass) {
                        row(ui, control, &control.of(&table), &mut scene.settings);
                    }
                    if pass == "classify" {
                        computed_on(ui, processor);
                    }
                });
                reset(ui, pass, || {
                    for control in CONTROLS.iter().filter(|control| control.pass == pass) {
                        let opened = control.get(&document.project.scene.settings);
                        control.set(&mut scene.settings, &opened);
                    }
                    if pass == "classify" {
                        *processor = document.project.processor;
                    }
                });
            });
        }
        if log.is_on() && *scene != before {
            let changed = controls::differences(&before.settings, &scene.settings);
            let what: Vec<String> = changed
                .iter()
                .map(|(control, value)| format!("{}={value}", control.path()))
                .collect();
            log.event("setting", json!({ "changed": what }));
        }
    }
}

/// Applies a preset as `--preset` does: to all settings except those of the picture.
pub(crate) fn take_preset(settings: &mut Settings, preset: Preset) {
    if let Ok(changed) = replaced(settings, &[format!("preset={preset}")]) {
        *settings = changed;
    }
}

/// Name of the preset that the settings are, but for those of the picture and of the look; or whether they are as they
/// were opened.
fn preset_of(scene: &Scene, opened: &Scene) -> String {
    let settings = &scene.settings;
    let fits = |preset: &Preset| {
        let mut all = preset.settings();
        all.refract.filter_patterns = settings.refract.filter_patterns;
        (&all.classify, &all.layers, &all.smooth, &all.refract)
            == (&settings.classify, &settings.layers, &settings.smooth, &settings.refract)
    };
    match Preset::ALL.iter().find(|preset| fits(preset)) {
        Some(preset) => preset.to_string(),
        None if *settings == opened.settings => "the scene's own".into(),
        None => "changed".into(),
    }
}

fn reset(ui: &mut egui::Ui, what: &str, act: impl FnOnce()) {
    let button = ui.small_button(format!("Reset {what}")).on_hover_text("as it was opened");
    if button.clicked() {
        act();
    }
}

/// A row for a setting: its name, and its `old` value with unit and range.
fn row(ui: &mut egui::Ui, control: &Control, old: &Value, settings: &mut Settings) {
    let hint = |ui: &mut egui::Ui| _ = ui.label(hint(control, settings));
    let label = ui.label(control.label).on_hover_ui(hint);
    let unit = match control.unit(settings) {
        "" => String::new(),
        unit if unit.starts_with('/') => unit.to_owned(),
        unit => format!(" {unit}"),
    };
    let mut value = old.clone();
    let response = match (control.kind, &mut value) {
        (ControlKind::Number(low, high, _), Value::Number(x)) => {
            ui.add(number_slider(x, low, high).suffix(unit))
        }
        (ControlKind::Whole(low, high, _), Value::Whole(n)) => {
            let slider = egui::Slider::new(n, low..=high).suffix(unit).clamping(Edits);
            ui.add(slider.logarithmic(high / low.max(1) > 64))
        }
        (ControlKind::Odd(low, high, _), Value::Whole(n)) => {
            let before = *n;
            let slider = egui::Slider::new(n, low..=high).suffix(unit).clamping(Edits);
            let response = ui.add(slider.step_by(2.0));
            if *n != before {
                *n = (*n | 1).clamp(low, high);
            }
            response
        }
        (ControlKind::Toggle, Value::Toggle(yes)) => ui.checkbox(yes, ""),
        (ControlKind::Choice(names), Value::Choice(name)) => {
            let choice = egui::ComboBox::from_id_salt(control.path()).selected_text(name.as_str());
            let response = choice.show_ui(ui, |ui| {
                for &option in names {
                    ui.selectable_value(name, option.to_owned(), option);
                }
            });
            named(&response.response, control.label);
            response.response
        }
        _ => label.clone(),
    };
    response.labelled_by(label.id).on_hover_ui(hint);
    ui.end_row();
    if value != *old {
        control.set(settings, &value);
    }
}

/// A row for the processor that classifies the particles.
fn computed_on(ui: &mut egui::Ui, processor: &mut Processor) {
    const NAME: &str = "Computed on";
    const HINT: &str =
        "The graphics device where that is faster, or one of the two.\ndefault auto\nclassify.on";
    let label = ui.label(NAME).on_hover_text(HINT);
    let choice = egui::ComboBox::from_id_salt("classify.on").selected_text(processor.to_string());
    let response = choice.show_ui(ui, |ui| {
        for option in Processor::ALL {
            ui.selectable_value(processor, option, option.to_string());
        }
    });
    named(&response.response, NAME);
    response.response.labelled_by(label.id).on_hover_text(HINT);
    ui.end_row();
}

fn hint(control: &Control, settings: &Settings) -> String {
    let unit = control.unit(settings);
    let range = match control.kind {
        ControlKind::Number(low, high, _) => format!("\n{low} to {high} {unit}"),
        ControlKind::Whole(low, high, _) => format!("\n{low} to {high} {unit}"),
        ControlKind::Odd(low, high, _) => format!("\n{low} to {high}, odd"),
        ControlKind::Toggle | ControlKind::Choice(_) => String::new(),
    };
    let default = control.get(&Settings::default());
    format!("{}{}\ndefault {default}\n{}", control.help, range.trim_end(), control.path())
}
