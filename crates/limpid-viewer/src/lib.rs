//! The window of `limpid view`: inspect liquids, tune settings, save pictures.
//!
//! There are four kinds of threads. The interface's thread never blocks: it sends requests and shows
//! results. The draw thread ([`backend::native::draw_thread`]) runs the code of `limpid render`. The workers of a
//! [`limpid_io::frame_cache::FrameCache`] load and classify frames ahead. Other long tasks (opening,
//! simulating, dialogs, ground truth) each have a temporary thread. All of them send messages to the
//! interface, which wake it; nothing else does except input and playback.
//!
//! A browser has no such threads: there one worker does what they do (`backend/web.rs`), with the same messages.
//!
//! [`Viewer::ui`] is one frame of the interface.

pub mod app;
pub mod backend;
pub mod model;
pub mod panels;
pub mod picture;

use std::collections::BTreeSet;
#[cfg(not(target_arch = "wasm32"))]
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::PathBuf;
use std::sync::Arc;
#[cfg(not(target_arch = "wasm32"))]
use std::sync::mpsc;
use web_time::Instant;

use eframe::egui;
use glam::UVec2;
use serde_json::json;

use limpid::camera::Camera;
#[cfg(not(target_arch = "wasm32"))]
use limpid::gpu::Gpu;
use limpid::scene::Scene;
use limpid_io::camera_path::CameraPath;
#[cfg(not(target_arch = "wasm32"))]
use limpid_io::error::Result;
use limpid_io::input::FrameTime;
#[cfg(not(target_arch = "wasm32"))]
use limpid_io::shared_classifier::SharedClassifier;

#[cfg(not(target_arch = "wasm32"))]
use app::log::Log;
use app::recent::Recent;
use app::state::{CameraState, Editing, Interface, Jobs, OpenDocument, PictureState};
use backend::background::{self, drop_in_background};
#[cfg(not(target_arch = "wasm32"))]
use backend::core::messages::{Message, Post};
use backend::frames::Frames;
#[cfg(not(target_arch = "wasm32"))]
use backend::native::draw_thread::DrawThread;
use model::document::{Document, Source};
use model::level::Level;
use model::playback::{Playback, Speed};
use model::views::View;
#[cfg(not(target_arch = "wasm32"))]
use panels::error_plot;
use panels::{style, times};
use picture::adaptive_resolution::AdaptiveResolution;
use picture::flipbook::Flipping;

#[cfg(not(target_arch = "wasm32"))]
pub use app::window::run;

/// Rays per pixel of a picture at rest.
pub const FINE_SAMPLES: u32 = 4;

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
            recent: None,
            log: None,
        }
    }
}

/// How settings A and B are compared on screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Compare {
    /// Only the settings being edited.
    #[default]
    Off,
    /// A on the left of a line, B on its right.
    Wipe,
    /// A and B, each in half of the window.
    SideBySide,
}

impl Compare {
    const ALL: [Self; 3] = [Self::Off, Self::Wipe, Self::SideBySide];

    fn label(self) -> &'static str {
        match self {
            Self::Off => "One",
            Self::Wipe => "Wipe",
            Self::SideBySide => "Side by side",
        }
    }
}

/// A tab of the side panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Tab {
    #[default]
    Settings,
    Camera,
    Times,
}

/// A notice to the user.
#[derive(Debug, Clone, PartialEq)]
pub struct Notice {
    /// Its text.
    pub text: String,
    /// Whether it is an error, which stays until it is dismissed.
    pub error: bool,
    since: Instant,
}

/// The application.
pub struct Viewer {
    options: Options,
    playback: Playback,
    jobs: Jobs,
    opened: OpenDocument,
    editing: Editing,
    eye: CameraState,
    picture: PictureState,
    flipping: Flipping,
    /// What the address of the page asks for, once its source is open.
    #[cfg(target_arch = "wasm32")]
    wishes: app::link::Wishes,
    times: times::History,
    #[cfg(not(target_arch = "wasm32"))]
    errors: error_plot::Errors,
    interface: Interface,
}

#[cfg(not(target_arch = "wasm32"))]
impl Drop for Viewer {
    /// Waits for files being written and particles being classified on the device; [`DrawThread`] waits for
    /// its own work.
    fn drop(&mut self) {
        self.jobs.classifier.close();
        if let Some(filming) = &self.jobs.filming {
            filming.stop();
        }
        for writer in self.jobs.writers.drain(..) {
            // A panic of the writer can no longer be reported.
            let _ = writer.join();
        }
    }
}

impl Viewer {
    /// Creates the viewer and opens the options' source.
    ///
    /// # Errors
    /// [`limpid_io::Error::Io`] if the log cannot be written.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn new(options: Options) -> Result<Self> {
        Self::with_devices(options, limpid_io::device::open)
    }

    /// As [`Viewer::new`], with devices from `open`: one for the first picture, and another after each
    /// loss.
    ///
    /// # Errors
    /// As [`Viewer::new`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn with_devices(
        options: Options,
        open: impl FnMut() -> Result<Gpu> + Send + 'static,
    ) -> Result<Self> {
        let (sender, messages) = mpsc::channel();
        let post = Post::new(sender);
        let classifier = SharedClassifier::default();
        let open = {
            let (mut open, classifier) = (open, classifier.clone());
            move || {
                // Threads that wait for a device must learn that there is none, even after a panic.
                let opened = catch_unwind(AssertUnwindSafe(&mut open));
                classifier.set(opened.as_ref().ok().and_then(|opened| opened.as_ref().ok()));
                opened.unwrap_or_else(|panic| resume_unwind(panic))
            }
        };
        let drawing = {
            let post = post.clone();
            DrawThread::new(open, move |answer| post.send(Message::Drawing(answer)))
        };
        let log = Log::new(options.log.as_deref())?;
        let frames = Frames::new(options.memory, classifier.clone());
        let jobs = Jobs {
            post,
            messages,
            log,
            drawing,
            classifier,
            device_asked: false,
            filming: None,
            writers: Vec::new(),
            adapter: None,
        };
        Ok(Self::of(options, jobs, frames))
    }

    /// Creates the viewer, and opens the options' source.
    fn of(options: Options, jobs: Jobs, frames: Frames) -> Self {
        let empty = Scene::around(-glam::DVec3::ONE, glam::DVec3::ONE, 0.0);
        let camera = Camera::fit(-glam::DVec3::ONE, glam::DVec3::ONE);
        let now = Instant::now();
        let recent = Recent::load(options.recent.clone());
        let flipping = Flipping::new(options.flipbook);
        let mut viewer = Self {
            options,
            playback: Playback::new(0, 30.0),
            jobs,
            opened: OpenDocument {
                document: None,
                opening: None,
                before: None,
                openings: 0,
                frame_times: Arc::default(),
                frames,
                failed: BTreeSet::new(),
            },
            editing: Editing {
                scenes: [empty.clone(), empty],
                edited: 0,
                compare: Compare::Off,
                wipe: 0.5,
                sides: Default::default(),
            },
            eye: CameraState {
                camera,
                path: CameraPath::default(),
                follow: false,
                path_seconds: 0.0,
            },
            picture: PictureState {
                dragging: false,
                view: View::Picture,
                view_before: View::Image(limpid::aov::Aov::Depth, 0),
                refine: true,
                resolution: AdaptiveResolution::default(),
                subject: None,
                changed: now,
                asked: 0,
                asked_level: Level::Draft,
                answered: 0,
                undrawn: false,
                fresh_device: true,
                viewport_size: UVec2::ZERO,
            },
            flipping,
            #[cfg(target_arch = "wasm32")]
            wishes: Default::default(),
            times: times::History::default(),
            #[cfg(not(target_arch = "wasm32"))]
            errors: error_plot::Errors::default(),
            interface: Interface {
                notices: Vec::new(),
                tab: Tab::Settings,
                panels: true,
                help: false,
                dialog: None,
                browsing: false,
                recent,
                demos: Vec::new(),
                dark: true,
                plain: false,
                ticked: now,
            },
        };
        viewer.jobs.log.event("start", json!({}));
        if let Some(source) = viewer.options.source.clone() {
            viewer.open(source);
        }
        viewer
    }

    /// Runs one frame of the interface.
    pub fn ui(&mut self, ui: &mut egui::Ui) {
        let begun = Instant::now();
        let ctx = ui.ctx().clone();
        if self.jobs.post.enter(&ctx) {
            style::apply(&ctx);
            ctx.set_theme(if self.interface.dark { egui::Theme::Dark } else { egui::Theme::Light });
        }
        self.handle_messages();
        #[cfg(not(target_arch = "wasm32"))]
        self.take_files(&ctx);
        self.handle_keys(&ctx);
        self.play(&ctx);

        let open = self.opened.document.is_some();
        if !self.interface.plain {
            self.toolbar(ui);
        }
        self.timeline(ui);
        self.notice_line(ui);
        if self.interface.panels && open {
            self.side_panel(ui);
        }
        self.flip();
        self.show_viewport(ui);
        self.help_window(&ctx);
        self.show_dialog(&ctx);

        self.load();
        self.ask(&ctx);
        #[cfg(not(target_arch = "wasm32"))]
        self.compare_with_truth();
        let again = ctx.has_requested_repaint();
        self.jobs.log.record_frame(begun, again);
        #[cfg(target_arch = "wasm32")]
        self.jobs.drawing.tell_dropped();
    }

    /// Prepares for another window, where nothing has been drawn yet.
    fn reset_for_new_window(&mut self) {
        self.jobs.post.leave();
        for side in &mut self.editing.sides {
            side.picture = Default::default();
        }
        self.picture.subject = None;
        self.flipping.clear();
    }

    pub(crate) fn opened(&mut self, document: Document) {
        // Simulations start playing.
        let plays = document.project.source.simulation().is_some();
        let frames = document.numbers.len();
        self.jobs.log.event(
            "opened",
            json!({ "input": document.source.input, "frames": frames, "plays": plays }),
        );
        if let Some(write) = self.interface.recent.add(&document.source.input) {
            // Without the list the viewer is as good.
            background::spawn(move || drop(write()));
        }
        let document = Arc::new(document);
        self.opened.frames.clear();
        self.opened.failed.clear();
        self.opened.frame_times = document.frame_times(Speed::Real).into();
        let looped = self.playback.looped;
        self.playback = Playback::new(self.opened.frame_times.len(), document.fps());
        self.playback.looped = looped;
        if let Some(named) = document.input.frame
            && let Some(at) =
                self.opened.frame_times.iter().position(|frame_time| frame_time.frame == named)
        {
            self.playback.seek(at);
        }
        self.editing.scenes = [document.project.scene.clone(), document.project.scene.clone()];
        self.opened.frames.processor = document.project.processor;
        self.editing.edited = 0;
        for side in std::mem::take(&mut self.editing.sides) {
            drop_in_background(side.loaded);
        }
        self.eye.camera = document.project.camera_for(Default::default());
        self.eye.path = CameraPath::default();
        self.eye.follow = false;
        self.picture.subject = None;
        self.flipping.clear();
        self.times = times::History::default();
        #[cfg(not(target_arch = "wasm32"))]
        self.errors.clear();
        self.playback.playing = plays;
        self.opened.document = Some(document);
        #[cfg(target_arch = "wasm32")]
        self.grant_wishes();
    }

    /// Advances playback and the camera path.
    fn play(&mut self, ctx: &egui::Context) {
        let now = Instant::now();
        let passed =
            now.duration_since(std::mem::replace(&mut self.interface.ticked, now)).as_secs_f64();
        if !self.playback.playing {
            return;
        }
        let mut openings = [&self.opened.opening, &self.opened.before].into_iter().flatten();
        let growing = openings
            .any(|opening| opening.progress.is_some() || opening.growing || opening.pending);
        if self.playback.count() > 1 {
            let (frames, kept) = (&self.opened.frames, self.kept());
            let caught_up = self.flipping.shown.is_some() || self.is_caught_up();
            // Each frame that has to be drawn is waited for.
            let (mut waits, needed) = (false, self.flipping.needed);
            self.playback.advance(passed, |i| {
                let proceeds = !waits && (kept[i] || (caught_up && frames.is_ready(i)));
                waits |= needed && !kept[i];
                proceeds
            });
            // If it waits for a frame, the message of its arrival wakes the interface.
            ctx.request_repaint_after(self.playback.remaining());
        } else if self.eye.follow {
            let length = self.eye.path.duration().max(f64::MIN_POSITIVE);
            self.eye.path_seconds = (self.eye.path_seconds + passed) % length;
            ctx.request_repaint();
        } else if !growing {
            self.playback.playing = false;
        }
        if self.eye.follow && !self.eye.path.keys.is_empty() {
            self.eye.camera = self.eye.path.at(self.seconds());
        }
    }

    /// The current frame time.
    fn frame_time(&self) -> Option<FrameTime> {
        self.opened.frame_times.get(self.playback.index()).copied()
    }

    /// The current time of playback, or along the camera path of a still, s.
    fn seconds(&self) -> f64 {
        match (&self.opened.document, self.frame_time()) {
            (Some(document), Some(at)) if self.playback.count() > 1 => document.seconds(at),
            _ => self.eye.path_seconds,
        }
    }

    /// Size of the viewport, pixels.
    pub fn picture_size(&self) -> UVec2 {
        self.picture.viewport_size
    }

    /// The notices to the user, newest last.
    pub fn notices(&self) -> &[Notice] {
        &self.interface.notices
    }

    /// Settings A and B, as scenes.
    pub fn scenes(&self) -> &[Scene; 2] {
        &self.editing.scenes
    }

    /// The view mode.
    pub fn view(&self) -> View {
        self.picture.view
    }

    /// The state of playback.
    pub fn playback(&self) -> &Playback {
        &self.playback
    }
}
