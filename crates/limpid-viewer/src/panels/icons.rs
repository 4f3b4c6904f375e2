//! Icons on buttons, drawn as shapes because fonts differ in the icons that they have.

use eframe::egui::{
    Color32, Painter, Pos2, Rect, Response, Role, Shape, Stroke, Ui, Vec2, WidgetInfo, pos2, vec2,
};

/// An icon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sign {
    First,
    Previous,
    Play,
    Pause,
    Next,
    Last,
    Backwards,
    Loop,
    Panels,
    Sun,
    Moon,
    Cross,
    Help,
    Undo,
    Redo,
}

/// A button with an icon, an accessible `name` and a tooltip `hint`.
pub(crate) fn button(ui: &mut Ui, sign: Sign, name: &str, hint: &str, on: bool) -> Response {
    let (rect, response) = ui.allocate_exact_size(vec2(28.0, 24.0), eframe::egui::Sense::click());
    let enabled = ui.is_enabled();
    response.widget_info(|| WidgetInfo::selected(Role::Button, enabled, on, name));
    let visuals = ui.style().interact_selectable(&response, on);
    let fill = if on { visuals.bg_fill } else { visuals.weak_bg_fill };
    ui.painter().rect_filled(rect, visuals.corner_radius, fill);
    draw(ui.painter(), sign, rect.center(), visuals.fg_stroke.color);
    response.on_hover_text(hint)
}

/// Draws an icon of about 12 by 12 points.
fn draw(painter: &Painter, sign: Sign, at: Pos2, color: Color32) {
    let line = Stroke::new(1.5, color);
    let triangle = |at: Pos2, way: f32| {
        let points = [(-4.0, -5.0), (-4.0, 5.0), (4.5, 0.0)].map(|(x, y)| at + vec2(way * x, y));
        painter.add(Shape::convex_polygon(points.to_vec(), color, Stroke::NONE));
    };
    let bar = |x: f32, width: f32| {
        let rect = Rect::from_center_size(at + vec2(x, 0.0), vec2(width, 10.0));
        painter.rect_filled(rect, 0.5, color);
    };
    let arc = |radius: f32, from: f32, to: f32| {
        let point = |i: u32| {
            let angle = from + (to - from) * i as f32 / 16.0;
            at + radius * Vec2::angled(angle)
        };
        let points: Vec<Pos2> = (0..=16).map(point).collect();
        painter.add(Shape::line(points, line));
    };
    let head = |tip: Pos2, way: Vec2| {
        let side = vec2(-way.y, way.x);
        let points = vec![tip + 3.5 * way, tip + 3.0 * side, tip - 3.0 * side];
        painter.add(Shape::convex_polygon(points, color, Stroke::NONE));
    };
    match sign {
        Sign::Play => triangle(at, 1.0),
        Sign::Pause => {
            bar(-3.0, 3.0);
            bar(3.0, 3.0);
        }
        Sign::Next => {
            bar(-4.5, 2.0);
            triangle(at + vec2(2.0, 0.0), 0.9);
        }
        Sign::Previous => {
            bar(4.5, 2.0);
            triangle(at - vec2(2.0, 0.0), -0.9);
        }
        Sign::Last => {
            bar(5.0, 2.0);
            triangle(at - vec2(1.0, 0.0), 1.0);
        }
        Sign::First => {
            bar(-5.0, 2.0);
            triangle(at + vec2(1.0, 0.0), -1.0);
        }
        Sign::Backwards => {
            painter.line_segment([at + vec2(-3.0, 0.0), at + vec2(6.0, 0.0)], line);
            head(at - vec2(3.0, 0.0), vec2(-1.0, 0.0));
        }
        Sign::Loop => {
            arc(5.0, -0.3, 4.6);
            head(at + 5.0 * Vec2::angled(4.6), vec2(1.0, 0.0));
        }
        Sign::Undo => {
            arc(4.5, -2.6, 2.0);
            head(at + 4.5 * Vec2::angled(-2.6), vec2(-0.5, 0.85));
        }
        Sign::Redo => {
            arc(4.5, -0.54, -5.14);
            head(at + 4.5 * Vec2::angled(-0.54), vec2(0.5, 0.85));
        }
        Sign::Panels => {
            let frame = Rect::from_center_size(at, vec2(13.0, 10.0));
            let inside = eframe::egui::StrokeKind::Middle;
            painter.rect_stroke(frame, 1, Stroke::new(1.2, color), inside);
            let side = Rect::from_min_max(pos2(frame.right() - 4.5, frame.top()), frame.max);
            painter.rect_filled(side, 0, color);
        }
        Sign::Sun => {
            painter.circle_filled(at, 3.2, color);
            for i in 0..8 {
                let way = Vec2::angled(std::f32::consts::FRAC_PI_4 * i as f32);
                painter.line_segment([at + 4.8 * way, at + 6.8 * way], line);
            }
        }
        Sign::Moon => {
            // The rim of a disc, and back along the rim of a disc that covers it.
            let tip = 5.5 * Vec2::angled(-1.9);
            let rim = (0..=20).map(|i| 5.5 * Vec2::angled(-1.9 + 3.8 * i as f32 / 20.0));
            let hollow = (1..20).rev().map(|i| {
                let share = i as f32 / 10.0 - 1.0;
                vec2(tip.x + 4.0 * (1.0 - share * share), -tip.y * share)
            });
            let points: Vec<Pos2> = rim.chain(hollow).map(|v| at + v - vec2(1.5, 0.0)).collect();
            painter.add(Shape::closed_line(points, line));
        }
        Sign::Cross => {
            for way in [vec2(4.0, 4.0), vec2(4.0, -4.0)] {
                painter.line_segment([at - way, at + way], line);
            }
        }
        Sign::Help => {
            let font = eframe::egui::FontId::proportional(14.0);
            painter.text(at, eframe::egui::Align2::CENTER_CENTER, "?", font, color);
        }
    }
}
