//! The layout that the tabs share: sections, and rows with names on the left.

use eframe::egui;

use crate::model::reading::Known;

/// A grid with names on the left and values over the rest of the panel.
pub(super) fn grid(ui: &mut egui::Ui, id: &str, rows: impl FnOnce(&mut egui::Ui)) {
    const NAMES: f32 = 124.0;
    const NUMBERS: f32 = 92.0;
    ui.spacing_mut().slider_width = (ui.available_width() - NAMES - NUMBERS - 28.0).max(40.0);
    let grid = egui::Grid::new(id).num_columns(2).min_col_width(NAMES);
    grid.spacing([8.0, 5.0]).show(ui, rows);
}

/// A section that can be closed.
pub(super) fn section(
    ui: &mut egui::Ui,
    id: &str,
    title: &str,
    open: bool,
    content: impl FnOnce(&mut egui::Ui),
) {
    let header = egui::CollapsingHeader::new(egui::RichText::new(title).strong());
    header.id_salt(id).default_open(open).show_unindented(ui, |ui| {
        content(ui);
        ui.add_space(4.0);
    });
}

/// Says how a value is known; in colour if it may be wrong.
pub(super) fn origin(ui: &mut egui::Ui, known: Known) {
    let text = egui::RichText::new(known.word());
    let text = match known.is_doubtful() {
        true => text.color(ui.visuals().warn_fg_color),
        false => text.weak(),
    };
    ui.label(text);
}
