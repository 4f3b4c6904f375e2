//! Refinement of the picture: a draft while things move, better pictures at rest.

#[cfg(not(target_arch = "wasm32"))]
use std::path::Path;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use web_time::Instant;

use eframe::egui;
use glam::UVec2;

use crate::backend::background::drop_in_background;
use crate::backend::core::drawing::{Pane, Request};
use crate::backend::core::messages::Message;
use crate::model::command_line::command_line;
use crate::model::level::Level;
use crate::model::views::View;
use crate::picture::viewport::Picture;
use crate::{Compare, FINE_SAMPLES, Viewer};
use limpid::camera::Camera;
use limpid::scene::Scene;
use limpid_io::error::Error;
#[cfg(not(target_arch = "wasm32"))]
use limpid_io::error::Result;
use limpid_io::input::Loaded;
#[cfg(not(target_arch = "wasm32"))]
use limpid_io::project::Project;
#[cfg(not(target_arch = "wasm32"))]
use limpid_io::shared_classifier::Processor;

/// Most rays per edge pixel in drafts.
const DRAFT_EDGE_SAMPLES: u32 = 4;

/// Time from the last change until a picture is at rest.
const REST: Duration = Duration::from_millis(150);

/// The state of one of the two settings.
#[derive(Debug, Default)]
pub(crate) struct Side {
    pub(crate) loaded: Option<Arc<Loaded>>,
    /// Index of the frame time last taken from a cache, loaded or failed; `None` while it is missing.
    pub(crate) at: Option<usize>,
    /// Whether `loaded` is that frame time, classified by the current settings.
    pub(crate) fits: bool,
    pub(crate) picture: Picture,
}

/// The inputs of the last requested picture, except its level.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Subject {
    scenes: Vec<Scene>,
    /// Addresses that identify the particles: each load has its own.
    loaded: Vec<usize>,
    camera: Camera,
    sizes: Vec<UVec2>,
    view: View,
    refine: bool,
}

impl Subject {
    /// Whether another subject differs at most in its frame, and in the camera if that `follows` a path.
    fn shows(&self, other: &Self, follows: bool) -> bool {
        self.scenes == other.scenes
            && (follows || self.camera == other.camera)
            && (&self.sizes, self.view, self.refine) == (&other.sizes, other.view, other.refine)
    }
}

impl Viewer {
    /// Indices of the settings on screen.
    pub(crate) fn visible(&self) -> Vec<usize> {
        if self.editing.compare == Compare::Off { vec![self.editing.edited] } else { vec![0, 1] }
    }

    /// Whether the current frame time is shown.
    pub(crate) fn is_caught_up(&self) -> bool {
        let index = Some(self.playback.index());
        let taken = self.visible().into_iter().all(|i| self.editing.sides[i].at == index);
        taken && self.picture.answered == self.picture.asked
    }

    /// Whether the particles of the current frame time are loaded, classified by the current settings.
    pub(crate) fn has_particles(&self) -> bool {
        let index = Some(self.playback.index());
        let fits = |i: usize| self.editing.sides[i].fits && self.editing.sides[i].at == index;
        self.visible().into_iter().all(fits)
    }

    /// Has a device opened, if frames are to be classified on it.
    #[cfg(not(target_arch = "wasm32"))]
    fn open_device(&mut self) {
        let on_device = self.opened.frames.processor == Processor::Gpu;
        if on_device && !self.jobs.device_asked {
            self.jobs.device_asked = true;
            if self.jobs.classifier.wait_for_device() {
                self.jobs.drawing.open_device();
            }
        }
    }

    /// Takes the current frame time from the caches, and updates their playback position.
    pub(crate) fn load(&mut self) {
        let Some(document) = self.opened.document.clone() else { return };
        // The first picture opens a device, but it needs its particles first.
        #[cfg(not(target_arch = "wasm32"))]
        self.open_device();
        let visible = self.visible();
        let scenes: Vec<&Scene> = visible.iter().map(|&i| &self.editing.scenes[i]).collect();
        let index = self.playback.index();
        let dragging =
            self.jobs.post.context().is_some_and(|ctx| ctx.input(|input| input.pointer.any_down()));
        let post = self.jobs.post.clone();
        let step = self.playback.speed().step();
        self.opened.frames.prepare(
            &document,
            &self.opened.frame_times,
            step,
            &scenes,
            (index, dragging),
            move || {
                post.send(Message::Loaded);
            },
        );
        // Frames whose pictures are kept need no particles while they play.
        let wanted = if self.playback.playing { self.first_missing() } else { Some(index) };
        if let Some(wanted) = wanted {
            self.opened.frames.aim(wanted, self.playback.step(), self.playback.looped);
        }
        let mut first = None;
        for side in visible {
            match self.opened.frames.get(&self.editing.scenes[side], index) {
                Some((Ok(loaded), fits)) => {
                    if self.editing.sides.iter().all(|side| side.loaded.is_none()) {
                        first = Some((loaded.clone(), side));
                    }
                    let side = &mut self.editing.sides[side];
                    (side.at, side.fits) = (Some(index), fits);
                    let old = side.loaded.replace(loaded);
                    if let Some(last) = old.filter(|old| Arc::strong_count(old) == 1) {
                        drop_in_background(last);
                    }
                }
                Some((Err(error), _)) => {
                    let side = &mut self.editing.sides[side];
                    (side.at, side.fits) = (Some(index), false);
                    // Report the error once; playback continues.
                    if self.opened.failed.insert(index) {
                        self.fail(&error);
                    }
                }
                None => self.editing.sides[side].at = None,
            }
        }
        // In a browser the worker tells them, which has the particles.
        if !cfg!(target_arch = "wasm32")
            && let Some((loaded, side)) = first
        {
            self.show_notices(&loaded, side);
        }
    }

    /// Shows the notices on the first frame of the document.
    fn show_notices(&mut self, loaded: &Loaded, side: usize) {
        let Some(document) = &self.opened.document else { return };
        for notice in document.notices(loaded, &self.editing.scenes[side]) {
            self.show_info(notice.to_string());
        }
    }

    /// Requests the picture that should be shown, unless it has been requested, or is kept in the flipbook.
    pub(crate) fn ask(&mut self, ctx: &egui::Context) {
        self.flip();
        let kept = self.flipping.shown.is_some();
        if kept && (self.playback.playing || !self.has_particles()) {
            return;
        }
        let visible = self.visible();
        let loaded: Option<Vec<Arc<Loaded>>> =
            visible.iter().map(|&i| self.editing.sides[i].loaded.clone()).collect();
        let full = self.full_size();
        // There is nothing to draw, or the window is minimised.
        let Some(loaded) = loaded.filter(|_| full.min_element() > 0) else { return };
        let subject = Subject {
            scenes: visible.iter().map(|&i| self.editing.scenes[i].clone()).collect(),
            loaded: loaded.iter().map(|loaded| Arc::as_ptr(loaded) as usize).collect(),
            camera: self.eye.camera,
            sizes: vec![full; visible.len()],
            view: self.picture.view,
            refine: self.picture.refine,
        };
        let now = Instant::now();
        let changed = self.picture.subject.as_ref() != Some(&subject);
        let level = if changed {
            self.picture.changed = now;
            if kept {
                // As if it had just been drawn.
                self.picture.subject = Some(subject);
                self.picture.asked_level = Level::Full;
                ctx.request_repaint_after(REST);
                return;
            }
            let other_frame = self
                .picture
                .subject
                .as_ref()
                .is_some_and(|last| last.shows(&subject, self.eye.follow));
            if other_frame && self.fills_flipbook() { Level::Full } else { Level::Draft }
        } else if self.picture.answered < self.picture.asked {
            // A request is in progress.
            return;
        } else if self.playback.playing
            || self.picture.dragging
            || now.duration_since(self.picture.changed) < REST
        {
            // Playback and the pointer wake the interface themselves.
            let rest = REST.saturating_sub(now.duration_since(self.picture.changed));
            if self.picture.asked_level < Level::Fine && !rest.is_zero() {
                ctx.request_repaint_after(rest);
            }
            return;
        } else {
            match self.picture.asked_level {
                Level::Draft => Level::Full,
                Level::Full => Level::Fine,
                Level::Fine => return,
            }
        };
        let samples = |scene: &Scene| match level {
            Level::Draft | Level::Full => 1,
            Level::Fine => self.fine_samples(scene),
        };
        let fine_is_full = visible.iter().all(|&i| self.fine_samples(&self.editing.scenes[i]) == 1);
        if level == Level::Fine && fine_is_full && self.picture.asked_level == Level::Full {
            self.picture.asked_level = Level::Fine;
            return;
        }
        let size = if level == Level::Draft { self.picture.resolution.draft(full) } else { full };
        let panes = visible.iter().zip(loaded).map(|(&i, loaded)| {
            let mut scene = self.editing.scenes[i].clone();
            scene.settings.refract.samples = samples(&scene);
            if level == Level::Draft {
                let edges = &mut scene.settings.refract.edge_samples;
                *edges = (*edges).min(DRAFT_EDGE_SAMPLES);
            }
            Pane { scene: Arc::new(scene), camera: self.eye.camera, loaded, size }
        });
        let panes = panes.collect();
        self.flipping.asked = match level {
            Level::Draft => None,
            Level::Full | Level::Fine => self.page().filter(|_| self.has_particles()),
        };
        self.picture.asked += 1;
        self.picture.asked_level = level;
        self.picture.undrawn = false;
        self.picture.subject = Some(subject);
        self.jobs.drawing.request(Request {
            number: self.picture.asked,
            panes,
            level,
            view: self.picture.view,
        });
    }

    /// Size of one picture on screen, pixels.
    pub(crate) fn full_size(&self) -> UVec2 {
        match self.editing.compare {
            Compare::SideBySide => {
                UVec2::new(self.picture.viewport_size.x / 2, self.picture.viewport_size.y)
            }
            _ => self.picture.viewport_size,
        }
    }

    /// Rays per pixel of a scene's picture at rest.
    pub(crate) fn fine_samples(&self, scene: &Scene) -> u32 {
        let own = scene.settings.refract.samples;
        if self.picture.refine { own.max(FINE_SAMPLES) } else { own }
    }

    /// The scene that is edited, as its picture at rest is drawn.
    pub(crate) fn fine_scene(&self) -> Scene {
        let mut scene = self.editing.scenes[self.editing.edited].clone();
        scene.settings.refract.samples = self.fine_samples(&scene);
        scene
    }

    /// The command that draws the picture at rest without a window; `None` if nothing is open.
    pub fn command_line(&self, output: &str) -> Option<String> {
        let document = self.opened.document.as_ref()?;
        let (scene, at) = (self.fine_scene(), self.frame_time()?);
        let size = self.picture.viewport_size.max(UVec2::ONE);
        let processor = self.opened.frames.processor;
        Some(command_line(document, (&scene, processor), &self.eye.camera, at, size, output))
    }

    /// Draws the picture at rest at `size` pixels and writes it in the format of the extension, in the
    /// background. Fails if the current frame is not loaded, because the one shown instead must not be
    /// saved under its name.
    pub fn save_picture(&mut self, path: PathBuf, size: UVec2, samples: u32) {
        let side = &self.editing.sides[self.editing.edited];
        let present = side.fits && side.at == Some(self.playback.index());
        let Some(loaded) = side.loaded.clone().filter(|_| present) else {
            self.fail(&Error::Usage("not saved: this frame is not loaded".into()));
            return;
        };
        let mut scene = self.fine_scene();
        scene.settings.refract.samples = samples;
        let pane = Pane { scene: Arc::new(scene), camera: self.eye.camera, loaded, size };
        self.jobs.drawing.save(pane, path, self.opened.document.clone());
    }

    /// Writes the edited scene with the current camera, in the background.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn save_scene(&mut self, path: PathBuf) {
        let (Some(document), Some(at)) = (self.opened.document.clone(), self.frame_time()) else {
            return;
        };
        let (scene, camera, processor) =
            (self.fine_scene(), self.eye.camera, self.opened.frames.processor);
        // Writing an environment map takes time.
        self.write(path, move |path| {
            document.check_scene_output(path)?;
            Project { processor, ..document.saved(scene, camera, at) }.save(path)
        });
    }

    /// Writes a file on its own thread, which the viewer joins when it is dropped.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn write(
        &mut self,
        path: PathBuf,
        write: impl FnOnce(&Path) -> Result<()> + Send + 'static,
    ) {
        let post = self.jobs.post.clone();
        let writer = move || post.send(Message::Saved(write(&path).map(|()| path)));
        self.jobs.writers.retain(|writer| !writer.is_finished());
        self.jobs.writers.push(std::thread::spawn(writer));
    }

    /// Whether the picture at rest is on screen, for the current frame time and settings.
    pub fn is_at_rest(&self) -> bool {
        self.opened.document.is_some()
            && self.opened.opening.as_ref().is_none_or(|opening| !opening.pending)
            && self.is_caught_up()
            && self.visible().into_iter().all(|i| self.editing.sides[i].fits)
            && self.picture.asked_level == Level::Fine
            && self.picture.asked > 0
            && !self.picture.undrawn
            && !self.playback.playing
    }
}
