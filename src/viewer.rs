//! The window of `limpid view`: look at liquid, tune it, save what is seen.
//!
//! Four kinds of threads. The interface's own never waits: it says what it wants and shows what has
//! come. One thread draws ([`draw_thread`]), with the code that `limpid render` runs. The workers of
//! a [`crate::ring::Ring`] read and classify frames ahead. What else takes time (opening, simulating,
//! dialogs, ground truth) has a thread while it lasts. All of them report to the interface, and a
//! report wakes it; nothing else does but input and playback.
//!
//! [`Viewer::ui`] is a frame of the interface on one page.

mod baking;
pub mod camera_panel;
pub mod command_line;
pub mod controls;
pub mod dialogs;
pub mod document;
pub mod draw_thread;
pub mod frames;
pub mod log;
pub mod pace;
pub mod playback;
pub mod rig;
mod settings_panel;
pub mod shortcuts;
mod signs;
mod stage;
mod style;
mod timeline;
mod times;
mod toolbar;
pub mod truth;
pub mod views;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock, mpsc};
use std::time::{Duration, Instant};

use eframe::egui;
use glam::UVec2;
use serde_json::json;

use crate::camera::Camera;
use crate::camera_path::CameraPath;
use crate::error::{Error, Result};
use crate::input::{Loaded, Moment};
use crate::scene::Scene;
use crate::sim::Progress;

use baking::Opening;
use dialogs::Dialog;
use document::{Document, Source};
use draw_thread::{Answer, DrawThread, Job, Pane, Request};
use frames::Frames;
use log::Log;
use pace::{Level, Pace};
use playback::{Playback, Speed};
use shortcuts::Action;
use stage::Picture;
use truth::Truth;
use views::View;

/// Rays per pixel of a picture at rest.
pub const FINE_SAMPLES: u32 = 4;

/// Most rays per pixel with an edge while things move.
const DRAFT_EDGE_SAMPLES: u32 = 4;

/// So long after the last change a picture is at rest.
const REST: Duration = Duration::from_millis(150);

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

/// What threads report to the interface.
enum News {
    Opened(u64, Box<Result<Document>>),
    Baked(u64, Progress),
    NotBaked(u64, Error),
    Grown(u64, Box<Result<Document>>),
    Drawing(Answer),
    Loaded,
    Chosen(Option<PathBuf>, Duration),
    Traced(Box<Result<Truth>>),
}

/// The way to the interface, for threads.
#[derive(Clone)]
struct Post {
    news: mpsc::Sender<News>,
    // Known from the first frame of the interface on, which looks for news anyway.
    context: Arc<OnceLock<egui::Context>>,
}

impl Post {
    fn send(&self, news: News) {
        // Once the viewer is gone nobody wants to know.
        if self.news.send(news).is_ok()
            && let Some(context) = self.context.get()
        {
            context.request_repaint();
        }
    }
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

/// What one of the two settings draws.
#[derive(Debug, Default)]
struct Side {
    loaded: Option<Arc<Loaded>>,
    /// The moment that was last taken from a ring, loaded or failed.
    at: Option<usize>,
    picture: Picture,
}

/// What the picture that was last asked for depends on, its level apart.
#[derive(Debug, Clone, PartialEq)]
struct Subject {
    scenes: Vec<Scene>,
    /// Which particles: their addresses, for each load has its own.
    loaded: Vec<usize>,
    camera: Camera,
    sizes: Vec<UVec2>,
    view: View,
    refine: bool,
}

/// The application.
pub struct Viewer {
    options: Options,
    post: Post,
    news: mpsc::Receiver<News>,
    log: Log,
    notices: Vec<Notice>,
    drawing: DrawThread,
    adapter: Option<String>,

    document: Option<Arc<Document>>,
    opening: Option<Opening>,
    moments: Arc<[Moment]>,
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
    pace: Pace,
    subject: Option<Subject>,
    changed: Instant,
    asked: u64,
    asked_level: Level,
    answered: u64,
    stage_size: UVec2,

    truth: Option<Truth>,
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

impl Viewer {
    /// Ready to be shown; opens what the options name.
    ///
    /// # Errors
    /// [`Error::Io`] if the log cannot be written.
    pub fn new(options: Options) -> Result<Self> {
        let (sender, news) = mpsc::channel();
        let post = Post { news: sender, context: Arc::default() };
        let drawing = {
            let post = post.clone();
            DrawThread::new(move |answer| post.send(News::Drawing(answer)))
        };
        let nothing = Scene::around(-glam::DVec3::ONE, glam::DVec3::ONE, 0.0);
        let camera = nothing.camera_for(Default::default());
        let now = Instant::now();
        let mut viewer = Self {
            log: Log::new(options.log.as_deref())?,
            frames: Frames::new(options.memory),
            post,
            news,
            notices: Vec::new(),
            drawing,
            adapter: None,
            document: None,
            opening: None,
            moments: Arc::default(),
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
            view_before: View::Image(crate::aov::Aov::Depth, 0),
            refine: true,
            pace: Pace::default(),
            subject: None,
            changed: now,
            asked: 0,
            asked_level: Level::Draft,
            answered: 0,
            stage_size: UVec2::ZERO,
            truth: None,
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
        if self.post.context.set(ctx.clone()).is_ok() {
            style::apply(&ctx);
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

    fn opened(&mut self, document: Document) {
        self.log.event(
            "opened",
            json!({ "input": document.source.input, "frames": document.numbers.len() }),
        );
        let document = Arc::new(document);
        self.frames.clear();
        self.failed.clear();
        self.moments = document.moments(Speed::Real).into();
        let looped = self.playback.looped;
        self.playback = Playback::new(self.moments.len(), document.fps());
        self.playback.looped = looped;
        if let Some(named) = document.input.frame
            && let Some(at) = self.moments.iter().position(|moment| moment.frame == named)
        {
            self.playback.seek(at);
        }
        self.scenes = [document.scene.clone(), document.scene.clone()];
        self.edited = 0;
        self.sides = Default::default();
        self.camera = document.scene.camera_for(Default::default());
        self.path = CameraPath::default();
        self.follow = false;
        self.subject = None;
        self.truth = None;
        self.points.clear();
        self.history = times::History::default();
        // A simulation is there to be seen moving.
        self.playback.playing = document.plain.simulation.is_some();
        self.document = Some(document);
    }

    fn take_news(&mut self) {
        while let Ok(news) = self.news.try_recv() {
            match news {
                News::Opened(number, document) => {
                    if let Some(opening) = self.opening.as_mut().filter(|o| o.number == number) {
                        opening.pending = false;
                        match *document {
                            Ok(document) => self.opened(document),
                            Err(error) => self.fail(&error),
                        }
                    }
                }
                News::Drawing(answer) => self.take_answer(answer),
                News::Baked(number, progress) => self.take_progress(number, progress),
                News::NotBaked(number, error) => {
                    if let Some(opening) = self.opening.as_mut().filter(|o| o.number == number) {
                        opening.progress = None;
                        self.fail(&error);
                    }
                }
                News::Grown(number, document) => match *document {
                    Ok(document) => self.take_grown(number, document),
                    Err(error) => self.fail(&error),
                },
                // The ring is asked in each frame anyway.
                News::Loaded => {}
                News::Chosen(path, waited) => self.chosen(path, waited),
                News::Traced(truth) => {
                    self.tracing = false;
                    match *truth {
                        Ok(truth) => self.truth = Some(truth),
                        Err(error) => self.fail(&error),
                    }
                }
            }
        }
    }

    fn take_answer(&mut self, answer: Answer) {
        match answer {
            Answer::Adapter(name) => {
                self.log.event("adapter", json!({ "name": name }));
                self.adapter = Some(name);
            }
            Answer::Drawn(Ok(drawn)) => self.show(drawn),
            Answer::Drawn(Err(error)) => {
                // Not again until something changes.
                self.answered = self.asked;
                self.fail(&error);
            }
            Answer::Saved(Ok(path)) => {
                self.log.event("saved", json!({ "path": path }));
                self.say(format!("saved {}", path.display()));
            }
            Answer::Saved(Err(error)) => self.fail(&error),
            Answer::Measured(measured) => {
                self.measuring = false;
                match measured {
                    Ok(measured) => self.take_measure(*measured),
                    Err(error) => self.fail(&error),
                }
            }
        }
    }

    /// Files that were dropped on the window.
    fn take_files(&mut self, ctx: &egui::Context) {
        let dropped = ctx.input(|input| input.raw.dropped_files.clone());
        if let Some(file) = dropped.first() {
            self.open(Source::new(file.path().to_string_lossy()));
        }
    }

    fn take_keys(&mut self, ctx: &egui::Context) {
        // Somebody may be typing a number or a path.
        if self.dialog.is_some() || ctx.text_edit_focused() {
            return;
        }
        let pressed = ctx.input(|input| {
            let flying = input.pointer.secondary_down();
            let keys = input.events.iter().filter_map(|event| match event {
                egui::Event::Key { key, pressed: true, modifiers, .. } => {
                    shortcuts::action(*key, *modifiers)
                }
                _ => None,
            });
            // W, A, S, D, Q and E fly then.
            if flying { Vec::new() } else { keys.collect::<Vec<_>>() }
        });
        for action in pressed {
            self.act(ctx, action);
        }
    }

    /// Does what a key, a button or a menu asks for.
    fn act(&mut self, ctx: &egui::Context, action: Action) {
        match action {
            Action::Open => self.dialog = Some(Dialog::open()),
            Action::Help => self.help = !self.help,
            Action::Close => {
                self.help = false;
                self.notices.clear();
            }
            Action::Quit => ctx.send_viewport_cmd(egui::ViewportCommand::Close),
            Action::Theme => {
                self.dark = !self.dark;
                ctx.set_theme(if self.dark { egui::Theme::Dark } else { egui::Theme::Light });
            }
            Action::Panels => self.panels = !self.panels,
            _ if self.document.is_none() => {}
            Action::Play => self.toggle_play(),
            Action::Reverse => self.playback.backwards = !self.playback.backwards,
            Action::Next => self.playback.step_by(true),
            Action::Previous => self.playback.step_by(false),
            Action::First => self.seek(0),
            Action::Last => self.seek(self.playback.count().saturating_sub(1)),
            Action::Loop => self.playback.looped = !self.playback.looped,
            Action::Faster => self.set_speed(self.playback.speed().next(true)),
            Action::Slower => self.set_speed(self.playback.speed().next(false)),
            Action::Fit => self.fit(),
            Action::Home => self.home(),
            Action::AddKey => self.add_key(),
            Action::NextView => {
                let all: Vec<View> = View::all().collect();
                let at = all.iter().position(|view| view.aov() == self.view.aov());
                self.set_view(all[(at.unwrap_or(0) + 1) % all.len()]);
            }
            Action::Picture => self.set_view(match self.view {
                View::Picture => self.view_before,
                View::Image(..) => View::Picture,
            }),
            Action::Compare => {
                let at = Compare::ALL.iter().position(|&c| c == self.compare).unwrap_or(0);
                self.compare = Compare::ALL[(at + 1) % Compare::ALL.len()];
            }
            Action::Swap => self.edited = 1 - self.edited,
            Action::SavePicture => self.dialog = self.save_picture_dialog(),
            Action::SaveScene => self.dialog = self.save_scene_dialog(),
            Action::Copy => {
                if let Some(command) = self.command_line("limpid.png") {
                    ctx.copy_text(command.clone());
                    self.say(format!("copied: {command}"));
                }
            }
        }
    }

    fn toggle_play(&mut self) {
        self.playback.playing = !self.playback.playing;
        self.log.event(if self.playback.playing { "play" } else { "pause" }, json!({}));
    }

    fn seek(&mut self, index: usize) {
        if index != self.playback.index() {
            self.playback.seek(index);
            self.log.event("seek", json!({ "index": index }));
        }
    }

    fn set_speed(&mut self, speed: Speed) {
        let Some(document) = &self.document else { return };
        self.moments = document.moments(speed).into();
        for side in &mut self.sides {
            side.at = None;
        }
        self.playback.set_speed(speed, self.moments.len());
        self.failed.clear();
    }

    fn set_view(&mut self, view: View) {
        if self.view != View::Picture {
            self.view_before = self.view;
        }
        if self.view != view {
            self.log.event("view", json!({ "view": view.label() }));
        }
        self.view = view;
    }

    fn set_camera(&mut self, camera: Camera) {
        // A camera that sees nothing is not gone to.
        if camera != self.camera && camera.check().is_ok() {
            self.camera = camera;
            self.follow = false;
        }
    }

    /// Lets time pass.
    fn play(&mut self, ctx: &egui::Context) {
        let now = Instant::now();
        let passed = now.duration_since(std::mem::replace(&mut self.ticked, now)).as_secs_f64();
        if !self.playback.playing {
            return;
        }
        let growing = self.opening.as_ref().is_some_and(|opening| opening.progress.is_some());
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
    fn moment(&self) -> Option<Moment> {
        self.moments.get(self.playback.index()).copied()
    }

    /// Its time, s.
    fn seconds(&self) -> f64 {
        match (&self.document, self.moment()) {
            (Some(document), Some(at)) if self.playback.count() > 1 => document.seconds(at),
            _ => self.path_seconds,
        }
    }

    /// The settings that are on the screen.
    fn visible(&self) -> Vec<usize> {
        if self.compare == Compare::Off { vec![self.edited] } else { vec![0, 1] }
    }

    /// Whether what is shown is the moment that playback is at.
    fn is_caught_up(&self) -> bool {
        let index = Some(self.playback.index());
        let taken = self.visible().into_iter().all(|i| self.sides[i].at == index);
        taken && self.answered == self.asked
    }

    /// Takes the present moment from the rings, and says what is wanted next.
    fn load(&mut self) {
        let Some(document) = &self.document else { return };
        let visible = self.visible();
        let scenes: Vec<&Scene> = visible.iter().map(|&i| &self.scenes[i]).collect();
        let index = self.playback.index();
        let dragging =
            self.post.context.get().is_some_and(|ctx| ctx.input(|input| input.pointer.any_down()));
        let post = self.post.clone();
        let step = self.playback.speed().step();
        self.frames.prepare(document, &self.moments, step, &scenes, (index, dragging), move || {
            post.send(News::Loaded);
        });
        self.frames.aim(index, self.playback.step(), self.playback.looped);
        for side in visible {
            match self.frames.get(&self.scenes[side], index) {
                Some(Ok(loaded)) => {
                    self.sides[side].loaded = Some(loaded);
                    self.sides[side].at = Some(index);
                }
                Some(Err(error)) => {
                    // Told once; playback goes on.
                    self.sides[side].at = Some(index);
                    if self.failed.insert(index) {
                        self.fail(&error);
                    }
                }
                None => {}
            }
        }
    }

    /// Asks for the picture that should be seen, if it has not been asked for.
    fn ask(&mut self, ctx: &egui::Context) {
        let visible = self.visible();
        let loaded: Option<Vec<Arc<Loaded>>> =
            visible.iter().map(|&i| self.sides[i].loaded.clone()).collect();
        let full = self.full_size();
        // Nothing to draw, or nowhere: a minimised window.
        let Some(loaded) = loaded.filter(|_| full.min_element() > 0) else { return };
        let subject = Subject {
            scenes: visible.iter().map(|&i| self.scenes[i].clone()).collect(),
            loaded: loaded.iter().map(|loaded| Arc::as_ptr(loaded) as usize).collect(),
            camera: self.camera,
            sizes: vec![full; visible.len()],
            view: self.view,
            refine: self.refine,
        };
        let now = Instant::now();
        let changed = self.subject.as_ref() != Some(&subject);
        let level = if changed {
            self.changed = now;
            Level::Draft
        } else if self.answered < self.asked {
            // One thing after the other.
            return;
        } else if self.playback.playing || self.dragging || now.duration_since(self.changed) < REST
        {
            // Playback and the pointer wake the interface themselves.
            let rest = REST.saturating_sub(now.duration_since(self.changed));
            if self.asked_level < Level::Fine && !rest.is_zero() {
                ctx.request_repaint_after(rest);
            }
            return;
        } else {
            match self.asked_level {
                Level::Draft => Level::Full,
                Level::Full => Level::Fine,
                Level::Fine => return,
            }
        };
        let samples = |scene: &Scene| match level {
            Level::Draft | Level::Full => 1,
            Level::Fine => self.fine_samples(scene),
        };
        let alike = visible.iter().all(|&i| self.fine_samples(&self.scenes[i]) == 1);
        if level == Level::Fine && alike && self.asked_level == Level::Full {
            self.asked_level = Level::Fine;
            return;
        }
        let size = if level == Level::Draft { self.pace.draft(full) } else { full };
        let panes = visible.iter().zip(loaded).map(|(&i, loaded)| {
            let mut scene = self.scenes[i].clone();
            scene.settings.refract.samples = samples(&scene);
            if level == Level::Draft {
                let edges = &mut scene.settings.refract.edge_samples;
                *edges = (*edges).min(DRAFT_EDGE_SAMPLES);
            }
            Pane { scene: Arc::new(scene), camera: self.camera, loaded, size }
        });
        let panes = panes.collect();
        self.asked += 1;
        self.asked_level = level;
        self.subject = Some(subject);
        self.drawing.request(Request { number: self.asked, panes, level, view: self.view });
    }

    /// Size of a picture on the screen, pixels.
    fn full_size(&self) -> UVec2 {
        match self.compare {
            Compare::SideBySide => UVec2::new(self.stage_size.x / 2, self.stage_size.y),
            _ => self.stage_size,
        }
    }

    /// Rays per pixel of a scene's picture at rest.
    fn fine_samples(&self, scene: &Scene) -> u32 {
        let own = scene.settings.refract.samples;
        if self.refine { own.max(FINE_SAMPLES) } else { own }
    }

    /// The scene that is edited, as its picture at rest is drawn.
    fn fine_scene(&self) -> Scene {
        let mut scene = self.scenes[self.edited].clone();
        scene.settings.refract.samples = self.fine_samples(&scene);
        scene
    }

    /// The command that draws the picture at rest without a window; none if nothing is open.
    pub fn command_line(&self, output: &str) -> Option<String> {
        let document = self.document.as_ref()?;
        let (scene, at) = (self.fine_scene(), self.moment()?);
        let size = self.stage_size.max(UVec2::ONE);
        Some(command_line::command_line(document, &scene, &self.camera, at, size, output))
    }

    /// Draws the picture at rest in `size` pixels and writes it as PNG, as soon as it can.
    pub fn save_picture(&mut self, path: PathBuf, size: UVec2, samples: u32) {
        let side = &self.sides[self.edited];
        let Some(loaded) = side.loaded.clone() else { return };
        let mut scene = self.fine_scene();
        scene.settings.refract.samples = samples;
        let pane = Pane { scene: Arc::new(scene), camera: self.camera, loaded, size };
        self.drawing.job(Job::Save(pane, path));
    }

    /// Writes the scene that is edited, seen as it is seen now.
    ///
    /// # Errors
    /// As [`Scene::save`].
    pub fn save_scene(&self, path: &std::path::Path) -> Result<()> {
        let nothing = || Error::Usage("nothing is open".into());
        let document = self.document.as_ref().ok_or_else(nothing)?;
        let mut scene = document.saved(&self.fine_scene(), self.moment().ok_or_else(nothing)?);
        scene.camera = Some(self.camera);
        scene.save(path)
    }

    fn fit(&mut self) {
        if let Some(loaded) = &self.sides[self.edited].loaded {
            let aspect = self.stage_size.as_dvec2();
            let aspect = if aspect.min_element() > 0.0 { aspect.x / aspect.y } else { 1.0 };
            let radius = f64::from(loaded.splats.radius);
            let (min, max) = loaded.bounds;
            let camera = rig::fit(&self.camera, (min - radius, max + radius), aspect);
            self.set_camera(camera);
        }
    }

    fn home(&mut self) {
        if let Some(document) = &self.document {
            let camera = document.scene.camera_for(Default::default());
            self.set_camera(camera);
        }
    }

    fn fail(&mut self, error: &Error) {
        let text = error.to_string();
        self.log.event("notice", json!({ "text": text }));
        self.notices.push(Notice { text, error: true, since: Instant::now() });
    }

    fn say(&mut self, text: String) {
        self.log.event("said", json!({ "text": text }));
        self.notices.push(Notice { text, error: false, since: Instant::now() });
    }

    /// Size of the picture on the screen, pixels.
    pub fn picture_size(&self) -> UVec2 {
        self.stage_size
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

    /// Whether the picture at rest is on the screen.
    pub fn is_at_rest(&self) -> bool {
        self.document.is_some()
            && self.opening.as_ref().is_none_or(|opening| !opening.pending)
            && self.asked_level == Level::Fine
            && self.answered == self.asked
            && self.asked > 0
            && !self.playback.playing
    }
}

impl eframe::App for Viewer {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        Self::ui(self, ui);
    }

    fn on_exit(&mut self) {
        self.log.close();
    }
}

/// Shows the window until it is closed.
///
/// # Errors
/// [`Error::Io`] if the log cannot be written, [`Error::Window`] if there is no window system.
pub fn run(options: Options) -> Result<()> {
    let window = options.window.as_vec2();
    let viewer = Viewer::new(options)?;
    let native = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("limpid")
            .with_app_id("limpid")
            .with_inner_size([window.x, window.y])
            .with_min_inner_size([480.0, 320.0])
            .with_drag_and_drop(true)
            .with_icon(egui::IconData::default()),
        persist_window: false,
        ..Default::default()
    };
    eframe::run_native("limpid", native, Box::new(|_| Ok(Box::new(viewer))))
        .map_err(|e| Error::Window(e.to_string()))
}
