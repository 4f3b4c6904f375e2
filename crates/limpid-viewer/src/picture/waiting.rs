//! The note on a late answer.

use std::time::Duration;

use eframe::egui::{self, Align2, Color32, FontId, Rect, Stroke, pos2, vec2};
use web_time::Instant;

use crate::model::stage::Stage;
use crate::model::views::View;
use crate::picture::captions::Caption;
use crate::picture::state::PictureState;

/// A wait is shown once it has lasted for this long.
pub(crate) const LATE: Duration = Duration::from_millis(300);

/// Time between two positions of a spinner. A software adapter needs the processor for the picture itself: each position
/// delays that by a tenth of a second or two.
const SPIN: Duration = Duration::from_secs(1);

/// Positions of a spinner in a turn.
const POSITIONS: u64 = 8;

/// The reason for a wait.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Wait {
    /// The particles of the frame are being loaded.
    Frame,
    /// Another view is being drawn.
    View(View),
    /// A picture is being drawn.
    Picture,
}

impl PictureState {
    /// The contents of the picture of a side that would be drawn now.
    pub(crate) fn caption(&self, stage: &Stage, side: usize) -> Caption {
        let is_opaque = stage.editing.scenes[side].is_opaque();
        let scale = stage.colors.scale.clone().filter(|_| is_opaque);
        Caption { at: self.sides[side].time, view: self.view, scale }
    }

    /// Whether the pictures on screen have the wanted contents.
    pub(crate) fn has_wanted_contents(&self, stage: &Stage) -> bool {
        stage.editing.visible().into_iter().all(|side| {
            let shown = self.sides[side].picture.shown.as_ref();
            shown.is_some_and(|facts| facts.caption == self.caption(stage, side))
        })
    }

    /// The reason why the picture on screen is not the wanted one; `None` if it is, or if that cannot be drawn.
    pub(crate) fn wait(&self, stage: &Stage) -> Option<Wait> {
        if self.flipping.shown.is_some() || self.undrawn {
            return None;
        }
        let index = Some(stage.playback.index());
        let visible = stage.editing.visible();
        // There is nothing to draw, or the window is minimised.
        let fails = |&i: &usize| self.sides[i].at == index && self.sides[i].loaded.is_none();
        if visible.iter().any(fails) || self.viewport_size.min_element() == 0 {
            return None;
        }
        let shown = |i: usize| self.sides[i].picture.shown.as_ref();
        let is_other_view =
            |&i: &usize| shown(i).is_none_or(|facts| facts.caption.view != self.view);
        if visible.iter().any(|&i| self.sides[i].at != index) && !stage.playback.playing {
            Some(Wait::Frame)
        } else if visible.iter().any(is_other_view) {
            Some(if visible.iter().all(|&i| shown(i).is_some()) {
                Wait::View(self.view)
            } else {
                Wait::Picture
            })
        } else if stage.playback.playing {
            // Frames follow each other.
            None
        } else {
            let is_drawn = self.answered >= self.subject_asked && self.has_wanted_contents(stage);
            (!is_drawn).then_some(Wait::Picture)
        }
    }

    /// Notes since when the screen waits, and wakes the interface once that is late.
    pub(crate) fn watch(&mut self, stage: &Stage, ctx: &egui::Context) {
        if self.wait(stage).is_none() {
            self.waits_since = None;
            return;
        }
        wake(ctx, *self.waits_since.get_or_insert_with(Instant::now));
    }

    /// The wait that is late, in words.
    pub(crate) fn late(&self, stage: &Stage) -> Option<(String, Instant)> {
        let since = self.waits_since.filter(|since| since.elapsed() >= LATE)?;
        let words = match self.wait(stage)? {
            Wait::Frame => {
                let at = stage.frame_time()?;
                if stage.frame_times.len() < 2 {
                    "loading".to_owned()
                } else {
                    format!("loading frame {}", at.time())
                }
            }
            Wait::View(view) => format!("drawing: {}", view.label()),
            Wait::Picture => "drawing".to_owned(),
        };
        Some((words, since))
    }
}

/// Wakes the interface once a wait is late, and then for each position of the spinner.
pub(crate) fn wake(ctx: &egui::Context, since: Instant) {
    let left = LATE.saturating_sub(since.elapsed());
    ctx.request_repaint_after(if left.is_zero() { SPIN } else { left });
}

/// Shows what is waited for and for how long, with a spinner, in the upper right corner of `rect`.
pub(crate) fn note(ui: &egui::Ui, rect: Rect, words: &str, since: Instant) {
    let painter = ui.painter().with_clip_rect(rect);
    let seconds = since.elapsed().as_secs();
    let text = if seconds > 0 { format!("{words}, {seconds} s") } else { words.to_owned() };
    let text = painter.layout_no_wrap(text, FontId::proportional(13.0), Color32::WHITE);
    let size = text.size() + vec2(24.0, 0.0);
    let place = Align2::RIGHT_TOP.anchor_size(rect.right_top() + vec2(-22.0, 19.0), size);
    painter.rect_filled(place.expand2(vec2(10.0, 7.0)), 5, Color32::from_black_alpha(170));
    spinner(&painter, pos2(place.left() + 7.0, place.center().y), seconds);
    painter.galley(place.min + vec2(24.0, 0.0), text, Color32::WHITE);
    // The words are for readers of screens, and for tests.
    let response = ui.interact(place, ui.scope_id().with("wait"), egui::Sense::hover());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ProgressIndicator, true, words));
}

fn spinner(painter: &egui::Painter, center: egui::Pos2, step: u64) {
    let angle = |k: u64| std::f32::consts::TAU * k as f32 / POSITIONS as f32;
    for k in 0..POSITIONS {
        let (sin, cos) = angle(step + k).sin_cos();
        let color = Color32::WHITE.gamma_multiply(k as f32 / POSITIONS as f32);
        let ends = [3.5, 7.0].map(|radius| center + radius * vec2(cos, sin));
        painter.line_segment(ends, Stroke::new(1.5, color));
    }
}
