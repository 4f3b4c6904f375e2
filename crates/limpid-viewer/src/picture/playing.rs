//! Playing from the flipbook.

use std::time::Duration;

use eframe::egui::{self, Align2, Color32, FontId, Rect, pos2, vec2};

use crate::model::log::Log;
use crate::model::stage::Stage;
use crate::panels::style::accent;
use crate::picture::flipbook::{Moment, Progress, Subject, Viewpoint};
use crate::picture::state::PictureState;
use crate::picture::texture::Picture;

impl PictureState {
    /// The subject of the current book; `None` if there is nothing to play.
    fn book_subject(&self, stage: &Stage) -> Option<Subject> {
        let size = self.full_size(stage);
        if stage.frame_times.len() < 2 || size.min_element() == 0 {
            return None;
        }
        let follows = stage.eye.is_led();
        let viewpoint = match follows {
            true => Viewpoint::Path(stage.eye.path.clone()),
            false => Viewpoint::Fixed(stage.eye.camera),
        };
        Some(Subject {
            scenes: stage
                .editing
                .visible()
                .into_iter()
                .map(|i| stage.editing.scenes[i].clone())
                .collect(),
            size,
            view: self.view,
            processor: stage.processor,
            viewpoint,
            scale: stage.colors.scale.clone(),
        })
    }

    /// The subject and the moment of the picture that should be shown.
    pub(crate) fn page(&self, stage: &Stage) -> Option<(Subject, Moment)> {
        Some((self.book_subject(stage)?, stage.frame_time()?.into()))
    }

    /// Whether each frame time of playback has kept pictures.
    pub(crate) fn kept(&self, stage: &Stage) -> Vec<bool> {
        let Some(subject) = self.book_subject(stage) else {
            return vec![false; stage.frame_times.len()];
        };
        let moments = stage.frame_times.iter().map(|&at| at.into());
        self.flipping.book.holds(&subject, moments).collect()
    }

    /// The first frame time from the current one, in the direction of playback, whose pictures are not kept.
    pub(crate) fn first_missing(&self, stage: &Stage) -> Option<usize> {
        let (kept, index) = (self.kept(stage), stage.playback.index());
        let [first, last] = stage.playback.span();
        let order: Vec<usize> = match stage.playback.backwards {
            false => (index..=last).chain(first..index).collect(),
            true => (first..=index).rev().chain((index + 1..=last).rev()).collect(),
        };
        order.into_iter().find(|&i| kept.get(i) == Some(&false))
    }

    /// Shows the kept pictures of the current moment, if there are any.
    pub(crate) fn flip(&mut self, stage: &Stage, log: &mut Log) {
        self.flipping.judge(self.resolution.full_ms(), 1e3 * stage.playback.duration());
        let page = self.page(stage).filter(|_| self.flipping.needed);
        let shown = page
            .and_then(|(subject, at)| Some((at, self.flipping.book.get(&subject, at)?.clone())));
        let Some((at, pictures)) = shown else {
            self.flipping.shown = None;
            return;
        };
        if self.flipping.shown != Some(at) {
            log.event("flip", serde_json::json!({ "moment": stage.playback.index() }));
        }
        self.flipping.shown = Some(at);
        for (i, picture) in stage.editing.visible().into_iter().zip(pictures) {
            self.sides[i].picture = picture;
        }
    }

    /// Whether playback draws the current frame at full size, to keep it.
    pub(crate) fn fills_flipbook(&self, stage: &Stage) -> bool {
        stage.playback.playing
            && !self.dragging
            && self.flipping.needed
            && self.book_subject(stage).is_some_and(|subject| !self.flipping.book.is_full(&subject))
    }

    /// Keeps the pictures of the newest request.
    pub(crate) fn keep(&mut self, stage: &Stage, pictures: Vec<Picture>) {
        let Some((subject, at)) = self.flipping.asked.take().filter(|_| self.flipping.needed)
        else {
            return;
        };
        let bytes = pictures.iter().map(Picture::bytes).sum();
        self.flipping.book.keep(&subject, at, pictures, bytes);
        match stage.playback.playing {
            true => self.flipping.tick(),
            false => self.flipping.last = None,
        }
    }

    /// The progress of the flipbook; `None` if it is not needed.
    pub(crate) fn flipbook(&self, stage: &Stage) -> Option<Progress> {
        if !self.flipping.needed {
            return None;
        }
        let subject = self.book_subject(stage)?;
        // Fast motion leaves out frames.
        let kept = self.kept(stage);
        let [first, last] = stage.playback.span();
        let kept = kept.get(first..=last).unwrap_or_default();
        let of_playback = || kept.iter().step_by(stage.playback.speed().stride());
        let (drawn, frames) = (of_playback().filter(|kept| **kept).count(), of_playback().count());
        let missing = (frames - drawn) as f64;
        let left = self.flipping.pace.map(|pace| Duration::from_secs_f64(missing * pace));
        Some(Progress { drawn, frames, full: self.flipping.book.is_full(&subject), left })
    }

    /// The progress in words, for the status line.
    pub(crate) fn flipbook_status(&self, stage: &Stage) -> Option<String> {
        let Progress { drawn, frames, full, left } = self.flipbook(stage)?;
        let mebi = self.flipping.book.bytes() >> 20;
        Some(match left {
            _ if drawn == frames => format!("flipbook complete, {mebi} MiB"),
            _ if full => format!("flipbook full: {drawn} of {frames} frames fit ({mebi} MiB)"),
            Some(left) if stage.playback.playing => {
                format!("flipbook {drawn} of {frames}, {:.0} s left", left.as_secs_f64().ceil())
            }
            _ => format!("flipbook {drawn} of {frames}"),
        })
    }

    /// Says on the picture that playback waits for the flipbook while that fills.
    pub(crate) fn flipbook_note(&self, stage: &Stage, ui: &egui::Ui, rect: Rect) {
        let progress = self.flipbook(stage).filter(|_| stage.playback.playing);
        let Some(Progress { drawn, frames, full: false, left }) = progress else { return };
        if drawn == frames {
            return;
        }
        let wait =
            left.map_or(String::new(), |left| format!(" in {:.0} s", left.as_secs_f64().ceil()));
        let text =
            format!("Drawing each frame once: {drawn} of {frames}. Plays at its own speed{wait}.");
        let painter = ui.painter().with_clip_rect(rect);
        let font = FontId::proportional(13.0);
        let text = painter.layout_no_wrap(text, font, Color32::from_gray(230));
        let place = pos2(rect.center().x, rect.top() + 12.0);
        let place = Align2::CENTER_TOP.anchor_size(place, text.size());
        let back = place.expand2(vec2(10.0, 7.0));
        painter.rect_filled(back, 5, Color32::from_black_alpha(170));
        let bar =
            Rect::from_min_max(pos2(back.left() + 6.0, back.bottom() - 4.0), back.right_bottom());
        let share = drawn as f32 / frames as f32;
        let bar = Rect::from_min_size(bar.min, vec2(share * (back.width() - 12.0), 2.0));
        painter.rect_filled(bar, 1, accent(ui));
        painter.galley(place.min, text, Color32::WHITE);
    }
}
