//! Notices over the picture, which keeps its size when they come and go; and the log of all of them.

use std::time::Duration;

use eframe::egui::{self, Align2, Color32, Rect, RichText, Sense, vec2};

use crate::model::notices::{Notice, Notices};
use crate::panels::Command;
use crate::panels::icons::{self, Sign};
use crate::panels::style::accent;

/// Most notices over the picture at a time; the log has the others.
const MOST: usize = 3;

/// Largest width of a notice, points.
const WIDTH: f32 = 560.0;

/// Shows the newest notices over the lower edge of `rect`.
pub(crate) fn show(ui: &egui::Ui, rect: Rect, notices: &mut Notices, commands: &mut Vec<Command>) {
    if let Some(left) = notices.expire() {
        ui.ctx().request_repaint_after(left);
    }
    let count = notices.shown().len();
    if count == 0 {
        return;
    }
    let mut dismissed = None;
    let bottom = rect.center_bottom() - vec2(0.0, 12.0);
    let area = egui::Area::new(ui.scope_id().with("notices"))
        .fixed_pos(bottom)
        .pivot(Align2::CENTER_BOTTOM)
        .constrain_to(rect);
    let shown = area.show(ui.ctx(), |ui| {
        ui.set_width((rect.width() - 24.0).min(WIDTH));
        let first = count.saturating_sub(MOST);
        if first > 0 && ui.link(format!("{first} more")).clicked() {
            commands.push(Command::ShowMessages);
        }
        for (i, notice) in notices.shown().iter().enumerate().skip(first) {
            egui::Frame::popup(ui.style()).show(ui, |ui| {
                ui.with_layout(egui::Layout::right_to_left(egui::Align::Min), |ui| {
                    if icons::button(ui, Sign::Cross, "Dismiss", "dismiss (Esc)", false).clicked() {
                        dismissed = Some(i);
                    }
                    ui.with_layout(egui::Layout::left_to_right(egui::Align::Min), |ui| {
                        line(ui, notice);
                    });
                });
            });
        }
    });
    // An area is placed by the size that it had.
    if (shown.response.rect.bottom() - bottom.y).abs() > 1.0 {
        ui.ctx().request_repaint();
    }
    if let Some(i) = dismissed {
        notices.dismiss(i);
    }
}

/// A dot in the colour of its kind, and the whole text.
fn line(ui: &mut egui::Ui, notice: &Notice) {
    let (dot, _) = ui.allocate_exact_size(vec2(8.0, 18.0), Sense::hover());
    ui.painter().circle_filled(dot.center(), 4.0, color(ui, notice));
    ui.add(egui::Label::new(notice.text.as_str()).wrap());
}

fn color(ui: &egui::Ui, notice: &Notice) -> Color32 {
    if notice.error { ui.visuals().error_fg_color } else { accent(ui) }
}

/// Shows the log of all notices while it is `open`, the newest first.
pub(crate) fn log_window(ctx: &egui::Context, open: &mut bool, notices: &Notices) {
    let window = egui::Window::new("Messages").open(open).default_size(vec2(520.0, 260.0));
    window.anchor(Align2::CENTER_CENTER, [0.0, 0.0]).collapsible(false).show(ctx, |ui| {
        if notices.log().len() == 0 {
            ui.weak("none so far");
        }
        egui::ScrollArea::vertical().auto_shrink([false, true]).show(ui, |ui| {
            for notice in notices.log().rev() {
                ui.horizontal_top(|ui| {
                    ui.set_width(ui.available_width());
                    line(ui, notice);
                });
                ui.label(RichText::new(age(notice.since.elapsed())).small().weak());
            }
        });
    });
}

fn age(time: Duration) -> String {
    match time.as_secs() {
        0..60 => "just now".to_owned(),
        seconds @ 60..3600 => format!("{} min ago", seconds / 60),
        seconds => format!("{} h ago", seconds / 3600),
    }
}
