//! The viewport: the picture, and pointer input.

use eframe::egui::{
    self, Align2, Color32, FontId, Key, PointerButton, Rect, Sense, Stroke, pos2, vec2,
};
use glam::{DVec2, DVec3, UVec2};
use serde_json::json;

use crate::backend::core::drawing::Drawn;
use crate::model::editing::{Compare, Editing};
use crate::model::level::Level;
use crate::model::log::Log;
use crate::model::stage::Stage;
use crate::model::views::View;
use crate::panels::style::accent;
use crate::picture::camera_controls;
use crate::picture::legend;
use crate::picture::particle;
use crate::picture::points;
use crate::picture::state::PictureState;
use crate::picture::texture::Picture;
use crate::picture::triad;
use crate::picture::waiting;
use limpid::camera::Camera;

/// Rotation for a drag over the picture's height, radians.
const TURN: f64 = std::f64::consts::PI;

/// Zoom per point of the wheel, e-foldings.
const ZOOM: f64 = 0.003;

/// Speed of flight, extents of the liquid per second.
const FLIGHT: f64 = 0.4;

impl PictureState {
    /// Takes finished pictures, which the window of `ctx` then shows.
    pub(crate) fn take(
        &mut self,
        drawn: Drawn,
        stage: &Stage,
        ctx: Option<&egui::Context>,
        log: &mut Log,
    ) {
        let Drawn { number, level, panes } = drawn;
        self.answered = self.answered.max(number);
        // Otherwise it is of another document or view, which must not stand for this one.
        let Some(captions) = self.captions.answered(number) else { return };
        self.waits_since = None;
        let visible = stage.editing.visible();
        // The comparison mode has changed since the request.
        if visible.len() != panes.len() {
            return;
        }
        let ms: f64 = panes.iter().map(|shown| shown.ms).sum();
        let recent = log.recent();
        let size = panes.first().map_or(UVec2::ZERO, |shown| shown.size);
        let at = captions.first().and_then(|caption| caption.at);
        let moment = stage.frame_times.iter().position(|&time| Some(time) == at);
        log.event(
            "picture",
            json!({
                "level": format!("{level:?}").to_lowercase(),
                "width": size.x,
                "height": size.y,
                "frame": at.map(|at| at.frame),
                "moment": moment,
                "draw_ms": ms,
                "ui_ms": recent["ui_ms"],
                "gap_ms": recent["gap_ms"],
            }),
        );
        // The first picture's time includes opening the device.
        let first = std::mem::take(&mut self.fresh_device);
        // A picture that reused passes of the last one says nothing about the full time.
        let whole = panes.iter().all(|shown| {
            shown.passes.is_empty() || shown.passes.iter().any(|pass| pass.name == "splat")
        });
        if level != Level::Fine && !first && whole {
            self.resolution.measured(size, self.full_size(stage), ms);
        }
        let Some(ctx) = ctx else { return };
        let pictures = panes.into_iter().zip(captions);
        let pictures = pictures.map(|(shown, caption)| Picture::new(ctx, shown, caption));
        let pictures: Vec<Picture> = pictures.collect();
        if number == self.asked {
            self.keep(stage, pictures.clone());
        }
        // Kept pictures on screen are those of the current frame, and at least as good.
        if self.flipping.shown.is_none() || number == self.asked {
            for (i, picture) in visible.into_iter().zip(pictures) {
                self.sides[i].picture = picture;
            }
        }
    }

    /// Adapts to a viewport of `rect`; returns whether anything can be shown there.
    pub(crate) fn resize(&mut self, ctx: &egui::Context, rect: Rect, log: &mut Log) -> bool {
        let pixels = (rect.size() * ctx.pixels_per_point()).round();
        // A minimised window has no size, or a negative one.
        let size = UVec2::new(pixels.x.max(0.0) as u32, pixels.y.max(0.0) as u32);
        if size != self.viewport_size {
            self.viewport_size = size;
            log.event("resize", json!({ "width": size.x, "height": size.y }));
        }
        rect.width() >= 1.0 && rect.height() >= 1.0
    }

    /// Shows the picture in a viewport of `rect`, where the pointer moves the camera.
    pub(crate) fn show(&mut self, ui: &mut egui::Ui, rect: Rect, stage: &mut Stage, log: &mut Log) {
        let viewport = ui.interact(rect, ui.scope_id().with("stage"), Sense::click_and_drag());
        viewport.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Picture"));
        self.pointer(ui, &viewport, rect, stage, log);
        self.pictures(ui, rect, &mut stage.editing);
        let side = self.edited(stage);
        if side.picture.shown.is_none()
            && let Some(loaded) = &side.loaded
        {
            points::paint(ui.painter(), rect, loaded, &stage.eye.camera);
        }
        let place = places(rect, stage.editing.compare)[stage.editing.edited];
        // Legends come and go with their pictures.
        if let Some(facts) = side.picture.shown.clone() {
            match (facts.caption.view, &facts.caption.scale) {
                (View::Image(..), _) => legend::show(ui, &facts, &viewport, place),
                (View::Picture, Some(scale)) if stage.colors.legend => {
                    self.legend.show(ui, rect, self.viewport_size, scale);
                }
                (View::Picture, _) => {}
            }
        }
        if let Some(picked) = &self.picked
            && particle::show(ui, place, self.full_size(stage), &stage.eye.camera, picked)
        {
            self.picked = None;
        }
        self.flipbook_note(stage, ui, rect);
        if let Some((words, since)) = self.late(stage) {
            waiting::note(ui, rect, &words, since);
        }
        if self.has_triad
            && let Some(direction) = triad::show(ui, rect, &stage.eye.camera, stage.up)
        {
            self.look_from(direction, stage);
        }
    }

    /// Looks at the liquid from a direction.
    pub(crate) fn look_from(&self, direction: DVec3, stage: &mut Stage) {
        let camera = camera_controls::from_direction(&stage.eye.camera, direction);
        stage.eye.set(self.fitted_from(&camera, stage).unwrap_or(camera));
    }

    fn pointer(
        &mut self,
        ui: &egui::Ui,
        viewport: &egui::Response,
        rect: Rect,
        stage: &mut Stage,
        log: &mut Log,
    ) {
        self.dragging = viewport.is_pointer_button_down_on();
        let places = places(rect, stage.editing.compare);
        let height = f64::from(places[0].height());
        let moved = viewport.drag_motion();
        let moved = DVec2::new(f64::from(moved.x), f64::from(moved.y)) / height;
        let shift = ui.input(|input| input.modifiers.shift);
        let panning = viewport.dragged_by(PointerButton::Middle)
            || (shift && viewport.dragged_by(PointerButton::Primary));
        let mut camera = stage.eye.camera;
        // A cursor in half heights from the middle, right and up.
        let cursor = |at: egui::Pos2| {
            let place = if places[1].contains(at) { places[1] } else { places[0] };
            let offset = (at - place.center()) * 2.0 / place.height();
            DVec2::new(f64::from(offset.x), f64::from(-offset.y))
        };
        let touch = ui.input(egui::InputState::multi_touch);
        if let Some(touch) = touch.filter(|touch| rect.contains(touch.center_pos)) {
            // Two fingers move and pinch; the first of them is also a pointer.
            let moved = touch.translation_delta / rect.height();
            let moved = DVec2::new(f64::from(moved.x), f64::from(moved.y));
            camera = camera_controls::pan(&camera, DVec2::new(-moved.x, moved.y));
            let pinch = f64::from(touch.zoom_delta.ln());
            camera = camera_controls::zoom(&camera, pinch, cursor(touch.center_pos));
        } else if panning {
            camera = camera_controls::pan(&camera, DVec2::new(-moved.x, moved.y));
        } else if viewport.dragged_by(PointerButton::Primary) {
            camera = camera_controls::orbit(&camera, TURN * DVec2::new(-moved.x, moved.y));
        } else if viewport.dragged_by(PointerButton::Secondary) {
            camera = camera_controls::look(&camera, 0.5 * TURN * DVec2::new(moved.x, -moved.y));
        }
        if let Some(at) = viewport.hover_pos().filter(|_| touch.is_none()) {
            let (wheel, pinch) =
                ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            let amount = ZOOM * f64::from(wheel) + f64::from(pinch.ln());
            if amount != 0.0 {
                camera = camera_controls::zoom(&camera, amount, cursor(at));
            }
        }
        if viewport.is_pointer_button_down_on() && ui.input(|input| input.pointer.secondary_down())
        {
            let extent = self.edited(stage).loaded.as_ref().map_or(1.0, |loaded| {
                let (min, max) = loaded.bulk.bounds;
                (max - min).length().max(f64::from(loaded.splats.radius)).max(1e-6)
            });
            camera = flown(ui, camera, extent, shift);
        }
        if camera != stage.eye.camera {
            log.event("camera", json!({ "eye": camera.eye.to_array() }));
            stage.eye.set(camera);
        }
        if viewport.clicked()
            && let Some(at) = viewport.interact_pointer_pos()
        {
            let place = if places[1].contains(at) { places[1] } else { places[0] };
            let share = (at - place.min) / place.size();
            self.clicked = Some(glam::Vec2::new(share.x, share.y));
        }
        if viewport.double_clicked()
            && let Some(camera) = self.fitted(stage)
        {
            stage.eye.set(camera);
        }
    }

    fn pictures(&self, ui: &mut egui::Ui, rect: Rect, editing: &mut Editing) {
        let all = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        let texture = |i: usize| self.sides[i].picture.texture.as_ref();
        let paint = |i: usize, to: Rect, clip: Rect| {
            if let Some(texture) = texture(i) {
                let painter = ui.painter().with_clip_rect(clip);
                painter.image(texture.id(), to, all, Color32::WHITE);
            }
        };
        let letters = |left: Rect, right: Rect| {
            for (rect, letter) in [(left, "A"), (right, "B")] {
                let at = pos2(rect.left() + 12.0, rect.top() + 10.0);
                tag(ui, at, letter);
            }
        };
        match editing.compare {
            Compare::Off => paint(editing.edited, rect, rect),
            Compare::SideBySide => {
                let (left, right) = rect.split_left_right_at_fraction(0.5);
                let places = places(rect, editing.compare);
                paint(0, places[0], left);
                paint(1, places[1], right);
                let line = [right.left_top(), right.left_bottom()];
                ui.painter().line_segment(line, Stroke::new(1.0, Color32::from_gray(20)));
                letters(left, right);
            }
            Compare::Wipe => {
                let x = rect.left() + editing.wipe * rect.width();
                let (left, right) = rect.split_left_right_at_x(x);
                paint(0, rect, left);
                paint(1, rect, right);
                letters(left, right);
                let grip = Rect::from_x_y_ranges(x - 6.0..=x + 6.0, rect.y_range());
                let handle = ui.interact(grip, ui.scope_id().with("wipe"), Sense::drag());
                let handle = handle.on_hover_and_drag_cursor(egui::CursorIcon::ResizeHorizontal);
                handle
                    .widget_info(|| egui::WidgetInfo::labeled(egui::Role::Splitter, true, "Wipe"));
                if let Some(at) = handle.interact_pointer_pos().filter(|_| handle.dragged()) {
                    editing.wipe = ((at.x - rect.left()) / rect.width()).clamp(0.02, 0.98);
                }
                let line = [pos2(x, rect.top()), pos2(x, rect.bottom())];
                ui.painter().line_segment(line, Stroke::new(2.0, Color32::WHITE));
                let middle = pos2(x, rect.center().y);
                ui.painter().circle_filled(middle, 7.0, Color32::WHITE);
                ui.painter().circle_filled(middle, 4.0, accent(ui));
            }
        }
    }
}

/// Where the pictures of A and B are in a viewport of `rect`: beside each other both are whole.
fn places(rect: Rect, compare: Compare) -> [Rect; 2] {
    if compare != Compare::SideBySide {
        return [rect; 2];
    }
    let (left, right) = rect.split_left_right_at_fraction(0.5);
    [left, right].map(|half| Rect::from_center_size(half.center(), 0.5 * rect.size()))
}

/// The camera moved by the keys W, A, S, D, Q and E, beside a liquid of this extent, m.
fn flown(ui: &egui::Ui, camera: Camera, extent: f64, fast: bool) -> Camera {
    let down = |key| f64::from(u8::from(ui.input(|input| input.key_down(key))));
    let way = DVec3::new(
        down(Key::D) - down(Key::A),
        down(Key::E) - down(Key::Q),
        down(Key::W) - down(Key::S),
    );
    if way == DVec3::ZERO {
        return camera;
    }
    ui.ctx().request_repaint();
    let seconds = f64::from(ui.input(|input| input.stable_dt).min(0.1));
    let speed = if fast { 4.0 * FLIGHT } else { FLIGHT };
    camera_controls::fly(&camera, speed * extent * seconds * way)
}

fn tag(ui: &egui::Ui, at: egui::Pos2, letter: &str) {
    let rect = Rect::from_min_size(at, vec2(20.0, 20.0));
    ui.painter().rect_filled(rect, 4, Color32::from_black_alpha(160));
    let font = FontId::proportional(13.0);
    ui.painter().text(rect.center(), Align2::CENTER_CENTER, letter, font, Color32::WHITE);
}
