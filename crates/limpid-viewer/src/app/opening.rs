//! Simulated scenes: a thread simulates missing frames while finished ones play.

#[cfg(not(target_arch = "wasm32"))]
use std::ops::ControlFlow;
#[cfg(not(target_arch = "wasm32"))]
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::Viewer;
#[cfg(not(target_arch = "wasm32"))]
use crate::backend::core::messages::Message;
#[cfg(not(target_arch = "wasm32"))]
use crate::backend::core::opening::simulated;
use crate::model::document::{Document, Source};
use limpid::look::Framing;
#[cfg(not(target_arch = "wasm32"))]
use limpid::scene::Solid;
#[cfg(not(target_arch = "wasm32"))]
use limpid_io::bake;
use limpid_io::bake::Progress;
use limpid_io::error::Result;
#[cfg(not(target_arch = "wasm32"))]
use limpid_sim::sim::Simulation;

/// A source that is open or being opened; dropping this stops its bake after the current frame.
#[derive(Debug)]
pub(crate) struct Opening {
    pub(crate) number: u64,
    pub(crate) source: Source,
    /// Whether it takes the place of the same source with other adjustments.
    pub(crate) replaces: bool,
    /// Whether it is still to be read.
    pub(crate) pending: bool,
    /// Whether it has been read and is the open document.
    opened: bool,
    /// Progress of its bake; `None` if none is needed or it has ended.
    pub(crate) progress: Option<Progress>,
    /// Whether the folder is being searched for new frames.
    pub(crate) growing: bool,
    /// Whether more frames have been baked since that search began.
    again: bool,
    stop: Arc<AtomicBool>,
}

impl Drop for Opening {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl Viewer {
    /// Opens a source in place of the current one, once it has been read. Until then, and if reading
    /// fails, a bake of the current one continues.
    pub fn open(&mut self, source: Source) {
        self.begin_opening(source, false);
    }

    /// Opens the current source again, with other adjustments: settings, camera and playback stay.
    pub(crate) fn reopen(&mut self, source: Source) {
        self.begin_opening(source, true);
    }

    pub(crate) fn begin_opening(&mut self, mut source: Source, again: bool) {
        // Wider windows show more at both sides; before the first frame the size is not known.
        let shown = Framing::of(self.picture.viewport_size);
        let is_known = self.picture.viewport_size.min_element() > 0;
        // The same source keeps its camera.
        if !again && is_known && shown.aspect < Framing::default().aspect {
            source.framing = shown;
        }
        self.opened.openings += 1;
        // They were for another source.
        #[cfg(target_arch = "wasm32")]
        {
            self.wishes = Default::default();
        }
        let number = self.opened.openings;
        // Two bakes of one scene would write the same files.
        let kept = |old: &Opening| old.opened && old.source.input != source.input;
        if let Some(old) = self.opened.opening.take().filter(kept) {
            self.opened.before = Some(old);
        }
        self.opened.before = self.opened.before.take().filter(kept);
        let stop = Arc::new(AtomicBool::new(false));
        let (post, requested, stopped) = (self.jobs.post.clone(), source.clone(), stop.clone());
        self.opened.opening = Some(Opening {
            number,
            source,
            replaces: again,
            pending: true,
            opened: false,
            progress: None,
            growing: false,
            again: false,
            stop,
        });
        #[cfg(target_arch = "wasm32")]
        {
            drop(post);
            self.jobs.drawing.open(number, &requested, again, stopped);
        }
        #[cfg(not(target_arch = "wasm32"))]
        std::thread::spawn(move || {
            let report = |document| post.send(Message::Opened(number, Box::new(document)));
            let Some(project) = simulated(&requested) else {
                return report(Document::open(&requested));
            };
            let Some(simulation) = project.source.simulation() else { return };
            let mut open = Document::open(&requested).map(|document| report(Ok(document))).is_ok();
            let baked = bake(simulation, &project.scene.solids, &requested, |progress| {
                if !open {
                    // The requested frames may be the last to be baked.
                    let document = Document::open(&requested);
                    if document.is_ok() || progress.done == progress.frames {
                        open = true;
                        report(document);
                    }
                }
                post.send(Message::Baked(number, progress));
                match stopped.load(Ordering::Relaxed) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            });
            match baked {
                Err(error) if open => post.send(Message::NotBaked(number, error)),
                Err(error) => report(Err(error)),
                Ok(()) => {}
            }
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

    /// The opening with this number, unless it has been dropped.
    pub(crate) fn opening_mut(&mut self, number: u64) -> Option<&mut Opening> {
        let all = [&mut self.opened.opening, &mut self.opened.before];
        all.into_iter().flatten().find(|opening| opening.number == number)
    }

    /// Handles the progress of a bake.
    pub(crate) fn take_progress(&mut self, number: u64, progress: Progress) {
        let known =
            self.opened.document.as_ref().map_or(0, |open| open.input.sequence.frames.len());
        let Some(opening) = self.opening_mut(number) else {
            return;
        };
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

    /// Searches for new frames on a thread.
    fn grow(&mut self, number: u64) {
        let Some(opening) = self.opening_mut(number) else { return };
        (opening.growing, opening.again) = (true, false);
        #[cfg(target_arch = "wasm32")]
        self.jobs.drawing.grow(number);
        #[cfg(not(target_arch = "wasm32"))]
        {
            let (source, post) = (opening.source.clone(), self.jobs.post.clone());
            std::thread::spawn(move || {
                post.send(Message::Grown(number, Box::new(Document::open(&source))));
            });
        }
    }

    /// Replaces the document by one with more frames; all other state stays.
    pub(crate) fn handle_grown(&mut self, number: u64, document: Result<Document>) {
        let Some(opening) = self.opening_mut(number) else {
            return;
        };
        opening.growing = false;
        let again = opening.again;
        match document {
            Ok(document) if opening.opened => {
                self.opened.frame_times = document.frame_times(self.playback.speed()).into();
                self.playback.set_count(self.opened.frame_times.len());
                let frames = document.numbers.len();
                self.opened.document = Some(Arc::new(document));
                self.jobs.log.event("grown", serde_json::json!({ "frames": frames }));
                #[cfg(target_arch = "wasm32")]
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
}

#[cfg(not(target_arch = "wasm32"))]
fn bake(
    simulation: &Simulation,
    solids: &[Solid],
    source: &Source,
    progress: impl FnMut(Progress) -> ControlFlow<()>,
) -> Result<()> {
    let path = Path::new(&source.input);
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    bake::bake(simulation, solids, &name, &bake::folder(path), progress)
}
