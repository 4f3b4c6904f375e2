//! Opening sources: new documents, those that grow, and the frames of the one that is open.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use serde_json::json;
use web_time::Instant;

use crate::app::Viewer;
use crate::app::state::{Attributes, Opening};
use crate::backend::here::{drop_in_background, spawn};
use crate::model::coloring::Coloring;
use crate::model::document::{Document, Source, framing_of};
use crate::model::history::History;
use crate::model::platform::IN_BROWSER;
use crate::model::playback::{Playback, Speed};
use crate::model::views::View;
use crate::panels::times::Times;
use limpid::scene::Scene;
use limpid_io::adjustments::{Floor, Sun};
use limpid_io::bake::Progress;
use limpid_io::camera_path::CameraPath;
use limpid_io::error::Result;
use limpid_io::input::Loaded;
use limpid_io::particles::Selection;
use limpid_io::project::controls;

impl Viewer {
    /// Opens a source in place of the current one, once it has been read. Until then, and if reading
    /// fails, a bake of the current one continues.
    pub fn open(&mut self, source: Source) {
        self.interface.invites = false;
        self.begin_opening(source, false);
    }

    /// Opens the current source again, with other adjustments: settings, camera and playback stay.
    pub(crate) fn reopen(&mut self, source: Source) {
        self.begin_opening(source, true);
    }

    pub(crate) fn begin_opening(&mut self, mut source: Source, again: bool) {
        // The same source keeps its camera. Before the first frame the size is not known.
        if !again && self.picture.viewport_size.min_element() > 0 {
            source.framing = framing_of(self.picture.viewport_size);
        }
        self.opened.openings += 1;
        // They were for another source.
        self.opened.wishes = Default::default();
        let number = self.opened.openings;
        // Two bakes of one scene would write the same files.
        let kept = |old: &Opening| old.opened && old.source.input != source.input;
        if let Some(old) = self.opened.opening.take().filter(kept) {
            self.opened.before = Some(old);
        }
        self.opened.before = self.opened.before.take().filter(kept);
        let stop = Arc::<AtomicBool>::default();
        self.backend.open(number, &source, again, stop.clone());
        self.opened.opening = Some(Opening {
            number,
            source,
            since: Instant::now(),
            replaces: again,
            pending: true,
            opened: false,
            progress: None,
            stopped: false,
            growing: false,
            again: false,
            stop,
        });
    }

    pub(crate) fn handle_opened(&mut self, number: u64, document: Result<Document>) {
        let Some(opening) = self.opened.opening.as_mut().filter(|opening| opening.number == number)
        else {
            return;
        };
        opening.pending = false;
        match document {
            Ok(document) => {
                opening.opened = true;
                let replaces = opening.replaces;
                // Its first report may come much later than this frame of the interface, in which playback would end.
                if opening.progress.is_none() {
                    opening.progress = progress_of(&document);
                }
                self.opened.before = None;
                match replaces {
                    true => self.reopened(document),
                    false => self.opened(document),
                }
            }
            Err(error) => {
                self.opened.opening = self.opened.before.take().or(self.opened.opening.take());
                self.fail(&error);
            }
        }
    }

    /// Handles the progress of a bake.
    pub(crate) fn take_progress(&mut self, number: u64, progress: Progress) {
        let known =
            self.opened.document.as_ref().map_or(0, |open| open.input.sequence.frames.len());
        let Some(opening) = self.opened.opening_mut(number) else {
            return;
        };
        if opening.stopped {
            return;
        }
        let ended = progress.done == progress.frames;
        opening.progress = (!ended).then_some(progress);
        let known = if opening.opened { known } else { 0 };
        // Frame caches restart when the number of frames changes, so it grows by half at a time.
        let least = if ended { known } else { known + known / 2 };
        if opening.pending || progress.done as usize <= least {
            return;
        }
        if opening.growing {
            opening.again = true;
        } else {
            self.grow(number);
        }
    }

    /// Ends the simulation of the open document, which keeps the frames that are made.
    pub(crate) fn stop_simulation(&mut self) {
        let Some(opening) = &mut self.opened.opening else { return };
        let Some(Progress { done, frames, .. }) = opening.progress.take() else { return };
        let (number, opened) = (opening.number, opening.opened);
        opening.stopped = true;
        self.backend.halt(number, &opening.stop);
        self.show_info(format!(
            "the simulation was stopped after {done} of {frames} frames; open it again to go on"
        ));
        if opened {
            self.grow(number);
        } else {
            self.opened.opening = self.opened.before.take();
        }
    }

    /// Searches for new frames.
    fn grow(&mut self, number: u64) {
        let Some(opening) = self.opened.opening_mut(number) else { return };
        (opening.growing, opening.again) = (true, false);
        self.backend.grow(number, &opening.source);
    }

    /// Replaces the document by one with more frames; all other state stays.
    pub(crate) fn handle_grown(&mut self, number: u64, document: Result<Document>) {
        let Some(opening) = self.opened.opening_mut(number) else {
            return;
        };
        opening.growing = false;
        let again = opening.again;
        match document {
            Ok(document) if opening.opened => {
                self.stage.frame_times = document.frame_times(self.stage.playback.speed()).into();
                self.stage.playback.set_count(self.stage.frame_times.len());
                let frames = document.numbers.len();
                if let Some(old) = self.opened.document.clone() {
                    self.recolor_reopened(&old, &document);
                }
                self.opened.document = Some(Arc::new(document));
                self.log.event("grown", serde_json::json!({ "frames": frames }));
                self.grant_frame();
            }
            Ok(document) => {
                opening.opened = true;
                self.opened(document);
            }
            Err(error) => self.fail(&error),
        }
        if again {
            self.grow(number);
        }
    }

    /// Opens the current source again, with these of its particles. Ground, sun and liquid stay as they are, although they
    /// were chosen by the whole body.
    pub(super) fn select(&mut self, select: Selection) {
        let Some(document) = &self.opened.document else { return };
        let mut source = document.source.clone();
        source.options.select = select;
        let scene = &document.project.scene;
        let (floor, sun) = (Floor::of(scene), Sun::of(scene));
        if document.is_bare() && floor != Floor::None {
            source.adjustments.floor.get_or_insert(floor);
        }
        if document.is_bare() && sun != Sun::None {
            source.adjustments.sun.get_or_insert(sun);
        }
        self.reopen(source);
    }

    pub(crate) fn opened(&mut self, document: Document) {
        // Simulations start playing.
        let plays = document.project.source.simulation().is_some() && !self.interface.still;
        let frames = document.numbers.len();
        self.log.event(
            "opened",
            json!({ "input": document.source.input, "frames": frames, "plays": plays }),
        );
        if let Some(write) = self.interface.recent.add(&document.source.input) {
            // Without the list the viewer is as good.
            spawn(move || drop(write()));
        }
        let document = Arc::new(document);
        self.opened.frames.clear();
        self.opened.failed.clear();
        self.stage.frame_times = document.frame_times(Speed::Real).into();
        let looped = self.stage.playback.looped;
        self.stage.playback = Playback::new(self.stage.frame_times.len(), document.fps());
        self.stage.playback.looped = looped;
        if let Some(named) = document.input.frame
            && let Some(at) =
                self.stage.frame_times.iter().position(|frame_time| frame_time.frame == named)
        {
            self.stage.playback.seek(at);
        }
        self.stage.editing.scenes =
            [document.project.scene.clone(), document.project.scene.clone()];
        self.stage.processor = document.project.processor;
        self.stage.colors = Coloring::of(&document, self.stage.colors.legend);
        self.opened.attributes = Attributes::default();
        self.opened.noticed = false;
        self.stage.editing.edited = 0;
        for side in std::mem::take(&mut self.picture.sides) {
            drop_in_background(side.loaded);
        }
        self.stage.up = document.reading.up;
        self.stage.eye.camera = document.project.camera_for(Default::default());
        self.stage.eye.path = CameraPath::default();
        self.stage.eye.follow = false;
        self.picture.withdraw();
        self.picture.flipping.clear();
        self.times = Times::default();
        self.history = History::default();
        self.errors.clear();
        self.stage.playback.playing = plays;
        self.opened.document = Some(document);
        self.grant_wishes();
    }

    /// Takes the place of the open document by one with other adjustments: settings, camera and playback stay.
    pub(crate) fn reopened(&mut self, document: Document) {
        let Some(old) = self.opened.document.clone() else { return self.opened(document) };
        let was_home = self.stage.eye.camera == old.project.camera_for(Default::default());
        let particles = |source: &Source| (source.adjustments.up, source.adjustments.scale);
        let moved = particles(&old.source) != particles(&document.source);
        let same = old.has_frames_of(&document);
        let kind =
            |source: &Source| (source.adjustments.color_by.clone(), source.adjustments.medium);
        let is_clipped = old.source.options.select != document.source.options.select;
        let is_other_liquid = kind(&old.source) != kind(&document.source);
        for edited in &mut self.stage.editing.scenes {
            let (before, after) = (&old.project.scene, &document.project.scene);
            let liquid = edited.liquid;
            *edited = carried(edited, before, after, is_other_liquid);
            if is_clipped {
                edited.liquid = liquid;
            }
        }
        self.recolor_reopened(&old, &document);
        if moved {
            self.opened.attributes = Attributes::default();
        }
        if (was_home && !is_clipped) || moved {
            self.stage.eye.camera = document.project.camera_for(Default::default());
        }
        if !same {
            // The picture stays until there is another one, but nothing is drawn of the old particles.
            self.opened.frames.clear();
            self.opened.failed.clear();
            for side in &mut self.picture.sides {
                (side.loaded, side.at, side.time) = (None, None, None);
            }
            self.picture.flipping.clear();
        }
        self.picture.withdraw();
        self.stage.playback.fps = document.fps();
        self.stage.up = document.reading.up;
        self.stage.frame_times = document.frame_times(self.stage.playback.speed()).into();
        self.stage.playback.set_count(self.stage.frame_times.len());
        if let Some(edits) = self.opened.wishes.edits.take() {
            (self.stage.editing.scenes, self.stage.colors) = *edits;
        }
        self.errors.forget();
        self.log.event("reopened", serde_json::json!({ "input": document.source.input }));
        self.opened.document = Some(Arc::new(document));
        self.grant_frame();
    }

    /// Fulfils the further wishes, now that the source is open.
    fn grant_wishes(&mut self) {
        let wishes = std::mem::take(&mut self.opened.wishes);
        if let Some(camera) = wishes.camera {
            self.stage.eye.set(camera);
        }
        self.opened.wishes.frame = wishes.frame;
        self.grant_frame();
        if let Some(aov) = wishes.view {
            self.picture.set_view(View::Image(aov, 0), &mut self.log);
        }
        if let Some(plays) = wishes.play {
            self.stage.playback.playing = plays && !self.interface.still;
        }
        self.picture.refine &= !wishes.unrefined;
        self.stage.colors.legend |= wishes.legend;
        if wishes.legend && self.stage.colors.scale.is_none() {
            self.show_info("no legend is shown: no attribute has a color map".into());
        }
    }

    /// Keeps the map and the range that were chosen for an attribute.
    fn recolor_reopened(&mut self, old: &Document, document: &Document) {
        let chosen = self.stage.colors.edits(old).cloned();
        self.stage.colors = Coloring::of(document, self.stage.colors.legend);
        let by = document.project.color_by.as_ref().map(|by| &by.attribute);
        if let Some(chosen) = chosen.filter(|chosen| Some(&chosen.attribute) == by) {
            self.stage.colors.set(chosen.map, chosen.range, document.usual_range());
        }
    }

    /// Goes to the frame that is asked for, if it is there: a simulation makes it later.
    fn grant_frame(&mut self) {
        if let Some(frame) = self.opened.wishes.frame
            && let Some(index) = self.stage.frame_times.iter().position(|at| at.frame == frame)
        {
            self.stage.playback.seek(index);
            self.opened.wishes.frame = None;
        }
    }

    /// Takes the current frame time from the caches, and updates their playback position.
    pub(super) fn load(&mut self) {
        let Some(document) = self.opened.document.clone() else { return };
        let processor = self.stage.processor;
        self.backend.prepare_device(processor);
        let visible = self.stage.editing.visible();
        let scenes: Vec<&Scene> = visible.iter().map(|&i| &self.stage.editing.scenes[i]).collect();
        let index = self.stage.playback.index();
        let dragging =
            self.post.context().is_some_and(|ctx| ctx.input(|input| input.pointer.any_down()));
        let step = self.stage.playback.speed().step();
        self.opened.frames.prepare(
            &self.backend,
            &document,
            &self.stage.frame_times,
            (step, processor),
            &scenes,
            (index, dragging),
        );
        // Frames whose pictures are kept need no particles while they play.
        let wanted = if self.stage.playback.playing {
            self.picture.first_missing(&self.stage)
        } else {
            Some(index)
        };
        if let Some(wanted) = wanted {
            self.opened.frames.aim(wanted, self.stage.playback.step(), self.stage.playback.looped);
        }
        let mut first = None;
        for side in visible {
            match self.opened.frames.get((&self.stage.editing.scenes[side], processor), index) {
                Some((Ok(loaded), fits)) => {
                    if !std::mem::replace(&mut self.opened.noticed, true) {
                        first = Some((loaded.clone(), side));
                    }
                    let side = &mut self.picture.sides[side];
                    (side.at, side.fits) = (Some(index), fits);
                    side.time = self.stage.frame_time();
                    let old = side.loaded.replace(loaded);
                    if let Some(last) = old.filter(|old| Arc::strong_count(old) == 1) {
                        drop_in_background(last);
                    }
                }
                Some((Err(error), _)) => {
                    let side = &mut self.picture.sides[side];
                    (side.at, side.fits) = (Some(index), false);
                    // Report the error once; playback continues.
                    if self.opened.failed.insert(index) {
                        self.fail(&error);
                    }
                }
                None => self.picture.sides[side].at = None,
            }
        }
        // In a browser the worker tells them, which has the particles.
        if !IN_BROWSER && let Some((loaded, side)) = first {
            self.show_notices(&loaded, side);
        }
    }

    /// Shows the notices on the first frame of the document.
    fn show_notices(&mut self, loaded: &Loaded, side: usize) {
        let Some(document) = &self.opened.document else { return };
        for notice in document.notices(loaded, &self.stage.editing.scenes[side]) {
            self.show_info(notice.to_string());
        }
    }
}

/// The progress of a document's simulation by the frames that it has; `None` if there are none to make.
fn progress_of(document: &Document) -> Option<Progress> {
    let frames = document.project.source.simulation()?.frames;
    let done = document.numbers.len() as u32;
    (done < frames).then_some(Progress { done, frames, again: false })
}

/// The scene `after`, with all that was edited since `before`, except for edits of the liquid if it is another one.
fn carried(edited: &Scene, before: &Scene, after: &Scene, is_other_liquid: bool) -> Scene {
    let mut scene = after.clone();
    for (control, value) in controls::differences(&before.settings, &edited.settings) {
        control.set(&mut scene.settings, &value);
    }
    if is_other_liquid {
        return scene;
    }
    let (new, edited_liquid, old) = (&mut scene.liquid, &edited.liquid, &before.liquid);
    if edited_liquid.kind != old.kind {
        *new = *edited_liquid;
    }
    fn carry<T: PartialEq + Copy>(new: &mut T, edited: T, old: T) {
        if edited != old {
            *new = edited;
        }
    }
    carry(&mut new.ior, edited_liquid.ior, old.ior);
    if new.kind == edited_liquid.kind {
        carry(&mut new.absorption, edited_liquid.absorption, old.absorption);
        carry(&mut new.scattering, edited_liquid.scattering, old.scattering);
        carry(&mut new.anisotropy, edited_liquid.anisotropy, old.anisotropy);
        carry(&mut new.color, edited_liquid.color, old.color);
        carry(&mut new.roughness, edited_liquid.roughness, old.roughness);
    }
    if edited.fluids != before.fluids {
        scene.fluids.clone_from(&edited.fluids);
    }
    scene
}
