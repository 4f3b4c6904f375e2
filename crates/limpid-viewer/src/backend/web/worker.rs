//! The worker: opens documents, loads their frames, simulates, and draws.
//!
//! Three kinds of tasks take turns: one draws, one loads frames ahead, and each simulation is one. Pictures for the
//! screen come first.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::pin::pin;
use std::rc::Rc;
use std::sync::Arc;
use std::task::Poll;

use js_sys::{ArrayBuffer, Uint8Array};
use limpid::gpu::Gpu;
use limpid::scene::Solid;
use limpid_io::bake::{self, Bake, Progress};
use limpid_io::error::Result;
use limpid_io::files::given;
use limpid_io::frame_cache::FrameCache;
use limpid_io::input::Loaded;
use limpid_io::project::Project;
use limpid_io::sequence::Sequence;
use limpid_io::shared_classifier::SharedClassifier;
use limpid_sim::sim::Simulation;
use wasm_bindgen::prelude::Closure;
use wasm_bindgen::{JsCast as _, JsValue};
use wasm_bindgen_futures::spawn_local;
use web_sys::{AbortController, File, MessageEvent};

use super::baked_files::BakedFiles;
use super::demos;
use super::fetch::{fetched, fetched_at_once, give_file, root_of, scope, without_queries};
use super::signal::{Signal, turn};
use super::wire::{
    Ask, DocumentText, LoadedText, PaneText, Tell, drawn_text, get, packed, unpacked, view,
};
use crate::backend::core::drawing::{Answer, Pane, Request};
use crate::backend::core::loading::Loader;
use crate::backend::core::messages::Message;
use crate::backend::core::opening::{self, Reports};
use crate::backend::core::picking::pick;
use crate::backend::core::queue::{Artist, Job, Next, Queue};
use crate::model::document::{Document, Source};

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

/// A cache of the page.
struct Cache {
    cache: FrameCache,
    loader: Loader,
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
    /// Whether no more frames are made.
    halted: Rc<Cell<bool>>,
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
    queue: RefCell<Queue>,
    /// Whether pictures for the screen are being drawn.
    drawing: Cell<bool>,
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
                    // Files on servers may have changed.
                    given::forget_servers();
                    self.noticed.take();
                }
                spawn_local(self.clone().open(number, source));
            }
            Ask::Stop { number } => self.stop(number),
            Ask::Halt { number } => {
                let all = self.baked.borrow();
                let its = all.values().filter(|baked| baked.number.get() == Some(number));
                its.for_each(|baked| baked.halted.set(true));
            }
            Ask::Grow { number } => {
                let source = self.sources.borrow().get(&number).cloned();
                if let Some(source) = source {
                    let document = Box::new(self.opened(number, &source));
                    self.say(&source, Message::Grown(number, document));
                }
            }
            Ask::Cache { id, document, frame_times, edits, processor, budget } => {
                let Some(document) = self.shown(document) else { return };
                let scene = edits.apply(&document.project.scene);
                let classifier = (&self.classifier, processor);
                let loader = Loader::new(&document, frame_times.into(), scene, classifier);
                let cache = FrameCache::without_workers(loader.times.len(), budget);
                self.caches.borrow_mut().insert(id, Rc::new(Cache { cache, loader, document }));
            }
            Ask::Forget { frame } => drop(self.known.borrow_mut().remove(&frame)),
            Ask::Uncache { id } => drop(self.caches.borrow_mut().remove(&id)),
            Ask::Aim { id, at, step, looped } => {
                if let Some(cache) = self.caches.borrow().get(&id) {
                    cache.cache.aim(at, step, looped);
                }
            }
            Ask::Draw { number, panes, level, view: text } => {
                let panes: Result<Vec<_>> = panes.iter().map(|pane| self.pane(pane)).collect();
                let view = view(text);
                let request = panes.map(|panes| Request { number, panes, level, view });
                let request = request.map_err(|error| answer(Answer::NotDrawn(number, error)));
                self.queue.borrow_mut().request(request.ok());
            }
            Ask::Save { pane, name } => match self.pane(&pane) {
                Ok(pane) => self.queue.borrow_mut().push(Job::Save(pane, name.into(), None)),
                Err(error) => answer(Answer::Saved(Err(error))),
            },
            Ask::Attributes { number, document } => {
                let Some(document) = self.shown(document) else { return };
                let listed = document.input.attributes().map_err(|error| error.to_string());
                tell(&Tell::Attributes { number, listed });
            }
            Ask::Pick { number, document, color_by, at, sight } => {
                let Some(document) = self.shown(document) else { return };
                let picked = pick(&document.input, color_by, at, &sight);
                tell(&Tell::Picked { number, picked: picked.map_err(|error| error.to_string()) });
            }
            Ask::SaveScene { document, edits, color_by, camera, at, processor, name } => {
                let Some(document) = self.shown(document) else { return };
                let scene = edits.apply(&document.project.scene);
                let project = document.saved(scene, camera, at);
                let project = Project { processor, color_by, ..project };
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
            Ask::Lose => self.queue.borrow_mut().push(Job::Lose),
        }
        self.changed.notify();
    }

    /// Opens the source of an opening.
    fn opened(&self, number: u64, source: &Source) -> Result<Document> {
        tell(&Tell::Opening(number));
        Document::open(&without_queries(source))
    }

    /// Tells the page of the opening of a source.
    fn say(&self, source: &Source, message: Message) {
        let text = |document: Result<Document>| {
            let mut document = document.map_err(|error| error.to_string())?;
            document.id = self.next_document.get();
            self.next_document.set(document.id + 1);
            let text = DocumentText::of(&document, source.clone());
            self.documents.borrow_mut().insert(document.id, Rc::new(document));
            Ok(text)
        };
        match message {
            Message::Opened(number, document) => {
                tell(&Tell::Opened { number, document: text(*document) });
            }
            Message::Grown(number, document) => {
                tell(&Tell::Grown { number, document: text(*document) });
            }
            Message::Baked(number, Progress { done, frames, .. }) => {
                tell(&Tell::Baked { number, done, frames });
            }
            Message::NotBaked(number, error) => {
                tell(&Tell::NotBaked { number, error: error.to_string() });
            }
            _ => {}
        }
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
        tell(&Tell::Opening(number));
        let document = || self.opened(number, &source);
        let report = |message| self.say(&source, message);
        opening::open(number, &plain, document, report, async |project, reports| {
            self.bake(number, project, &plain, reports).await
        })
        .await;
    }

    /// Simulates the frames that are missing, and reports each while the page wants it.
    async fn bake(
        &self,
        number: u64,
        project: Project,
        plain: &Source,
        reports: &mut Reports<impl FnMut() -> Result<Document>, impl FnMut(Message)>,
    ) -> Result<()> {
        let Some(simulation) = project.source.simulation().cloned() else { return Ok(()) };
        simulation.check()?;
        let solids = project.scene.solids;
        let path = Path::new(&plain.input);
        let folder = bake::folder(path);
        let number = Rc::new(Cell::new(Some(number)));
        let halted = Rc::new(Cell::new(false));
        let goes_on = self.takes_over(&folder, &simulation, &solids, (&number, &halted));
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let files = BakedFiles { folder: &folder, name: &name, goes_on };
        let mut bake = Bake::new(&simulation, &solids, &name, files);
        while let Some(progress) = bake.step()? {
            reports.progressed(progress);
            self.changed.notify();
            turn().await;
            // Pictures for the screen have a second turn for each frame.
            if self.is_wanted() {
                turn().await;
            }
            if number.get().is_none() || halted.get() {
                break;
            }
        }
        Ok(())
    }

    /// Ends the simulation of a folder's frames in favour of another one; returns whether that makes the same frames. If
    /// not, they are dropped.
    fn takes_over(
        &self,
        folder: &Path,
        simulation: &Simulation,
        solids: &[Solid],
        (number, halted): (&Rc<Cell<Option<u64>>>, &Rc<Cell<bool>>),
    ) -> bool {
        let same = self.baked.borrow().get(folder).is_some_and(|old| {
            // Two tasks would write the same frames.
            old.number.set(None);
            (&old.simulation, &*old.solids) == (simulation, solids)
        });
        if !same {
            given::take_back(folder);
        }
        let (simulation, solids) = (simulation.clone(), solids.to_vec());
        let (number, halted) = (number.clone(), halted.clone());
        let baked = Baked { simulation, solids, number, halted };
        self.baked.borrow_mut().insert(folder.to_owned(), baked);
        same
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
        self.drawing.get() || self.queue.borrow().is_wanted()
    }

    /// Loads the frames of all caches, those first that are needed first.
    async fn load(self: Rc<Self>) {
        loop {
            let seen = self.changed.changes();
            turn().await;
            // The picture first: loading a frame holds it up.
            if self.queue.borrow().is_wanted() || !self.opened_device.get() {
                self.changed.after(seen).await;
                continue;
            }
            let next = {
                let caches = self.caches.borrow();
                let ranked = caches
                    .iter()
                    .filter_map(|(&id, cache)| Some((cache.cache.next_rank()?, id, cache.clone())));
                let mut ranked: Vec<_> = ranked.collect();
                ranked.sort_by_key(|&(rank, id, _)| (rank, id));
                ranked.into_iter().find_map(|(_, id, cache)| {
                    let i = cache.cache.begin()?;
                    Some((id, cache, i))
                })
            };
            let Some((id, cache, i)) = next else {
                self.changed.after(seen).await;
                continue;
            };
            let state = cache.cache.state();
            tell(&Tell::Cached { id, state });
            let wanted = || self.caches.borrow().contains_key(&id);
            for path in cache.loader.input.files_at(cache.loader.times[i]) {
                self.fetch(path, wanted).await;
            }
            if !wanted() {
                continue;
            }
            let loaded = cache.loader.load(i).await;
            cache.cache.finish(i, loaded);
            self.tell_loaded(id, &cache, i);
        }
    }

    fn tell_loaded(&self, id: u64, cache: &Cache, i: usize) {
        let outcome = match cache.cache.get(i) {
            Some(Ok(loaded)) => {
                let document = &cache.document;
                let source = &document.source.input;
                let is_first = self.noticed.replace(source.clone()) != *source;
                if is_first {
                    for notice in document.notices(&loaded, &cache.loader.scene) {
                        tell(&Tell::Said(notice.to_string()));
                    }
                }
                let frame = self.next_frame.get();
                self.next_frame.set(frame + 1);
                let text = LoadedText::of(frame, &loaded, is_first);
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
        tell(&Tell::Cached { id, state: cache.cache.state() });
    }

    /// A picture's inputs.
    fn pane(&self, text: &PaneText) -> Result<Pane> {
        let known = self.known.borrow();
        let unknown = || limpid::Error::Defect("a frame is drawn that is not in memory".into());
        let Known { loaded, document } = known.get(&text.frame).ok_or_else(unknown)?;
        let scene = Arc::new(text.edits.apply(&document.project.scene));
        let PaneText { camera, size, legend, .. } = *text;
        let (loaded, scale) = (loaded.clone(), text.scale.clone());
        Ok(Pane { scene, camera, loaded, size, scale, legend })
    }

    /// Draws what the page wants.
    async fn draw(self: Rc<Self>) {
        let classifier = self.classifier.clone();
        let opened = self.opened_device.clone();
        let open = async || {
            classifier.set(None);
            let gpu = Gpu::request().await?;
            classifier.set(Some(&gpu));
            Ok(gpu)
        };
        let mut artist = Artist::new(open, answer, |path, bytes| {
            tell_file(path.to_string_lossy().into_owned(), bytes);
            Ok(())
        });
        // Particles may be classified on it; the first picture tells why there is none.
        artist.act(Next::Job(Job::Open)).await;
        opened.set(true);
        self.changed.notify();
        loop {
            let seen = self.changed.changes();
            let next = self.queue.borrow_mut().next();
            let Some(next) = next else {
                self.changed.after(seen).await;
                continue;
            };
            self.drawing.set(matches!(next, Next::Request(_)));
            artist.act(next).await;
            self.drawing.set(false);
            self.changed.notify();
        }
    }
}

/// Tells the page an answer of the one that draws.
fn answer(answer: Answer) {
    match answer {
        Answer::Adapter(name) => tell(&Tell::Adapter(name)),
        Answer::Lost(reason) => tell(&Tell::Lost(reason)),
        Answer::Drawn(drawn) => {
            let (message, buffers) = drawn_text(&drawn);
            tell_with(&message, buffers);
        }
        Answer::NotDrawn(number, error) => {
            tell(&Tell::NotDrawn { number, error: error.to_string() });
        }
        Answer::Saved(Err(error)) => tell(&Tell::NotSaved(error.to_string())),
        // The page has been told with the file. Ground truth is measured on threads alone.
        Answer::Saved(Ok(_)) | Answer::Measured(_) => {}
    }
}
