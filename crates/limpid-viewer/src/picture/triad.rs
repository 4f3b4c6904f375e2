//! The axes of the files in a corner of the picture; a click on an end looks from there.

use eframe::egui::{
    self, Align2, Color32, FontId, Pos2, Rect, Role, Sense, Stroke, WidgetInfo, pos2, vec2,
};
use glam::DVec3;
use limpid::camera::Camera;
use limpid::liquid::Up;

use crate::picture::camera_controls::axes;

/// Length of an axis, points.
const LENGTH: f32 = 30.0;

/// Radius of an end, points.
const END: f32 = 8.0;

/// Colours of x, y and z.
const COLORS: [Color32; 3] = [
    Color32::from_rgb(228, 84, 84),
    Color32::from_rgb(116, 190, 66),
    Color32::from_rgb(84, 140, 236),
];

/// Shows the axes of files in which `up` is up, in the lower right corner of `rect`. Returns the direction from which
/// to look, if one is clicked.
pub(crate) fn show(ui: &egui::Ui, rect: Rect, camera: &Camera, up: Up) -> Option<DVec3> {
    // Notices cover the lower edge.
    let middle = pos2(rect.right() - LENGTH - 18.0, rect.bottom() - LENGTH - 50.0);
    if rect.width() < 8.0 * LENGTH || rect.height() < 8.0 * LENGTH {
        return None;
    }
    let [right, above, back] = axes(camera);
    let ends = (0..6).map(|i| {
        let sign = if i < 3 { 1.0 } else { -1.0 };
        let direction = up.to_y_up(sign * DVec3::AXES[i % 3]);
        let place = vec2(direction.dot(right) as f32, -direction.dot(above) as f32);
        (i, direction, middle + LENGTH * place, direction.dot(back))
    });
    let mut ends: Vec<(usize, DVec3, Pos2, f64)> = ends.collect();
    // The nearest ones last, over the others.
    ends.sort_by(|a, b| a.3.total_cmp(&b.3));
    let mut chosen = None;
    for (i, direction, at, _) in ends {
        let (name, color) = (["x", "y", "z"][i % 3], COLORS[i % 3]);
        let sign = if i < 3 { "+" } else { "-" };
        let place = Rect::from_center_size(at, egui::Vec2::splat(2.0 * END));
        let end = ui.interact(place, ui.scope_id().with(("triad", i)), Sense::click());
        let text = format!("From {sign}{name}");
        end.widget_info(|| WidgetInfo::labeled(Role::Button, true, text.as_str()));
        let painter = ui.painter().with_clip_rect(rect);
        let hovered = end.hovered();
        if i < 3 {
            painter.line_segment([middle, at], Stroke::new(2.0, color));
            painter.circle_filled(at, END, color);
            let font = FontId::proportional(12.0);
            painter.text(at, Align2::CENTER_CENTER, name, font, Color32::BLACK);
        } else {
            painter.circle_filled(at, 0.6 * END, color.gamma_multiply(0.35));
        }
        if hovered {
            painter.circle_stroke(at, END, Stroke::new(1.5, Color32::WHITE));
        }
        if end.on_hover_text(format!("look from {sign}{name}")).clicked() {
            chosen = Some(direction);
        }
    }
    chosen
}
