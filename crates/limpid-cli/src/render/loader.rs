//! Particles, loaded ahead of what is drawn.

use std::sync::Arc;

use limpid::scene::Scene;
use limpid_io::film::Shot;
use limpid_io::frame_cache::FrameCache;
use limpid_io::input::{FrameTime, Input, Loaded};
use limpid_io::shared_classifier::SharedClassifier;

pub(super) struct Loader {
    cache: FrameCache,
    /// The frame times in the cache, ascending: pictures of the same particles share their loading.
    wanted: Vec<usize>,
    /// What a loop comes back to may still be there.
    looped: bool,
    classifier: SharedClassifier,
}

impl Loader {
    /// For these pictures, with so many bytes for what is loaded ahead of the next one; their particles
    /// are classified by `classifier`, which is closed with the loader.
    pub(super) fn new(
        input: Input,
        classifier: SharedClassifier,
        scene: &Scene,
        frame_times: &[FrameTime],
        shots: &[Shot],
        memory: u64,
    ) -> Self {
        let mut wanted: Vec<usize> = shots.iter().map(|shot| shot.frame).collect();
        wanted.sort_unstable();
        wanted.dedup();
        let loading: Vec<FrameTime> = wanted.iter().map(|&frame| frame_times[frame]).collect();
        let workers = std::thread::available_parallelism().map_or(1, |n| n.get().min(wanted.len()));
        let scene = scene.clone();
        let input = input.classified(classifier.clone());
        let load = move |i: usize| input.load(loading[i], &scene);
        let cache = FrameCache::new(wanted.len(), memory, workers, load, |_| ());
        Self { cache, looped: shots.len() > wanted.len(), wanted, classifier }
    }

    /// Begins to load what comes after another picture, and what lies further that way.
    pub(super) fn aim(&self, shot: &Shot, after: &Shot) {
        let step = if shot.frame < after.frame && !self.looped { -1 } else { 1 };
        self.cache.aim(self.index(shot), step, self.looped);
    }

    /// Whether nobody has to wait for the particles of a picture.
    pub(super) fn has(&self, shot: &Shot) -> bool {
        self.cache.get(self.index(shot)).is_some()
    }

    pub(super) fn wait(&self, shot: &Shot) -> limpid_io::Result<Arc<Loaded>> {
        self.cache.wait(self.index(shot))
    }

    /// Where particles are classified.
    pub(super) fn classifier(&self) -> &SharedClassifier {
        &self.classifier
    }

    fn index(&self, shot: &Shot) -> usize {
        self.wanted.partition_point(|&frame| frame < shot.frame)
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        self.classifier.close();
    }
}
