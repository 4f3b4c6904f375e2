//! The page's side of the worker: it sends questions and handles answers.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::rc::{Rc, Weak as RcWeak};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Weak};

use js_sys::{Array, Function, Object, Uint8Array};
use limpid::camera::Camera;
use limpid::scene::Scene;
use limpid_io::bake::Progress;
use limpid_io::color_by::ColorBy;
use limpid_io::error::Error;
use limpid_io::input::{FrameTime, Loaded};
use limpid_io::shared_classifier::Processor;
use wasm_bindgen::prelude::Closure;
use wasm_bindgen::{JsCast as _, JsValue};
use web_sys::{File, MessageEvent};

use super::demos;
use super::frame_cache::{FrameCache, Mirror};
use super::wire::{
    Ask, Edits, PaneText, Tell, drawn, get, packed, set, text_of, told, unpacked, view_text,
};
use crate::backend::core::drawing::{Answer, Pane, Request};
use crate::backend::core::messages::{Message, Post};
use crate::backend::core::picking::Sight;
use crate::backend::core::truth::Truth;
use crate::model::document::{Document, Source};

/// Number of workers that may follow the first one, until the user opens something else.
const ATTEMPTS: usize = 3;

/// The worker of a page, as a handle.
#[derive(Clone)]
pub(crate) struct Backend(Rc<Link>);

impl std::fmt::Debug for Backend {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Backend")
    }
}

/// The end of a worker: its reason; without one its memory has run out.
#[derive(Debug)]
pub(crate) struct Crash(pub(crate) Option<String>);

struct Link {
    /// The functions of the page: see `PageOptions::host`.
    host: JsValue,
    worker: RefCell<Option<web_sys::Worker>>,
    /// Whether it has ended.
    ended: Cell<bool>,
    /// Why, until that has been reported.
    crash: RefCell<Option<Crash>>,
    /// Number of workers that may follow it.
    left: Cell<usize>,
    /// The opening that it is busy with.
    busy: Cell<Option<u64>>,
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

impl Backend {
    pub(crate) fn new(host: JsValue, post: Post) -> Self {
        let link = Rc::new(Link {
            host,
            worker: RefCell::default(),
            ended: Cell::new(false),
            crash: RefCell::default(),
            left: Cell::new(ATTEMPTS),
            busy: Cell::default(),
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
    ///
    /// # Errors
    /// Message of the exception that it has thrown.
    pub(crate) fn call(&self, name: &str, arguments: &[JsValue]) -> Result<JsValue, String> {
        let function: Function = get(&self.0.host, name).unwrap_or_default().unchecked_into();
        let arguments: Array = arguments.iter().collect();
        function.apply(&self.0.host, &arguments).map_err(|error| text_of(&error))
    }

    fn start(&self) {
        self.0.ended.set(false);
        let worker: web_sys::Worker = match self.call("worker", &[]) {
            Ok(worker) => worker.unchecked_into(),
            Err(reason) => return self.crashed(Some(reason)),
        };
        let link = self.clone();
        let receive = Closure::<dyn FnMut(MessageEvent)>::new(move |event: MessageEvent| {
            link.receive(&event.data());
        });
        worker.set_onmessage(Some(receive.as_ref().unchecked_ref()));
        // Workers are few, and live as long as the page.
        receive.forget();
        let link = self.clone();
        // A script that cannot be loaded has no message.
        let fail = Closure::<dyn FnMut(JsValue)>::new(move |event: JsValue| {
            let message = get(&event, "message").and_then(|message| message.as_string());
            link.crashed(match message {
                None => Some("its script could not be loaded".into()),
                // A panic has told its reason before; otherwise it is memory that traps, or cannot be had for a buffer.
                Some(text) if text.contains("unreachable") || text.contains("RangeError") => None,
                Some(text) => Some(text),
            });
        });
        worker.set_onerror(Some(fail.as_ref().unchecked_ref()));
        fail.forget();
        *self.0.worker.borrow_mut() = Some(worker);
        for (path, file) in self.0.given.borrow().iter() {
            self.send_file(path, file);
        }
    }

    /// Ends the worker; returns the opening that it was busy with.
    pub(crate) fn end(&self) -> Option<u64> {
        if let Some(ended) = self.0.worker.borrow_mut().take() {
            ended.set_onmessage(None);
            ended.set_onerror(None);
            ended.terminate();
        }
        // The next one numbers frames anew.
        self.0.frames.borrow_mut().clear();
        self.0.busy.take()
    }

    /// Starts another worker, unless too many have ended; returns whether it did.
    pub(crate) fn restart(&self) -> bool {
        let left = self.0.left.get().checked_sub(1);
        if let Some(left) = left {
            self.0.left.set(left);
            self.start();
        }
        left.is_some()
    }

    /// Whether there is one.
    pub(crate) fn is_running(&self) -> bool {
        self.0.worker.borrow().is_some()
    }

    /// Reports the end of the worker, once: a panic is told by its hook, and then by the browser. Without a reason its
    /// memory has run out.
    fn crashed(&self, reason: Option<String>) {
        if !self.0.ended.replace(true) {
            *self.0.crash.borrow_mut() = Some(Crash(reason));
            self.0.post.wake();
        }
    }

    /// The end of the worker, once.
    pub(crate) fn take_crash(&self) -> Option<Crash> {
        self.0.crash.take()
    }

    pub(crate) fn ask(&self, ask: &Ask) {
        if let Some(worker) = &*self.0.worker.borrow() {
            let (message, transfer) = packed(ask, Vec::new());
            // Fails for a worker that has ended, which is reported by itself.
            let _ = worker.post_message_with_transfer(&message, &transfer);
        }
    }

    pub(crate) fn give(&self, path: &str, file: &File) {
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
            Tell::Opening(number) => self.0.busy.set(Some(number)),
            Tell::Opened { number, document } => {
                self.0.busy.take();
                let document = told(document).map(|document| document.outline());
                send(Message::Opened(number, Box::new(document)));
            }
            Tell::Grown { number, document } => {
                self.0.busy.take();
                let document = told(document).map(|document| document.outline());
                send(Message::Grown(number, Box::new(document)));
            }
            Tell::Baked { number, done, frames } => {
                send(Message::Baked(number, Progress { done, frames, again: false }));
            }
            Tell::NotBaked { number, error } => {
                self.0.busy.take();
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
                    self.0.frames.borrow_mut().push((Arc::downgrade(&loaded), text.frame));
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
            Tell::Attributes { number, listed } => {
                send(Message::Attributes(number, Box::new(told(listed))));
            }
            Tell::Picked { number, picked } => send(Message::Picked(number, told(picked))),
            Tell::Saved(name) => {
                if let Some(bytes) = buffers.first() {
                    self.download(&name, Uint8Array::new(bytes));
                }
                send(Message::Saved(Ok(name.into())));
            }
            Tell::NotSaved(error) => send(Message::Saved(Err(Error::Usage(error)))),
            Tell::Said(text) => send(Message::Said(text)),
            Tell::Panicked(reason) => self.crashed(Some(reason)),
        }
    }

    /// Has the page offer a file to the user.
    pub(crate) fn download(&self, name: &str, contents: Uint8Array) {
        if let Err(problem) = self.call("save", &[name.into(), contents.into()]) {
            self.0.post.send(Message::Saved(Err(Error::Usage(format!("{name}: {problem}")))));
        }
    }

    fn mirror(&self, id: u64) -> Option<Rc<RefCell<Mirror>>> {
        self.0.caches.borrow().get(&id)?.upgrade()
    }

    /// Opens a source, perhaps the same one `again`, until `stop` is set.
    pub(crate) fn open(&self, number: u64, source: &Source, again: bool, stop: Arc<AtomicBool>) {
        if !again {
            self.0.left.set(ATTEMPTS);
        }
        // After too many failures the worker stayed away.
        if !self.is_running() {
            self.start();
        }
        self.0.openings.borrow_mut().insert(number, stop);
        self.ask(&Ask::Open { number, source: source.clone(), again });
    }

    /// Ends the simulation of an opening, whose frames stay.
    pub(crate) fn halt(&self, number: u64, _stop: &AtomicBool) {
        self.ask(&Ask::Halt { number });
    }

    /// Opens the source of an opening again.
    pub(crate) fn grow(&self, number: u64, _source: &Source) {
        self.ask(&Ask::Grow { number });
    }

    /// Tells the worker which openings and which outlines of frames have been dropped.
    pub(crate) fn tell_dropped(&self) {
        self.0.frames.borrow_mut().retain(|&(ref outline, frame)| {
            let needed = outline.strong_count() > 0;
            if !needed {
                self.ask(&Ask::Forget { frame });
            }
            needed
        });
        self.0.openings.borrow_mut().retain(|&number, stop| {
            let stopped = stop.load(Ordering::Relaxed);
            if stopped {
                self.ask(&Ask::Stop { number });
            }
            !stopped
        });
    }

    /// Reads the attributes of a document's first frame.
    pub(crate) fn attributes(&self, number: u64, document: &Document) {
        self.ask(&Ask::Attributes { number, document: document.id });
    }

    /// Finds the particle in a line of sight.
    pub(crate) fn pick(
        &self,
        number: u64,
        (document, color_by): (&Document, Option<ColorBy>),
        at: FrameTime,
        sight: Sight,
    ) {
        self.ask(&Ask::Pick { number, document: document.id, color_by, at, sight });
    }

    /// A cache of the frames of a document.
    pub(crate) fn cache(
        &self,
        document: &Document,
        frame_times: &Arc<[FrameTime]>,
        scene: &Scene,
        processor: Processor,
        budget: u64,
    ) -> FrameCache {
        let post = self.0.post.clone();
        let ready = move || post.send(Message::Loaded);
        let id = self.0.next_cache.get();
        self.0.next_cache.set(id + 1);
        let worker = self.clone();
        let cache = FrameCache::new(id, move |ask: &Ask| worker.ask(ask), ready);
        let mut caches = self.0.caches.borrow_mut();
        caches.retain(|_, mirror| mirror.strong_count() > 0);
        caches.insert(id, Rc::downgrade(cache.mirror()));
        drop(caches);
        let (frame_times, edits) = (frame_times.to_vec(), Edits::of(scene));
        let document = document.id;
        self.ask(&Ask::Cache { id, document, frame_times, edits, processor, budget });
        cache
    }

    /// Nothing: the worker opens a device as it starts.
    pub(crate) fn prepare_device(&mut self, _processor: Processor) {}

    /// Nothing: a browser has neither the threads nor the time for ground truth, which its panels do not offer.
    pub(crate) fn trace(
        &self,
        _number: u64,
        _document: Arc<Document>,
        _scene: Scene,
        _camera: Camera,
        _at: FrameTime,
    ) {
    }

    /// Nothing: there is no ground truth.
    pub(crate) fn measure(&self, _pane: Pane, _truth: Arc<Truth>) {}

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
            scale: pane.scale.clone(),
            legend: pane.legend,
        })
    }

    /// Requests pictures for the screen, in place of a request that has not begun.
    pub(crate) fn request(&self, request: Request) {
        let Request { number, panes, level, view } = request;
        let panes: Option<Vec<_>> = panes.iter().map(|pane| self.pane(pane)).collect();
        match panes {
            Some(panes) => {
                self.ask(&Ask::Draw { number, panes, level, view: view_text(view) });
            }
            None => self.0.post.send(Message::Drawing(Answer::NotDrawn(number, unknown_frame()))),
        }
    }

    /// Draws a picture and offers it to the user.
    pub(crate) fn save(&self, pane: Pane, path: PathBuf, _: Option<Arc<Document>>) {
        match self.pane(&pane) {
            Some(pane) => {
                self.ask(&Ask::Save { pane, name: path.to_string_lossy().into_owned() });
            }
            None => self.0.post.send(Message::Saved(Err(unknown_frame()))),
        }
    }

    /// A URL relative to the page, as an absolute one; a demo and a path of the user's files as it is.
    pub(crate) fn absolute(&self, url: &str) -> String {
        let folder = url.split_inclusive('/').next().unwrap_or(url);
        let is_given = self.0.given.borrow().iter().any(|(path, _)| path.starts_with(folder));
        if folder == demos::FOLDER || folder.ends_with('/') && is_given {
            return url.to_owned();
        }
        let absolute = self.call("absolute", &[url.into()]);
        absolute.ok().and_then(|url| url.as_string()).unwrap_or_else(|| url.to_owned())
    }

    /// A source with absolute URLs.
    pub(crate) fn absolute_source(&self, mut source: Source) -> Source {
        source.input = self.absolute(&source.input);
        let scene = source.scene.map(|scene| self.absolute(&scene.to_string_lossy()).into());
        Source { scene, ..source }
    }
}

/// The error of a frame that the worker does not have: one of a worker that has ended.
fn unknown_frame() -> Error {
    Error::Usage("this frame is being loaded again".into())
}
