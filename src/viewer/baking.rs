//! Simulated scenes: frames that are not there yet are made on a thread while those that are there
//! play.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::document::{Document, Source};
use super::{News, Viewer};
use crate::error::{Error, Result};
use crate::output;
use crate::scene::Scene;
use crate::sim::{self, Progress};

/// The scene that is shown without any other.
const BUILT_IN: &str = include_str!("../../sims/dam_break.toml");

/// What is open or being opened; on dropping this, its bake ends with the frame in hand.
#[derive(Debug)]
pub(super) struct Opening {
    pub(super) number: u64,
    pub(super) source: Source,
    /// Whether it has not been read yet.
    pub(super) pending: bool,
    /// How far its bake has come, if one is needed and has not ended.
    pub(super) progress: Option<Progress>,
    /// Whether frames that have been added are being looked for.
    growing: bool,
    stop: Arc<AtomicBool>,
}

impl Drop for Opening {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl Source {
    /// A dam that breaks, as a scene file in the user's cache folder, beside which its frames go.
    ///
    /// # Errors
    /// [`Error::Io`] naming what cannot be written.
    pub fn built_in() -> Result<Self> {
        let path = cache().join("limpid").join("dam_break.toml");
        let folder = path.parent().unwrap_or(Path::new(""));
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
        if std::fs::read_to_string(&path).ok().as_deref() != Some(BUILT_IN) {
            // Frames of an older version are another liquid's.
            sim::clear("dam_break", &sim::folder(&path))?;
            output::write_atomically(&path, |file| {
                std::io::Write::write_all(file, BUILT_IN.as_bytes())
            })?;
        }
        Ok(Self::new(path.to_string_lossy()))
    }
}

/// Where programs keep what they can make again.
fn cache() -> PathBuf {
    let folder = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    folder("XDG_CACHE_HOME")
        .or_else(|| folder("LOCALAPPDATA"))
        .or_else(|| folder("HOME").map(|home| home.join(".cache")))
        .unwrap_or_else(std::env::temp_dir)
}

impl Viewer {
    /// Opens a source in place of what is open, once it has been read.
    pub fn open(&mut self, source: Source) {
        let number = self.opening.as_ref().map_or(0, |opening| opening.number) + 1;
        let stop = Arc::new(AtomicBool::new(false));
        let (post, given, stopped) = (self.post.clone(), source.clone(), stop.clone());
        self.opening =
            Some(Opening { number, source, pending: true, progress: None, growing: false, stop });
        std::thread::spawn(move || {
            let told = |document| post.send(News::Opened(number, Box::new(document)));
            let Some(scene) = simulated(&given) else { return told(Document::open(&given)) };
            let mut open = Document::open(&given).map(|document| told(Ok(document))).is_ok();
            let baked = bake(&scene, &given, |progress| {
                if !open {
                    open = true;
                    told(Document::open(&given));
                }
                post.send(News::Baked(number, progress));
                match stopped.load(Ordering::Relaxed) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            });
            match baked {
                Err(error) if open => post.send(News::NotBaked(number, error)),
                Err(error) => told(Err(error)),
                Ok(()) => {}
            }
        });
    }

    /// A frame has been added to what is open.
    pub(super) fn take_progress(&mut self, number: u64, progress: Progress) {
        let known = self.document.as_ref().map_or(0, |document| document.numbers.len());
        let Some(opening) = self.opening.as_mut().filter(|opening| opening.number == number) else {
            return;
        };
        let ended = progress.done == progress.frames;
        opening.progress = (!ended).then_some(progress);
        // Rings begin anew with each number of frames, so they grow by half at a time.
        let enough = progress.done as usize > known + known / 2;
        if opening.pending || opening.growing || !(ended || enough) {
            return;
        }
        opening.growing = true;
        let (post, source) = (self.post.clone(), opening.source.clone());
        std::thread::spawn(move || {
            post.send(News::Grown(number, Box::new(Document::open(&source))));
        });
    }

    /// What is open has more frames; all else stays.
    pub(super) fn take_grown(&mut self, number: u64, document: Document) {
        let Some(opening) = self.opening.as_mut().filter(|opening| opening.number == number) else {
            return;
        };
        opening.growing = false;
        self.moments = document.moments(self.playback.speed()).into();
        self.playback.set_count(self.moments.len());
        let ended = opening.progress.is_none();
        let frames = document.numbers.len();
        let total = document.plain.simulation.as_ref().map_or(0, |simulation| simulation.frames);
        self.document = Some(Arc::new(document));
        self.log.event("grown", serde_json::json!({ "frames": frames }));
        // The bake may have ended while these were looked for.
        if ended && (frames as u32) < total {
            self.take_progress(number, Progress { done: total, frames: total });
        }
    }
}

/// The scene of a source that is simulated; `None` for all others, and for what cannot be read,
/// which opening tells.
fn simulated(source: &Source) -> Option<Scene> {
    let path = Path::new(&source.input);
    let scene = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let scene = scene.then(|| Scene::load(path).ok()).flatten()?;
    scene.simulation.is_some().then_some(scene)
}

fn bake(
    scene: &Scene,
    source: &Source,
    progress: impl FnMut(Progress) -> ControlFlow<()>,
) -> Result<()> {
    let path = Path::new(&source.input);
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    sim::bake(scene, &name, &sim::folder(path), progress)
}
