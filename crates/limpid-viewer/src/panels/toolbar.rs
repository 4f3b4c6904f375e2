//! The toolbar at the top: files, view mode, comparison.

use eframe::egui;

use crate::model::demos::{DEMOS, Demo};
use crate::model::shortcuts::{self, Action};
use crate::model::views::View;
use crate::panels::icons::{self, Sign};
use crate::{Compare, Viewer};

/// Width from which the toolbar fits one line, points.
const WIDE: f32 = 860.0;

/// The button that copies what draws this picture: a command, or in a browser a link.
const COPY: &str = if cfg!(target_arch = "wasm32") { "Copy link" } else { "Copy command" };

impl Viewer {
    pub(crate) fn toolbar(&mut self, ui: &mut egui::Ui) {
        let ctx = ui.ctx().clone();
        let open = self.opened.document.is_some();
        let mut action_chosen = None;
        let bar = egui::Frame::side_top_panel(ui.style()).inner_margin(6);
        let mut demo_chosen = None;
        egui::Panel::top("toolbar").frame(bar).show(ui, |ui| {
            // On a narrow screen the buttons can be scrolled.
            let wide = ui.available_width() > WIDE;
            let mut buttons = |ui: &mut egui::Ui| {
                let mut button = |ui: &mut egui::Ui, text: &str, action: Action| {
                    let hint = shortcuts::of(action).tooltip();
                    if ui.button(text).on_hover_text(hint).clicked() {
                        action_chosen = Some(action);
                    }
                };
                button(ui, "Open…", Action::Open);
                // A page opens with a demo, not with the first screen.
                if cfg!(target_arch = "wasm32") {
                    let (live, others) = (&DEMOS[0], &DEMOS[1..]);
                    let hint = format!("{}, {}", live.title, live.about);
                    if ui.button("Simulate").on_hover_text(hint).clicked() {
                        demo_chosen = Some(live);
                    }
                    ui.menu_button("Demos", |ui| {
                        for demo in others {
                            if ui.button(demo.title).on_hover_text(demo.about).clicked() {
                                demo_chosen = Some(demo);
                            }
                        }
                    });
                }
                ui.add_enabled_ui(open, |ui| {
                    button(ui, "Save picture…", Action::SavePicture);
                    if !cfg!(target_arch = "wasm32") {
                        button(ui, "Save film…", Action::SaveFilm);
                    }
                    button(ui, "Save scene…", Action::SaveScene);
                    button(ui, COPY, Action::Copy);
                    ui.separator();
                    self.view_choice(ui);
                    ui.separator();
                    self.compare_choice(ui);
                });
                let layout = egui::Layout::right_to_left(egui::Align::Center);
                let mut signs = |ui: &mut egui::Ui| {
                    let mut button = |ui: &mut egui::Ui, sign, name, action, on| {
                        let hint = shortcuts::of(action).tooltip();
                        if icons::button(ui, sign, name, &hint, on).clicked() {
                            action_chosen = Some(action);
                        }
                    };
                    button(ui, Sign::Help, "Keys", Action::Help, self.interface.help);
                    let theme = if self.interface.dark { Sign::Sun } else { Sign::Moon };
                    button(ui, theme, "Theme", Action::Theme, false);
                    if open {
                        button(ui, Sign::Panels, "Panels", Action::Panels, self.interface.panels);
                    }
                };
                if wide { ui.with_layout(layout, signs).inner } else { signs(ui) }
            };
            if wide {
                ui.horizontal(buttons);
            } else {
                egui::ScrollArea::horizontal().show(ui, |ui| ui.horizontal(&mut buttons));
            }
        });
        if let Some(action) = action_chosen {
            self.act(&ctx, action);
        }
        match demo_chosen.map(Demo::source) {
            Some(Ok(source)) => self.open(source),
            Some(Err(error)) => self.fail(&error),
            None => {}
        }
    }

    fn view_choice(&mut self, ui: &mut egui::Ui) {
        let mut view = self.picture.view;
        let choice = egui::ComboBox::from_id_salt("view").selected_text(view.label()).width(130.0);
        let response = choice.height(400.0).show_ui(ui, |ui| {
            for mode in View::all() {
                let chosen = mode.aov() == view.aov();
                if ui.selectable_label(chosen, mode.label()).clicked() {
                    view = mode;
                }
            }
        });
        named(&response.response, "View");
        if let View::Image(aov, layer) = &mut view {
            let aov = *aov;
            let layers =
                View::Image(aov, 0).layers(self.editing.scenes[self.editing.edited].lights.len());
            if !layers.is_empty() {
                *layer = (*layer).min(layers.len() - 1);
                let choice = egui::ComboBox::from_id_salt("layer")
                    .selected_text(layers[*layer].as_str())
                    .width(130.0);
                let response = choice.show_ui(ui, |ui| {
                    for (i, name) in layers.iter().enumerate() {
                        ui.selectable_value(layer, i, name.as_str());
                    }
                });
                named(&response.response, "Layer");
            }
        }
        if view != self.picture.view {
            self.set_view(view);
        }
    }

    fn compare_choice(&mut self, ui: &mut egui::Ui) {
        ui.spacing_mut().item_spacing.x = 2.0;
        for compare in Compare::ALL {
            let hint = match compare {
                Compare::Off => "the settings that are edited",
                Compare::Wipe => "A on the left of a line that can be moved, B on its right",
                Compare::SideBySide => "A and B beside each other",
            };
            ui.selectable_value(&mut self.editing.compare, compare, compare.label())
                .on_hover_text(hint);
        }
    }
}

/// Sets the name of a combo box for accessibility and tests.
pub(crate) fn named(response: &egui::Response, name: &str) {
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, name));
}
