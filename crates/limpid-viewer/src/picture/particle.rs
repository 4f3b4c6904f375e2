//! The values of the particle that was clicked, and a ring around it.

use eframe::egui::{self, Align2, Color32, Rect, Stroke, pos2, vec2};
use glam::{DVec3, UVec2};
use limpid::camera::Camera;

use crate::backend::core::picking::Picked;

/// Shows them over a picture of `size` pixels in `rect`. Returns whether they are closed.
pub(crate) fn show(
    ui: &egui::Ui,
    rect: Rect,
    size: UVec2,
    camera: &Camera,
    picked: &Picked,
) -> bool {
    if let Some((at, radius)) = shown(rect, size, camera, picked) {
        let painter = ui.painter().with_clip_rect(rect);
        painter.circle_stroke(at, radius + 2.0, Stroke::new(3.0, Color32::from_black_alpha(140)));
        painter.circle_stroke(at, radius + 2.0, Stroke::new(1.5, Color32::WHITE));
    }
    let area = egui::Area::new(ui.scope_id().with("particle"))
        .fixed_pos(pos2(rect.right() - 12.0, rect.top() + 12.0))
        .pivot(Align2::RIGHT_TOP)
        .order(egui::Order::Middle);
    let shown = area.show(ui.ctx(), |ui| {
        egui::Frame::popup(ui.style()).show(ui, |ui| {
            ui.strong("Particle");
            egui::Grid::new("particle").num_columns(2).spacing([12.0, 3.0]).show(ui, |ui| {
                for (name, value) in &picked.values {
                    ui.label(name.as_str());
                    ui.monospace(value.as_str());
                    ui.end_row();
                }
            });
            ui.small_button("Close").clicked()
        })
    });
    shown.inner.inner
}

/// Where a particle is seen, and how large, points; `None` behind the eye.
fn shown(rect: Rect, size: UVec2, camera: &Camera, picked: &Picked) -> Option<(egui::Pos2, f32)> {
    let view = camera.uniform(size, camera.eye);
    let to = picked.place - camera.eye;
    let row = |i: usize| DVec3::from_array(view.view_from_world.map(|column| column[i].into()));
    let (x, y, depth) = (to.dot(row(0)), to.dot(row(1)), -to.dot(row(2)));
    let scale = if view.far > 0.0 { 1.0 } else { depth.recip() };
    if depth <= 0.0 {
        return None;
    }
    let (tangent, shift) = (view.tangent.as_dvec2(), view.shift.as_dvec2());
    let right = (x * scale - shift.x) / tangent.x;
    let up = (y * scale - shift.y) / tangent.y;
    let at = rect.center() + 0.5 * rect.size() * vec2(right as f32, -up as f32);
    let radius = picked.radius * scale / tangent.y * 0.5 * f64::from(rect.height());
    Some((at, radius as f32))
}
