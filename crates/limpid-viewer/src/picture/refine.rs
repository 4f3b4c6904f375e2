//! Refinement of the picture: a draft while things move, better pictures at rest.

use std::sync::Arc;
use std::time::Duration;

use eframe::egui;
use web_time::Instant;

use crate::backend::core::drawing::{Pane, Request};
use crate::model::level::Level;
use crate::model::log::Log;
use crate::model::stage::Stage;
use crate::picture::state::{PictureState, Subject};
use limpid::scene::Scene;
use limpid_io::input::Loaded;

/// Most rays per edge pixel in drafts.
const DRAFT_EDGE_SAMPLES: u32 = 4;

/// Time from the last change until a picture is at rest.
const REST: Duration = Duration::from_millis(150);

impl PictureState {
    /// The request for the picture that should be shown, unless it has been requested, or is kept in the flipbook.
    pub(crate) fn request(
        &mut self,
        stage: &Stage,
        ctx: &egui::Context,
        log: &mut Log,
    ) -> Option<Request> {
        self.flip(stage, log);
        let kept = self.flipping.shown.is_some();
        if kept && (stage.playback.playing || !self.has_particles(stage)) {
            return None;
        }
        let visible = stage.editing.visible();
        let loaded: Option<Vec<Arc<Loaded>>> =
            visible.iter().map(|&i| self.sides[i].loaded.clone()).collect();
        let full = self.full_size(stage);
        // There is nothing to draw, or the window is minimised.
        let loaded = loaded.filter(|_| full.min_element() > 0)?;
        let subject = Subject {
            scenes: visible.iter().map(|&i| stage.editing.scenes[i].clone()).collect(),
            loaded: loaded.iter().map(|loaded| Arc::as_ptr(loaded) as usize).collect(),
            camera: stage.eye.camera,
            sizes: vec![full; visible.len()],
            view: self.view,
            refine: self.refine,
            scale: stage.colors.scale.clone(),
        };
        let now = Instant::now();
        let changed = self.subject.as_ref() != Some(&subject);
        let level = if changed {
            self.changed = now;
            if kept {
                // As if it had just been drawn.
                self.subject = Some(subject);
                self.asked_level = Level::Full;
                ctx.request_repaint_after(REST);
                return None;
            }
            let other_frame =
                self.subject.as_ref().is_some_and(|last| last.shows(&subject, stage.eye.follow));
            if other_frame && self.fills_flipbook(stage) { Level::Full } else { Level::Draft }
        } else if self.answered < self.asked {
            // A request is in progress.
            return None;
        } else if stage.playback.playing || self.dragging || now.duration_since(self.changed) < REST
        {
            // Playback and the pointer wake the interface themselves.
            let rest = REST.saturating_sub(now.duration_since(self.changed));
            if self.asked_level < Level::Fine && !rest.is_zero() {
                ctx.request_repaint_after(rest);
            }
            return None;
        } else {
            match self.asked_level {
                Level::Draft => Level::Full,
                Level::Full => Level::Fine,
                Level::Fine => return None,
            }
        };
        let samples = |scene: &Scene| match level {
            Level::Draft | Level::Full => 1,
            Level::Fine => self.fine_samples(scene),
        };
        let fine_is_full =
            visible.iter().all(|&i| self.fine_samples(&stage.editing.scenes[i]) == 1);
        if level == Level::Fine && fine_is_full && self.asked_level == Level::Full {
            self.asked_level = Level::Fine;
            return None;
        }
        let size = if level == Level::Draft { self.resolution.draft(full) } else { full };
        let panes = visible.iter().zip(loaded).map(|(&i, loaded)| {
            let mut scene = stage.editing.scenes[i].clone();
            scene.settings.refract.samples = samples(&scene);
            if level == Level::Draft {
                let edges = &mut scene.settings.refract.edge_samples;
                *edges = (*edges).min(DRAFT_EDGE_SAMPLES);
            }
            let (scene, camera) = (Arc::new(scene), stage.eye.camera);
            let scale = stage.colors.scale.clone();
            Pane { scene, camera, loaded, size, scale, legend: false }
        });
        let panes = panes.collect();
        let captions = visible.iter().map(|&i| self.caption(stage, i)).collect();
        self.flipping.asked = match level {
            Level::Draft => None,
            Level::Full | Level::Fine => self.page(stage).filter(|_| self.has_particles(stage)),
        };
        self.asked += 1;
        self.captions.asked(self.asked, captions);
        if changed {
            self.subject_asked = self.asked;
        }
        self.asked_level = level;
        self.undrawn = false;
        self.subject = Some(subject);
        Some(Request { number: self.asked, panes, level, view: self.view })
    }
}
