//! The controls of colours by an attribute: which, by which map, over which range, and the legend.

use eframe::egui;
use glam::UVec2;
use limpid::scene::Scene;
use limpid_io::color_by::{Attribute, AttributeRange, ColorScale, MapName};
use limpid_io::notice::brief;
use limpid_io::overlay::legend_fits;

use crate::model::coloring::Coloring;
use crate::model::document::Document;
use crate::panels::Command;
use crate::panels::toolbar::named;

/// Size of a list of attributes at most, points.
const LIST: egui::Vec2 = egui::vec2(220.0, 360.0);

/// State that the controls show and change.
pub(crate) struct ColorRows<'a> {
    pub(crate) document: &'a Document,
    pub(crate) colors: &'a mut Coloring,
    /// The attributes of the files; `None` until they are known.
    pub(crate) attributes: Option<&'a [AttributeRange]>,
    /// The scene that is edited.
    pub(crate) scene: &'a Scene,
    /// Size of the picture, pixels.
    pub(crate) size: UVec2,
}

impl ColorRows<'_> {
    /// Rows for what `--color-by`, `--colormap`, `--range` and `--legend` change. They hold for A and B.
    pub(crate) fn show(self, ui: &mut egui::Ui, commands: &mut Vec<Command>) {
        let Self { document, colors, attributes, scene, size } = self;
        attribute_row(ui, document, colors, attributes, commands);
        let Some(scale) = &colors.scale else { return };
        map_row(ui, scale, commands);
        range_rows(ui, scale, commands);
        let hint =
            "A bar with the values of the colors, over this picture and over saved ones.\n--legend";
        let label = ui.label("Legend").on_hover_text(hint);
        let fits = legend_fits(size, scale);
        ui.horizontal(|ui| {
            ui.checkbox(&mut colors.legend, "").labelled_by(label.id).on_hover_text(hint);
            if colors.legend && !fits {
                ui.weak("the picture is too small for it");
            }
        });
        ui.end_row();
        if !scene.is_opaque() {
            ui.label("");
            ui.weak("shown by opaque liquid alone");
            ui.end_row();
        }
    }
}

fn attribute_row(
    ui: &mut egui::Ui,
    document: &Document,
    colors: &Coloring,
    attributes: Option<&[AttributeRange]>,
    commands: &mut Vec<Command>,
) {
    let hint = "The attribute of the particles that colors them; of vectors, the length. With the values of the first \
                frame.\n--color-by";
    let label = ui.label("Color by").on_hover_text(hint);
    // A scene may have one of its own.
    let none = if document.is_bare() { "none" } else { "as opened" };
    let by = colors.by.as_ref().map(|by| &by.attribute);
    let given = document.source.adjustments.color_by.as_ref();
    let shown = by.map_or_else(|| none.to_owned(), Attribute::to_string);
    let choice = egui::ComboBox::from_id_salt("color by").selected_text(shown).height(LIST.y);
    let response = choice.show_ui(ui, |ui| {
        if ui.selectable_label(given.is_none(), none).clicked() && given.is_some() {
            commands.push(Command::ColorBy(None));
        }
        let Some(attributes) = attributes else {
            ui.weak("reading the first frame");
            // A popup does not grow with its contents.
            ui.allocate_space(LIST);
            return commands.push(Command::ListAttributes);
        };
        for row in attributes {
            let attribute = Attribute::from(row.name.as_str());
            let chosen = by.is_some_and(|by| by.name().eq_ignore_ascii_case(&row.name));
            if ui.selectable_label(chosen, text_of(row)).clicked() && !chosen {
                commands.push(Command::ColorBy(Some(attribute)));
            }
        }
    });
    named(&response.response, "Color by");
    response.response.labelled_by(label.id).on_hover_text(hint);
    ui.end_row();
}

/// An attribute with its values: `Temperature, 20 to 80 K`.
fn text_of(row: &AttributeRange) -> String {
    let AttributeRange { name, unit, spread } = row;
    let space = if unit.is_empty() { "" } else { " " };
    match spread.map(|spread| spread.extremes.map(brief)) {
        None => name.clone(),
        Some([low, high]) if low == high => format!("{name}, {low}{space}{unit}"),
        Some([low, high]) => format!("{name}, {low} to {high}{space}{unit}"),
    }
}

fn map_row(ui: &mut egui::Ui, scale: &ColorScale, commands: &mut Vec<Command>) {
    let hint = "The colors of the values.\n--colormap";
    let label = ui.label("Color map").on_hover_text(hint);
    let mut map = scale.map;
    let choice = egui::ComboBox::from_id_salt("color map").selected_text(map.name());
    let response = choice.height(400.0).show_ui(ui, |ui| {
        for option in MapName::ALL {
            ui.horizontal(|ui| {
                swatch(ui, option);
                ui.selectable_value(&mut map, option, option.name());
            });
        }
    });
    named(&response.response, "Color map");
    response.response.labelled_by(label.id).on_hover_text(hint);
    ui.end_row();
    if map != scale.map {
        commands.push(Command::Recolor(map, (!scale.automatic).then_some(scale.range)));
    }
}

/// A small picture of a map.
fn swatch(ui: &mut egui::Ui, map: MapName) {
    const STEPS: u8 = 24;
    let (rect, _) = ui.allocate_exact_size(egui::vec2(48.0, 12.0), egui::Sense::hover());
    let at = |step: u8| rect.left() + rect.width() * f32::from(step) / f32::from(STEPS);
    for step in 0..STEPS {
        let [r, g, b] = map.srgb((f64::from(step) + 0.5) / f64::from(STEPS));
        let part = egui::Rect::from_x_y_ranges(at(step)..=at(step + 1) + 0.5, rect.y_range());
        ui.painter().rect_filled(part, 0, egui::Color32::from_rgb(r, g, b));
    }
}

fn range_rows(ui: &mut egui::Ui, scale: &ColorScale, commands: &mut Vec<Command>) {
    let hint = "The values that the map's ends stand for: by default the 2nd to 98th percentile of the sequence, the \
                same for every frame.\n--range";
    let label = ui.label("Usual range").on_hover_text(hint);
    let mut automatic = scale.automatic;
    let toggled = ui.checkbox(&mut automatic, "").labelled_by(label.id).on_hover_text(hint);
    let toggled = toggled.changed();
    ui.end_row();
    let mut range = scale.range;
    let speed = 0.004 * f64::from(range[1] - range[0]).abs().max(1e-6);
    for (end, name) in range.iter_mut().zip(["From", "To"]) {
        let label = ui.label(name).on_hover_text(hint);
        let suffix = if scale.unit.is_empty() { String::new() } else { format!(" {}", scale.unit) };
        let drag = egui::DragValue::new(end).speed(speed).suffix(suffix);
        // All digits, because leaving the field parses the text again.
        let drag = drag.custom_formatter(|x, _| (x as f32).to_string());
        ui.add(drag.update_while_editing(false)).labelled_by(label.id).on_hover_text(hint);
        ui.end_row();
    }
    if toggled {
        commands.push(Command::Recolor(scale.map, (!automatic).then_some(scale.range)));
    } else if range != scale.range {
        commands.push(Command::Recolor(scale.map, Some(range)));
    }
}
