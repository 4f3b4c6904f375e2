//! The frame caches of both settings that can be compared.

use std::sync::Arc;

use crate::backend::background::drop_in_background;
use crate::model::document::Document;
use limpid::scene::Scene;
use limpid::settings::Classify;
#[cfg(not(target_arch = "wasm32"))]
use limpid_io::frame_cache::FrameCache;
use limpid_io::frame_cache::{CacheState, Outcome};
use limpid_io::input::FrameTime;
use limpid_io::shared_classifier::Processor;
#[cfg(not(target_arch = "wasm32"))]
use limpid_io::shared_classifier::SharedClassifier;

#[cfg(target_arch = "wasm32")]
use crate::backend::web::FrameCache;

/// The inputs of a cache's frames besides the document.
#[derive(Debug, Clone, PartialEq)]
struct Key {
    classify: Classify,
    processor: Processor,
    /// Frames from one frame time to the next.
    step: f64,
    count: usize,
    budget: u64,
}

/// One cache for each distinct classification on screen.
#[derive(Debug)]
pub(crate) struct Frames {
    caches: Vec<(Key, FrameCache)>,
    /// Memory for all caches, bytes.
    budget: u64,
    #[cfg(not(target_arch = "wasm32"))]
    classifier: SharedClassifier,
    #[cfg(target_arch = "wasm32")]
    worker: crate::backend::web::Worker,
    /// The processor that classifies the frames.
    pub(crate) processor: Processor,
}

impl Frames {
    /// Creates no caches yet; `worker` will load their frames.
    #[cfg(target_arch = "wasm32")]
    pub(crate) fn new(budget: u64, worker: crate::backend::web::Worker) -> Self {
        Self { caches: Vec::new(), budget, worker, processor: Processor::default() }
    }

    /// Creates no caches yet; `classifier` will classify their frames.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn new(budget: u64, classifier: SharedClassifier) -> Self {
        Self { caches: Vec::new(), budget, classifier, processor: Processor::default() }
    }

    /// Drops all caches.
    pub(crate) fn clear(&mut self) {
        drop_in_background(std::mem::take(&mut self.caches));
    }

    /// Ensures that there is a cache for each of `scenes`, and no other.
    ///
    /// `hold` keeps the current caches until they have frame `at`: a dragged slider changes faster than
    /// frames are classified.
    pub(crate) fn prepare(
        &mut self,
        document: &Arc<Document>,
        frame_times: &Arc<[FrameTime]>,
        step: f64,
        scenes: &[&Scene],
        (at, hold): (usize, bool),
        ready: impl Fn() + Clone + Send + Sync + 'static,
    ) {
        let mut different: Vec<&Scene> = Vec::new();
        for scene in scenes {
            if !different.iter().any(|d| d.settings.classify == scene.settings.classify) {
                different.push(scene);
            }
        }
        let budget = self.budget / different.len().max(1) as u64;
        let key = |scene: &Scene| Key {
            classify: scene.settings.classify.clone(),
            processor: self.processor,
            step,
            count: frame_times.len(),
            budget,
        };
        let keys: Vec<Key> = different.iter().map(|scene| key(scene)).collect();
        if self.caches.iter().map(|(key, _)| key).eq(&keys) {
            return;
        }
        let busy = self.caches.iter().any(|(_, cache)| cache.get(at).is_none());
        if hold && busy && self.caches.len() == keys.len() {
            return;
        }
        let mut old = std::mem::take(&mut self.caches);
        for (key, scene) in keys.into_iter().zip(different) {
            if let Some(same) = old.iter().position(|(k, _)| *k == key) {
                self.caches.push(old.swap_remove(same));
                continue;
            }
            let cache = self.cache(document, frame_times, scene, budget, ready.clone());
            self.caches.push((key, cache));
        }
        drop_in_background(old);
    }

    /// A cache that loads frames on threads of its own.
    #[cfg(not(target_arch = "wasm32"))]
    fn cache(
        &self,
        document: &Document,
        frame_times: &Arc<[FrameTime]>,
        scene: &Scene,
        budget: u64,
        ready: impl Fn() + Send + Sync + 'static,
    ) -> FrameCache {
        let input = document.input.clone().classified(self.classifier.clone());
        let input = input.processed_by(self.processor);
        let (frame_times, scene) = (frame_times.clone(), scene.clone());
        let workers = std::thread::available_parallelism().map_or(1, |n| n.get());
        let (count, workers) = (frame_times.len(), workers.min(frame_times.len()));
        let load = move |i: usize| input.load(frame_times[i], &scene);
        FrameCache::new(count, budget, workers, load, move |_| ready())
    }

    /// A cache of the worker.
    #[cfg(target_arch = "wasm32")]
    fn cache(
        &self,
        document: &Document,
        frame_times: &[FrameTime],
        scene: &Scene,
        budget: u64,
        ready: impl Fn() + 'static,
    ) -> FrameCache {
        self.worker.cache(document, frame_times, scene, self.processor, budget, ready)
    }

    /// Sets the position and direction of playback in all caches.
    pub(crate) fn aim(&self, at: usize, step: isize, looped: bool) {
        for (_, cache) in &self.caches {
            cache.aim(at, step, looped);
        }
    }

    /// The particles of a frame time, if they are loaded, and whether they are classified as in `scene`:
    /// while a slider is dragged they may not be.
    pub(crate) fn get(&self, scene: &Scene, i: usize) -> Option<(Outcome, bool)> {
        let fits = |key: &Key| {
            (&key.classify, key.processor) == (&scene.settings.classify, self.processor)
        };
        let (key, cache) = self.caches.iter().find(|(key, _)| fits(key)).or(self.caches.first())?;
        Some((cache.get(i)?, fits(key)))
    }

    /// Whether all caches have a frame time, loaded or failed.
    pub(crate) fn is_ready(&self, i: usize) -> bool {
        !self.caches.is_empty() && self.caches.iter().all(|(_, cache)| cache.get(i).is_some())
    }

    /// The state of the first cache, with the bytes and the frames being loaded of all.
    pub(crate) fn state(&self) -> CacheState {
        let mut states = self.caches.iter().map(|(_, cache)| cache.state());
        let first = states.next().unwrap_or_default();
        states.fold(first, |mut all, state| {
            all.bytes += state.bytes;
            all.budget += state.budget;
            all.loading.extend(state.loading);
            all
        })
    }
}
