//! The page's side: the viewer, and the worker that it asks.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::{Rc, Weak as RcWeak};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak, mpsc};

use eframe::egui;
use glam::UVec2;
use js_sys::{Array, Function, Object, Uint8Array};
use limpid::camera::Camera;
use limpid::scene::Scene;
use limpid_io::bake::Progress;
use limpid_io::error::Error;
use limpid_io::input::{FrameTime, Loaded};
use limpid_io::shared_classifier::Processor;
use serde_json::json;
use wasm_bindgen::prelude::Closure;
use wasm_bindgen::{JsCast as _, JsValue};
use web_sys::{ErrorEvent, File, MessageEvent};
use web_time::{Duration, Instant};

use super::frame_cache::{FrameCache, Mirror};
use super::link;
use super::wire::{Ask, Edits, PaneText, Tell, drawn, get, packed, set, told, unpacked, view_text};
use crate::document::{Document, Source};
use crate::drawing::{Answer, Pane, Request};
use crate::frames::Frames;
use crate::log::Log;
use crate::messages::{Message, Post};
use crate::state::Jobs;
use crate::views::View;
use crate::{Options, Viewer, demos};

/// Number of workers in quick succession before the last one stays away.
const ATTEMPTS: usize = 3;

/// A worker that lived longer resets the attempts.
const STEADY: Duration = Duration::from_secs(20);

/// The worker of a page, as a handle.
#[derive(Clone)]
pub(crate) struct Worker(Rc<Link>);

impl std::fmt::Debug for Worker {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Worker")
    }
}

struct Link {
    /// The functions of the page: see [`PageOptions::host`].
    host: JsValue,
    worker: RefCell<Option<web_sys::Worker>>,
    /// When it was started, and how many more may follow it.
    started: Cell<(Instant, usize)>,
    post: Post,
    /// Files that the worker has been given.
    given: RefCell<Vec<(String, File)>>,
    caches: RefCell<BTreeMap<u64, RcWeak<RefCell<Mirror>>>>,
    next_cache: Cell<u64>,
    /// The worker's numbers of frames, by their outlines.
    frames: RefCell<Vec<(Weak<Loaded>, u64)>>,
    /// Whether openings have been dropped.
    openings: RefCell<BTreeMap<u64, Arc<AtomicBool>>>,
}

impl Worker {
    fn new(host: JsValue, post: Post) -> Self {
        let link = Rc::new(Link {
            host,
            worker: RefCell::default(),
            started: Cell::new((Instant::now(), ATTEMPTS)),
            post,
            given: RefCell::default(),
            caches: RefCell::default(),
            next_cache: Cell::new(0),
            frames: RefCell::default(),
            openings: RefCell::default(),
        });
        let worker = Self(link);
        worker.start();
        worker
    }

    /// Calls a function of the page.
    fn call(&self, name: &str, arguments: &[JsValue]) -> Option<JsValue> {
        let function: Function = get(&self.0.host, name)?.dyn_into().ok()?;
        let arguments: Array = arguments.iter().collect();
        function.apply(&self.0.host, &arguments).ok()
    }

    fn start(&self) {
        let Some(worker) = self.call("worker", &[]) else { return };
        let worker: web_sys::Worker = worker.unchecked_into();
        let link = self.clone();
        let receive = Closure::<dyn FnMut(MessageEvent)>::new(move |event: MessageEvent| {
            link.receive(&event.data());
        });
        worker.set_onmessage(Some(receive.as_ref().unchecked_ref()));
        // Workers are few, and live as long as the page.
        receive.forget();
        let link = self.clone();
        let fail = Closure::<dyn FnMut(ErrorEvent)>::new(move |event: ErrorEvent| {
            link.0.post.send(Message::Crashed(event.message()));
        });
        worker.set_onerror(Some(fail.as_ref().unchecked_ref()));
        fail.forget();
        *self.0.worker.borrow_mut() = Some(worker);
        for (path, file) in self.0.given.borrow().iter() {
            self.send_file(path, file);
        }
    }

    pub(super) fn ask(&self, ask: &Ask) {
        if let Some(worker) = &*self.0.worker.borrow() {
            let (message, transfer) = packed(ask, Vec::new());
            // Fails for a worker that has ended, which is reported by itself.
            let _ = worker.post_message_with_transfer(&message, &transfer);
        }
    }

    fn give(&self, path: &str, file: &File) {
        self.send_file(path, file);
        self.0.given.borrow_mut().push((path.to_owned(), file.clone()));
    }

    fn send_file(&self, path: &str, file: &File) {
        let message = Object::new();
        set(&message, "path", &path.into());
        set(&message, "file", file);
        if let Some(worker) = &*self.0.worker.borrow() {
            let _ = worker.post_message(&message);
        }
    }

    fn receive(&self, data: &JsValue) {
        let Some((message, buffers)) = unpacked::<Tell>(data) else { return };
        let send = |message| self.0.post.send(message);
        match message {
            Tell::Ready => {}
            Tell::Opened { number, document } => {
                let document = told(document).map(|document| document.outline());
                send(Message::Opened(number, Box::new(document)));
            }
            Tell::Grown { number, document } => {
                let document = told(document).map(|document| document.outline());
                send(Message::Grown(number, Box::new(document)));
            }
            Tell::Baked { number, done, frames } => {
                send(Message::Baked(number, Progress { done, frames }));
            }
            Tell::NotBaked { number, error } => {
                send(Message::NotBaked(number, Error::Usage(error)));
            }
            Tell::Adapter(name) => send(Message::Drawing(Answer::Adapter(name))),
            Tell::Lost(reason) => send(Message::Drawing(Answer::Lost(reason))),
            Tell::Drawn { number, level, panes } => {
                let drawn = drawn(number, level, panes, buffers);
                send(Message::Drawing(Answer::Drawn(drawn)));
            }
            Tell::NotDrawn { number, error } => {
                send(Message::Drawing(Answer::NotDrawn(number, Error::Usage(error))));
            }
            Tell::Loaded { id, i, outcome } => {
                let outcome = outcome.map(|text| {
                    let loaded = Arc::new(text.outline());
                    let mut frames = self.0.frames.borrow_mut();
                    frames.retain(|(known, _)| known.strong_count() > 0);
                    frames.push((Arc::downgrade(&loaded), text.frame));
                    loaded
                });
                if let Some(mirror) = self.mirror(id) {
                    mirror.borrow_mut().loaded(i, outcome);
                }
            }
            Tell::Cached { id, state } => {
                if let Some(mirror) = self.mirror(id) {
                    mirror.borrow_mut().cached(state);
                }
            }
            Tell::Saved(name) => {
                let bytes = buffers.into_iter().next().unwrap_or_default();
                self.download(&name, &bytes);
                send(Message::Saved(Ok(name.into())));
            }
            Tell::NotSaved(error) => send(Message::Saved(Err(Error::Usage(error)))),
            Tell::Said(text) => send(Message::Said(text)),
            Tell::Panicked(reason) => send(Message::Crashed(reason)),
        }
    }

    /// Has the page offer a file to the user.
    fn download(&self, name: &str, bytes: &[u8]) {
        self.call("save", &[name.into(), Uint8Array::from(bytes).into()]);
    }

    fn mirror(&self, id: u64) -> Option<Rc<RefCell<Mirror>>> {
        self.0.caches.borrow().get(&id)?.upgrade()
    }

    /// Opens a source, until `stop` is set.
    pub(crate) fn open(&self, number: u64, source: &Source, stop: Arc<AtomicBool>) {
        // After too many failures the worker stayed away.
        if self.0.worker.borrow().is_none() {
            self.0.started.set((Instant::now(), ATTEMPTS));
            self.start();
        }
        self.0.openings.borrow_mut().insert(number, stop);
        self.ask(&Ask::Open { number, source: source.clone() });
    }

    /// Opens the source of an opening again.
    pub(crate) fn grow(&self, number: u64) {
        self.ask(&Ask::Grow { number });
    }

    /// Ends the simulations of openings that have been dropped.
    pub(crate) fn stop_dropped(&self) {
        self.0.openings.borrow_mut().retain(|&number, stop| {
            let stopped = stop.load(Ordering::Relaxed);
            if stopped {
                self.ask(&Ask::Stop { number });
            }
            !stopped
        });
    }

    /// A cache of frames for the worker's current document.
    pub(crate) fn cache(
        &self,
        frame_times: &[FrameTime],
        scene: &Scene,
        processor: Processor,
        budget: u64,
        ready: impl Fn() + 'static,
    ) -> FrameCache {
        let id = self.0.next_cache.get();
        self.0.next_cache.set(id + 1);
        let cache = FrameCache::new(id, self.clone(), ready);
        self.0.caches.borrow_mut().insert(id, Rc::downgrade(cache.mirror()));
        let (frame_times, edits) = (frame_times.to_vec(), Edits::of(scene));
        self.ask(&Ask::Cache { id, frame_times, edits, processor, budget });
        cache
    }

    fn pane(&self, pane: &Pane) -> Option<PaneText> {
        let frames = self.0.frames.borrow();
        let known =
            |(loaded, _): &&(Weak<Loaded>, u64)| loaded.as_ptr() == Arc::as_ptr(&pane.loaded);
        let frame = frames.iter().find(known)?.1;
        Some(PaneText {
            edits: Edits::of(&pane.scene),
            camera: pane.camera,
            frame,
            size: pane.size,
        })
    }

    /// Requests pictures for the screen, in place of a request that has not begun.
    pub(crate) fn request(&self, request: Request) {
        let Request { number, panes, level, view } = request;
        let panes = panes.iter().filter_map(|pane| self.pane(pane)).collect();
        self.ask(&Ask::Draw { number, panes, level, view: view_text(view) });
    }

    /// Draws a picture and offers it to the user.
    pub(crate) fn save(&self, pane: Pane, path: PathBuf, _: Option<Arc<Document>>) {
        if let Some(pane) = self.pane(&pane) {
            self.ask(&Ask::Save { pane, name: path.to_string_lossy().into_owned() });
        }
    }
}

impl Viewer {
    /// Has the page show the browser's dialog for files, or for a folder.
    pub(crate) fn pick(&mut self, folder: bool) {
        self.jobs.drawing.call("pick", &[folder.into()]);
    }

    /// Offers the edited scene with the current camera to the user.
    pub fn save_scene(&mut self, path: PathBuf) {
        let Some(at) = self.frame_time() else { return };
        let (edits, camera) = (Edits::of(&self.fine_scene()), self.eye.camera);
        let (processor, name) = (self.opened.frames.processor, path.to_string_lossy().into_owned());
        self.jobs.drawing.ask(&Ask::SaveScene { edits, camera, at, processor, name });
    }

    /// Offers the camera path to the user.
    pub(crate) fn download_path(&mut self, path: &Path) {
        let saved = self.eye.path.to_toml().map(|text| {
            self.jobs.drawing.download(&path.to_string_lossy(), text.as_bytes());
            path.to_owned()
        });
        self.take_saved(saved);
    }

    /// Does what the address asks for, now that its source is open.
    pub(crate) fn grant_wishes(&mut self) {
        let wishes = std::mem::take(&mut self.wishes);
        if let Some(camera) = wishes.camera {
            self.set_camera(camera);
        }
        if let Some(frame) = wishes.frame
            && let Some(index) = self.opened.frame_times.iter().position(|at| at.frame == frame)
        {
            self.playback.seek(index);
        }
        if let Some(aov) = wishes.view {
            self.set_view(View::Image(aov, 0));
        }
        self.playback.playing |= wishes.play;
        self.picture.refine &= !wishes.unrefined;
    }

    /// Has the interface show what has changed from outside.
    fn wake(&self) {
        if let Some(ctx) = self.jobs.post.context() {
            ctx.request_repaint();
        }
    }

    /// Copies a link that opens this picture.
    pub(crate) fn copy_link(&mut self, ctx: &egui::Context) {
        let Some(query) = link::query(self) else {
            self.show_info("only files on a server can be linked to, these are yours alone".into());
            return;
        };
        let link = self.jobs.drawing.call("link", &[query.as_str().into()]);
        if let Some(link) = link.and_then(|link| link.as_string()) {
            ctx.copy_text(link.clone());
            self.show_info(format!("copied: {link}"));
        }
    }

    /// Starts another worker after the last one has ended, and opens the document again.
    pub(crate) fn restart_worker(&mut self, reason: &str) {
        let worker = self.jobs.drawing.clone();
        // A panic is told by itself, and then as an error.
        let Some(ended) = worker.0.worker.borrow_mut().take() else { return };
        ended.terminate();
        let (started, left) = worker.0.started.get();
        let left = if started.elapsed() > STEADY { ATTEMPTS } else { left };
        // Whatever was asked is not answered any more.
        self.opened.frames.clear();
        self.picture.answered = self.picture.asked;
        self.picture.subject = None;
        let opening = self.opened.opening.take();
        let failed = opening.as_ref().filter(|opening| opening.pending);
        match failed {
            // As a decoder that panics fails elsewhere.
            Some(opening) => {
                let problem = format!("{}: damaged: its decoder failed", opening.source.input);
                self.fail(&Error::Usage(problem));
            }
            None => self.fail(&Error::Usage(format!("the worker failed ({reason})"))),
        }
        if left == 0 {
            return;
        }
        worker.0.started.set((Instant::now(), left - 1));
        worker.start();
        let before = self.opened.document.as_ref().map(|document| document.source.clone());
        if let Some(source) = before {
            self.reopen(source);
        }
    }
}

/// The settings of a page.
pub struct PageOptions {
    /// The functions of the page: `worker()` starts a worker and returns it, `pick(folder)` shows the browser's
    /// dialog for files, `save(name, bytes)` offers a file to the user, and `link(query)` makes a link.
    pub host: JsValue,
    /// The parameters of the address: see [`link`].
    pub query: Vec<(String, String)>,
    /// Whether files of the user can be opened, and links copied: not in a picture within another page.
    pub plain: bool,
}

/// A viewer in a page.
#[derive(Clone)]
pub struct Page {
    viewer: Rc<RefCell<Viewer>>,
    worker: Worker,
    /// Number of drops and choices of files so far.
    drops: Rc<Cell<u32>>,
}

impl Page {
    /// Creates the viewer, starts its worker, and opens what the address names, or a demo.
    ///
    /// # Errors
    /// [`Error::Usage`] naming a parameter of the address and its problem; the viewer then shows the demo.
    pub fn new(options: PageOptions) -> Self {
        let (sender, messages) = mpsc::channel();
        let post = Post::new(sender);
        let worker = Worker::new(options.host, post.clone());
        let opened = link::parse(&options.query);
        let source = match &opened {
            Ok(link) => link.source.clone(),
            Err(_) => Source::new(demos::FIRST_SOURCE),
        };
        let viewer_options = Options {
            source: Some(source),
            memory: 512 << 20,
            flipbook: 256 << 20,
            ..Options::default()
        };
        let frames = Frames::new(viewer_options.memory, worker.clone());
        let log = Log::new(None).expect("without a file nothing can fail");
        let jobs = Jobs { post, messages, log, drawing: worker.clone(), adapter: None };
        let mut viewer = Viewer::of(viewer_options, jobs, frames);
        match opened {
            Ok(link) => viewer.wishes = link.wishes,
            Err(error) => viewer.fail(&error),
        }
        // A narrow screen is all picture.
        let width = web_sys::window().and_then(|window| window.inner_width().ok()?.as_f64());
        viewer.interface.panels = !options.plain && width.is_none_or(|width| width > 720.0);
        viewer.interface.plain = options.plain;
        Self { viewer: Rc::new(RefCell::new(viewer)), worker, drops: Rc::default() }
    }

    /// The application, for one canvas; after that has lost its context, for another one.
    pub fn app(&self) -> Box<dyn eframe::App> {
        Box::new(App { viewer: self.viewer.clone() })
    }

    /// Prepares for another canvas.
    pub fn leave(&self) {
        self.viewer.borrow_mut().reset_for_new_window("of the page: its canvas was lost");
    }

    /// Gives files of the user, with their paths in what was dropped or chosen, and opens them: the scene among
    /// them, the only file, or the folder.
    pub fn open_files(&self, files: &[(String, File)]) {
        let count = self.drops.get() + 1;
        self.drops.set(count);
        // Earlier files may still be open.
        let folder = if count == 1 { "files".to_owned() } else { format!("files{count}") };
        for (path, file) in files {
            self.worker.give(&format!("{folder}/{path}"), file);
        }
        let paths: Vec<&str> = files.iter().map(|(path, _)| path.as_str()).collect();
        if let Some(input) = opened_of(&paths) {
            let input = if input.is_empty() { folder } else { format!("{folder}/{input}") };
            self.open(&input);
        }
    }

    /// Opens a URL, or a path that has been given.
    pub fn open(&self, input: &str) {
        let mut viewer = self.viewer.borrow_mut();
        viewer.interface.dialog = None;
        viewer.open(Source::new(input));
        viewer.wake();
    }

    /// Opens what the parameters of an address name.
    ///
    /// # Errors
    /// As [`link::parse`].
    pub fn open_query(&self, query: &[(String, String)]) -> Result<(), Error> {
        let link = link::parse(query)?;
        let mut viewer = self.viewer.borrow_mut();
        viewer.wishes = link.wishes;
        viewer.open(link.source);
        viewer.wake();
        Ok(())
    }

    /// Changes settings of the open document, as `--set` does.
    ///
    /// # Errors
    /// As [`limpid_io::project::overrides::replaced`].
    pub fn set(&self, overrides: &[String]) -> Result<(), Error> {
        let mut viewer = self.viewer.borrow_mut();
        let edited = viewer.editing.edited;
        let settings = &viewer.editing.scenes[edited].settings;
        let replaced = limpid_io::project::overrides::replaced(settings, overrides)?;
        viewer.editing.scenes[edited].settings = replaced;
        viewer.wake();
        Ok(())
    }

    /// Sets the camera, written as for `--camera`.
    ///
    /// # Errors
    /// [`Error::Usage`] naming what is wrong.
    pub fn set_camera(&self, camera: &str) -> Result<(), Error> {
        let camera: Camera = camera.parse()?;
        let mut viewer = self.viewer.borrow_mut();
        viewer.set_camera(camera);
        viewer.wake();
        Ok(())
    }

    /// Plays or pauses.
    pub fn play(&self, playing: bool) {
        let mut viewer = self.viewer.borrow_mut();
        viewer.playback.playing = playing;
        viewer.wake();
    }

    /// Goes to the frame of an index, from 0.
    pub fn seek(&self, index: usize) {
        let mut viewer = self.viewer.borrow_mut();
        viewer.seek(index);
        viewer.wake();
    }

    /// Draws the picture at rest at another size, and saves it under a name.
    pub fn save(&self, name: &str, size: UVec2, samples: u32) {
        self.viewer.borrow_mut().save_picture(name.into(), size, samples);
    }

    /// The parameters of an address that opens this picture; `None` for files of the user.
    pub fn query(&self) -> Option<String> {
        link::query(&self.viewer.borrow())
    }

    /// Loses the worker's device, for tests: another one takes over.
    pub fn lose_device(&self) {
        self.worker.ask(&Ask::Lose);
        self.viewer.borrow().wake();
    }

    /// What the page shows, as JSON.
    pub fn status(&self) -> String {
        let viewer = self.viewer.borrow();
        let side = &viewer.editing.sides[viewer.editing.edited];
        let shown = side.picture.shown.as_ref();
        let opening = viewer.opened.opening.as_ref().filter(|opening| opening.pending);
        let status = json!({
            "adapter": viewer.jobs.adapter,
            "opening": opening.map(|opening| &opening.source.input),
            "open": viewer.opened.document.as_ref().map(|document| &document.source.input),
            "frame": viewer.frame_time().map(|at| at.frame),
            "index": viewer.playback.index(),
            "frames": viewer.playback.count(),
            "playing": viewer.playback.playing,
            "particles": side.loaded.as_ref().map(|loaded| loaded.particles),
            "atRest": viewer.is_at_rest(),
            "pictures": viewer.picture.answered,
            "size": viewer.picture.viewport_size.to_array(),
            "shown": shown.map(|facts| json!({
                "size": facts.size.to_array(), "samples": facts.samples, "ms": facts.ms,
            })),
            "passes": viewer.times.last().map(|(name, ms)| json!([name, ms])).collect::<Vec<_>>(),
            "eye": viewer.eye.camera.eye.to_array(),
            "view": viewer.picture.view.label(),
            "notices": viewer.notices().iter().map(|notice| {
                json!({ "text": notice.text, "error": notice.error })
            }).collect::<Vec<_>>(),
        });
        status.to_string()
    }
}

/// The application of one canvas.
struct App {
    viewer: Rc<RefCell<Viewer>>,
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        self.viewer.borrow_mut().ui(ui);
    }
}

/// What to open of files with these paths: the scene among them, the only file, or their folder.
fn opened_of(paths: &[&str]) -> Option<String> {
    let scenes = paths.iter().filter(|path| path.to_lowercase().ends_with(".toml"));
    if let Some(scene) = scenes.min_by_key(|path| (path.matches('/').count(), **path)) {
        return Some((*scene).to_owned());
    }
    match paths {
        [] => None,
        [only] => Some((*only).to_owned()),
        [first, ..] => Some(first.rsplit_once('/').map_or("", |(folder, _)| folder).to_owned()),
    }
}
