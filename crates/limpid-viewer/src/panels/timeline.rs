//! The bars at the bottom: playback, loaded frames and status.

use std::collections::BTreeSet;

use eframe::egui::{self, Color32, Rect, Sense, Stroke, StrokeKind, pos2, vec2};

use crate::model::document::Document;
use crate::model::playback::{Playback, Speed};
use crate::model::shortcuts::{self, Action};
use crate::panels::Command;
use crate::panels::icons::{self, Sign};
use crate::panels::sliders::{edited_number, rounded};
use crate::panels::style::accent;
use crate::panels::toolbar::named;
use limpid_io::camera_path::Key;
use limpid_io::frame_cache::CacheState;
use limpid_io::input::FrameTime;

/// Contents of the timeline.
pub(crate) struct Timeline<'a> {
    pub(crate) document: Option<&'a Document>,
    /// The source that is being opened.
    pub(crate) opening: Option<&'a str>,
    pub(crate) playback: &'a Playback,
    pub(crate) frame_times: &'a [FrameTime],
    /// The frame time of the picture on screen, which may be late.
    pub(crate) shown: Option<FrameTime>,
    /// The frames that are loaded ahead.
    pub(crate) ahead: &'a CacheState,
    /// Indices of frame times that could not be loaded.
    pub(crate) failed: &'a BTreeSet<usize>,
    /// Indices of frame times whose pictures are kept, ascending.
    pub(crate) kept: &'a [usize],
    /// The camera's key frames.
    pub(crate) keys: &'a [Key],
    /// The status line.
    pub(crate) facts: &'a [String],
    /// Whether a film is being written.
    pub(crate) films: bool,
    /// Whether frames are being simulated.
    pub(crate) simulates: bool,
    /// Number of notices in the log.
    pub(crate) messages: usize,
    /// The graphics device that draws.
    pub(crate) adapter: Option<&'a str>,
}

impl Timeline<'_> {
    pub(crate) fn show(&self, ui: &mut egui::Ui, commands: &mut Vec<Command>) {
        let bar = egui::Frame::side_top_panel(ui.style()).inner_margin(6);
        egui::Panel::bottom("timeline").frame(bar).show(ui, |ui| {
            if let Some(document) = self.document {
                if self.frame_times.len() > 1 {
                    self.transport(ui, document, commands);
                    ui.add_space(2.0);
                }
                self.status(ui, commands);
            } else {
                ui.weak(match self.opening {
                    Some(input) => format!("opening {input}"),
                    None => "nothing is open".to_owned(),
                });
            }
        });
    }

    fn transport(&self, ui: &mut egui::Ui, document: &Document, commands: &mut Vec<Command>) {
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
                    commands.push(Command::Act(action));
                }
            }
            self.marks(ui, commands);
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
                commands.push(Command::SetSpeed(speed));
            }
            ui.add_space(4.0);
            let width = (ui.available_width() - 190.0).max(60.0);
            let index = self.track(ui, width, document, commands);
            if let Some(at) = self.shown.or(self.frame_times.get(index).copied()) {
                ui.add_space(6.0);
                self.frame_field(ui, at, commands);
                let last = document.numbers.last().copied().unwrap_or_default();
                let seconds = document.seconds(at);
                ui.monospace(format!("/ {last}  {seconds:6.2} s"));
            }
        });
    }

    /// Buttons for the first and the last frame time that are played.
    fn marks(&self, ui: &mut egui::Ui, commands: &mut Vec<Command>) {
        let marked = self.playback.marked();
        let end = self.frame_times.len() - 1;
        let on = marked.map_or([false; 2], |[first, last]| [first > 0, last < end]);
        for (name, action, on) in [("In", Action::In, on[0]), ("Out", Action::Out, on[1])] {
            let hint = shortcuts::of(action).tooltip();
            if ui.selectable_label(on, name).on_hover_text(hint).clicked() {
                commands.push(Command::Act(action));
            }
        }
    }

    /// The number of the frame, which can be typed: the nearest one is shown.
    fn frame_field(&self, ui: &mut egui::Ui, at: FrameTime, commands: &mut Vec<Command>) {
        let shown = rounded(at.time(), 3);
        let mut typed = at.time();
        let drag = egui::DragValue::new(&mut typed).speed(0.1).update_while_editing(false);
        let drag = drag.custom_formatter(|x, _| rounded(x, 3)).custom_parser(edited_number(shown));
        let response = ui.add(drag).on_hover_text("the number of the frame");
        response.widget_info(|| egui::WidgetInfo {
            label: Some("Frame".to_owned()),
            ..egui::WidgetInfo::drag_value(true, at.time())
        });
        if response.changed() && typed.is_finite() {
            let distance = |at: &FrameTime| (at.time() - typed).abs();
            let nearest = (0..self.frame_times.len()).min_by(|&a, &b| {
                distance(&self.frame_times[a]).total_cmp(&distance(&self.frame_times[b]))
            });
            commands.extend(nearest.map(Command::Seek));
        }
    }

    /// The scrub bar: loaded, loading, failed and, brightest, drawn frames, the camera's keys and the playhead. Returns
    /// the index where that is.
    fn track(
        &self,
        ui: &mut egui::Ui,
        width: f32,
        document: &Document,
        commands: &mut Vec<Command>,
    ) -> usize {
        let (outer, mut response) =
            ui.allocate_exact_size(vec2(width, 24.0), Sense::click_and_drag());
        let count = self.frame_times.len();
        let last = (count - 1) as f32;
        let rect = outer.shrink2(vec2(6.0, 8.0));
        let x = |i: f32| rect.left() + rect.width() * i / last;
        let mut index = self.playback.index();
        if let Some(pointer) = response.interact_pointer_pos() {
            let share = ((pointer.x - rect.left()) / rect.width()).clamp(0.0, 1.0);
            index = (share * last).round() as usize;
            commands.push(Command::Seek(index));
            response.mark_changed();
        }
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
        paint(&self.ahead.loaded, dim);
        paint(&self.ahead.loading, visuals.weak_text_color().gamma_multiply(0.5));
        paint(&self.ahead.failed, visuals.error_fg_color);
        let known: Vec<usize> = self.failed.iter().copied().collect();
        paint(&known, visuals.error_fg_color);
        paint(self.kept, accent(ui));
        if let Some(ends) = self.playback.marked() {
            let [from, to] = ends.map(|i| x(i as f32));
            let before = rect.with_max_x(from);
            let after = rect.with_min_x(to);
            for outside in [before, after] {
                painter.rect_filled(outside, 2, visuals.panel_fill.gamma_multiply(0.75));
            }
            for (at, way) in [(from, 1.0), (to, -1.0)] {
                let bracket = [
                    pos2(at + 4.0 * way, outer.top() + 3.0),
                    pos2(at, outer.top() + 3.0),
                    pos2(at, outer.bottom() - 3.0),
                    pos2(at + 4.0 * way, outer.bottom() - 3.0),
                ];
                painter.line(bracket.to_vec(), Stroke::new(2.0, visuals.warn_fg_color));
            }
        }
        painter.rect_stroke(rect, 3, visuals.widgets.noninteractive.bg_stroke, StrokeKind::Outside);
        let length = self.frame_times.last().map_or(0.0, |&at| document.seconds(at));
        for key in self.keys {
            if length > 0.0 && (0.0..=length).contains(&key.time) {
                let at = pos2(x(last * (key.time / length) as f32), rect.top() - 4.0);
                painter.circle_filled(at, 2.5, visuals.warn_fg_color);
            }
        }
        let at = x(index as f32);
        let head = Stroke::new(2.0, visuals.strong_text_color());
        painter.line_segment([pos2(at, outer.top() + 3.0), pos2(at, outer.bottom() - 3.0)], head);
        painter.circle_filled(pos2(at, rect.center().y), 4.5, visuals.strong_text_color());
        index
    }

    /// The status line. Its buttons keep their place, whatever its texts take.
    fn status(&self, ui: &mut egui::Ui, commands: &mut Vec<Command>) {
        let left = egui::Layout::left_to_right(egui::Align::Center);
        let right = egui::Layout::right_to_left(egui::Align::Center);
        ui.horizontal(|ui| {
            ui.with_layout(right, |ui| {
                let messages = format!("Messages: {}", self.messages);
                let buttons = [
                    (self.messages > 0, messages.as_str(), Command::ShowMessages),
                    (self.simulates, "Stop simulation", Command::StopSimulation),
                    (self.films, "Stop film", Command::StopFilm),
                ];
                for (shown, text, command) in buttons {
                    if shown && ui.small_button(text).clicked() {
                        commands.push(command);
                    }
                }
                ui.with_layout(left, |ui| {
                    let facts = egui::RichText::new(self.facts.join("   ·   ")).small();
                    ui.add(egui::Label::new(facts).truncate());
                    ui.with_layout(right, |ui| {
                        let adapter = egui::RichText::new(self.adapter.unwrap_or_default());
                        ui.add(egui::Label::new(adapter.small().weak()).truncate());
                    });
                });
            });
        });
    }
}
