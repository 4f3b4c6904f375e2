//! The bars at the bottom: playback, loaded frames, status and notices.

use eframe::egui::{self, Color32, Rect, Sense, Stroke, StrokeKind, pos2, vec2};

use crate::Viewer;
use crate::model::document::Document;
use crate::model::playback::Speed;
use crate::model::shortcuts::{self, Action};
use crate::panels::icons::{self, Sign};
use crate::panels::style::accent;
use crate::panels::toolbar::named;
use limpid_io::frame_cache::CacheState;
use limpid_io::notice::thousands;

impl Viewer {
    pub(crate) fn timeline(&mut self, ui: &mut egui::Ui) {
        let bar = egui::Frame::side_top_panel(ui.style()).inner_margin(6);
        egui::Panel::bottom("timeline").frame(bar).show(ui, |ui| {
            if let Some(document) = self.opened.document.clone() {
                let ahead = self.opened.frames.state();
                if self.opened.frame_times.len() > 1 {
                    self.transport(ui, &document, &ahead);
                    ui.add_space(2.0);
                }
                self.status(ui, &ahead);
            } else {
                ui.weak(match self.opened.opening.as_ref().filter(|opening| opening.pending) {
                    Some(opening) => format!("opening {}", opening.source.input),
                    None => "nothing is open".to_owned(),
                });
            }
        });
    }

    fn transport(&mut self, ui: &mut egui::Ui, document: &Document, ahead: &CacheState) {
        let ctx = ui.ctx().clone();
        let mut chosen = None;
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 3.0;
            let playing = self.playback.playing;
            let all = [
                (Sign::First, "First", Action::First, false),
                (Sign::Previous, "Previous", Action::Previous, false),
                match playing {
                    true => (Sign::Pause, "Pause", Action::Play, true),
                    false => (Sign::Play, "Play", Action::Play, false),
                },
                (Sign::Next, "Next", Action::Next, false),
                (Sign::Last, "Last", Action::Last, false),
                (Sign::Backwards, "Backwards", Action::Reverse, self.playback.backwards),
                (Sign::Loop, "Loop", Action::Loop, self.playback.looped),
            ];
            for (sign, name, action, on) in all {
                let hint = shortcuts::of(action).tooltip();
                if icons::button(ui, sign, name, &hint, on).clicked() {
                    chosen = Some(action);
                }
            }
            ui.add_space(4.0);
            let mut speed = self.playback.speed();
            let choice =
                egui::ComboBox::from_id_salt("speed").selected_text(speed.label()).width(64.0);
            let response = choice.show_ui(ui, |ui| {
                for choice in Speed::ALL {
                    ui.selectable_value(&mut speed, choice, choice.label());
                }
            });
            named(&response.response, "Speed");
            if speed != self.playback.speed() {
                self.set_speed(speed);
            }
            ui.add_space(4.0);
            let width = (ui.available_width() - 190.0).max(60.0);
            self.track(ui, width, document, ahead);
            if let Some(at) = self.frame_time() {
                ui.add_space(6.0);
                let last = document.numbers.last().copied().unwrap_or_default();
                let time = at.time();
                let frame = if at.fraction > 0.0 { format!("{time:.3}") } else { time.to_string() };
                let seconds = document.seconds(at);
                ui.monospace(format!("{frame:>6} / {last}  {seconds:6.2} s"));
            }
        });
        if let Some(action) = chosen {
            self.act(&ctx, action);
        }
    }

    /// The scrub bar: loaded, loading, failed and, brightest, drawn frames, the camera's keys and the playhead.
    fn track(&mut self, ui: &mut egui::Ui, width: f32, document: &Document, ahead: &CacheState) {
        let (outer, mut response) =
            ui.allocate_exact_size(vec2(width, 24.0), Sense::click_and_drag());
        let count = self.opened.frame_times.len();
        let last = (count - 1) as f32;
        let rect = outer.shrink2(vec2(6.0, 8.0));
        let x = |i: f32| rect.left() + rect.width() * i / last;
        if let Some(pointer) = response.interact_pointer_pos() {
            let share = ((pointer.x - rect.left()) / rect.width()).clamp(0.0, 1.0);
            self.seek((share * last).round() as usize);
            response.mark_changed();
        }
        let index = self.playback.index();
        response.widget_info(|| egui::WidgetInfo::slider(true, index as f64, "Timeline"));
        let painter = ui.painter();
        let visuals = ui.visuals();
        painter.rect_filled(rect, 3, visuals.extreme_bg_color);
        let dim = accent(ui).gamma_multiply(0.55);
        let paint = |indices: &[usize], color: Color32| {
            for run in indices.chunk_by(|a, b| a + 1 == *b) {
                let (from, to) = (run[0] as f32 - 0.5, run[run.len() - 1] as f32 + 0.5);
                let (from, to) = (x(from.max(0.0)), x(to.min(last)));
                let part = Rect::from_x_y_ranges(from..=to.max(from + 1.0), rect.y_range());
                painter.rect_filled(part, 2, color);
            }
        };
        paint(&ahead.loaded, dim);
        paint(&ahead.loading, visuals.weak_text_color().gamma_multiply(0.5));
        paint(&ahead.failed, visuals.error_fg_color);
        let known: Vec<usize> = self.opened.failed.iter().copied().collect();
        paint(&known, visuals.error_fg_color);
        if self.flipping.needed {
            let kept = self.kept();
            let kept: Vec<usize> = (0..count).filter(|&i| kept[i]).collect();
            paint(&kept, accent(ui));
        }
        painter.rect_stroke(rect, 3, visuals.widgets.noninteractive.bg_stroke, StrokeKind::Outside);
        let length = self.opened.frame_times.last().map_or(0.0, |&at| document.seconds(at));
        for key in &self.eye.path.keys {
            if length > 0.0 && (0.0..=length).contains(&key.time) {
                let at = pos2(x(last * (key.time / length) as f32), rect.top() - 4.0);
                painter.circle_filled(at, 2.5, visuals.warn_fg_color);
            }
        }
        let at = x(index as f32);
        let head = Stroke::new(2.0, visuals.strong_text_color());
        painter.line_segment([pos2(at, outer.top() + 3.0), pos2(at, outer.bottom() - 3.0)], head);
        painter.circle_filled(pos2(at, rect.center().y), 4.5, visuals.strong_text_color());
    }

    fn status(&mut self, ui: &mut egui::Ui, ahead: &CacheState) {
        ui.horizontal(|ui| {
            let side = &self.editing.sides[self.editing.edited];
            let mut facts = Vec::new();
            if let Some(loaded) = &side.loaded {
                facts.push(format!("{} particles", thousands(loaded.particles)));
                let splashes = loaded.splashes;
                facts.push(format!("{} splashes", thousands(splashes)));
            } else if self.opened.document.is_some() {
                facts.push("loading".to_owned());
            }
            if let Some(shown) = &side.picture.shown {
                let (size, samples) = (shown.size, shown.samples);
                facts.push(format!("{} × {}, {samples} per pixel", size.x, size.y));
                facts.push(format!("drawn in {:.0} ms", shown.ms));
            }
            if let Some(progress) =
                self.opened.opening.as_ref().and_then(|opening| opening.progress)
            {
                facts.push(format!("simulating, {} of {}", progress.done, progress.frames));
            }
            if self.opened.frame_times.len() > 1 {
                let mebi = |bytes: u64| bytes >> 20;
                facts.push(format!("ahead {} of {} MiB", mebi(ahead.bytes), mebi(ahead.budget)));
            }
            facts.extend(self.flipbook_status());
            #[cfg(not(target_arch = "wasm32"))]
            if let Some(filming) = &self.jobs.filming {
                facts.push(format!("film {} of {}", filming.done, filming.pictures));
            }
            ui.small(facts.join("   ·   "));
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                #[cfg(not(target_arch = "wasm32"))]
                if let Some(filming) = &self.jobs.filming
                    && ui.small_button("Stop film").clicked()
                {
                    filming.stop();
                }
                if let Some(adapter) = &self.jobs.adapter {
                    ui.add(
                        egui::Label::new(egui::RichText::new(adapter).small().weak()).truncate(),
                    );
                }
            });
        });
    }

    /// The line with the newest notice, if there is one.
    pub(crate) fn notice_line(&mut self, ui: &mut egui::Ui) {
        // How long notices other than errors are shown.
        const NOTICE_TIME: std::time::Duration = std::time::Duration::from_secs(6);
        self.interface
            .notices
            .retain(|notice| notice.error || notice.since.elapsed() < NOTICE_TIME);
        let Some(notice) = self.interface.notices.last().cloned() else { return };
        if !notice.error {
            ui.ctx().request_repaint_after(NOTICE_TIME.saturating_sub(notice.since.elapsed()));
        }
        let color = match notice.error {
            true => ui.visuals().error_fg_color,
            false => accent(ui),
        };
        let bar = egui::Frame::side_top_panel(ui.style()).inner_margin(6);
        egui::Panel::bottom("notice").frame(bar).show(ui, |ui| {
            ui.horizontal(|ui| {
                let (dot, _) = ui.allocate_exact_size(vec2(8.0, 16.0), Sense::hover());
                ui.painter().circle_filled(dot.center(), 4.0, color);
                let more = self.interface.notices.len() - 1;
                ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                    if icons::button(ui, Sign::Cross, "Dismiss", "dismiss", false).clicked() {
                        self.interface.notices.pop();
                    }
                    if more > 0 {
                        ui.weak(format!("and {more} more"));
                    }
                    ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                        let label = egui::Label::new(notice.text.as_str()).truncate();
                        ui.add(label).on_hover_text(notice.text.as_str());
                    });
                });
            });
        });
    }
}
