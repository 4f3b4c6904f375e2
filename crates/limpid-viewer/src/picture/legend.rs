//! Legends: the meaning of a picture's colours.

use eframe::egui::{self, Align2, Color32, Rect, Sense, StrokeKind, pos2, vec2};

use crate::model::views::{Legend, viridis};
use crate::panels::style::number;
use crate::picture::texture::Facts;

/// Shows the legend of a picture in a corner of `rect`, with the values under the pointer.
pub(crate) fn show(ui: &mut egui::Ui, facts: &Facts, viewport: &egui::Response, rect: Rect) {
    let anchor = pos2(rect.left() + 12.0, rect.bottom() - 12.0);
    let area = egui::Area::new(ui.scope_id().with("legend"))
        .fixed_pos(anchor)
        .pivot(Align2::LEFT_BOTTOM)
        .interactable(false)
        .order(egui::Order::Middle);
    area.show(ui.ctx(), |ui| {
        egui::Frame::popup(ui.style()).show(ui, |ui| {
            ui.set_width(230.0);
            legend(ui, &facts.legend);
            if let Some(text) = facts.values.as_ref().and_then(|values| {
                let at = (viewport.hover_pos()? - rect.min) / rect.size();
                let texts: Vec<_> = values.at(at.x, at.y)?.into_iter().map(number).collect();
                Some(texts.join(", "))
            }) {
                ui.monospace(format!("here  {text}"));
            }
        });
    });
}

fn legend(ui: &mut egui::Ui, legend: &Legend) {
    match legend {
        Legend::Picture => {}
        Legend::Nothing(why) => {
            ui.label(*why);
        }
        Legend::Normal => {
            ui.strong("Normal, outward, as seen from the camera");
            for (color, text) in [
                ([255, 128, 128], "to the right"),
                ([128, 255, 128], "up"),
                ([128, 128, 255], "towards the eye"),
            ] {
                ui.horizontal(|ui| {
                    let (swatch, _) = ui.allocate_exact_size(vec2(18.0, 12.0), Sense::hover());
                    ui.painter().rect_filled(
                        swatch,
                        2,
                        Color32::from_rgb(color[0], color[1], color[2]),
                    );
                    ui.label(text);
                });
            }
        }
        Legend::Scale { title, low, high, unit } => {
            ui.strong(format!("{title}{}", in_unit(unit)));
            ramp(ui, viridis);
            ends(ui, *low, *high);
        }
        Legend::Light { title, white, unit } => {
            ui.strong(format!("{title}, linear RGB{}", in_unit(unit)));
            ramp(ui, |t| Color32::from_gray((255.0 * t.powf(1.0 / 2.2)) as u8));
            ends(ui, 0.0, *white);
        }
    }
}

fn in_unit(unit: &str) -> String {
    if unit.is_empty() { String::new() } else { format!(", {unit}") }
}

fn ramp(ui: &mut egui::Ui, color: impl Fn(f32) -> Color32) {
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), 12.0), Sense::hover());
    let steps = 64;
    for i in 0..steps {
        let share = |i: usize| rect.left() + rect.width() * i as f32 / steps as f32;
        let part = Rect::from_x_y_ranges(share(i)..=share(i + 1) + 0.5, rect.y_range());
        ui.painter().rect_filled(part, 0, color((i as f32 + 0.5) / steps as f32));
    }
    let frame = ui.visuals().widgets.noninteractive.bg_stroke;
    ui.painter().rect_stroke(rect, 0, frame, StrokeKind::Outside);
}

fn ends(ui: &mut egui::Ui, low: f32, high: f32) {
    ui.columns(3, |columns| {
        columns[0].monospace(number(low));
        columns[1].vertical_centered(|ui| ui.monospace(number(0.5 * (low + high))));
        let right = egui::Layout::right_to_left(egui::Align::Min);
        columns[2].with_layout(right, |ui| ui.monospace(number(high)));
    });
}
