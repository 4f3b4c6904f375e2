//! The toolbar at the top: files, view mode, comparison.

use eframe::egui;

use crate::model::demos::DEMOS;
use crate::model::document::Source;
use crate::model::editing::Compare;
use crate::model::platform::IN_BROWSER;
use crate::model::shortcuts::{self, Action};
use crate::model::views::View;
use crate::panels::Command;
use crate::panels::icons::{self, Sign};

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
    /// The view of the picture on screen.
    pub(crate) shown: View,
    /// Number of lights of the scene that is edited.
    pub(crate) lights: usize,
    pub(crate) compare: &'a mut Compare,
    /// Names and sources of those that were opened last, the last one first.
    pub(crate) recent: Vec<(String, &'a str)>,
    /// Whether a change can be taken back, and whether one can be made again.
    pub(crate) can_step: [bool; 2],
}

impl Toolbar<'_> {
    pub(crate) fn show(self, ui: &mut egui::Ui, commands: &mut Vec<Command>) {
        let Self { open, help, dark, panels, view, shown, lights, compare, recent, can_step } =
            self;
        let bar = egui::Frame::side_top_panel(ui.style()).inner_margin(6);
        egui::Panel::top("toolbar").frame(bar).show(ui, |ui| {
            let layout = egui::Layout::right_to_left(egui::Align::Center);
            let height = ui.spacing().interact_size.y + 2.0;
            ui.allocate_ui_with_layout(egui::vec2(ui.available_width(), height), layout, |ui| {
                let mut sign = |ui: &mut egui::Ui, sign, name, action, on| {
                    let hint = shortcuts::of(action).tooltip();
                    if icons::button(ui, sign, name, &hint, on).clicked() {
                        commands.push(Command::Act(action));
                    }
                };
                sign(ui, Sign::Help, "Keys", Action::Help, help);
                let theme = if dark { Sign::Sun } else { Sign::Moon };
                sign(ui, theme, "Theme", Action::Theme, false);
                if open {
                    sign(ui, Sign::Panels, "Panels", Action::Panels, panels);
                    ui.add_enabled_ui(can_step[1], |ui| {
                        sign(ui, Sign::Redo, "Redo", Action::Redo, false);
                    });
                    ui.add_enabled_ui(can_step[0], |ui| {
                        sign(ui, Sign::Undo, "Undo", Action::Undo, false);
                    });
                }
                // On a narrow screen the other buttons can be scrolled.
                ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                    egui::ScrollArea::horizontal().auto_shrink(false).show(ui, |ui| {
                        ui.horizontal(|ui| {
                            open_menu(ui, &recent, commands);
                            ui.add_enabled_ui(open, |ui| {
                                save_buttons(ui, commands);
                                ui.separator();
                                view_choice(ui, (view, shown), lights, commands);
                                ui.separator();
                                compare_choice(ui, compare);
                            });
                        });
                    });
                });
            });
        });
    }
}

fn save_buttons(ui: &mut egui::Ui, commands: &mut Vec<Command>) {
    button(ui, "Save picture…", Action::SavePicture, commands);
    if !IN_BROWSER {
        button(ui, "Save film…", Action::SaveFilm, commands);
    }
    button(ui, "Save scene…", Action::SaveScene, commands);
    button(ui, COPY, Action::Copy, commands);
}

/// All that can be opened: files, folders, what was open before, and the demos.
fn open_menu(ui: &mut egui::Ui, recent: &[(String, &str)], commands: &mut Vec<Command>) {
    // Room for the arrow, which the font lacks.
    let menu = ui.menu_button("Open    ", |ui| {
        let key = shortcuts::of(Action::Open).shown;
        if ui.add(egui::Button::new("File…").shortcut_text(key)).clicked() {
            commands.push(Command::Act(Action::Open));
        }
        if ui.button("Folder…").clicked() {
            commands.push(Command::OpenFolder);
        }
        if !recent.is_empty() {
            ui.separator();
            ui.weak("Open before");
        }
        for (name, input) in recent {
            if ui.button(name.as_str()).on_hover_text(*input).clicked() {
                commands.push(Command::Open(Source::new(*input)));
            }
        }
        ui.separator();
        ui.weak("Demos");
        for demo in &DEMOS {
            if ui.button(demo.title).on_hover_text(demo.about).clicked() {
                commands.push(Command::OpenDemo(demo));
            }
        }
    });
    let tip = menu.response.rect.right_center() - egui::vec2(12.0, -3.0);
    let arrow = [egui::vec2(-4.0, -5.0), egui::vec2(4.0, -5.0), egui::Vec2::ZERO];
    let points = arrow.map(|corner| tip + corner).to_vec();
    let color = ui.style().interact(&menu.response).fg_stroke.color;
    ui.painter().add(egui::Shape::convex_polygon(points, color, egui::Stroke::NONE));
    menu.response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, "Open"));
}

fn button(ui: &mut egui::Ui, text: &str, action: Action, commands: &mut Vec<Command>) {
    let hint = shortcuts::of(action).tooltip();
    if ui.button(text).on_hover_text(hint).clicked() {
        commands.push(Command::Act(action));
    }
}

/// The choice of a view, under the name of the one on screen.
fn view_choice(
    ui: &mut egui::Ui,
    (now, shown): (View, View),
    lights: usize,
    commands: &mut Vec<Command>,
) {
    let mut view = now;
    let choice = egui::ComboBox::from_id_salt("view").selected_text(shown.label()).width(130.0);
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
        // Until its picture is there, the view has no name, nor has its layer.
        if let View::Image(of, index) = shown
            && of == *aov
            && !layers.is_empty()
        {
            let index = index.min(layers.len() - 1);
            *layer = (*layer).min(layers.len() - 1);
            let choice = egui::ComboBox::from_id_salt("layer")
                .selected_text(layers[index].as_str())
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
