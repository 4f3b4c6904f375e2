//! The application: its state, and the effects of keys, buttons and messages.

mod actions;
mod coloring;
pub mod command_line;
#[cfg(not(target_arch = "wasm32"))]
mod filming;
#[cfg(target_arch = "wasm32")]
pub mod link;
mod measuring;
mod messages;
mod opening;
#[cfg(target_arch = "wasm32")]
pub mod page;
mod picking;
mod recent;
mod saving;
mod showing;
mod state;
mod status;
mod undoing;
#[cfg(not(target_arch = "wasm32"))]
pub(crate) mod window;

use std::path::PathBuf;
use std::sync::{Arc, mpsc};

use eframe::egui;
use glam::{DVec3, UVec2};
use serde_json::json;
use web_time::Instant;

use crate::backend::core::filming::Filming;
use crate::backend::core::messages::{Message, Post};
use crate::backend::frames::Frames;
use crate::backend::here::Backend;
use crate::model::coloring::Coloring;
use crate::model::document::Source;
use crate::model::editing::Editing;
use crate::model::eye::Eye;
use crate::model::history::{History, State};
use crate::model::log::Log;
use crate::model::notices::Notice;
use crate::model::platform::IN_BROWSER;
use crate::model::playback::Playback;
use crate::model::stage::Stage;
use crate::model::views::View;
use crate::panels::dialogs::help_window;
use crate::panels::error_plot::Errors;
use crate::panels::notices::log_window;
use crate::panels::style;
use crate::panels::times::Times;
use crate::picture::flipbook::Progress;
use crate::picture::state::PictureState;
use limpid::camera::Camera;
use limpid::liquid::Up;
use limpid::scene::Scene;
use limpid_io::camera_path::CameraPath;
use limpid_io::input::FrameTime;
use limpid_io::shared_classifier::Processor;
use recent::Recent;
use state::{Interface, OpenDocument};

/// Width of a window from which panels are shown beside the picture, unless the user says otherwise, points.
const WIDE: f32 = 900.0;

/// Startup options.
#[derive(Debug, Clone)]
pub struct Options {
    /// The source to open.
    pub source: Option<Source>,
    /// Size of the window, points.
    pub window: UVec2,
    /// Memory for frames loaded ahead, bytes.
    pub memory: u64,
    /// Memory for kept pictures, bytes; 0 keeps none.
    pub flipbook: u64,
    /// Whether a legend is shown of the colours of values.
    pub legend: bool,
    /// The file with the list of the sources that were opened last; none keeps no list.
    pub recent: Option<PathBuf>,
    /// The file for the event log.
    pub log: Option<PathBuf>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            source: None,
            window: UVec2::new(1280, 800),
            memory: 1 << 30,
            flipbook: 1 << 30,
            legend: false,
            recent: None,
            log: None,
        }
    }
}

/// The application.
pub struct Viewer {
    /// The film that is being written. The backend waits for it, so it is stopped before.
    filming: Option<Filming>,
    backend: Backend,
    post: Post,
    messages: mpsc::Receiver<Message>,
    log: Log,
    opened: OpenDocument,
    stage: Stage,
    picture: PictureState,
    times: Times,
    errors: Errors,
    interface: Interface,
    history: History<State>,
}

impl Viewer {
    /// Creates the viewer, and opens the options' source.
    fn of(
        options: Options,
        backend: Backend,
        (post, messages): (Post, mpsc::Receiver<Message>),
        log: Log,
    ) -> Self {
        let (min, max) = (-DVec3::ONE, DVec3::ONE);
        let mut viewer = Self {
            filming: None,
            backend,
            post,
            messages,
            log,
            opened: OpenDocument::new(Frames::new(options.memory)),
            stage: Stage {
                editing: Editing::new(Scene::around(min, max, 0.0)),
                eye: Eye::new(Camera::fit(min, max)),
                up: Up::default(),
                playback: Playback::new(0, 30.0),
                frame_times: Arc::default(),
                processor: Processor::default(),
                colors: Coloring::default(),
            },
            picture: PictureState::new(options.flipbook),
            times: Times::default(),
            errors: Errors::default(),
            interface: Interface::new(Recent::load(options.recent)),
            history: History::default(),
        };
        viewer.log.event("start", json!({}));
        if let Some(source) = options.source {
            viewer.open(source);
            viewer.opened.wishes.legend = options.legend;
        }
        viewer
    }

    /// Runs one frame of the interface.
    pub fn ui(&mut self, ui: &mut egui::Ui) {
        let begun = Instant::now();
        let ctx = ui.ctx().clone();
        if self.post.enter(&ctx) {
            style::apply(&ctx);
            ctx.set_theme(if self.interface.dark { egui::Theme::Dark } else { egui::Theme::Light });
        }
        self.interface.is_wide = ctx.content_rect().width() >= WIDE;
        self.handle_messages();
        // In a browser the page takes them.
        if !IN_BROWSER {
            self.take_files(&ctx);
            self.name_window(&ctx);
        }
        self.handle_keys(&ctx);
        self.play(&ctx);

        if !self.interface.plain {
            self.show_toolbar(ui);
        }
        self.show_timeline(ui);
        if self.interface.shows_panels() && self.opened.document.is_some() {
            self.show_side_panel(ui);
        }
        self.picture.flip(&self.stage, &mut self.log);
        self.show_viewport(ui);
        self.pick();
        help_window(&ctx, &mut self.interface.help);
        log_window(&ctx, &mut self.interface.messages, &self.interface.notices);
        self.show_dialog(&ctx);

        self.load();
        if let Some(request) = self.picture.request(&self.stage, &ctx, &mut self.log) {
            self.backend.request(request);
        }
        if self.opened.document.is_none() || self.opened.is_leaving() {
            self.picture.waits_since = None;
        } else {
            self.picture.watch(&self.stage, &ctx);
        }
        self.compare_with_truth();
        self.record_changes(&ctx);
        let again = ctx.has_requested_repaint();
        self.log.record_frame(begun, again);
    }

    /// Advances playback and the camera path.
    fn play(&mut self, ctx: &egui::Context) {
        let now = Instant::now();
        let passed =
            now.duration_since(std::mem::replace(&mut self.interface.ticked, now)).as_secs_f64();
        // The old document does not play on while another one is being opened.
        if !self.stage.playback.playing || self.opened.is_leaving() {
            return;
        }
        if self.stage.playback.count() > 1 {
            let (frames, kept) = (&self.opened.frames, self.picture.kept(&self.stage));
            let flipping = &self.picture.flipping;
            let caught_up = flipping.shown.is_some() || self.picture.is_caught_up(&self.stage);
            // Each frame that has to be drawn is waited for.
            let (mut waits, needed) = (false, flipping.needed);
            self.stage.playback.advance(passed, |i| {
                let proceeds = !waits && (kept[i] || (caught_up && frames.is_ready(i)));
                waits |= needed && !kept[i];
                proceeds
            });
            // If it waits for a frame, the message of its arrival wakes the interface.
            ctx.request_repaint_after(self.stage.playback.remaining());
        } else if self.stage.eye.follow {
            let length = self.stage.eye.path.duration().max(f64::MIN_POSITIVE);
            self.stage.eye.path_seconds = (self.stage.eye.path_seconds + passed) % length;
            ctx.request_repaint();
        } else if !self.opened.grows() {
            self.stage.playback.playing = false;
        }
        if self.stage.eye.is_led() {
            self.stage.eye.camera = self.stage.eye.path.at(self.seconds());
        }
    }

    /// The current time of playback, or along the camera path of a still, s.
    fn seconds(&self) -> f64 {
        match (&self.opened.document, self.stage.frame_time()) {
            (Some(document), Some(at)) if self.stage.playback.count() > 1 => document.seconds(at),
            _ => self.stage.eye.path_seconds,
        }
    }

    /// Prepares for another window, where nothing has been drawn yet.
    fn reset_for_new_window(&mut self) {
        self.post.leave();
        self.interface.title.clear();
        self.picture.reset_for_new_window();
    }

    /// Writes the last event of the log.
    pub fn close(&mut self) {
        self.log.close();
    }

    /// Size of the viewport, pixels.
    pub fn picture_size(&self) -> UVec2 {
        self.picture.viewport_size
    }

    /// The notices over the picture, newest last.
    pub fn notices(&self) -> &[Notice] {
        self.interface.notices.shown()
    }

    /// Settings A and B, as scenes.
    pub fn scenes(&self) -> &[Scene; 2] {
        &self.stage.editing.scenes
    }

    /// The attribute that colours the particles, its map, its range, and the legend.
    pub fn colors(&self) -> &Coloring {
        &self.stage.colors
    }

    /// The view mode.
    pub fn view(&self) -> View {
        self.picture.view
    }

    /// The view and the frame time of the picture on screen, which may be late.
    pub fn shown(&self) -> Option<(View, Option<FrameTime>)> {
        let facts = self.picture.edited(&self.stage).picture.shown.as_ref()?;
        Some((facts.caption.view, facts.caption.at))
    }

    /// The state of playback.
    pub fn playback(&self) -> &Playback {
        &self.stage.playback
    }

    /// The camera path of key frames.
    pub fn path(&self) -> &CameraPath {
        &self.stage.eye.path
    }

    /// The progress of the flipbook; `None` if it is not needed.
    pub fn flipbook(&self) -> Option<Progress> {
        self.picture.flipbook(&self.stage)
    }

    /// Whether the picture at rest is on screen, for the current frame time and settings.
    pub fn is_at_rest(&self) -> bool {
        self.opened.document.is_some()
            && self.opened.pending().is_none()
            && self.picture.is_at_rest(&self.stage)
    }
}
