//! The viewer of a page, as JavaScript calls it, and features that only pages have.

use std::cell::{Cell, RefCell};
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::mpsc;

use eframe::egui;
use glam::UVec2;
use limpid::camera::Camera;
use limpid_io::error::Error;
use limpid_io::project::Project;
use wasm_bindgen::JsValue;
use web_sys::File;

use crate::app::link;
use crate::app::saving::NO_FILMS;
use crate::app::{Options, Viewer};
use crate::backend::core::messages::Post;
use crate::backend::web::{Ask, Backend, Crash, Edits, demos};
use crate::model::document::{Source, framing_of, opened_of};
use crate::model::log::Log;
use crate::panels::dialogs::{Browse, Dialog};

impl Viewer {
    /// Opens a URL that was typed.
    pub(super) fn open_typed(&mut self, url: &str) {
        let url = self.backend.absolute(url);
        self.open(Source::new(url));
    }

    /// Has the page show the browser's dialog for files, or for a folder, in place of ours.
    pub(super) fn browse(&mut self, _dialog: Dialog, how: Browse) {
        // It fails for a page that has gone.
        let _ = self.backend.call("pick", &[(how == Browse::Folder).into()]);
    }

    /// Copies a link that opens this picture.
    pub(super) fn copy(&mut self, ctx: &egui::Context) {
        let Some(query) = link::query(self) else {
            self.show_info("only files on a server can be linked to, these are yours alone".into());
            return;
        };
        let link = self.backend.call("link", &[query.as_str().into()]);
        if let Some(link) = link.ok().and_then(|link| link.as_string()) {
            ctx.copy_text(link.clone());
            self.show_info(format!("copied: {link}"));
        }
    }

    /// Offers the edited scene with the current camera to the user.
    pub fn save_scene(&mut self, path: PathBuf) {
        let Some(at) = self.stage.frame_time() else { return };
        let Some(document) = self.opened.document.as_ref().map(|document| document.id) else {
            return;
        };
        if !self.backend.is_running() {
            return self
                .fail(&Error::Usage("open the document again, its worker has ended".into()));
        }
        let edits = Edits::of(&self.picture.fine_scene(&self.stage.editing));
        let (camera, processor) = (self.stage.eye.camera, self.stage.processor);
        let color_by = self.stage.colors.by.clone();
        let name = path.to_string_lossy().into_owned();
        let ask = Ask::SaveScene { document, edits, color_by, camera, at, processor, name };
        self.backend.ask(&ask);
    }

    /// Offers the camera path to the user.
    pub(super) fn save_path(&mut self, path: PathBuf) {
        let saved = self.stage.eye.path.to_toml().map(|text| {
            self.backend.download(&path.to_string_lossy(), text.as_bytes().into());
            path
        });
        self.take_saved(saved);
    }

    /// Nothing: a page is given scenes and particles alone.
    pub(super) fn load_path(&self, _path: PathBuf) {}

    /// Nothing: a page saves no films.
    pub(super) fn film_facts(&self) -> String {
        String::new()
    }

    /// Says why no film is saved.
    pub fn save_film(&mut self, _path: PathBuf, _size: UVec2, _samples: u32) {
        self.show_info(NO_FILMS.into());
    }

    /// Starts another worker after the last one has ended, and opens the document again. Without a reason its memory has
    /// run out.
    pub(crate) fn restart_worker(&mut self, reason: Option<String>) {
        let worker = self.backend.clone();
        let busy = worker.end();
        let at = self.stage.frame_time();
        // No request is answered any more.
        self.opened.frames.clear();
        self.picture.answered = self.picture.asked;
        self.picture.withdraw();
        // The next worker has none of these frames.
        for side in &mut self.picture.sides {
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
                self.opened.wishes.frame = at.map(|at| at.frame);
            }
            _ => {}
        }
    }
}

/// The settings of a page.
pub struct PageOptions {
    /// The functions of the page: `worker()` starts a worker and returns it, `pick(folder)` shows the browser's
    /// dialog for files, `save(name, bytes)` offers a file to the user, `absolute(url)` makes a URL absolute,
    /// `link(query)` makes a link, and `still()` says whether the user wants no motion.
    pub host: JsValue,
    /// The parameters of the address: see [`link`].
    pub query: Vec<(String, String)>,
    /// Whether it is a picture and a timeline alone, within another page.
    pub plain: bool,
    /// Size of the element, whatever its unit: an automatic camera is for its shape.
    pub size: UVec2,
}

/// A viewer in a page.
#[derive(Clone)]
pub struct Page {
    viewer: Rc<RefCell<Viewer>>,
    worker: Backend,
    /// Number of drops and choices of files so far.
    drops: Rc<Cell<u32>>,
}

impl Page {
    /// Creates the viewer, starts its worker, and opens the source in the address, or without one a demo, with a
    /// notice if a parameter is wrong.
    pub fn new(options: PageOptions) -> Self {
        let (sender, messages) = mpsc::channel();
        let post = Post::new(sender);
        let worker = Backend::new(options.host, post.clone());
        let still = worker.call("still", &[]).is_ok_and(|still| still.is_truthy());
        let opened = link::parse(&options.query);
        let source = match &opened {
            Ok(link) => worker.absolute_source(link.source.clone()),
            Err(_) => Source::new(demos::first_source()),
        };
        let source = Source { framing: framing_of(options.size), ..source };
        let viewer_options = Options {
            source: Some(source),
            memory: 512 << 20,
            flipbook: 256 << 20,
            ..Options::default()
        };
        let log = Log::new(None).expect("without a file nothing can fail");
        let mut viewer = Viewer::of(viewer_options, worker.clone(), (post, messages), log);
        (viewer.interface.still, viewer.interface.plain) = (still, options.plain);
        viewer.interface.invites = !options.plain && !matches!(&opened, Ok(link) if !link.is_first);
        match opened {
            Ok(link) => {
                viewer.opened.wishes = link.wishes;
                let best = Some(demos::STILL_FRAME).filter(|_| still && link.is_first);
                viewer.opened.wishes.frame = viewer.opened.wishes.frame.or(best);
            }
            Err(error) => viewer.fail(&error),
        }
        if options.plain {
            viewer.interface.panels = [false; 2];
            viewer.picture.has_triad = false;
        }
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
                viewer.post.wake();
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
        viewer.post.wake();
    }

    /// Opens the source in the parameters of an address.
    ///
    /// # Errors
    /// As [`link::parse`].
    pub fn open_query(&self, query: &[(String, String)]) -> Result<(), Error> {
        let link = link::parse(query)?;
        let mut viewer = self.viewer.borrow_mut();
        viewer.open(self.worker.absolute_source(link.source));
        viewer.opened.wishes = link.wishes;
        viewer.post.wake();
        Ok(())
    }

    /// Changes the open document, as `--set` does.
    ///
    /// # Errors
    /// As [`Project::set`].
    pub fn set(&self, overrides: &[String]) -> Result<(), Error> {
        let mut viewer = self.viewer.borrow_mut();
        let edited = viewer.stage.editing.edited;
        let scene = viewer.stage.editing.scenes[edited].clone();
        let processor = viewer.stage.processor;
        let color_by = viewer.stage.colors.by.clone();
        let mut project = Project { scene, processor, color_by, ..Project::default() };
        project.set(overrides)?;
        viewer.stage.processor = project.processor;
        viewer.set_colors(project.color_by, overrides);
        viewer.stage.editing.scenes[edited] = project.scene;
        viewer.post.wake();
        Ok(())
    }

    /// Sets the camera, written as for `--camera`.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the wrong parameter.
    pub fn set_camera(&self, camera: &str) -> Result<(), Error> {
        let camera: Camera = camera.parse()?;
        let mut viewer = self.viewer.borrow_mut();
        viewer.stage.eye.set(camera);
        viewer.post.wake();
        Ok(())
    }

    /// Plays or pauses.
    pub fn play(&self, playing: bool) {
        let mut viewer = self.viewer.borrow_mut();
        viewer.stage.playback.playing = playing;
        viewer.post.wake();
    }

    /// Goes to the frame of an index, from 0.
    pub fn seek(&self, index: usize) {
        let mut viewer = self.viewer.borrow_mut();
        viewer.seek(index);
        viewer.post.wake();
    }

    /// Draws the picture at rest at another size, and saves it under a name.
    pub fn save(&self, name: &str, size: UVec2, samples: u32) {
        let mut viewer = self.viewer.borrow_mut();
        viewer.save_picture(name.into(), size, samples);
        viewer.post.wake();
    }

    /// The parameters of an address that opens this picture; `None` for files of the user.
    pub fn query(&self) -> Option<String> {
        link::query(&self.viewer.borrow())
    }

    /// Loses the worker's device, for tests: another one takes over.
    pub fn lose_device(&self) {
        self.worker.ask(&Ask::Lose);
        self.viewer.borrow().post.wake();
    }

    /// State of the page, as JSON: see [`Viewer::status`].
    pub fn status(&self) -> String {
        self.viewer.borrow().status().to_string()
    }
}

/// The application of one canvas.
struct App {
    viewer: Rc<RefCell<Viewer>>,
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut egui::Ui, _frame: &mut eframe::Frame) {
        let mut viewer = self.viewer.borrow_mut();
        viewer.handle_messages();
        if let Some(Crash(reason)) = viewer.backend.take_crash() {
            viewer.restart_worker(reason);
        }
        viewer.ui(ui);
        viewer.backend.tell_dropped();
    }
}
