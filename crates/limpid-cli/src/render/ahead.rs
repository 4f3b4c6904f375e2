//! Loading of particles ahead of drawing.

use std::sync::Arc;

use limpid::scene::Scene;
use limpid_io::film::Shot;
use limpid_io::frame_cache::FrameCache;
use limpid_io::input::{FrameTime, Loaded, Loader};
use limpid_io::shared_classifier::SharedClassifier;

/// Loads particles on threads of its own.
pub(super) struct Ahead {
    cache: FrameCache,
    /// Indices of the frame times in the cache, ascending: pictures of the same particles share one.
    frame_times: Vec<usize>,
    /// Whether frame times repeat, as in a loop.
    looped: bool,
    classifier: SharedClassifier,
}

impl Ahead {
    /// Begins loading the particles of `shots`, with `memory` bytes for those ahead of the next picture.
    /// They are classified by `classifier`, which is closed with this.
    pub(super) fn new(
        loader: Loader,
        classifier: SharedClassifier,
        scene: &Scene,
        frame_times: &[FrameTime],
        shots: &[Shot],
        memory: u64,
    ) -> Self {
        let mut used: Vec<usize> = shots.iter().map(|shot| shot.frame).collect();
        used.sort_unstable();
        used.dedup();
        let loaded: Vec<FrameTime> = used.iter().map(|&frame| frame_times[frame]).collect();
        let workers = std::thread::available_parallelism().map_or(1, |n| n.get().min(used.len()));
        let scene = scene.clone();
        let loader = loader.classified(classifier.clone());
        let load = move |i: usize| loader.load(loaded[i], &scene);
        let cache = FrameCache::new(used.len(), memory, workers, load, |_| ());
        Self { cache, looped: shots.len() > used.len(), frame_times: used, classifier }
    }

    /// Begins loading the picture `shot` that follows `after`, and those beyond it in that direction.
    pub(super) fn aim(&self, shot: &Shot, after: &Shot) {
        let step = if shot.frame < after.frame && !self.looped { -1 } else { 1 };
        self.cache.aim(self.index(shot), step, self.looped);
    }

    /// Whether the particles of a picture have loaded or failed.
    pub(super) fn has(&self, shot: &Shot) -> bool {
        self.cache.get(self.index(shot)).is_some()
    }

    /// Waits for the particles of a picture.
    pub(super) fn wait(&self, shot: &Shot) -> limpid_io::Result<Arc<Loaded>> {
        self.cache.wait(self.index(shot))
    }

    /// The classifier of the particles.
    pub(super) fn classifier(&self) -> &SharedClassifier {
        &self.classifier
    }

    fn index(&self, shot: &Shot) -> usize {
        self.frame_times.partition_point(|&frame| frame < shot.frame)
    }
}

impl Drop for Ahead {
    fn drop(&mut self) {
        self.classifier.close();
    }
}
