//! The viewer of a page, as JavaScript calls it.

use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::mpsc;

use eframe::egui;
use glam::UVec2;
use limpid::camera::Camera;
use limpid_io::error::Error;
use limpid_io::project::Project;
use serde_json::json;
use wasm_bindgen::JsValue;
use web_sys::File;

use crate::app::link;
use crate::app::log::Log;
use crate::app::state::Jobs;
use crate::backend::core::messages::Post;
use crate::backend::frames::Frames;
use crate::backend::web::{Ask, Edits, Worker};
use crate::model::demos;
use crate::model::document::{Source, opened_of};
use crate::model::views::View;
use crate::{Options, Viewer};

impl Viewer {
    /// Has the page show the browser's dialog for files, or for a folder.
    pub(crate) fn pick(&mut self, folder: bool) {
        // It fails for a page that has gone.
        let _ = self.jobs.drawing.call("pick", &[folder.into()]);
    }

    /// Offers the edited scene with the current camera to the user.
    pub fn save_scene(&mut self, path: PathBuf) {
        let Some(at) = self.frame_time() else { return };
        let Some(document) = self.opened.document.as_ref().map(|document| document.id) else {
            return;
        };
        if !self.jobs.drawing.is_running() {
            return self
                .fail(&Error::Usage("open the document again, its worker has ended".into()));
        }
        let (edits, camera) = (Edits::of(&self.fine_scene()), self.eye.camera);
        let (processor, name) = (self.opened.frames.processor, path.to_string_lossy().into_owned());
        self.jobs.drawing.ask(&Ask::SaveScene { document, edits, camera, at, processor, name });
    }

    /// Offers the camera path to the user.
    pub(crate) fn download_path(&mut self, path: &Path) {
        let saved = self.eye.path.to_toml().map(|text| {
            self.jobs.drawing.download(&path.to_string_lossy(), text.as_bytes().into());
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
        self.wishes.frame = wishes.frame;
        self.grant_frame();
        if let Some(aov) = wishes.view {
            self.set_view(View::Image(aov, 0));
        }
        self.playback.playing |= wishes.play;
        self.picture.refine &= !wishes.unrefined;
    }

    /// Goes to the frame that the address asks for, if it is there: a simulation makes it later.
    pub(crate) fn grant_frame(&mut self) {
        if let Some(frame) = self.wishes.frame
            && let Some(index) = self.opened.frame_times.iter().position(|at| at.frame == frame)
        {
            self.playback.seek(index);
            self.wishes.frame = None;
        }
    }

    /// Opens a URL that was typed.
    pub(crate) fn open_url(&mut self, url: &str) {
        let url = self.jobs.drawing.absolute(url);
        self.open(Source::new(url));
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
        if let Some(link) = link.ok().and_then(|link| link.as_string()) {
            ctx.copy_text(link.clone());
            self.show_info(format!("copied: {link}"));
        }
    }

    /// Starts another worker after the last one has ended, and opens the document again. Without a reason its memory has
    /// run out.
    pub(crate) fn restart_worker(&mut self, reason: Option<String>) {
        let worker = self.jobs.drawing.clone();
        let busy = worker.end();
        let at = self.frame_time();
        // Whatever was asked is not answered any more.
        self.opened.frames.clear();
        self.picture.answered = self.picture.asked;
        self.picture.subject = None;
        // The next worker has none of these frames.
        for side in &mut self.editing.sides {
            (side.loaded, side.at) = (None, None);
        }
        self.opened.before = None;
        let opening = self.opened.opening.take().filter(|opening| opening.pending);
        let opened = opening.as_ref().filter(|opening| busy == Some(opening.number));
        let name = opened.map(|opening| opening.source.input.clone());
        let problem = match (&name, reason) {
            (Some(name), None) => format!("{name}: takes more memory than a page has"),
            // As a decoder that panics fails elsewhere.
            (Some(name), Some(_)) => format!("{name}: damaged: its decoder failed"),
            (None, None) => "memory ran out, of which a page has 4 GiB at most".into(),
            (None, Some(reason)) => format!("the worker failed ({reason})"),
        };
        let restarted = worker.restart();
        let remedy = if restarted { "" } else { "; open the document again to go on" };
        self.fail(&Error::Usage(problem + remedy));
        if !restarted {
            return;
        }
        let before = self.opened.document.as_ref().map(|document| document.source.clone());
        match (opening, before) {
            (Some(opening), _) if name.is_none() => {
                self.begin_opening(opening.source.clone(), opening.replaces);
            }
            (_, Some(before)) => {
                self.reopen(before);
                self.wishes.frame = at.map(|at| at.frame);
            }
            _ => {}
        }
    }
}

/// The settings of a page.
pub struct PageOptions {
    /// The functions of the page: `worker()` starts a worker and returns it, `pick(folder)` shows the browser's
    /// dialog for files, `save(name, bytes)` offers a file to the user, `absolute(url)` makes a URL absolute, and
    /// `link(query)` makes a link.
    pub host: JsValue,
    /// The parameters of the address: see [`link`].
    pub query: Vec<(String, String)>,
    /// Whether it is a picture and a timeline alone, within another page.
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
    /// Creates the viewer, starts its worker, and opens what the address names. Without that it opens a demo, and so it
    /// does beside a notice if a parameter is wrong.
    pub fn new(options: PageOptions) -> Self {
        let (sender, messages) = mpsc::channel();
        let post = Post::new(sender);
        let worker = Worker::new(options.host, post.clone());
        let opened = link::parse(&options.query);
        let source = match &opened {
            Ok(link) => worker.absolute_source(link.source.clone()),
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
        let mut viewer = self.viewer.borrow_mut();
        viewer.reset_for_new_window();
        viewer.show_info("the page's canvas was lost; another one takes its place".into());
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
        match opened_of(&paths) {
            Some(input) if input.is_empty() => self.open_path(&folder),
            Some(input) => self.open_path(&format!("{folder}/{input}")),
            None => {
                let mut viewer = self.viewer.borrow_mut();
                viewer.fail(&Error::Usage("no files could be read in what was given".into()));
                viewer.wake();
            }
        }
    }

    /// Opens a URL, which may be relative to the page.
    pub fn open(&self, url: &str) {
        self.open_path(&self.worker.absolute(url));
    }

    fn open_path(&self, input: &str) {
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
        viewer.open(self.worker.absolute_source(link.source));
        viewer.wishes = link.wishes;
        viewer.wake();
        Ok(())
    }

    /// Changes the open document, as `--set` does.
    ///
    /// # Errors
    /// As [`Project::set`].
    pub fn set(&self, overrides: &[String]) -> Result<(), Error> {
        let mut viewer = self.viewer.borrow_mut();
        let edited = viewer.editing.edited;
        let scene = viewer.editing.scenes[edited].clone();
        let processor = viewer.opened.frames.processor;
        let mut project = Project { scene, processor, ..Project::default() };
        project.set(overrides)?;
        viewer.editing.scenes[edited] = project.scene;
        viewer.opened.frames.processor = project.processor;
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
        let mut viewer = self.viewer.borrow_mut();
        viewer.save_picture(name.into(), size, samples);
        viewer.wake();
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
