//! The side panel, which shows one of its tabs.

use eframe::egui;

/// A tab of the side panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Tab {
    /// The data, the look around them and their colours.
    #[default]
    Scene,
    /// The liquid and the settings of every pass.
    Settings,
    Camera,
    Times,
}

/// Shows the tabs, and the `content` of the one that is chosen.
pub(crate) fn side_panel(
    ui: &mut egui::Ui,
    tab: &mut Tab,
    content: impl FnOnce(&mut egui::Ui, Tab),
) {
    let bar = egui::Frame::side_top_panel(ui.style()).inner_margin(8);
    let panel = egui::Panel::right("side").frame(bar).default_size(350.0);
    panel.size_range(300.0..=520.0).show(ui, |ui| {
        ui.horizontal(|ui| {
            for (choice, name) in [
                (Tab::Scene, "Scene"),
                (Tab::Settings, "Settings"),
                (Tab::Camera, "Camera"),
                (Tab::Times, "Times"),
            ] {
                ui.selectable_value(tab, choice, name);
            }
        });
        ui.separator();
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| content(ui, *tab));
    });
}
