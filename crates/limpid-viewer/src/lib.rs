//! The window of `limpid view`: look at liquid, tune it, save what is seen.
//!
//! Four kinds of threads. The interface's own never waits: it says what it wants and shows what has
//! come. One thread draws ([`draw_thread`]), with the code that `limpid render` runs. The workers of
//! a [`limpid_io::frame_cache::FrameCache`] read and classify frames ahead. What else takes time (opening, simulating,
//! dialogs, ground truth) has a thread while it lasts. All of them report to the interface, and a
//! report wakes it; nothing else does but input and playback.
//!
//! [`Viewer::ui`] is a frame of the interface on one page.

mod actions;
pub mod adaptive_resolution;
mod baking;
pub mod camera_controls;
pub mod camera_panel;
pub mod command_line;
pub mod controls;
mod dialogs;
pub mod document;
pub mod draw_thread;
mod frames;
mod icons;
mod log;
mod messages;
pub mod playback;
mod refine;
mod settings_panel;
pub mod shortcuts;
mod style;
mod timeline;
mod times;
mod toolbar;
mod truth;
mod viewport;
pub mod views;
mod window;

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::PathBuf;
use std::sync::{Arc, mpsc};
use std::thread::JoinHandle;
use std::time::Instant;

use eframe::egui;
use glam::UVec2;
use serde_json::json;

use limpid::camera::Camera;
use limpid::gpu::Gpu;
use limpid::scene::Scene;
use limpid_io::camera_path::CameraPath;
use limpid_io::error::Result;
use limpid_io::input::FrameTime;
use limpid_io::shared_classifier::SharedClassifier;

use adaptive_resolution::{AdaptiveResolution, Level};
use baking::Opening;
use dialogs::Dialog;
use document::{Document, Source};
use draw_thread::DrawThread;
use frames::{Frames, let_go};
use log::Log;
use messages::{Message, Post};
use playback::{Playback, Speed};
use refine::{Side, Subject};
use truth::Truth;
use views::View;

pub use window::run;

/// Rays per pixel of a picture at rest.
pub const FINE_SAMPLES: u32 = 4;

/// How the viewer starts.
#[derive(Debug, Clone)]
pub struct Options {
    /// What to open.
    pub source: Option<Source>,
    /// Size of the window, points.
    pub window: UVec2,
    /// Memory for frames that are loaded ahead, bytes.
    pub memory: u64,
    /// Where to log what happens.
    pub log: Option<PathBuf>,
}

impl Default for Options {
    fn default() -> Self {
        Self { source: None, window: UVec2::new(1280, 800), memory: 1 << 30, log: None }
    }
}

/// One or two settings on the screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Compare {
    /// The settings that are edited.
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

/// What the panel on the right shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Tab {
    #[default]
    Settings,
    Camera,
    Times,
}

/// A line for the user.
#[derive(Debug, Clone, PartialEq)]
pub struct Notice {
    /// What it says.
    pub text: String,
    /// Whether something went wrong; it then stays until it is dismissed.
    pub error: bool,
    since: Instant,
}

/// The application.
pub struct Viewer {
    options: Options,
    post: Post,
    news: mpsc::Receiver<Message>,
    log: Log,
    notices: Vec<Notice>,
    drawing: DrawThread,
    /// Where particles are classified.
    classifier: SharedClassifier,
    /// The thread that draws has been told to open a device for them.
    device_asked: bool,
    /// What writes files.
    writers: Vec<JoinHandle<()>>,
    adapter: Option<String>,

    document: Option<Arc<Document>>,
    opening: Option<Opening>,
    /// What is open while something else is being opened.
    before: Option<Opening>,
    /// How many have been opened.
    openings: u64,
    frame_times: Arc<[FrameTime]>,
    frames: Frames,
    failed: BTreeSet<usize>,
    playback: Playback,

    /// Settings A and B, as scenes.
    scenes: [Scene; 2],
    edited: usize,
    compare: Compare,
    wipe: f32,
    sides: [Side; 2],
    camera: Camera,
    path: CameraPath,
    follow: bool,
    path_seconds: f64,

    dragging: bool,
    view: View,
    view_before: View,
    refine: bool,
    resolution: AdaptiveResolution,
    subject: Option<Subject>,
    changed: Instant,
    asked: u64,
    asked_level: Level,
    answered: u64,
    /// The picture that was last asked for could not be drawn.
    undrawn: bool,
    /// No picture has come from the device yet: the first takes longer.
    fresh_device: bool,
    viewport_size: UVec2,

    truth: Option<Arc<Truth>>,
    /// How many have been asked for; what is another's is not taken.
    traces: u64,
    tracing: bool,
    measuring: bool,
    points: Vec<truth::Point>,
    history: times::History,

    tab: Tab,
    panels: bool,
    help: bool,
    dialog: Option<Dialog>,
    browsing: bool,
    dark: bool,
    ticked: Instant,
}

impl Drop for Viewer {
    /// Waits for the files that are being written and for particles on the device; the thread that
    /// draws waits for its own.
    fn drop(&mut self) {
        self.classifier.close();
        for writer in self.writers.drain(..) {
            // It has panicked: there is nobody left to tell.
            let _ = writer.join();
        }
    }
}

impl Viewer {
    /// Ready to be shown; opens what the options name.
    ///
    /// # Errors
    /// [`limpid_io::Error::Io`] if the log cannot be written.
    pub fn new(options: Options) -> Result<Self> {
        Self::with_devices(options, limpid_io::device::open)
    }

    /// As [`Viewer::new`], drawing with devices that `open` opens: one at the first picture, and
    /// another whenever one is lost.
    ///
    /// # Errors
    /// As [`Viewer::new`].
    pub fn with_devices(
        options: Options,
        open: impl FnMut() -> Result<Gpu> + Send + 'static,
    ) -> Result<Self> {
        let (sender, news) = mpsc::channel();
        let post = Post::new(sender);
        let classifier = SharedClassifier::default();
        let open = {
            let (mut open, classifier) = (open, classifier.clone());
            move || {
                // Whoever waits for a device must hear that there is none, even of a defect.
                let opened = catch_unwind(AssertUnwindSafe(&mut open));
                classifier.set(opened.as_ref().ok().and_then(|opened| opened.as_ref().ok()));
                opened.unwrap_or_else(|defect| resume_unwind(defect))
            }
        };
        let drawing = {
            let post = post.clone();
            DrawThread::new(open, move |answer| post.send(Message::Drawing(answer)))
        };
        let nothing = Scene::around(-glam::DVec3::ONE, glam::DVec3::ONE, 0.0);
        let camera = Camera::fit(-glam::DVec3::ONE, glam::DVec3::ONE);
        let now = Instant::now();
        let mut viewer = Self {
            log: Log::new(options.log.as_deref())?,
            frames: Frames::new(options.memory, classifier.clone()),
            post,
            news,
            notices: Vec::new(),
            drawing,
            classifier,
            device_asked: false,
            writers: Vec::new(),
            adapter: None,
            document: None,
            opening: None,
            before: None,
            openings: 0,
            frame_times: Arc::default(),
            failed: BTreeSet::new(),
            playback: Playback::new(0, 30.0),
            scenes: [nothing.clone(), nothing],
            edited: 0,
            compare: Compare::Off,
            wipe: 0.5,
            sides: Default::default(),
            camera,
            path: CameraPath::default(),
            follow: false,
            path_seconds: 0.0,
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
            truth: None,
            traces: 0,
            tracing: false,
            measuring: false,
            points: Vec::new(),
            history: times::History::default(),
            tab: Tab::Settings,
            panels: true,
            help: false,
            dialog: None,
            browsing: false,
            dark: true,
            ticked: now,
            options,
        };
        viewer.log.event("start", json!({}));
        if let Some(source) = viewer.options.source.clone() {
            viewer.open(source);
        }
        Ok(viewer)
    }

    /// A frame of the interface.
    pub fn ui(&mut self, ui: &mut egui::Ui) {
        let begun = Instant::now();
        let ctx = ui.ctx().clone();
        if self.post.enter(&ctx) {
            style::apply(&ctx);
            ctx.set_theme(if self.dark { egui::Theme::Dark } else { egui::Theme::Light });
        }
        self.take_news();
        self.take_files(&ctx);
        self.take_keys(&ctx);
        self.play(&ctx);

        let open = self.document.is_some();
        self.toolbar(ui);
        self.timeline(ui);
        self.notice_line(ui);
        if self.panels && open {
            self.side_panel(ui);
        }
        self.stage(ui);
        self.help_window(&ctx);
        self.show_dialog(&ctx);

        self.load();
        self.ask(&ctx);
        self.compare_with_truth();
        let again = ctx.has_requested_repaint();
        self.log.worked(begun, again);
    }

    /// Ready for another window, where nothing has been drawn yet; the last one failed for a `reason`.
    fn moved(&mut self, reason: &str) {
        self.post.leave();
        for side in &mut self.sides {
            side.picture = Default::default();
        }
        self.subject = None;
        self.lose(reason);
    }

    pub(crate) fn opened(&mut self, document: Document) {
        self.log.event(
            "opened",
            json!({ "input": document.source.input, "frames": document.numbers.len() }),
        );
        let document = Arc::new(document);
        self.frames.clear();
        self.failed.clear();
        self.frame_times = document.frame_times(Speed::Real).into();
        let looped = self.playback.looped;
        self.playback = Playback::new(self.frame_times.len(), document.fps());
        self.playback.looped = looped;
        if let Some(named) = document.input.frame
            && let Some(at) = self.frame_times.iter().position(|moment| moment.frame == named)
        {
            self.playback.seek(at);
        }
        self.scenes = [document.project.scene.clone(), document.project.scene.clone()];
        self.frames.processor = document.project.processor;
        self.edited = 0;
        for side in std::mem::take(&mut self.sides) {
            let_go(side.loaded);
        }
        self.camera = document.project.camera_for(Default::default());
        self.path = CameraPath::default();
        self.follow = false;
        self.subject = None;
        self.truth = None;
        self.traces += 1;
        self.tracing = false;
        self.points.clear();
        self.history = times::History::default();
        // A simulation is there to be seen moving.
        self.playback.playing = document.project.source.simulation().is_some();
        self.document = Some(document);
    }

    /// Lets time pass.
    fn play(&mut self, ctx: &egui::Context) {
        let now = Instant::now();
        let passed = now.duration_since(std::mem::replace(&mut self.ticked, now)).as_secs_f64();
        if !self.playback.playing {
            return;
        }
        let mut openings = [&self.opening, &self.before].into_iter().flatten();
        let growing = openings
            .any(|opening| opening.progress.is_some() || opening.growing || opening.pending);
        if self.playback.count() > 1 {
            let (frames, caught_up) = (&self.frames, self.is_caught_up());
            self.playback.advance(passed, |i| caught_up && frames.have(i));
            // If it waits for a frame, the news of that wakes it.
            ctx.request_repaint_after(self.playback.remaining());
        } else if self.follow {
            let length = self.path.duration().max(f64::MIN_POSITIVE);
            self.path_seconds = (self.path_seconds + passed) % length;
            ctx.request_repaint();
        } else if !growing {
            self.playback.playing = false;
        }
        if self.follow && !self.path.keys.is_empty() {
            self.camera = self.path.at(self.seconds());
        }
    }

    /// The present moment.
    fn moment(&self) -> Option<FrameTime> {
        self.frame_times.get(self.playback.index()).copied()
    }

    /// Its time, s.
    fn seconds(&self) -> f64 {
        match (&self.document, self.moment()) {
            (Some(document), Some(at)) if self.playback.count() > 1 => document.seconds(at),
            _ => self.path_seconds,
        }
    }

    /// Size of the picture on the screen, pixels.
    pub fn picture_size(&self) -> UVec2 {
        self.viewport_size
    }

    /// What the notice line says, the newest last.
    pub fn notices(&self) -> &[Notice] {
        &self.notices
    }

    /// Settings A and B, with what surrounds them.
    pub fn scenes(&self) -> &[Scene; 2] {
        &self.scenes
    }

    /// What is shown of a frame.
    pub fn view(&self) -> View {
        self.view
    }

    /// Where playback is.
    pub fn playback(&self) -> &Playback {
        &self.playback
    }
}
