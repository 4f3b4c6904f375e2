//! The toolbar at the top: files, view mode, comparison.

use eframe::egui;

use crate::model::demos::DEMOS;
use crate::model::editing::Compare;
use crate::model::platform::IN_BROWSER;
use crate::model::shortcuts::{self, Action};
use crate::model::views::View;
use crate::panels::Command;
use crate::panels::icons::{self, Sign};

/// Width from which the toolbar fits one line, points.
const WIDE: f32 = 860.0;

/// The button that copies a command that draws this picture, or in a browser a link to it.
const COPY: &str = if IN_BROWSER { "Copy link" } else { "Copy command" };

/// Contents of the toolbar.
pub(crate) struct Toolbar<'a> {
    /// Whether a document is open.
    pub(crate) open: bool,
    /// Whether the keys are shown.
    pub(crate) help: bool,
    /// Whether the interface is dark.
    pub(crate) dark: bool,
    /// Whether the panels are shown.
    pub(crate) panels: bool,
    pub(crate) view: View,
    /// Number of lights of the scene that is edited.
    pub(crate) lights: usize,
    pub(crate) compare: &'a mut Compare,
}

impl Toolbar<'_> {
    pub(crate) fn show(self, ui: &mut egui::Ui, commands: &mut Vec<Command>) {
        let Self { open, help, dark, panels, view, lights, compare } = self;
        let bar = egui::Frame::side_top_panel(ui.style()).inner_margin(6);
        egui::Panel::top("toolbar").frame(bar).show(ui, |ui| {
            // On a narrow screen the buttons can be scrolled.
            let wide = ui.available_width() > WIDE;
            let mut buttons = |ui: &mut egui::Ui| {
                button(ui, "Open…", Action::Open, commands);
                // A page opens with a demo, not with the first screen.
                if IN_BROWSER {
                    demos(ui, commands);
                }
                ui.add_enabled_ui(open, |ui| {
                    button(ui, "Save picture…", Action::SavePicture, commands);
                    if !IN_BROWSER {
                        button(ui, "Save film…", Action::SaveFilm, commands);
                    }
                    button(ui, "Save scene…", Action::SaveScene, commands);
                    button(ui, COPY, Action::Copy, commands);
                    ui.separator();
                    view_choice(ui, view, lights, commands);
                    ui.separator();
                    compare_choice(ui, compare);
                });
                let layout = egui::Layout::right_to_left(egui::Align::Center);
                let mut signs = |ui: &mut egui::Ui| {
                    let mut button = |ui: &mut egui::Ui, sign, name, action, on| {
                        let hint = shortcuts::of(action).tooltip();
                        if icons::button(ui, sign, name, &hint, on).clicked() {
                            commands.push(Command::Act(action));
                        }
                    };
                    button(ui, Sign::Help, "Keys", Action::Help, help);
                    let theme = if dark { Sign::Sun } else { Sign::Moon };
                    button(ui, theme, "Theme", Action::Theme, false);
                    if open {
                        button(ui, Sign::Panels, "Panels", Action::Panels, panels);
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
    }
}

fn button(ui: &mut egui::Ui, text: &str, action: Action, commands: &mut Vec<Command>) {
    let hint = shortcuts::of(action).tooltip();
    if ui.button(text).on_hover_text(hint).clicked() {
        commands.push(Command::Act(action));
    }
}

fn demos(ui: &mut egui::Ui, commands: &mut Vec<Command>) {
    let (live, others) = (&DEMOS[0], &DEMOS[1..]);
    let hint = format!("{}, {}", live.title, live.about);
    if ui.button("Simulate").on_hover_text(hint).clicked() {
        commands.push(Command::OpenDemo(live));
    }
    ui.menu_button("Demos", |ui| {
        for demo in others {
            if ui.button(demo.title).on_hover_text(demo.about).clicked() {
                commands.push(Command::OpenDemo(demo));
            }
        }
    });
}

fn view_choice(ui: &mut egui::Ui, now: View, lights: usize, commands: &mut Vec<Command>) {
    let mut view = now;
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
        let layers = View::Image(*aov, 0).layers(lights);
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
    if view != now {
        commands.push(Command::SetView(view));
    }
}

fn compare_choice(ui: &mut egui::Ui, compare: &mut Compare) {
    ui.label("Compare");
    ui.spacing_mut().item_spacing.x = 2.0;
    for choice in Compare::ALL {
        let hint = match choice {
            Compare::Off => "one picture, of the settings that are edited",
            Compare::Wipe => "A on the left of a line that can be moved, B on its right",
            Compare::SideBySide => "A and B beside each other",
        };
        ui.selectable_value(compare, choice, choice.label()).on_hover_text(hint);
    }
}

/// Sets the name of a combo box for accessibility and tests.
pub(crate) fn named(response: &egui::Response, name: &str) {
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, name));
}
