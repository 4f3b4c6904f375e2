//! The frame caches of both settings that can be compared.

use std::sync::Arc;

use crate::backend::here::{Backend, FrameCache, drop_in_background};
use crate::model::document::Document;
use limpid::scene::Scene;
use limpid::settings::Classify;
use limpid_io::frame_cache::{CacheState, Outcome};
use limpid_io::input::FrameTime;
use limpid_io::shared_classifier::Processor;

/// The inputs of a cache's frames besides the document.
#[derive(Debug, Clone, PartialEq)]
struct Key {
    classify: Classify,
    /// Whether the liquid is opaque: walls are then wetted otherwise, and particles have colours.
    is_opaque: bool,
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
}

impl Frames {
    /// Creates no caches yet, whose memory is `budget` bytes.
    pub(crate) fn new(budget: u64) -> Self {
        Self { caches: Vec::new(), budget }
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
        backend: &Backend,
        document: &Document,
        frame_times: &Arc<[FrameTime]>,
        (step, processor): (f64, Processor),
        scenes: &[&Scene],
        (at, hold): (usize, bool),
    ) {
        let mut different: Vec<&Scene> = Vec::new();
        for scene in scenes {
            if !different.iter().any(|d| inputs(d) == inputs(scene)) {
                different.push(scene);
            }
        }
        let budget = self.budget / different.len().max(1) as u64;
        let key = |scene: &Scene| Key {
            classify: scene.settings.classify.clone(),
            is_opaque: scene.is_opaque(),
            processor,
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
            let cache = backend.cache(document, frame_times, scene, processor, budget);
            self.caches.push((key, cache));
        }
        drop_in_background(old);
    }

    /// Sets the position and direction of playback in all caches.
    pub(crate) fn aim(&self, at: usize, step: isize, looped: bool) {
        for (_, cache) in &self.caches {
            cache.aim(at, step, looped);
        }
    }

    /// The particles of a frame time, if they are loaded, and whether they are classified as in `scene`:
    /// while a slider is dragged they may not be.
    pub(crate) fn get(
        &self,
        (scene, processor): (&Scene, Processor),
        i: usize,
    ) -> Option<(Outcome, bool)> {
        let fits = |key: &Key| {
            ((&key.classify, key.is_opaque), key.processor) == (inputs(scene), processor)
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

/// The parts of a scene that classification depends on.
fn inputs(scene: &Scene) -> (&Classify, bool) {
    (&scene.settings.classify, scene.is_opaque())
}
