//! The viewport: the picture, its legend and pointer input.

use std::sync::Arc;

use eframe::egui::{
    self, Align2, Color32, FontId, Key, PointerButton, Rect, Sense, Stroke, StrokeKind,
    TextureHandle, TextureOptions, pos2, vec2,
};
use glam::{DVec2, DVec3, UVec2};
use serde_json::json;

use crate::backend::core::drawing::{Drawn, Shown};
use crate::model::level::Level;
use crate::model::views::{Legend, Values, View, viridis};
use crate::panels::style::{accent, number};
use crate::picture::camera_controls;
use crate::{Compare, Viewer};

/// A picture on the screen.
#[derive(Clone, Default)]
pub(crate) struct Picture {
    texture: Option<TextureHandle>,
    pub(crate) shown: Option<Arc<Facts>>,
}

impl Picture {
    /// Memory of its pixels and values, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        let values = self.shown.as_ref().and_then(|facts| facts.values.as_ref());
        let values = values.map_or(0, |values| values.channels.iter().map(Vec::len).sum());
        let pixels = self.texture.as_ref().map_or(0, TextureHandle::byte_size);
        (pixels + size_of::<f32>() * values) as u64
    }
}

/// Properties of the picture shown.
#[derive(Debug)]
pub(crate) struct Facts {
    pub(crate) size: UVec2,
    pub(crate) samples: u32,
    pub(crate) ms: f64,
    legend: Legend,
    values: Option<Values>,
}

impl std::fmt::Debug for Picture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Picture").field("shown", &self.shown).finish_non_exhaustive()
    }
}

/// Rotation for a drag over the picture's height, radians.
const TURN: f64 = std::f64::consts::PI;

/// Zoom per point of the wheel, e-foldings.
const ZOOM: f64 = 0.003;

/// Speed of flight, extents of the liquid per second.
const FLIGHT: f64 = 0.4;

impl Viewer {
    /// Shows finished pictures.
    pub(crate) fn show(&mut self, drawn: Drawn) {
        let Drawn { number, level, panes } = drawn;
        self.picture.answered = self.picture.answered.max(number);
        let visible = self.visible();
        // The comparison mode has changed since the request.
        if visible.len() != panes.len() {
            return;
        }
        let ms: f64 = panes.iter().map(|shown| shown.ms).sum();
        let recent = self.jobs.log.recent();
        let size = panes.first().map_or(UVec2::ZERO, |shown| shown.size);
        self.jobs.log.event(
            "picture",
            json!({
                "level": format!("{level:?}").to_lowercase(),
                "width": size.x,
                "height": size.y,
                "moment": self.playback.index(),
                "draw_ms": ms,
                "ui_ms": recent["ui_ms"],
                "gap_ms": recent["gap_ms"],
            }),
        );
        // The first picture's time includes opening the device.
        let first = std::mem::take(&mut self.picture.fresh_device);
        // A picture that reused passes of the last one says nothing about the full time.
        let whole = panes.iter().all(|shown| {
            shown.passes.is_empty() || shown.passes.iter().any(|pass| pass.name == "splat")
        });
        if level != Level::Fine && !first && whole {
            self.picture.resolution.measured(size, self.full_size(), ms);
        }
        if let Some(first) = panes.first() {
            self.times.push(&first.passes);
        }
        let Some(ctx) = self.jobs.post.context() else { return };
        let pictures = panes.into_iter().map(|shown| {
            let Shown { image, legend, values, ms, size, samples, .. } = shown;
            let options = match legend {
                Legend::Picture => TextureOptions::LINEAR,
                _ => TextureOptions::NEAREST,
            };
            // A texture of its own, since the flipbook may keep the last one.
            let texture = Some(ctx.load_texture("picture", image, options));
            let shown = Some(Arc::new(Facts { size, samples, ms, legend, values }));
            Picture { texture, shown }
        });
        let pictures: Vec<Picture> = pictures.collect();
        if number == self.picture.asked {
            self.keep(pictures.clone());
        }
        // Kept pictures on screen are those of the current frame, and at least as good.
        if self.flipping.shown.is_none() || number == self.picture.asked {
            for (i, picture) in visible.into_iter().zip(pictures) {
                self.editing.sides[i].picture = picture;
            }
        }
    }

    pub(crate) fn show_viewport(&mut self, ui: &mut egui::Ui) {
        let fill = match self.interface.dark {
            true => Color32::from_gray(12),
            false => Color32::from_gray(200),
        };
        egui::CentralPanel::default().frame(egui::Frame::NONE.fill(fill)).show(ui, |ui| {
            let rect = ui.available_rect_before_wrap();
            let pixels = (rect.size() * ui.ctx().pixels_per_point()).round();
            // A minimised window has no size, or a negative one.
            let size = UVec2::new(pixels.x.max(0.0) as u32, pixels.y.max(0.0) as u32);
            if size != self.picture.viewport_size {
                self.picture.viewport_size = size;
                self.jobs.log.event("resize", json!({ "width": size.x, "height": size.y }));
            }
            if rect.width() < 1.0 || rect.height() < 1.0 {
                return;
            }
            if self.opened.document.is_none() {
                self.first_screen(ui, rect);
                return;
            }
            let viewport = ui.interact(rect, ui.scope_id().with("stage"), Sense::click_and_drag());
            viewport.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "Picture"));
            self.pointer(ui, &viewport, rect);
            self.pictures(ui, rect);
            let side = &self.editing.sides[self.editing.edited];
            if side.picture.shown.is_none() {
                let what = if side.loaded.is_some() { "drawing" } else { "loading" };
                let font = FontId::proportional(15.0);
                let color = ui.visuals().weak_text_color();
                ui.painter().text(rect.center(), Align2::CENTER_CENTER, what, font, color);
            }
            self.legend(ui, &viewport, rect);
            self.flipbook_note(ui, rect);
        });
    }

    fn pointer(&mut self, ui: &egui::Ui, viewport: &egui::Response, rect: Rect) {
        self.picture.dragging = viewport.is_pointer_button_down_on();
        let height = f64::from(rect.height());
        let moved = viewport.drag_motion();
        let moved = DVec2::new(f64::from(moved.x), f64::from(moved.y)) / height;
        let shift = ui.input(|input| input.modifiers.shift);
        let panning = viewport.dragged_by(PointerButton::Middle)
            || (shift && viewport.dragged_by(PointerButton::Primary));
        let mut camera = self.eye.camera;
        // A cursor in half heights from the middle, right and up.
        let cursor = |at: egui::Pos2| {
            let offset = (at - rect.center()) * 2.0 / rect.height();
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
            camera = self.flown(ui, camera, shift);
        }
        if camera != self.eye.camera {
            self.jobs.log.event("camera", json!({ "eye": camera.eye.to_array() }));
            self.set_camera(camera);
        }
        if viewport.double_clicked() {
            self.fit();
        }
    }

    /// The camera moved by the keys W, A, S, D, Q and E.
    fn flown(
        &self,
        ui: &egui::Ui,
        camera: limpid::camera::Camera,
        fast: bool,
    ) -> limpid::camera::Camera {
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
        let extent =
            self.editing.sides[self.editing.edited].loaded.as_ref().map_or(1.0, |loaded| {
                let (min, max) = loaded.bulk.bounds;
                (max - min).length().max(f64::from(loaded.splats.radius)).max(1e-6)
            });
        let seconds = f64::from(ui.input(|input| input.stable_dt).min(0.1));
        let speed = if fast { 4.0 * FLIGHT } else { FLIGHT };
        camera_controls::fly(&camera, speed * extent * seconds * way)
    }

    fn pictures(&mut self, ui: &mut egui::Ui, rect: Rect) {
        let all = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        let texture = |i: usize| self.editing.sides[i].picture.texture.as_ref();
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
        match self.editing.compare {
            Compare::Off => paint(self.editing.edited, rect, rect),
            Compare::SideBySide => {
                let (left, right) = rect.split_left_right_at_fraction(0.5);
                paint(0, left, left);
                paint(1, right, right);
                let line = [right.left_top(), right.left_bottom()];
                ui.painter().line_segment(line, Stroke::new(1.0, Color32::from_gray(20)));
                letters(left, right);
            }
            Compare::Wipe => {
                let x = rect.left() + self.editing.wipe * rect.width();
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
                    self.editing.wipe = ((at.x - rect.left()) / rect.width()).clamp(0.02, 0.98);
                }
                let line = [pos2(x, rect.top()), pos2(x, rect.bottom())];
                ui.painter().line_segment(line, Stroke::new(2.0, Color32::WHITE));
                let middle = pos2(x, rect.center().y);
                ui.painter().circle_filled(middle, 7.0, Color32::WHITE);
                ui.painter().circle_filled(middle, 4.0, accent(ui));
            }
        }
    }

    fn legend(&self, ui: &mut egui::Ui, viewport: &egui::Response, rect: Rect) {
        let Some(facts) = &self.editing.sides[self.editing.edited].picture.shown else { return };
        if self.picture.view == View::Picture {
            return;
        }
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
}

fn tag(ui: &egui::Ui, at: egui::Pos2, letter: &str) {
    let rect = Rect::from_min_size(at, vec2(20.0, 20.0));
    ui.painter().rect_filled(rect, 4, Color32::from_black_alpha(160));
    let font = FontId::proportional(13.0);
    ui.painter().text(rect.center(), Align2::CENTER_CENTER, letter, font, Color32::WHITE);
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
