//! The state of the picture on the screen.

use std::sync::Arc;

use glam::{UVec2, Vec2};
use serde_json::json;
use web_time::Instant;

use crate::backend::core::picking::Picked;
use crate::model::editing::{Compare, Editing};
use crate::model::level::{FINE_SAMPLES, Level};
use crate::model::log::Log;
use crate::model::stage::Stage;
use crate::model::views::View;
use crate::picture::adaptive_resolution::AdaptiveResolution;
use crate::picture::camera_controls;
use crate::picture::captions::Captions;
use crate::picture::color_legend::ColorLegend;
use crate::picture::flipbook::Flipping;
use crate::picture::texture::Picture;
use limpid::aov::Aov;
use limpid::camera::Camera;
use limpid::scene::Scene;
use limpid_io::color_by::ColorScale;
use limpid_io::input::{FrameTime, Loaded};

/// The state of one of the two settings.
#[derive(Debug, Default)]
pub(crate) struct Side {
    pub(crate) loaded: Option<Arc<Loaded>>,
    /// The time of `loaded`.
    pub(crate) time: Option<FrameTime>,
    /// Index of the frame time last taken from a cache, loaded or failed; `None` while it is missing.
    pub(crate) at: Option<usize>,
    /// Whether `loaded` is that frame time, classified by the current settings.
    pub(crate) fits: bool,
    pub(crate) picture: Picture,
}

/// The inputs of the last requested picture, except its level.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Subject {
    pub(crate) scenes: Vec<Scene>,
    /// Addresses that identify the particles: each load has its own.
    pub(crate) loaded: Vec<usize>,
    pub(crate) camera: Camera,
    pub(crate) sizes: Vec<UVec2>,
    pub(crate) view: View,
    pub(crate) refine: bool,
    pub(crate) scale: Option<ColorScale>,
}

impl Subject {
    /// Whether another subject differs at most in its frame, and in the camera if that `follows` a path.
    pub(crate) fn shows(&self, other: &Self, follows: bool) -> bool {
        (&self.scenes, &self.scale) == (&other.scenes, &other.scale)
            && (follows || self.camera == other.camera)
            && (&self.sizes, self.view, self.refine) == (&other.sizes, other.view, other.refine)
    }
}

/// The view mode, the pictures of both settings, and the requests for them.
pub(crate) struct PictureState {
    /// Whether the pointer holds the picture.
    pub(crate) dragging: bool,
    pub(crate) view: View,
    pub(crate) view_before: View,
    pub(crate) refine: bool,
    pub(crate) resolution: AdaptiveResolution,
    pub(crate) subject: Option<Subject>,
    pub(crate) changed: Instant,
    pub(crate) asked: u64,
    pub(crate) asked_level: Level,
    /// The first request for the subject.
    pub(crate) subject_asked: u64,
    pub(crate) answered: u64,
    /// The contents of the pictures that are asked for.
    pub(crate) captions: Captions,
    /// Since when the screen waits for a picture.
    pub(crate) waits_since: Option<Instant>,
    /// The last requested picture could not be drawn.
    pub(crate) undrawn: bool,
    /// The device has not drawn a picture yet: the first takes longer.
    pub(crate) fresh_device: bool,
    /// Size of the viewport, pixels.
    pub(crate) viewport_size: UVec2,
    /// The particles and pictures of settings A and B.
    pub(crate) sides: [Side; 2],
    pub(crate) flipping: Flipping,
    pub(crate) legend: ColorLegend,
    /// Whether the axes are shown.
    pub(crate) has_triad: bool,
    /// The place of the picture that was clicked last, both coordinates 0 to 1, until it is asked for.
    pub(crate) clicked: Option<Vec2>,
    /// The particle there.
    pub(crate) picked: Option<Picked>,
    /// Number of clicks so far.
    pub(crate) picks: u64,
}

impl PictureState {
    /// Nothing is shown yet; kept pictures have a budget of `flipbook` bytes.
    pub(crate) fn new(flipbook: u64) -> Self {
        Self {
            dragging: false,
            view: View::Picture,
            view_before: View::Image(Aov::Depth, 0),
            refine: true,
            resolution: AdaptiveResolution::default(),
            subject: None,
            changed: Instant::now(),
            asked: 0,
            asked_level: Level::Draft,
            subject_asked: 0,
            answered: 0,
            captions: Captions::default(),
            waits_since: None,
            undrawn: false,
            fresh_device: true,
            viewport_size: UVec2::ZERO,
            sides: Default::default(),
            flipping: Flipping::new(flipbook),
            legend: ColorLegend::default(),
            has_triad: true,
            clicked: None,
            picked: None,
            picks: 0,
        }
    }

    /// Withdraws all requests, for another document or view: their pictures are not shown if they come.
    pub(crate) fn withdraw(&mut self) {
        self.captions.withdraw();
        self.waits_since = None;
        self.subject = None;
    }

    /// Prepares for another window, where nothing has been drawn yet.
    pub(crate) fn reset_for_new_window(&mut self) {
        for side in &mut self.sides {
            side.picture = Default::default();
        }
        self.subject = None;
        self.legend = ColorLegend::default();
        self.flipping.clear();
    }

    /// Whether the current frame time is shown.
    pub(crate) fn is_caught_up(&self, stage: &Stage) -> bool {
        let index = Some(stage.playback.index());
        let taken = stage.editing.visible().into_iter().all(|i| self.sides[i].at == index);
        taken && self.answered == self.asked
    }

    /// Whether the particles of the current frame time are loaded, classified by the current settings.
    pub(crate) fn has_particles(&self, stage: &Stage) -> bool {
        let index = Some(stage.playback.index());
        let fits = |i: usize| self.sides[i].fits && self.sides[i].at == index;
        stage.editing.visible().into_iter().all(fits)
    }

    /// Whether the picture at rest is on screen, for the current frame time and settings.
    pub(crate) fn is_at_rest(&self, stage: &Stage) -> bool {
        self.is_caught_up(stage)
            && stage.editing.visible().into_iter().all(|i| self.sides[i].fits)
            && self.asked_level == Level::Fine
            && self.asked > 0
            && !self.undrawn
            && self.has_wanted_contents(stage)
            && !stage.playback.playing
    }

    /// The particles and the picture of the settings that are edited.
    pub(crate) fn edited(&self, stage: &Stage) -> &Side {
        &self.sides[stage.editing.edited]
    }

    /// Size of one picture on screen, pixels.
    pub(crate) fn full_size(&self, stage: &Stage) -> UVec2 {
        match stage.editing.compare {
            // Each half shows the whole picture.
            Compare::SideBySide => self.viewport_size / 2,
            _ => self.viewport_size,
        }
    }

    /// Rays per pixel of a scene's picture at rest.
    pub(crate) fn fine_samples(&self, scene: &Scene) -> u32 {
        let own = scene.settings.refract.samples;
        if self.refine { own.max(FINE_SAMPLES) } else { own }
    }

    /// The scene that is edited, as its picture at rest is drawn.
    pub(crate) fn fine_scene(&self, editing: &Editing) -> Scene {
        let mut scene = editing.scene().clone();
        scene.settings.refract.samples = self.fine_samples(&scene);
        scene
    }

    pub(crate) fn set_view(&mut self, view: View, log: &mut Log) {
        if self.view != View::Picture {
            self.view_before = self.view;
        }
        if self.view != view {
            log.event("view", json!({ "view": view.label() }));
            self.withdraw();
        }
        self.view = view;
    }

    /// The camera that shows the whole liquid; `None` until that is loaded.
    pub(crate) fn fitted(&self, stage: &Stage) -> Option<Camera> {
        self.fitted_from(&stage.eye.camera, stage)
    }

    /// As [`Self::fitted`], in the direction of `camera`.
    pub(crate) fn fitted_from(&self, camera: &Camera, stage: &Stage) -> Option<Camera> {
        let loaded = self.edited(stage).loaded.as_ref()?;
        let aspect = self.viewport_size.as_dvec2();
        let aspect = if aspect.min_element() > 0.0 { aspect.x / aspect.y } else { 1.0 };
        let radius = f64::from(loaded.splats.radius);
        let (min, max) = loaded.bulk.bounds;
        Some(camera_controls::fit(camera, (min - radius, max + radius), aspect))
    }
}
