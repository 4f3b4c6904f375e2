//! The worker: opens documents, loads their frames, simulates, and draws.
//!
//! Three kinds of tasks take turns: one draws, one loads frames ahead, and each simulation is one. Pictures for the
//! screen come first.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::path::{Path, PathBuf};
use std::pin::pin;
use std::rc::Rc;
use std::sync::Arc;
use std::task::Poll;

use js_sys::{ArrayBuffer, Uint8Array};
use limpid::gpu::Gpu;
use limpid::liquid::Particles;
use limpid::memory;
use limpid::offscreen::Offscreen;
use limpid::scene::{Scene, Solid};
use limpid_io::bake;
use limpid_io::error::{Error, Result};
use limpid_io::files::given::{self, ReadAt};
use limpid_io::frame_cache::FrameCache;
use limpid_io::input::{FrameTime, Input, Loaded};
use limpid_io::particles::bgeo;
use limpid_io::project::Project;
use limpid_io::sequence::Sequence;
use limpid_io::shared_classifier::SharedClassifier;
use limpid_sim::sim::{Simulation, Solver, State};
use wasm_bindgen::prelude::Closure;
use wasm_bindgen::{JsCast as _, JsValue};
use wasm_bindgen_futures::{JsFuture, spawn_local};
use web_sys::{
    AbortController, DedicatedWorkerGlobalScope, File, FileReaderSync, MessageEvent, RequestInit,
    Response, XmlHttpRequest, XmlHttpRequestResponseType,
};

use super::signal::{Signal, turn};
use super::wire::{
    Ask, DocumentText, LoadedText, PaneText, Tell, drawn_text, get, packed, text_of, unpacked, view,
};
use crate::backend::core::drawing::{self, DeviceEvent, Drawer, Pane, Request};
use crate::backend::core::opening::simulated;
use crate::model::demos;
use crate::model::document::{Document, Source};

/// Memory for a particle of a simulated frame, bytes: its record in the file, and its place in the list of them.
const FRAME_BYTES: usize = 64;

/// Runs the worker: answers the messages of its page for as long as it lives.
pub fn work() {
    std::panic::set_hook(Box::new(|info| {
        let reason = info.payload_as_str().unwrap_or("for an unknown reason");
        tell(&Tell::Panicked(reason.into()));
    }));
    given::fetch_with(Rc::new(fetched_at_once));
    demos::give_all();
    let worker = Rc::new(Worker::default());
    let receiver = worker.clone();
    let receive = Closure::<dyn FnMut(MessageEvent)>::new(move |event: MessageEvent| {
        receiver.receive(&event.data());
    });
    scope().set_onmessage(Some(receive.as_ref().unchecked_ref()));
    // It lives as long as the worker.
    receive.forget();
    spawn_local(worker.clone().draw());
    spawn_local(worker.load());
}

fn scope() -> DedicatedWorkerGlobalScope {
    js_sys::global().unchecked_into()
}

fn tell(message: &Tell) {
    tell_with(message, Vec::new());
}

fn tell_file(name: String, contents: &[u8]) {
    tell_with(&Tell::Saved(name), vec![Uint8Array::from(contents).buffer()]);
}

fn tell_with(message: &Tell, buffers: Vec<ArrayBuffer>) {
    let (message, transfer) = packed(message, buffers);
    // Fails for a page that has gone.
    let _ = scope().post_message_with_transfer(&message, &transfer);
}

/// A task that is never replaced by a newer one, in order.
enum Job {
    Save(Result<Pane>, String),
    Lose,
}

/// A request for the screen, with the reason if it cannot be drawn.
struct Wanted {
    number: u64,
    request: Result<Request>,
}

/// A cache of the page.
struct Cache {
    frames: FrameCache,
    frame_times: Vec<FrameTime>,
    input: Input,
    /// The scene that particles are classified for.
    scene: Scene,
    /// The document that it belongs to.
    document: Rc<Document>,
}

/// A frame that the page has the outline of, which it may ask for whatever a cache evicts.
struct Known {
    loaded: Arc<Loaded>,
    document: Rc<Document>,
}

/// Frames of a simulation, and what they were made from.
struct Baked {
    simulation: Simulation,
    solids: Vec<Solid>,
    /// The opening that is told of the progress; none once it has ended.
    number: Rc<Cell<Option<u64>>>,
}

#[derive(Default)]
struct Worker {
    /// Documents by their numbers, except those before the one that the page shows.
    documents: RefCell<BTreeMap<u64, Rc<Document>>>,
    next_document: Cell<u64>,
    /// The source whose notices have been told.
    noticed: RefCell<String>,
    /// Sources by opening.
    sources: RefCell<BTreeMap<u64, Source>>,
    /// The newest opening.
    newest: Cell<u64>,
    caches: RefCell<BTreeMap<u64, Rc<Cache>>>,
    known: RefCell<BTreeMap<u64, Known>>,
    next_frame: Cell<u64>,
    wanted: RefCell<Option<Wanted>>,
    drawing: Cell<bool>,
    jobs: RefCell<VecDeque<Job>>,
    baked: RefCell<BTreeMap<PathBuf, Baked>>,
    classifier: SharedClassifier,
    /// Whether a device has been opened, or cannot be.
    opened_device: Rc<Cell<bool>>,
    changed: Rc<Signal>,
}

impl Worker {
    fn receive(self: &Rc<Self>, data: &JsValue) {
        if let (Some(path), Some(file)) = (get(data, "path"), get(data, "file")) {
            if let (Some(path), Ok(file)) = (path.as_string(), file.dyn_into::<File>()) {
                give_file(&path, file);
            }
            return;
        }
        let Some((ask, _)) = unpacked::<Ask>(data) else { return };
        match ask {
            Ask::Open { number, source, again } => {
                self.sources.borrow_mut().insert(number, source.clone());
                self.newest.set(number);
                if !again {
                    // What servers have may have changed.
                    given::forget_servers();
                    self.noticed.take();
                }
                spawn_local(self.clone().open(number, source));
            }
            Ask::Stop { number } => self.stop(number),
            Ask::Grow { number } => {
                let source = self.sources.borrow().get(&number).cloned();
                if let Some(source) = source {
                    let document = self.opened(number, &source);
                    tell(&Tell::Grown { number, document });
                }
            }
            Ask::Cache { id, document, frame_times, edits, processor, budget } => {
                let Some(document) = self.shown(document) else { return };
                let input = document.input.clone().classified(self.classifier.clone());
                let cache = Cache {
                    frames: FrameCache::without_workers(frame_times.len(), budget),
                    frame_times,
                    input: input.processed_by(processor),
                    scene: edits.apply(&document.project.scene),
                    document,
                };
                self.caches.borrow_mut().insert(id, Rc::new(cache));
            }
            Ask::Forget { frame } => drop(self.known.borrow_mut().remove(&frame)),
            Ask::Uncache { id } => drop(self.caches.borrow_mut().remove(&id)),
            Ask::Aim { id, at, step, looped } => {
                if let Some(cache) = self.caches.borrow().get(&id) {
                    cache.frames.aim(at, step, looped);
                }
            }
            Ask::Draw { number, panes, level, view: text } => {
                let panes = panes.iter().map(|pane| self.pane(pane)).collect();
                let view = view(text);
                let request = |panes| Request { number, panes, level, view };
                let wanted = Wanted { number, request: Result::map(panes, request) };
                *self.wanted.borrow_mut() = Some(wanted);
            }
            Ask::Save { pane, name } => {
                self.jobs.borrow_mut().push_back(Job::Save(self.pane(&pane), name));
            }
            Ask::SaveScene { document, edits, camera, at, processor, name } => {
                let Some(document) = self.shown(document) else { return };
                let scene = edits.apply(&document.project.scene);
                let project = Project { processor, ..document.saved(scene, camera, at) };
                // Files of the user are named from their folder, where the scene belongs.
                match project.to_files(&root_of(&document.source.input).join(&name)) {
                    Ok(files) => {
                        for (path, bytes) in files {
                            let name = path.file_name().unwrap_or_default();
                            tell_file(name.to_string_lossy().into_owned(), &bytes);
                        }
                    }
                    Err(error) => tell(&Tell::NotSaved(error.to_string())),
                }
            }
            Ask::Lose => self.jobs.borrow_mut().push_back(Job::Lose),
        }
        self.changed.notify();
    }

    /// Opens the source of an opening.
    fn opened(&self, number: u64, source: &Source) -> Result<DocumentText, String> {
        tell(&Tell::Opening(number));
        let document = Document::open(&without_queries(source));
        let mut document = document.map_err(|error| error.to_string())?;
        document.id = self.next_document.get();
        self.next_document.set(document.id + 1);
        let text = DocumentText::of(&document, source.clone());
        self.documents.borrow_mut().insert(document.id, Rc::new(document));
        Ok(text)
    }

    /// The document that the page shows. It will never ask for those before.
    fn shown(&self, id: u64) -> Option<Rc<Document>> {
        let mut documents = self.documents.borrow_mut();
        documents.retain(|&known, _| known >= id);
        documents.get(&id).cloned()
    }

    /// Ends an opening that has been dropped, and frees the frames of its simulation.
    fn stop(&self, number: u64) {
        self.sources.borrow_mut().remove(&number);
        self.baked.borrow_mut().retain(|folder, baked| {
            let ends = baked.number.get() == Some(number);
            if ends {
                baked.number.set(None);
                given::take_back(folder);
            }
            !ends
        });
    }

    async fn open(self: Rc<Self>, number: u64, source: Source) {
        let plain = without_queries(&source);
        let names = [Some(plain.input.as_str().into()), plain.scene.clone()];
        for path in names.into_iter().flatten() {
            if given::is_one_file(&path) {
                self.fetch(&path, || self.newest.get() == number).await;
            }
        }
        if self.newest.get() != number {
            return;
        }
        // Frames that are named need no list of files.
        let frames = plain.frames.as_ref().and_then(|frames| frames.frames().ok());
        let names = frames.and_then(|frames| Sequence::names(&plain.input, frames.into_iter()));
        if let (Some(names), Some(folder)) =
            (names.filter(|names| !names.is_empty()), Path::new(&plain.input).parent())
        {
            given::list(folder, names);
        }
        let report = |document| tell(&Tell::Opened { number, document });
        tell(&Tell::Opening(number));
        let project = simulated(&plain);
        let simulation = project.as_ref().and_then(|project| project.source.simulation().cloned());
        let (Some(project), Some(simulation)) = (project, simulation) else {
            return report(self.opened(number, &source));
        };
        if let Err(error) = simulation.check() {
            return report(Err(error.to_string()));
        }
        let folder = bake::folder(Path::new(&plain.input));
        let solids = project.scene.solids;
        let teller = Rc::new(Cell::new(Some(number)));
        let same = self.baked.borrow().get(&folder).is_some_and(|old| {
            // Two tasks would write the same frames.
            old.number.set(None);
            (&old.simulation, &old.solids) == (&simulation, &solids)
        });
        if !same {
            given::take_back(&folder);
        }
        let baked = Baked {
            simulation: simulation.clone(),
            solids: solids.clone(),
            number: teller.clone(),
        };
        self.baked.borrow_mut().insert(folder, baked);
        let mut open = false;
        let baked = self.bake(simulation, solids, source, teller, same, &mut open).await;
        match baked.map_err(|error| error.to_string()) {
            Ok(()) => {}
            Err(error) if open => tell(&Tell::NotBaked { number, error }),
            Err(error) => report(Err(error)),
        }
    }

    /// Simulates all frames, or if it `goes_on` those that are missing, and tells each while the page wants it.
    async fn bake(
        &self,
        simulation: Simulation,
        solids: Vec<Solid>,
        source: Source,
        number: Rc<Cell<Option<u64>>>,
        goes_on: bool,
        open: &mut bool,
    ) -> Result<()> {
        let plain = without_queries(&source);
        let path = Path::new(&plain.input);
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let file = |done| bake::frame_path(&bake::folder(path), &name, done);
        let exists = |done: &u32| goes_on && given::has(&file(*done));
        let frames = simulation.frames;
        let found = (1..=frames).take_while(exists).count() as u32;
        let last = || -> Option<Particles> { limpid_io::particles::read(&file(found)).ok() };
        let last = (found > 0).then(last).flatten().and_then(State::from_particles);
        memory::probe(simulation.memory(last.as_ref()), &name)?;
        let mut solver = Solver::new(&simulation, &solids, last);
        for done in found.max(1)..=frames {
            let Some(opening) = number.get() else { return Ok(()) };
            if done > found {
                let particles = solver.make(done);
                memory::probe(particles.len().saturating_mul(FRAME_BYTES), &name)?;
                let path = file(done);
                let bytes = bgeo::to_bytes(&particles);
                let bytes = bytes.map_err(|error| Error::io(&path, "write", error))?;
                given::give_bytes(path, bytes);
            }
            if !*open {
                // The requested frames may be the last to be made.
                let document = self.opened(opening, &source);
                if document.is_ok() || done == frames {
                    *open = true;
                    tell(&Tell::Opened { number: opening, document });
                }
            }
            tell(&Tell::Baked { number: opening, done, frames });
            self.changed.notify();
            turn().await;
            // Pictures for the screen have a second turn for each frame.
            if self.is_wanted() {
                turn().await;
            }
        }
        Ok(())
    }

    /// Fetches the file of a path, if it is a URL and not yet here, for as long as it is `wanted`. Failures are
    /// reported by whoever reads it then.
    async fn fetch(&self, path: &Path, wanted: impl Fn() -> bool) {
        let Some(url) = given::missing(path) else { return };
        let Ok(abort) = AbortController::new() else { return };
        let mut answer = pin!(fetched(&url, &abort));
        loop {
            let seen = self.changed.changes();
            let answered = std::future::poll_fn(|context| {
                let changed = pin!(self.changed.after(seen)).poll(context);
                match answer.as_mut().poll(context) {
                    Poll::Ready(bytes) => Poll::Ready(Some(bytes)),
                    Poll::Pending => changed.map(|()| None),
                }
            });
            if let Some(bytes) = answered.await {
                return bytes.into_iter().for_each(|bytes| given::keep(path, bytes));
            }
            if !wanted() {
                return abort.abort();
            }
        }
    }

    /// Whether the page waits for a picture.
    fn is_wanted(&self) -> bool {
        self.drawing.get() || self.wanted.borrow().is_some()
    }

    /// Loads the frames of all caches, those first that are needed first.
    async fn load(self: Rc<Self>) {
        loop {
            let seen = self.changed.changes();
            turn().await;
            // The picture first: loading a frame holds it up.
            if self.wanted.borrow().is_some() || !self.opened_device.get() {
                self.changed.after(seen).await;
                continue;
            }
            let next = {
                let caches = self.caches.borrow();
                let ranked = caches.iter().filter_map(|(&id, cache)| {
                    Some((cache.frames.next_rank()?, id, cache.clone()))
                });
                let mut ranked: Vec<_> = ranked.collect();
                ranked.sort_by_key(|&(rank, id, _)| (rank, id));
                ranked.into_iter().find_map(|(_, id, cache)| {
                    let i = cache.frames.begin()?;
                    Some((id, cache, i))
                })
            };
            let Some((id, cache, i)) = next else {
                self.changed.after(seen).await;
                continue;
            };
            let state = cache.frames.state();
            tell(&Tell::Cached { id, state });
            let wanted = || self.caches.borrow().contains_key(&id);
            for path in cache.input.files_at(cache.frame_times[i]) {
                self.fetch(path, wanted).await;
            }
            if !wanted() {
                continue;
            }
            let loaded = cache.input.finish_load(cache.frame_times[i], &cache.scene).await;
            cache.frames.finish(i, loaded);
            self.tell_loaded(id, &cache, i);
        }
    }

    fn tell_loaded(&self, id: u64, cache: &Cache, i: usize) {
        let outcome = match cache.frames.get(i) {
            Some(Ok(loaded)) => {
                let document = &cache.document;
                let source = &document.source.input;
                if self.noticed.replace(source.clone()) != *source {
                    for notice in document.notices(&loaded, &cache.scene) {
                        tell(&Tell::Said(notice.to_string()));
                    }
                }
                let frame = self.next_frame.get();
                self.next_frame.set(frame + 1);
                let text = LoadedText::of(frame, &loaded);
                let document = cache.document.clone();
                self.known.borrow_mut().insert(frame, Known { loaded, document });
                Some(Ok(text))
            }
            Some(Err(error)) => Some(Err(error.to_string())),
            // Larger than the memory for all.
            None => None,
        };
        if let Some(outcome) = outcome {
            tell(&Tell::Loaded { id, i, outcome });
        }
        tell(&Tell::Cached { id, state: cache.frames.state() });
    }

    /// A picture's inputs.
    fn pane(&self, text: &PaneText) -> Result<Pane> {
        let known = self.known.borrow();
        let unknown = || limpid::Error::Defect("a frame is drawn that is not in memory".into());
        let Known { loaded, document } = known.get(&text.frame).ok_or_else(unknown)?;
        let scene = Arc::new(text.edits.apply(&document.project.scene));
        Ok(Pane { scene, camera: text.camera, loaded: loaded.clone(), size: text.size })
    }

    /// Draws what the page wants.
    async fn draw(self: Rc<Self>) {
        let classifier = self.classifier.clone();
        let opened = self.opened_device.clone();
        let mut drawer = Drawer::new(async || {
            classifier.set(None);
            let gpu = Gpu::request().await?;
            classifier.set(Some(&gpu));
            Ok(gpu)
        });
        // Particles may be classified on it; the first picture tells why there is none.
        let _ = drawer.offscreen(&device_event).await;
        opened.set(true);
        self.changed.notify();
        loop {
            let seen = self.changed.changes();
            let wanted = self.wanted.borrow_mut().take();
            self.drawing.set(wanted.is_some());
            if let Some(Wanted { number, request }) = wanted {
                match draw_wanted(&mut drawer, request).await {
                    Ok(drawn) => {
                        let (message, buffers) = drawn_text(&drawn);
                        tell_with(&message, buffers);
                    }
                    Err(error) => {
                        tell(&Tell::NotDrawn { number, error: error.to_string() });
                    }
                }
                self.drawing.set(false);
                self.changed.notify();
                continue;
            }
            let job = self.jobs.borrow_mut().pop_front();
            match job {
                Some(Job::Save(pane, name)) => match saved(&mut drawer, pane, &name).await {
                    Ok(bytes) => tell_file(name, &bytes),
                    Err(error) => tell(&Tell::NotSaved(error.to_string())),
                },
                Some(Job::Lose) => {
                    if let Ok(offscreen) = drawer.offscreen(&device_event).await {
                        offscreen.gpu().device.destroy();
                    }
                }
                None => self.changed.after(seen).await,
            }
        }
    }
}

async fn draw_wanted(
    drawer: &mut Drawer<impl AsyncFnMut() -> Result<Gpu>>,
    request: Result<Request>,
) -> Result<drawing::Drawn> {
    let request = request?;
    let draw = async |offscreen: &mut Offscreen| drawing::draw(offscreen, &request).await;
    drawer.attempt(&device_event, draw).await
}

async fn saved(
    drawer: &mut Drawer<impl AsyncFnMut() -> Result<Gpu>>,
    pane: Result<Pane>,
    name: &str,
) -> Result<Vec<u8>> {
    let (pane, path) = (pane?, Path::new(name));
    let encode = async |offscreen: &mut Offscreen| drawing::encoded(offscreen, &pane, path).await;
    drawer.attempt(&device_event, encode).await
}

/// The folder of a drop, which all its files are in; empty for a URL.
fn root_of(input: &str) -> &Path {
    let first = Path::new(input).components().next();
    let first = first.map_or(Path::new(""), |first| Path::new(first.as_os_str()));
    if first.to_string_lossy().ends_with(':') { Path::new("") } else { first }
}

/// A source as files are named: without the queries of its URLs.
fn without_queries(source: &Source) -> Source {
    let scene = source.scene.as_ref().map(|scene| scene.to_string_lossy());
    Source {
        input: given::without_query(&source.input),
        scene: scene.map(|scene| given::without_query(&scene).into()),
        ..source.clone()
    }
}

fn device_event(event: DeviceEvent) {
    let message = match event {
        DeviceEvent::Opened(adapter) => Tell::Adapter(adapter),
        DeviceEvent::Lost(reason) => Tell::Lost(reason),
    };
    tell(&message);
}

/// Gives a file of the page to all who read files.
fn give_file(path: &str, file: File) {
    let length = file.size() as u64;
    let read: ReadAt = Rc::new(move |offset, buffer| {
        let fail = |error: JsValue| io::Error::other(text_of(&error));
        let (start, end) = (offset as f64, (offset + buffer.len() as u64) as f64);
        let part = file.slice_with_f64_and_f64(start, end).map_err(fail)?;
        let reader = FileReaderSync::new().map_err(fail)?;
        let bytes = reader.read_as_array_buffer(&part).map_err(fail)?;
        let bytes = Uint8Array::new(&bytes);
        if bytes.length() as usize != buffer.len() {
            return Err(io::Error::other("it changed while it was read"));
        }
        bytes.copy_to(buffer);
        Ok(())
    });
    given::give(path, length, read);
}

/// Fetches a URL, waiting for the server, as a worker may: lists and small files, which are found while others are read.
fn fetched_at_once(url: &str) -> io::Result<Vec<u8>> {
    /// Longest wait, ms.
    const PATIENCE: u32 = 60_000;
    let fail = |error: JsValue| {
        let problem = "the server cannot be reached, or does not let other sites read this (CORS)";
        io::Error::other(format!("{problem}: {}", text_of(&error)))
    };
    let request = XmlHttpRequest::new().map_err(fail)?;
    request.open_with_async("GET", url, false).map_err(fail)?;
    request.set_timeout(PATIENCE);
    request.set_response_type(XmlHttpRequestResponseType::Arraybuffer);
    request.send().map_err(fail)?;
    match request.status().unwrap_or_default() {
        200..=299 => {
            let body = request.response().map_err(fail)?;
            Ok(Uint8Array::new(&body.unchecked_into::<ArrayBuffer>()).to_vec())
        }
        404 | 410 => Err(io::ErrorKind::NotFound.into()),
        status => Err(io::Error::other(format!("the server answers {status}"))),
    }
}

/// Fetches a URL; `None` if that fails.
async fn fetched(url: &str, abort: &AbortController) -> Option<Vec<u8>> {
    let options = RequestInit::new();
    options.set_signal(Some(&abort.signal()));
    let answer = JsFuture::from(scope().fetch_with_str_and_init(url, &options)).await.ok()?;
    let answer: Response = answer.unchecked_into();
    if !answer.ok() {
        return None;
    }
    let body = JsFuture::from(answer.array_buffer().ok()?).await.ok()?;
    Some(Uint8Array::new(&body).to_vec())
}
